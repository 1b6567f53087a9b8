"""The package crossbody itself, of which the five folders are the parts."""
