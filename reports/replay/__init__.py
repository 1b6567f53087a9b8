"""Hardware logs on the command line: what a log holds, replay, identification."""
