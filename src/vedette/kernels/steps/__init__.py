"""One scan of each filter."""
