"""The page for phones and tablets in the room."""
