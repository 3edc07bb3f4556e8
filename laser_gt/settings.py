"""The [laser] table of campaign.toml."""

from typing import Literal, Self

from pydantic import Field, model_validator

from validation.campaign.folder import Finite, Name, NotNegative, Positive, Settings


class ScannerSettings(Settings):
    """A scanner on the robot.

    ``mount`` is the sensor frame in the robot frame (x, y in metres, theta in radians). Of several
    scanners each must be stated; a single one without is itself what is placed. ``mount_sigmas``
    say how well that of the first scanner, whose frame is the laser frame, was measured. ``sigma``
    is the standard deviation of a range; without it, it is estimated from the scans. ``turn_time``
    is the time of a turn of the mirror in seconds: scans of logs with odometry are then corrected
    for the robot's motion; ``interlaced`` is the number of turns that a scan is put together from.
    ``scans`` is the file of this scanner alone, where each has its own.
    """

    mount: tuple[Finite, Finite, Finite] | None = None
    mount_sigmas: tuple[Positive, Positive, Positive] | None = None
    sigma: Positive | None = None
    turn_time: Positive | None = None
    interlaced: int = Field(default=1, ge=1, le=8)
    scans: str | None = None


Pair = tuple[Positive, Positive]


class JudgementTable(Settings):
    """Limits of the verdicts on matches: those of `JudgementSettings`, under the same names."""

    explained: NotNegative = 0.45
    agreement: Pair = (0.85, 0.5)
    violating: Pair = (0.06, 0.25)
    intruder: Positive = 0.5
    scale: Pair = (2.0, 3.0)
    sigma_length: Positive = 0.006
    sigma_angle: Positive = 0.003
    real_share: NotNegative = 0.6
    eigenvalue_ratio: NotNegative = 0.01
    return_share: NotNegative = 0.6
    rival_margin: NotNegative = 0.12
    contradiction: Positive = 16.27
    start_length: Positive = 0.12
    start_angle: Positive = 0.09
    starts: int = Field(default=8, ge=1, le=100)


class LaserSettings(Settings):
    """Files and choices of laser GT; paths are relative to the campaign folder.

    ``scans`` is the campaign's own CSV, a CARMEN log, or a bag, as ``format`` says; for a log,
    ``stops`` names the time at which each stop was scanned, and ``max_delay`` is how far from it,
    in seconds, scan and odometry may be. ``odometry`` has a pose for each stop, or
    (``odometry_format`` 'rawseeds') is a log of poses in time. ``decisions`` is the file of what
    people decided about pairs. ``scanners`` has a table for each scanner. ``reference`` lists the
    surveyed stops that place the laser frame in the GTV frame: one as in the document, several to
    share their errors; empty for all. ``guess_sigmas`` say how good the odometry is from stop to
    stop (metres, radians).

    A pair of stops is matched if they are within ``pair_radius`` (metres) and ``pair_heading``
    (radians) of each other and at least ``pair_overlap`` (0 to 1) of what they saw may overlap;
    each stop with its ``pairs_per_stop`` nearest. ``initial`` is where the scan matcher starts:
    'local' at the guess, 'gpm' and 'kiss' where another matcher ends. ``overlay_pairs`` are pairs
    of stops whose scans are shown over each other through the surveyed poses. ``genetic`` says if
    the genetic aligner runs too, with ``population`` individuals over ``generations``, of which
    the first is drawn within ``genetic_radius`` metres of the guess; it matches each stop with its
    ``genetic_pairs`` nearest, and more where those leave stops apart; ``seed`` starts its chance.
    With ``as_published`` poses by the document's way are computed too. ``judgement`` has the
    limits of the verdicts.

    The defaults of distances, shares and counts are those of `PairSettings`, `MatchSettings`,
    `EngineSettings` and `GeneticSettings`. ``max_delay``: a judgement, between
    two scans of a scanner at 10 Hz.
    """

    scans: str = "laser/scans.csv"
    format: Literal["csv", "carmen", "rawseeds_sick", "rawseeds_hokuyo", "bag", "csm",
                    "breezyslam", "rawlog"] = "csv"  # fmt: skip
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
    overlay_pairs: list[tuple[Name, Name]] = Field(default_factory=list)
    genetic: bool = True
    generations: int = Field(default=300, ge=1, le=5000)
    population: int = Field(default=100, ge=10, le=2000)
    genetic_pairs: int = Field(default=3, ge=1, le=100)
    genetic_radius: Positive = 3.0
    seed: int = Field(default=1, ge=0)
    as_published: bool = False
    judgement: JudgementTable = Field(default_factory=JudgementTable)

    @property
    def own_files(self) -> dict[str, str]:
        """File of each scanner that has one of its own, by the scanner's name."""
        scanners = self.scanners.items()
        return {name: one.scans for name, one in scanners if one.scans is not None}

    @property
    def scan_files(self) -> list[str]:
        """All files of scans."""
        return list(self.own_files.values()) or [self.scans]

    @model_validator(mode="after")
    def _each_or_none(self) -> Self:
        """Raise where only some of the scanners have a file of their own."""
        without = [name for name in self.scanners if name not in self.own_files]
        if self.own_files and without:
            raise ValueError(
                f"state scans of {', '.join(without)} too: either each scanner has a file of its "
                "own, or all scans are in one file"
            )
        return self


class DriveSettings(Settings):
    """The [laser_drive] table: a log of scans taken while driving; paths as in [laser].

    ``scans`` is the log, ``format`` what it is. ``odometry`` is a file of poses in time, in any
    format of trajectories; without it the poses that came along in the log are used, in a bag
    those of its Odometry or transforms, of which ``odometry_topic`` and ``odometry_body`` choose;
    ``odometry_degrees`` says whether its angles are degrees, where a file leaves that open.
    ``stops`` has the columns pose, from, to: when the robot stood where, on the clock of the
    odometry. ``reference`` lists the surveyed stops that hold the drive; empty for all.
    ``max_delay`` is how far apart scans of several scanners may be, in seconds. ``scanners`` has
    a table for each scanner; without one those of [laser.scanners] are meant.
    """

    scans: str = "laser/drive/scans.csv"
    format: Literal["csv", "carmen", "rawseeds_sick", "rawseeds_hokuyo", "bag", "csm",
                    "breezyslam", "rawlog"] = "csv"  # fmt: skip
    odometry: str | None = None
    odometry_degrees: bool | None = None
    odometry_topic: str | None = None
    odometry_body: str | None = None
    stops: str = "laser/drive/stops.csv"
    scanners: dict[str, ScannerSettings] = Field(default_factory=dict)
    reference: list[Name] = Field(default_factory=list)
    max_delay: Positive = 0.05
