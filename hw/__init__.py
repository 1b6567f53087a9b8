"""Hardware logs: formats, column maps, checks, replay and identification."""
