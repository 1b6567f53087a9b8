"""What engines' own readers make of robot files: audit of a file, table of features, causes, rewrites."""
