"""Boards and markers at known places: checks of the cameras, and of the survey by a camera."""
