"""From a file to a log in SI: columns, units, repair, store."""
