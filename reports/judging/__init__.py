"""What decides a verdict: the truth of a case, comparison with it, the audit of an engine's physics."""
