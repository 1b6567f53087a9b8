"""The shipped cases, one file each; a file here without a leading underscore is a case."""
