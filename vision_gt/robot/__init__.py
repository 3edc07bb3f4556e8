"""The robot's pose from its markers."""
