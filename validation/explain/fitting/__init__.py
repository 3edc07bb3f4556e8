"""Models of errors and their fits."""
