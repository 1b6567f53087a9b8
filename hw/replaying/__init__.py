"""What engines make of a log: windows, starts, predictions, and how far they are off."""
