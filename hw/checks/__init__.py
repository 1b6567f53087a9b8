"""What is doubtful about a log: clock, rates, values."""
