"""The red body: order of its modes and limits."""
