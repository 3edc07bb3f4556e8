"""Where readings are entered: a terminal, and a page in the browser."""
