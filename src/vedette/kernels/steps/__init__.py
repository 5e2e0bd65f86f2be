"""One scan of each filter: prediction, update and reduction."""
