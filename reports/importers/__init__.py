"""What engines' own readers make of robot files: the audit of one file, the table of features, causes and rewrites."""
