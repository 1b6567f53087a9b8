"""The delta robot as engines of hinges see it."""
