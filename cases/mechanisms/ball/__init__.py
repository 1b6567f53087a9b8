"""The bouncing ball: its exact motion and how far engines may be from it."""
