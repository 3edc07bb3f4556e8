"""One scan laid on another, and whether to believe it."""
