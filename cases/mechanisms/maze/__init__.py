"""The ball maze: geometry, closed forms, claims, limits."""
