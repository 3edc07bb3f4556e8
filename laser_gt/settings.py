"""The [laser] table of campaign.toml."""

from typing import Literal

from pydantic import Field

from validation.campaign.folder import Finite, Name, NotNegative, Positive, Settings


class ScannerSettings(Settings):
    """A scanner on the robot.

    ``mount`` is the sensor frame in the robot frame (x, y in metres, theta in radians),
    ``mount_sigmas`` how well it was measured. ``sigma`` is the standard deviation of a range;
    without it, it is estimated from the scans. ``turn_time`` is the time of a turn of the mirror in
    seconds: scans of logs with odometry are then corrected for the robot's motion;
    ``interlaced`` is the number of turns that a scan is put together from. ``scans`` is the file
    of this scanner alone, where each has its own.
    """

    mount: tuple[Finite, Finite, Finite] = (0.0, 0.0, 0.0)
    mount_sigmas: tuple[Positive, Positive, Positive] = (0.002, 0.002, 0.002)
    sigma: Positive | None = None
    turn_time: Positive | None = None
    interlaced: int = Field(default=1, ge=1, le=8)
    scans: str | None = None


class LaserSettings(Settings):
    """Files and choices of laser GT; paths are relative to the campaign folder.

    ``scans`` is the campaign's own CSV, a CARMEN log, or a bag; for a log, ``stops`` names the
    time at which each stop was scanned. ``odometry`` has a pose for each stop, or
    (``odometry_format`` 'rawseeds') is a log of poses in time. ``reference`` lists the surveyed
    stops that place the laser frame in the GTV frame: one as in the document, several to share
    their errors; empty for all. ``guess_sigmas`` say how good the odometry is from stop to stop
    (metres, radians).
    """

    scans: str = "laser/scans.csv"
    format: Literal["csv", "carmen", "rawseeds_sick", "rawseeds_hokuyo", "bag"] = "csv"
    stops: str = "laser/stops.csv"
    odometry: str = "laser/odometry.csv"
    odometry_format: Literal["csv", "rawseeds"] = "csv"
    decisions: str = "laser/decisions.csv"
    scanners: dict[str, ScannerSettings] = Field(default_factory=dict)
    reference: list[Name] = Field(default_factory=list)
    max_delay: Positive = 0.05
    guess_sigmas: tuple[Positive, Positive] = (0.15, 0.1)
    pair_radius: Positive = 4.0
    pair_heading: Positive = 3.15
    pair_overlap: NotNegative = 0.35
    pairs_per_stop: int = Field(default=8, ge=1, le=100)
    initial: Literal["local", "gpm", "kiss"] = "local"
    genetic: bool = True
    generations: int = Field(default=300, ge=1, le=5000)
    population: int = Field(default=100, ge=10, le=2000)
    seed: int = Field(default=1, ge=0)
