"""Pairs of scans with known relative poses: good ones, and ones without a right answer."""

from dataclasses import dataclass, replace

import numpy as np

from data_samples.rooms.scanners import (
    FULL_TURN,
    HALF_TURN,
    Panels,
    Scanner,
    bare_room,
    corridor,
    furnished_room,
    furniture,
    take_sweep,
)
from laser_gt.scans.planar import between, rotation
from laser_gt.scans.scan import Sweep
from validation.poses.angles import Array

KINDS = ("room", "little_overlap", "corridor", "moved_furniture")


@dataclass(frozen=True)
class ScanPair:
    """Two sweeps, the true pose of the second in the first, and a guess of it.

    Parameters
    ----------
    reference, moving : Sweep
        The sweeps.
    truth, guess : (3,) array
        Pose of the moving frame in the reference frame.
    kind : str
        One of `KINDS`.
    """

    reference: Sweep
    moving: Sweep
    truth: Array
    guess: Array
    kind: str


def draw_pair(
    rng: np.random.Generator,
    kind: str = "room",
    scanner: Scanner = FULL_TURN,
    *,
    sigma: float = 0.01,
    apart: float = 1.0,
    turned: float = 0.6,
    guess_length: float = 0.1,
    guess_angle: float = float(np.deg2rad(5)),
) -> ScanPair:
    """A pair of the kind.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of all chance.
    kind : str
        'room': one furnished room. 'little_overlap': two different rooms, or the same one seen
        with half-turn scanners back to back. 'corridor': parallel walls as far as the scanner
        sees. 'moved_furniture': the same walls with all furniture elsewhere.
    scanner : Scanner
        Which takes both; its noise is replaced by ``sigma``.
    sigma : float
        Range noise in metres.
    apart, turned : float
        Largest displacement along each axis, and largest turn, between the two.
    guess_length, guess_angle : float
        Largest error of the guess in each axis and in heading.
    """
    scanner = replace(scanner, sigma=sigma, resolution=0.0)
    other_room = None
    if kind == "corridor":
        room = corridor(rng, length=rng.uniform(40, 60))
        scanner = replace(scanner, range_max=12.0)
        first = np.array([rng.uniform(-3, 3), rng.uniform(-0.4, 0.4), rng.normal(0, 0.3)])
        step = np.array([rng.uniform(-1, 1), rng.uniform(-0.2, 0.2), rng.uniform(-0.3, 0.3)])
        second = first + step * [apart, 1, 1]
    else:
        room, other_room, inside = _rooms(rng, kind)
        first = np.array([*rng.uniform([2.2, 2.0], [5.8, 4.6]), rng.uniform(-np.pi, np.pi)])
        second = first + np.array([*rng.uniform(-apart, apart, 2), rng.uniform(-turned, turned)])
        second[:2] = np.clip(second[:2], *inside)
        if kind == "little_overlap" and other_room is None:
            second[2] = first[2] + np.pi + rng.uniform(-0.2, 0.2)
            scanner = replace(HALF_TURN, sigma=sigma, resolution=0.0)
    truth = between(first, second)
    off = [*rng.uniform(-guess_length, guess_length, 2), rng.uniform(-guess_angle, guess_angle)]
    guess = truth + np.array(off)
    reference = take_sweep(room, [scanner], first, rng, name="reference")
    moving = take_sweep(
        room if other_room is None else other_room, [scanner], second, rng, name="moving"
    )
    return ScanPair(reference, moving, truth, guess, kind)


def mixed_pair(number: int, seed: int) -> ScanPair:
    """One of a series of pairs of which two thirds are good and a third has no right answer.

    Parameters
    ----------
    number : int
        Place in the series: the kinds and both scanners take turns.
    seed : int
        Of all chance.
    """
    kind = KINDS[0] if number % 3 else KINDS[1 + (number // 3) % 3]
    scanner = (FULL_TURN, HALF_TURN)[(number // 2) % 2]
    return draw_pair(np.random.default_rng(seed), kind, scanner)


CORRIDOR_GUESS = (0.1, 0.05)
"""Standard deviations of the guesses of `corridor_pair`: metres, radians."""


def corridor_pair(seed: int) -> tuple[ScanPair, Array]:
    """A pair in a corridor of which neither scan sees an end, and its direction.

    Parameters
    ----------
    seed : int
        Of all chance.

    Returns
    -------
    ScanPair, (2,) array
        The pair, and the unit vector along the corridor in the frame of the reference.
    """
    rng = np.random.default_rng(seed)
    scanner = Scanner(722, 2 * np.pi, range_max=12.0, resolution=0.0)
    hall = corridor(rng, 50)
    first = np.array([rng.uniform(-3, 3), rng.uniform(-0.4, 0.4), rng.normal(0, 0.3)])
    second = first + rng.uniform(-1, 1, 3) * [0.5, 0.1, 0.2]
    truth = between(first, second)
    length, angle = CORRIDOR_GUESS
    guess = truth + rng.normal(0, 1, 3) * [length, length, angle]
    reference, moving = (take_sweep(hall, [scanner], pose, rng) for pose in (first, second))
    along = rotation(first[2]).T @ np.array([1.0, 0.0])
    return ScanPair(reference, moving, truth, guess, "corridor"), along


def _rooms(rng: np.random.Generator, kind: str) -> tuple[Panels, Panels | None, Array]:
    """The room of the first scan, that of the second where it is another, and where to stand.

    The last is a (2, 2) array, the least and greatest x and y of the second sensor.
    """
    anywhere = np.array([[-np.inf, -np.inf], [np.inf, np.inf]])
    if kind == "moved_furniture":
        walls = bare_room(rng)
        return walls + furniture(rng), walls + furniture(rng), anywhere
    room = furnished_room(rng)
    if kind == "little_overlap" and rng.random() < 0.5:
        length, width = rng.uniform(4, 12), rng.uniform(5.2, 9)
        inside = np.array([[0.3, 0.3], [length - 0.3, width - 0.7]])
        return room, furnished_room(rng, length, width), inside
    return room, None, anywhere
