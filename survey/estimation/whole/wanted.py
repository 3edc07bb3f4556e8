"""Which readings would determine what is open."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from survey.estimation.geometry import rotate
from survey.readings.point_names import robot_point
from survey.readings.readings import Readings
from validation.poses.angles import Array

ENOUGH = 0.02
"""Standard deviation, in metres, at which no further reading is asked for."""
_READING = 0.005
"""Standard deviation, in metres, that readings yet to be made are granted, places included."""
_LOOSE = 3.0
"""Metres and radians within which an open place is looked for: a room."""
_MOST = 4
"""Readings asked for at a time; after them the place is known well enough to ask on."""
_ARM = 0.3
"""Metres at which a heading counts as much as a coordinate: half a rig."""
_APART = 10.0
"""Standard deviations by which a reading must differ between two places to tell them apart."""


@dataclass(frozen=True)
class Open:
    """Why a place or a stop is not known.

    Parameters
    ----------
    reason : str
        In words.
    is_weak : bool
        Whether all that is wrong is a large standard deviation.
    candidates : (c, 2 or 3) array
        Places that fit, if there are several.
    """

    reason: str
    is_weak: bool = False
    candidates: Array = field(default_factory=lambda: np.empty((0, 2)))


@dataclass(frozen=True)
class Surroundings:
    """What is known about something open: places, metres, and the readings there are."""

    places: Mapping[str, Array]
    body: Mapping[str, Array]
    readings: Readings


def wanted_readings(name: str, states: Array, sigma: Array, around: Surroundings) -> str:
    """The readings that would determine a place or a stop, as the end of a sentence.

    Parameters
    ----------
    name : str
        Of the world point, or of the stop with a slash.
    states : (c, 2 or 3) array
        Where it may be.
    sigma : (2,) or (3,) array
        Its standard deviations, metres and radians.
    around : Surroundings
        What is known.

    Notes
    -----
    One after the other that which takes most from the variances at all the places, or tells
    most of them apart. An open place is only guessed at: the readings are an example.
    """
    pairs = _pairs(name, states, around)
    if not pairs:
        return "; locate the points around it first"
    from_here, ends = zip(*pairs, strict=True)
    known = np.array([around.places[end] for end in ends])
    body = np.array([around.body.get(point, np.zeros(2)) for point in from_here])
    length, slope = _lengths(states, known, body)
    arm = np.array([1.0, 1.0, _ARM])[: states.shape[1]]
    covariance = [np.diag(np.minimum(sigma, _LOOSE) ** 2) for _ in states]
    twin = len(states) > 1
    chosen: list[int] = []
    while len(chosen) < _MOST:
        gain = np.zeros(len(pairs))
        for C, H in zip(covariance, slope, strict=True):
            moved = H @ C
            gain += ((moved * arm) ** 2).sum(1) / ((moved * H).sum(1) + _READING**2)
        worst = max(float((np.sqrt(np.diagonal(C)) * arm).max()) for C in covariance)
        if worst <= ENOUGH and not twin:
            break
        if worst <= ENOUGH:
            gain = np.ptp(length, axis=0)
        gain[chosen] = -1.0
        best = int(gain.argmax())
        chosen.append(best)
        twin = twin and float(np.ptp(length[:, chosen], axis=0).max()) < _APART * _READING
        for k, H in enumerate(slope):
            C, h = covariance[k], H[best]
            covariance[k] = C - np.outer(C @ h, C @ h) / (h @ C @ h + _READING**2)
    said = []
    for i in chosen:
        here = name + from_here[i]
        told = " or ".join(f"{d:.2f}" for d in dict.fromkeys(np.round(length[:, i], 2)))
        said.append(f"{here}–{ends[i]}" + (f" ({told} m)" if len(states) > 1 else ""))
    return f"; for instance {', '.join(said)} would determine it"


def _pairs(name: str, states: Array, around: Surroundings) -> list[tuple[str, str]]:
    """(Point of the rig or '', known point) of the pairs not read yet."""
    stop = states.shape[1] == 3
    read = {
        frozenset(pair) for pair in zip(around.readings.start, around.readings.end, strict=True)
    }
    pairs = []
    for point in around.body if stop else ("",):
        here = name + point
        for end in around.places:
            of_stop = robot_point(end) is not None
            if (not stop or not of_stop) and frozenset((here, end)) not in read:
                pairs.append((point, end))
    return pairs


def _lengths(states: Array, known: Array, body: Array) -> tuple[Array, Array]:
    """Lengths (c, p) of pairs at states (c, 2 or 3) and their derivatives (c, p, 2 or 3)."""
    stop = states.shape[1] == 3
    arm = rotate(states[:, 2:], body[None]) if stop else np.zeros((len(states), len(body), 2))
    gap = states[:, None, :2] + arm - known
    length = np.maximum(np.linalg.norm(gap, axis=-1), 1e-9)
    unit = gap / length[..., None]
    if not stop:
        return length, unit
    turn = unit[..., 1] * arm[..., 0] - unit[..., 0] * arm[..., 1]
    return length, np.concatenate([unit, turn[..., None]], axis=-1)
