"""How good the guesses were, by what the accepted matches say."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from laser_gt.matching.kiss import chain
from laser_gt.matching.verdicts import Match
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import between, wrapped
from validation.poses.angles import Array
from validation.statistics.robust import sigma_from_median

GENEROUS = 2.0
"""What to take the guesses' deviations for, over their scatter about the accepted matches: those
are the easy ones. A judgement: twice as wide a search costs time, a narrow one right poses."""

WORSE = 1.5
"""Times the expected deviation from which on guesses are worse: a deviation of ten is known to a
third of itself."""

FEWEST = 10
"""Accepted matches below which nothing is said: from ten, a deviation by medians is known to 37 %
of itself (1.17 / sqrt(10))."""


@dataclass(frozen=True)
class Trajectory:
    """First guess of all laser frames, in the frame of the first.

    Parameters
    ----------
    poses : (n, 3) array
        Laser frames.
    source : str
        Where they come from, in words.
    doubtful : tuple of str
        Stops that could not be placed with confidence.
    """

    poses: Array
    source: str
    doubtful: tuple[str, ...] = ()


def first_trajectory(sweeps: Sequence[Prepared], odometry: Array | None) -> Trajectory:
    """Laser frames by odometry, (n, 3), or by matching the scans in a row where there is none."""
    if odometry is not None:
        return Trajectory(between(odometry[0], odometry), "odometry")
    poses, doubtful = chain(sweeps)
    names = tuple(sweeps[number].name for number in doubtful)
    return Trajectory(poses, "scans matched in a row (kiss-icp)", names)


def guess_deviations(poses: Array, start: int, end: int, sigmas: Sequence[float]) -> Array:
    """Standard deviations of the guess of a pair of stops from a chain of motions.

    Parameters
    ----------
    poses : (n, 3) array
        The chain: x, y, theta of each stop in turn.
    start, end : int
        The pair.
    sigmas : (float, float)
        Of one motion, from stop to stop: metres in x and y each, radians.

    Returns
    -------
    (2,) array
        Metres (in the worse direction) and radians.

    Notes
    -----
    Errors of k motions add up to sqrt(k), and an error of the heading turns the rest of the way:
    sigma^2 = k sigma_l^2 + sigma_theta^2 (sum of squared distances from each stop in between to
    the last).
    """
    length, angle = sigmas
    first, last = sorted((start, end))
    steps = max(last - first, 1)
    rest = poses[first + 1 : last, :2] - poses[last, :2]
    turned = angle**2 * float((rest**2).sum())
    return np.array([np.sqrt(steps * length**2 + turned), angle * np.sqrt(steps)])


def guess_scatter(matches: Sequence[Match], growth: npt.ArrayLike | None = None) -> Array | None:
    """Standard deviations of the guesses about the accepted matches.

    Parameters
    ----------
    matches : sequence of Match
        Judged; only the accepted count.
    growth : (n, 2) array_like, optional
        Factors by which length and angle of each guess were expected to be worse than those from
        one stop to the next; 1 if not given.

    Returns
    -------
    (2,) array or None
        Metres in x and y each, and radians, of a guess with factors 1; None where fewer than ten
        matches are accepted.

    Notes
    -----
    From medians, so that a few wild guesses do not count. The accepted are the easier ones, and a
    guess that is far off is less likely to be among them: take it for a lower bound.
    """
    accepted = np.array([one.verdict == "accepted" for one in matches], dtype=bool)
    if accepted.sum() < FEWEST:
        return None
    off = wrapped(np.array([one.pose - one.guess for one in matches])[accepted])
    if growth is not None:
        off /= np.asarray(growth, dtype=float)[accepted][:, [0, 0, 1]]
    x, y, theta = sigma_from_median(off, axis=0)
    return np.array([np.hypot(x, y) / np.sqrt(2), theta])


def wider_guesses(scatter: Array, sigmas: Sequence[float]) -> tuple[float, float] | None:
    """What to search with where guesses scatter by more than was expected; else None.

    Parameters
    ----------
    scatter : (2,) array
        As of `guess_scatter`.
    sigmas : (float, float)
        Expected, metres and radians.
    """
    if not (scatter > WORSE * np.array(sigmas)).any():
        return None
    length, angle = np.maximum(GENEROUS * scatter, sigmas).tolist()
    return length, angle


def scatter_from_stop_to_stop(
    stops: Sequence[str], poses: Array, matches: Sequence[Match], sigmas: Sequence[float]
) -> Array | None:
    """The same of a step from one stop to the next, from matches of stops further apart, too.

    Parameters
    ----------
    stops : sequence of str
        All, in the order of ``poses``, (n, 3), the chain of the guesses.
    matches : sequence of Match
        Whose guesses are of that chain.
    sigmas : (float, float)
        Expected of a step, which tells how the errors of steps add up.
    """
    place = {stop: number for number, stop in enumerate(stops)}
    expected = [
        guess_deviations(poses, place[one.reference], place[one.moving], sigmas) for one in matches
    ]
    return guess_scatter(matches, np.array(expected).reshape(-1, 2) / np.array(sigmas))
