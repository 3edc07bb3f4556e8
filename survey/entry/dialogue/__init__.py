"""The conversation with the person who enters readings."""
