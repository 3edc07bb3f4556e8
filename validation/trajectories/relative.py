"""Errors of a source over lengths and times: its drift."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.trajectory import Trajectory
from validation.statistics.dependence import SeriesRms, rms_of_series
from validation.trajectories.association import Pairs

MOST_MOTIONS = 5000
"""Of those that start at every pose; the errors of motions that overlap are nearly the same."""

Unit = Literal["m", "s", "poses"]
Rows = npt.NDArray[np.intp]


@dataclass(frozen=True)
class RelativeErrors:
    """How much motions over one length or time differ.

    Parameters
    ----------
    delta : float
        Length or time of the motions.
    unit : {"m", "s", "poses"}
        Of delta.
    start, end : (p,) array of int
        Rows of the pairs at which each motion starts and ends.
    translations, rotations : (p,) array
        Sizes of the errors, metres and radians; rotations are NaN for positions only.
    rms : SeriesRms
        Of the translations.
    """

    delta: float
    unit: Unit
    start: Rows
    end: Rows
    translations: Array
    rotations: Array
    rms: SeriesRms


def relative_errors(
    pairs: Pairs,
    delta: float,
    unit: Unit = "m",
    *,
    every: bool = True,
    most: int | None = None,
) -> RelativeErrors:
    """Errors of the motions over a length, a time or a number of poses.

    Parameters
    ----------
    pairs : Pairs
        Aligned or not: a frame changes nothing for poses.
    delta : float
        Length of the motions along the reference's path, in metres, their time, or their number
        of poses.
    unit : {"m", "s", "poses"}
        Of delta.
    every : bool
        Whether a motion starts at every pose, or where the one before has ended.
    most : int, optional
        At most so many motions, evenly among those that there are.

    Raises
    ------
    GtvalError
        If no motion is so long without a gap.

    Notes
    -----
    Of the motions ``A_i^-1 A_j`` of the reference and ``B_i^-1 B_j`` of the source it is
    ``(A_i^-1 A_j)^-1 (B_i^-1 B_j)``, as KITTI and evo (rpe) have it; of positions without
    orientation the difference of the displacements, for which the frame has to be aligned.
    """
    if not delta > 0:
        raise GtvalError(f"a length or time of {delta:g} {unit} is not positive")
    start, end = motions(pairs, delta, unit, every=every)
    if most is not None:
        step = -(-len(start) // most) or 1
        start, end = start[::step], end[::step]
    if not len(start):
        raise GtvalError(f"no motion without a gap is {delta:g} {unit} long")
    return errors_of_motions(pairs, start, end, delta, unit)


def errors_of_motions(
    pairs: Pairs, start: Rows, end: Rows, delta: float, unit: Unit
) -> RelativeErrors:
    """Errors of motions between given rows."""
    ours, theirs = pairs.reference, pairs.source
    if ours.has_orientation:
        moved, turned = _motion(ours, start, end)
        other, other_turned = _motion(theirs, start, end)
        translations = np.linalg.norm(turned.inv().apply(other - moved), axis=1)
        rotations = (turned.inv() * other_turned).magnitude()
    else:
        away = ours.positions - theirs.positions
        translations = np.linalg.norm(away[end] - away[start], axis=1)
        rotations = np.full(len(start), np.nan)
    rms = rms_of_series(translations)
    return RelativeErrors(delta, unit, start, end, translations, rotations, rms)


def motions(pairs: Pairs, delta: float, unit: Unit, *, every: bool = True) -> tuple[Rows, Rows]:
    """Rows at which motions start and end: the first pose that is delta or farther on.

    None crosses a gap.
    """
    n = len(pairs.times)
    if unit == "s":
        measure = np.asarray(pairs.times)
    elif unit == "m":
        steps = np.linalg.norm(np.diff(pairs.reference.positions, axis=0), axis=1)
        measure = np.concatenate([[0.0], np.cumsum(steps)])
    else:
        measure = np.arange(n, dtype=float)
    # Times such as 0.1 + 0.2 differ in the last bits from 0.3.
    end = np.searchsorted(measure, measure + delta * (1 - 1e-9), side="left")
    start = np.arange(n)
    stretch = np.cumsum(pairs.starts_anew)
    good = end < n
    good[good] &= stretch[end[good]] == stretch[start[good]]
    if not every:
        kept, row = np.zeros(n, dtype=bool), 0
        while row < n:
            kept[row] = good[row]
            row = int(end[row]) if good[row] else row + 1
        good &= kept
    return start[good], end[good]


def _motion(one: Trajectory, start: Rows, end: Rows) -> tuple[Array, Rotation]:
    """(p, 3) displacements in the frame of the start, and the turns."""
    moved = one.positions[end] - one.positions[start]
    if one.dimensions == 2:
        moved = np.column_stack([moved, np.zeros(len(moved))])
    back = _rotations(one, start).inv()
    return back.apply(moved), back * _rotations(one, end)


def _rotations(one: Trajectory, rows: Rows) -> Rotation:
    if one.kind == "space":
        return Rotation.from_quat(one.poses[rows, 3:])
    return Rotation.from_rotvec(one.poses[rows, 2:] * [0.0, 0.0, 1.0])
