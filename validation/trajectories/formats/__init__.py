"""Trajectories in files: the formats of data sets, robots, motion capture and total stations."""

from validation.trajectories.formats.reading import is_trajectory, read_trajectory
from validation.trajectories.formats.writing import trajectory_text, write_trajectory

__all__ = ["is_trajectory", "read_trajectory", "trajectory_text", "write_trajectory"]
