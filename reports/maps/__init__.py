"""Maps over two parameters: collision rules over gaps, regions of stability."""
