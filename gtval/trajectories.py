"""Poses in time: their files, clocks, errors, causes and fusion."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from gtval.arguments import said_plainly
from gtval.judging import findings_table
from validation.explain.telling.in_time import (
    time_cause_table,
    time_findings,
    time_parameter_table,
)
from validation.poses.angles import Array
from validation.poses.pose_table import PoseTable
from validation.poses.trajectory import Trajectory
from validation.report.html import html_blocks
from validation.shown import Shown, html_of
from validation.trajectories.alignment import parts_of
from validation.trajectories.causes.explanation import TimeExplanation, time_causes
from validation.trajectories.clock.estimate import sync as estimated
from validation.trajectories.clock.result import ClockEstimate
from validation.trajectories.clock.tables import clock_table
from validation.trajectories.comparison import TimeComparison
from validation.trajectories.comparison import compare_in_time as compared
from validation.trajectories.formats import read_trajectory as read
from validation.trajectories.formats import write_trajectory as write
from validation.trajectories.smoothing.clocked import clocked
from validation.trajectories.smoothing.fusion import fuse as fused
from validation.trajectories.smoothing.source import Fused
from validation.trajectories.stops import Stop
from validation.trajectories.stops import find_standstills as standing
from validation.trajectories.stops import poses_at_stops as at_stops
from validation.trajectories.telling import overview_in_time, statistics_in_time

__all__ = ["ClockEstimate", "Clocks", "Fused", "Stop", "TimeComparison", "TimeExplanation"]
__all__ += ["Trajectory", "compare_in_time", "explain_in_time", "find_standstills"]
__all__ += ["fuse", "poses_at_stops", "read_trajectory", "sync", "write_trajectory"]

LIMIT_M, LIMIT_RAD = 0.05, 0.05
"""What a notebook shows errors beside where nothing else is asked for: as `gtval compare`."""


@dataclass(frozen=True, repr=False)
class Clocks(Shown):
    """The clocks of sources against one reference.

    Parameters
    ----------
    reference : str
        Its name.
    estimates : tuple of ClockEstimate
        One a source.
    """

    reference: str
    estimates: tuple[ClockEstimate, ...]

    def __getitem__(self, system: str) -> ClockEstimate:
        return {one.source: one for one in self.estimates}[system]

    def __iter__(self) -> Iterator[ClockEstimate]:
        return iter(self.estimates)


@said_plainly
def read_trajectory(
    path: Path | str, *, system: str | None = None, **told: str | None
) -> Trajectory:
    r"""The poses at times in a file, whatever its format.

    Parameters
    ----------
    path : Path or str
        A file of a motion capture, a data set, a robot or a total station.
    system : str, optional
        Its name; that of the file by default.
    **told : str
        What the file does not tell: format, unit, topic, body, up.

    Raises
    ------
    InputError
        Naming every bad place.

    Examples
    --------
    >>> file = folder / "robot.tum"
    >>> _ = file.write_text("1000000000.1 1 0 0 0 0 0 1\n1000000000.2 2 0 0 0 0 0 1\n")
    >>> gtval.read_trajectory(file).poses.tolist()
    [[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]
    """
    return read(
        Path(path),
        system=system,
        format=told.pop("format", None),
        unit=told.pop("unit", None),
        topic=told.pop("topic", None),
        body=told.pop("body", None),
        up=told.pop("up", None),
    )


@said_plainly
def write_trajectory(trajectory: Trajectory, path: Path | str) -> tuple[Path, ...]:
    """Write a trajectory, whole or not at all; the name's end tells the format.

    Parameters
    ----------
    trajectory : Trajectory
        The poses.
    path : Path or str
        Ends in .csv (which keeps all there is), .tum, .kitti or .mcap; .gz behind it compresses.

    Examples
    --------
    >>> drive = gtval.testing.make_motion(seed=1, minutes=1)
    >>> [file.name for file in gtval.write_trajectory(drive.reference, folder / "mocap.tum")]
    ['mocap.tum']
    """
    return tuple(write(trajectory, Path(path)))


@said_plainly
def sync(
    reference: Trajectory,
    sources: Trajectory | Sequence[Trajectory],
    *,
    window: float = 60.0,
    confidence: float = 0.95,
) -> Clocks:
    """How late the stamps of sources are by the clock of a reference.

    Parameters
    ----------
    reference : Trajectory
        Of the same robot; it may be odometry. Frames and mounts may differ.
    sources : Trajectory or sequence of Trajectory
        Their names must differ.
    window : float
        Seconds to both sides in which a delay is looked for.
    confidence : float
        Of the intervals.

    Returns
    -------
    Clocks
        ``delay_s`` of each is what is added to its stamps: a source that stamps 0.1 s late has
        -0.1.

    Examples
    --------
    >>> drive = gtval.testing.make_motion(seed=1, minutes=3)
    >>> clocks = gtval.sync(drive.reference, drive.cameras["camera_2"])
    >>> round(clocks["camera_2"].delay_s, 2)
    -0.21
    """
    listed = [sources] if isinstance(sources, Trajectory) else list(sources)
    found = estimated(reference, listed, window=window, confidence=confidence)
    return Clocks(reference.system, tuple(found.values()))


@said_plainly
def compare_in_time(
    reference: Trajectory,
    source: Trajectory,
    *,
    align: str = "none",
    confidence: float = 0.95,
) -> TimeComparison:
    """The errors of a source in time, reference minus source, at common times.

    Parameters
    ----------
    reference, source : Trajectory
        Of the same robot, on one clock.
    align : str
        What is fitted first: 'none', or 'frame', 'scale', 'mount', 'time' joined by '+'.
    confidence : float
        Of all intervals, which allow for errors that neighbours share.

    Examples
    --------
    >>> drive = gtval.testing.make_motion(seed=1, minutes=2)
    >>> errors = gtval.compare_in_time(drive.truth, drive.reference)
    >>> bool(errors.rms_position.rms < 0.001)
    True
    """
    return compared(reference, source, parts_of(align), confidence=confidence)


@said_plainly
def explain_in_time(reference: Trajectory, source: Trajectory) -> TimeExplanation:
    """Where the errors of a source in time come from: frame, mount, scale, delay, or what drifts.

    Parameters
    ----------
    reference, source : Trajectory
        Of the same robot, with headings.

    Examples
    --------
    >>> drive = gtval.testing.make_motion(seed=1, minutes=3)
    >>> gtval.explain_in_time(drive.reference, drive.cameras["camera_2"]).name
    'delay'
    """
    return time_causes(reference, source)


@said_plainly
def fuse(
    sources: Sequence[Trajectory],
    *,
    odometry: Trajectory | None = None,
    clocks: Clocks | None = None,
) -> Fused:
    """One trajectory with covariances out of several, all in one frame.

    Parameters
    ----------
    sources : sequence of Trajectory
        The poses; of one source alone, its smoothed trajectory.
    odometry : Trajectory, optional
        In a frame of its own, which may drift.
    clocks : Clocks, optional
        From `sync`, with the odometry's clock or one that is the same as reference. A source whose
        clock jumps is fused in parts, each with its delay; in the result each part is a source.

    Raises
    ------
    GtvalError
        If they cannot be fused, or a delay cannot be told.

    Examples
    --------
    >>> drive = gtval.testing.make_motion(seed=1, minutes=2)
    >>> fused = gtval.fuse([drive.reference])
    >>> len(fused.trajectory) == len(drive.reference)
    True
    """
    known = {} if clocks is None else {one.source: one for one in clocks}
    parts = [part for one in sources for part in clocked(one, known.get(one.system))]
    return fused(parts, odometry=odometry)


@said_plainly
def find_standstills(trajectory: Trajectory, *, shortest: float = 2.0) -> tuple[Stop, ...]:
    """When the robot stands, as stops named 1, 2, and so on.

    Parameters
    ----------
    trajectory : Trajectory
        Of a robot that stands still from time to time.
    shortest : float
        Seconds.

    Examples
    --------
    >>> drive = gtval.testing.make_motion(seed=1, minutes=2)
    >>> gtval.find_standstills(drive.reference)[0].name
    '1'
    """
    found: Array = standing(trajectory, shortest) + trajectory.epoch
    return tuple(Stop(str(n), *row) for n, row in enumerate(found.tolist(), 1))


@said_plainly
def poses_at_stops(trajectory: Trajectory, stops: Sequence[Stop]) -> PoseTable:
    """One pose a stop, with its covariance: what `compare` takes.

    Parameters
    ----------
    trajectory : Trajectory
        Of a robot that stands still from time to time.
    stops : sequence of Stop
        On its clock.

    Raises
    ------
    GtvalError
        If the trajectory saw none of them.

    Examples
    --------
    >>> drive = gtval.testing.make_motion(seed=1, minutes=2)
    >>> stops = gtval.find_standstills(drive.reference)
    >>> gtval.poses_at_stops(drive.reference, stops).ids[:2]
    ('1', '2')
    """
    return at_stops(trajectory, stops).table


@html_of.register
def _(result: TimeComparison) -> str:
    """One row and the answer for 5 cm; then every component."""
    tables = [overview_in_time([result], LIMIT_M), statistics_in_time(result, LIMIT_M)]
    return html_blocks(tables, "errors in time")


@html_of.register
def _(result: Clocks) -> str:
    """One row a source."""
    return html_blocks([clock_table(result.estimates)], "clocks")


@html_of.register
def _(result: ClockEstimate) -> str:
    """One row."""
    return html_blocks([clock_table([result])], "clock")


@html_of.register
def _(result: TimeExplanation) -> str:
    """In sentences, then the numbers."""
    tables = [
        findings_table(time_findings(result)),
        time_cause_table([result]),
        time_parameter_table(result),
    ]
    return html_blocks([one for one in tables if one.rows], "explanation in time")
