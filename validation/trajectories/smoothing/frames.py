"""Sources whose poses differ as those in two frames do: by one turn and shift all the time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.results import Finding, Severity, Size
from validation.trajectories.alignment import umeyama
from validation.trajectories.smoothing.gathering import Stamped, states_all
from validation.trajectories.smoothing.source import Source

FEWEST = 60
"""Poses of both sources at one time below which nothing is said: ten in each of the parts."""
PARTS = 6
"""Parts of the time in which the rest about the frame is looked at: errors that last differ from
part to part, a frame does not."""
SURE = 10.0
"""How many times what the frame moves must exceed what is left beside it, noise of single poses or
errors that last. Measured on 16 simulated drives of four levels of noise, 77 pairs of cameras in
one frame: at most 0.3 times, and 1.7 where delays are wrong by 0.2 s."""
STATED = 4.0
"""How many stated standard deviations it must exceed, where covariances are stated: an error that
stays the same all the time is in them, and a frame is not."""
LARGE = 0.1
"""Metres from which on nobody can take it for an error of a mount or a survey. A judgement: these
are off by centimetres."""


@dataclass(frozen=True)
class Apart:
    """How the frames of two sources lie to each other.

    Parameters
    ----------
    moved : float
        What the frame moves the poses by, root mean square, metres.
    shift : (k,) array
        From the middle of the poses of the first to those of the second, metres.
    turn : float
        Radians.
    """

    moved: float
    shift: Array
    turn: float


def frame_findings(sources: Sequence[Source], stamps: Sequence[Stamped]) -> list[Finding]:
    """Sources in other frames than one before them, in words."""
    found = []
    for later in range(1, len(sources)):
        for first in range(later):
            apart = apart_of((sources[first], sources[later]), (stamps[first], stamps[later]))
            if apart is None:
                continue
            name, other = (sources[one].trajectory.system for one in (later, first))
            text = (
                f"Its poses lie {apart.moved:.3f} m from those of '{other}' all the time, as those "
                f"in another frame do: turned by {np.degrees(apart.turn):.2f} degrees, and shifted "
                f"by {' and '.join(f'{one:.3f}' for one in apart.shift)} m. The fused poses hop "
                f"between them. Bring both into one frame (`gtval explain` tells which is off, "
                "with a third source), or fuse one of them alone."
            )
            severity: Severity = "error" if apart.moved > LARGE else "warning"
            size = Size("distance between the frames", apart.moved, "m")
            found.append(Finding(severity, text, name, "sources_apart", (size,)))
            break
    return found


def apart_of(sources: Sequence[Source], stamps: Sequence[Stamped]) -> Apart | None:
    """The two frames, if the sources surely are in two.

    Notes
    -----
    Positions of the second source at the times of the first (linear in between, across no gap)
    are fitted by one turn and shift. It is a frame if what that moves is many times what is left:
    noise, and its medians in parts of the time, in which errors that last and wander show; and if
    no delay of the second explains half of it.
    """
    dims = _dims(sources[0])
    (target, sigma), (points, other) = (_places(*one) for one in zip(sources, stamps, strict=True))
    times = [one.times for one in stamps]
    if min(len(target), len(points)) < FEWEST:
        return None
    after = np.clip(np.searchsorted(times[1], times[0]), 1, len(times[1]) - 1)
    low, high = times[1][after - 1], times[1][after]
    inside = (low <= times[0]) & (times[0] <= high) & (high > low) & (high - low <= stamps[1].gap)
    if inside.sum() < FEWEST:
        return None
    share = ((times[0] - low) / np.maximum(high - low, 1e-12))[inside, None]
    there = points[after - 1][inside] * (1 - share) + points[after][inside] * share
    here = target[inside]
    apart = np.linalg.norm(there - here, axis=1)
    # The start: differences near their median, component by component; both frames' outliers fall.
    kept = np.linalg.norm(there - here - np.median(there - here, axis=0), axis=1)
    keep = kept <= np.quantile(kept, 0.8)
    for _ in range(10):
        rotation, shift = _fitted(there[keep], here[keep])
        rest = there - (here @ rotation.T + shift)
        left = np.linalg.norm(rest, axis=1)
        keep = left <= 3 * np.median(left)
    moved = float(np.sqrt(np.mean(np.sum((here @ rotation.T + shift - here) ** 2, axis=1))))
    noise = float(np.sqrt(np.mean(left[keep] ** 2)))
    medians = [np.median(part, axis=0) for part in np.array_split(rest, PARTS)]
    lasting = float(np.linalg.norm(medians, axis=1).max())
    stated = STATED * float(np.hypot(sigma, other))
    if moved < max(SURE * noise, SURE * lasting, stated) or np.median(apart) < moved / 2:
        return None
    # A delay along a straight way looks like a frame too.
    rates = (points[after] - points[after - 1])[inside] / (high - low)[inside, None]
    late = np.sum(rates[keep] * (there - here)[keep]) / max(np.sum(rates[keep] ** 2), 1e-12)
    if np.median(np.linalg.norm(there - here - late * rates, axis=1)[keep]) < moved / 2:
        return None
    middle = here.mean(axis=0)
    turn = np.arctan2(rotation[1, 0], rotation[0, 0])
    if dims == 3:
        turn = np.arccos(np.clip((np.trace(rotation) - 1) / 2, -1.0, 1.0))
    return Apart(moved, middle @ rotation.T + shift - middle, float(turn))


def _fitted(target: Array, points: Array) -> tuple[Array, Array]:
    """Turn and shift that bring points onto others; no turn where all are at one place."""
    try:
        rotation, shift, _scale = umeyama(target, points)
    except GtvalError:
        return np.eye(target.shape[1]), target.mean(0) - points.mean(0)
    return rotation, shift


def _dims(source: Source) -> int:
    """Numbers of a position."""
    return 2 if source.trajectory.kind in {"plane", "points_plane"} else 3


def _places(source: Source, stamps: Stamped) -> tuple[Array, float]:
    """(n, k) positions in the order of the stamps, and the stated standard deviation or 0."""
    own, dims = source.trajectory, _dims(source)
    sigma = 0.0
    if source.noise is not None:
        sigma = source.noise[0] * np.sqrt(dims)
    elif states_all(own):
        variances = np.diagonal(own.covariances[:, :dims, :dims], axis1=1, axis2=2).sum(1)
        sigma = np.sqrt(np.median(variances))
    return own.poses[stamps.rows, :dims], float(sigma)
