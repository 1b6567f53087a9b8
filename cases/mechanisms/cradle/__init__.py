"""Newton's cradle: scene, collision rules, exact motions, limits."""
