"""The ball maze as engines see it: scene, rows, and its event machine in plain Python."""
