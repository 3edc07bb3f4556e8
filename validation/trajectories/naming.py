"""Which standstill of a trajectory is which surveyed stop."""

from dataclasses import dataclass
from itertools import permutations

import numpy as np
import numpy.typing as npt

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.trajectories.alignment import umeyama

NEAREST = 0.3
"""Metres within which a standstill and a stop are taken as one place. A judgement: ground truth
that is wrong by more is told apart by nothing but its stops.csv; stops that are surveyed nearer to
each other than twice this cannot be told apart by their places alone."""
SAME_LENGTH = 0.1
"""Metres by which a distance between two standstills may differ from that of two stops."""
FEWEST_NAMED = 3
"""Stops that have to agree before a frame is believed: two agree with many pairs."""


@dataclass(frozen=True)
class Named:
    """Standstills with the names of stops.

    Parameters
    ----------
    names : (m,) tuple of str
        The stop of each standstill; '' where there is none.
    reason : str
        Why nothing is named; empty where something is.
    """

    names: tuple[str, ...]
    reason: str = ""


def name_standstills(
    places: Array, stops: Array, names: tuple[str, ...], *, same_frame: bool
) -> Named:
    """The surveyed stop of each standstill, by its place.

    Parameters
    ----------
    places : (m, 2) array
        Mean positions of the standstills, metres.
    stops : (n, 2) array
        Surveyed positions, metres.
    names : (n,) tuple of str
        Of the stops.
    same_frame : bool
        Whether both are in one frame. Otherwise the frame is found first, from the distances
        between the places: rotation and shift, no mirror.

    Notes
    -----
    A frame that fits is not enough: where another one, which gives other names, fits as many
    standstills, the names are ambiguous and none is given.
    """
    if same_frame:
        return Named(_nearest(places, stops, names))
    candidates = _frames(places, stops)
    if not candidates:
        return Named(("",) * len(places), "no rotation and shift makes three of them coincide")
    fits = sorted((_nearest(moved, stops, names) for moved in candidates), key=_unnamed)
    best = fits[0]
    if len(best) - _unnamed(best) < FEWEST_NAMED:
        return Named(("",) * len(places), "no rotation and shift makes three of them coincide")
    if any(one != best and _unnamed(one) <= _unnamed(best) for one in fits):
        return Named(("",) * len(places), "several frames fit equally well")
    return Named(best)


def _unnamed(names: tuple[str, ...]) -> int:
    return sum(not name for name in names)


def _nearest(places: Array, stops: Array, names: tuple[str, ...]) -> tuple[str, ...]:
    """The stop within reach of each place, where no other is nearly as near."""
    distances = np.linalg.norm(places[:, None] - stops[None], axis=2)
    nearest = distances.argmin(1)
    second = np.sort(np.column_stack([distances, np.full(len(places), np.inf)]), axis=1)[:, 1]
    sure = (distances.min(1) < NEAREST) & (second > 2 * distances.min(1))
    return tuple(
        names[stop] if sure[row] and _is_first(distances, row, stop) else ""
        for row, stop in enumerate(nearest)
    )


def _is_first(distances: Array, row: int, stop: np.intp) -> bool:
    """Whether no earlier standstill is as near to the stop: a second visit keeps no name."""
    near = np.flatnonzero(distances[:, stop] < NEAREST)
    return bool(near[0] == row)


def _frames(places: Array, stops: Array) -> list[Array]:
    """The places moved into the frame of the stops, for each pair of pairs of equal length."""
    m, n = len(places), len(stops)
    if m < 2 or n < 2:
        return []
    pairs = np.array(list(permutations(range(n), 2)))
    moved: list[Array] = []
    for a, b in _long_pairs(places):
        line = places[b] - places[a]
        lines = stops[pairs[:, 1]] - stops[pairs[:, 0]]
        same = np.abs(np.linalg.norm(lines, axis=1) - np.linalg.norm(line)) < SAME_LENGTH
        turns = np.arctan2(lines[same, 1], lines[same, 0]) - np.arctan2(line[1], line[0])
        for turn, start in zip(turns, pairs[same, 0], strict=True):
            c, s = np.cos(turn), np.sin(turn)
            around = (places - places[a]) @ np.array([[c, s], [-s, c]])
            moved.append(around + stops[start])
    return [_refined(one, stops) for one in moved]


def _long_pairs(places: Array) -> list[tuple[np.intp, np.intp]]:
    """Up to a dozen pairs of places that are far apart, so that their direction is sure."""
    distances = np.linalg.norm(places[:, None] - places[None], axis=2)
    order = np.argsort(-np.triu(distances), axis=None)[:12]
    rows, columns = np.unravel_index(order, distances.shape)
    return [(a, b) for a, b in zip(rows, columns, strict=True) if distances[a, b] > 0]


def _refined(places: Array, stops: Array) -> Array:
    """The places moved by the rotation and shift that fits those within reach of a stop."""
    for _ in range(3):
        distances = np.linalg.norm(places[:, None] - stops[None], axis=2)
        near: npt.NDArray[np.bool_] = distances.min(1) < 2 * NEAREST
        if near.sum() < 2:
            break
        here, there = places[near], stops[distances.argmin(1)[near]]
        try:
            rotation, shift, _ = umeyama(there, here)
        except GtvalError:  # all of them are one place
            break
        places = places @ rotation.T + shift
    return places
