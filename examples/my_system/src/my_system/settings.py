"""The table [mocap] of campaign.toml."""

from gtval.plugins import Settings


class MocapSettings(Settings):
    """Where the rig's poses are, and how well it measures.

    ``file`` is relative to the campaign folder. ``sigmas`` are the standard deviations of x, y
    (metres) and theta (radians) with all markers in view: facts of the rig, so there is no
    default. Poses from fewer than ``least_markers`` markers are left out.
    """

    sigmas: tuple[float, float, float]
    file: str = "mocap/poses.csv"
    least_markers: int = 3
