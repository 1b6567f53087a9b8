"""Robot files as scenes: MJCF and URDF through MuJoCo's compiler, whose arrays are read, not its text."""
