"""Parameters of a model from a log, with intervals."""
