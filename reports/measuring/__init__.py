"""What metrics share: the truth, runs laid beside it, what errors are measured by."""
