"""The delta robot: what its cases share, closed forms, limits."""
