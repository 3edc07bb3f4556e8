"""One receiver: where it was, how well, and for how much of the time."""
