"""What is known of the room while readings come in, and whether a reading fits."""
