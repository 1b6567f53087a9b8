"""Windows of a log: cutting, rates and starts of what was measured, one run over one window."""
