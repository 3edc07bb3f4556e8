"""Cameras, and the pose of what they see."""
