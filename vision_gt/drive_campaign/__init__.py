"""Continuous acquisition in a campaign folder: frames, what is kept of them, what is told."""
