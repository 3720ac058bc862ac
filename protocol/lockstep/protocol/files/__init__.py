"""Files that somebody else may have written: read within bounds, and never waited for."""
