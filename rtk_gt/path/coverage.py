"""Which parts of a drive have ground truth: fix kinds, satellites, gaps and error ellipses."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rtk_gt.path.interpolation import segments
from rtk_gt.receivers.fixes import FIX_NAMES, RTK_FIXED, RTK_FLOAT, Fixes
from rtk_gt.receivers.steps import Steps
from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame

NOT_RECORDED = "no record"


@dataclass(frozen=True)
class ReceiverCoverage:
    """What one receiver recorded.

    Parameters
    ----------
    receiver : str
        Its name.
    count : int
        Fixes recorded.
    interval : float
        Usual time between two fixes, in seconds.
    shares : dict of str to float
        Share of the drive's duration in each fix kind; the rest has no record.
    satellites, hdop : (float, float, float), optional
        Least, median and greatest; None where not stated.
    longest_gap : float
        Longest time without an RTK-fixed position, in seconds.
    ellipses : dict of str to (float, float)
        Median semi-axes in metres of the stated 1-sigma ellipses, by fix kind.
    """

    receiver: str
    count: int
    interval: float
    shares: dict[str, float]
    satellites: tuple[float, float, float] | None
    hdop: tuple[float, float, float] | None
    longest_gap: float
    ellipses: dict[str, tuple[float, float]]


@dataclass(frozen=True)
class Gap:
    """A part of the drive without ground truth.

    ``start`` in seconds since 1970, ``duration`` in seconds, ``length`` in metres along the
    track of the receiver that saw most of it (straight where none saw anything).
    """

    start: float
    duration: float
    length: float


@dataclass(frozen=True)
class Coverage:
    """What of a drive has ground truth.

    Parameters
    ----------
    receivers : tuple of ReceiverCoverage
        Each receiver alone.
    start, duration : float
        Of the whole record, in seconds.
    length : float
        Of the track, in metres.
    poses : int
        Number of poses.
    share_of_time, share_of_length : float
        Covered by stretches of poses without a gap.
    gaps : tuple of Gap
        The longest first.
    max_gap : float
        Pauses up to so many seconds do not count as gaps.
    """

    receivers: tuple[ReceiverCoverage, ...]
    start: float
    duration: float
    length: float
    poses: int
    share_of_time: float
    share_of_length: float
    gaps: tuple[Gap, ...]
    max_gap: float


def coverage(records: Sequence[Fixes], steps: Steps, posed: Array, max_gap: float) -> Coverage:
    """What of a drive has ground truth.

    Parameters
    ----------
    records : sequence of Fixes
        Of all receivers.
    steps : Steps
        The same, brought together.
    posed : (n,) array
        Times of the poses, in seconds since 1970.
    max_gap : float
        Longest pause in seconds that does not count as a gap.
    """
    start, end = float(steps.times[0]), float(steps.times[-1])
    times, track = _track(records, steps.frame)
    walked = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(track, axis=0), axis=1))])

    def length_between(a: float, b: float) -> float:
        return float(np.diff(np.interp([a, b], times, walked))[0])

    bounds = [(float(posed[s[0]]), float(posed[s[-1]])) for s in segments(posed, max_gap) if len(s)]
    edges = [start, *(edge for pair in bounds for edge in pair), end]
    gaps = [
        Gap(a, b - a, length_between(a, b))
        for a, b in zip(edges[::2], edges[1::2], strict=True)
        if b > a
    ]
    total = walked[-1]
    duration = max(end - start, 1e-9)
    return Coverage(
        receivers=tuple(_receiver(record, start, end) for record in records),
        start=start,
        duration=end - start,
        length=float(total),
        poses=len(posed),
        share_of_time=sum(b - a for a, b in bounds) / duration,
        share_of_length=sum(length_between(a, b) for a, b in bounds) / max(float(total), 1e-9),
        gaps=tuple(sorted(gaps, key=lambda gap: -gap.duration)),
        max_gap=max_gap,
    )


def _track(records: Sequence[Fixes], frame: LocalFrame) -> tuple[Array, Array]:
    """Times and positions of the receiver whose record spans most of the drive, once a second.

    One position a second keeps noise from adding to the length.
    """
    longest = max(records, key=lambda record: np.ptp(record.times) if len(record) else -1.0)
    seconds = np.floor(longest.times)
    first = np.concatenate([[True], np.diff(seconds) > 0])
    first[-1] = True
    return longest.times[first], frame.from_geodetic(longest.geodetic[first])


def _receiver(record: Fixes, start: float, end: float) -> ReceiverCoverage:
    interval = float(np.median(np.diff(record.times))) if len(record) > 1 else end - start
    # Each fix stands for the time to the next, up to one and a half usual intervals.
    lasting = np.minimum(np.diff(record.times, append=record.times[-1] + interval), 1.5 * interval)
    duration = max(end - start + interval, 1e-9)
    shares = {
        FIX_NAMES[int(kind)]: float(lasting[record.kinds == kind].sum()) / duration
        for kind in np.unique(record.kinds)
    }
    shares[NOT_RECORDED] = max(1.0 - sum(shares.values()), 0.0)
    fixed = record.times[record.kinds == RTK_FIXED]
    gaps = np.diff(np.concatenate([[start], fixed, [end]]))
    known = record.satellites[record.satellites >= 0].astype(float)
    hdop = record.hdop[np.isfinite(record.hdop)]
    return ReceiverCoverage(
        receiver=record.receiver,
        count=len(record),
        interval=interval,
        shares=shares,
        satellites=_range(known),
        hdop=_range(hdop),
        longest_gap=float(gaps.max()),
        ellipses=_ellipses(record),
    )


def _range(values: Array) -> tuple[float, float, float] | None:
    if len(values) == 0:
        return None
    return float(values.min()), float(np.median(values)), float(values.max())


def _ellipses(record: Fixes) -> dict[str, tuple[float, float]]:
    """Median semi-axes of the stated ellipses of fixed and float positions."""
    found = {}
    for kind in (RTK_FIXED, RTK_FLOAT):
        stated = record.covariances[record.kinds == kind][:, :2, :2]
        stated = stated[np.isfinite(stated).all((1, 2))]
        if len(stated):
            axes = np.sqrt(np.maximum(np.linalg.eigvalsh(stated), 0))
            small, large = np.median(axes, axis=0)
            found[FIX_NAMES[kind]] = (float(large), float(small))
    return found
