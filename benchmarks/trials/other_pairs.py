"""Pairs of scans in places unlike the rooms of the samples, drawn by a program of its own.

Halls with walls at any angle, round columns, tables of thin legs, people, panes that answer only a
beam that meets them squarely; ranges in steps, with errors that neighbouring beams share. Nothing
here is taken from `data_samples`, so that what was set on those rooms is judged elsewhere.
"""

import numpy as np

from laser_gt.scans.planar import between, compose
from laser_gt.scans.scan import Scan, Sweep, sweep
from trials.scan_pairs import ScanPair
from validation.poses.angles import Array

KINDS = ("hall", "hall_half", "people", "other_hall", "passage", "emptied")
GOOD = ("hall", "hall_half", "people")
"""Kinds of which the right pose is determined."""


class Place:
    """Walls, (n, 4) ends, of which some are panes, and round things, (m, 3) x, y, radius."""

    def __init__(self, walls: Array, panes: Array, rounds: Array) -> None:
        self.walls, self.panes, self.rounds = walls, panes, rounds

    def with_rounds(self, more: Array) -> "Place":
        """The same place with other round things as well."""
        return Place(self.walls, self.panes, np.concatenate([self.rounds, more]))


def hall(rng: np.random.Generator) -> Place:
    """A hall of five to eight corners with columns, boxes at any angle and tables of four legs."""
    count = int(rng.integers(5, 9))
    turn = np.sort(rng.uniform(0, 2 * np.pi, count) * 0.15 + np.arange(count) * 2 * np.pi / count)
    far = rng.uniform(4.5, 8.5, count)
    corners = np.column_stack([far * np.cos(turn), far * np.sin(turn)])
    walls = [_closed(corners)]
    panes = [np.zeros(count, dtype=bool)]
    panes[0][int(rng.integers(count))] = rng.random() < 0.4
    for _ in range(int(rng.integers(3, 8))):
        middle, size = rng.uniform(-4, 4, 2), rng.uniform(0.2, 0.9, 2)
        if np.hypot(*middle) < 1.8:
            continue
        box = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * size / 2
        angle = rng.uniform(0, np.pi)
        cosine, sine = np.cos(angle), np.sin(angle)
        walls.append(_closed(box @ np.array([[cosine, sine], [-sine, cosine]]) + middle))
        panes.append(np.zeros(4, dtype=bool))
    rounds = np.column_stack([rng.uniform(-4, 4, (6, 2)), rng.uniform(0.15, 0.35, 6)])
    legs = rng.uniform(-3.5, 3.5, (3, 1, 2)) + rng.choice([-0.4, 0.4], (3, 4, 2))
    legs = np.column_stack([legs.reshape(-1, 2), np.full(12, 0.02)])
    rounds = np.concatenate([rounds, legs])
    rounds = rounds[np.hypot(rounds[:, 0], rounds[:, 1]) > 1.8]
    return Place(np.concatenate(walls), np.concatenate(panes), rounds)


def passage(rng: np.random.Generator) -> Place:
    """Two parallel walls without an end."""
    half = rng.uniform(0.9, 1.4)
    walls = np.array([[-60.0, -half, 60.0, -half], [60.0, half, -60.0, half]])
    return Place(walls, np.zeros(2, dtype=bool), np.zeros((0, 3)))


def _closed(corners: Array) -> Array:
    """The walls between corners and back to the first."""
    return np.hstack([corners, np.roll(corners, -1, 0)])


def people(rng: np.random.Generator, count: int) -> Array:
    """(2 * count, 3) legs of people who stand about."""
    at = rng.uniform(-3.5, 3.5, (count, 2))
    at = at[np.hypot(*at.T) > 1.5]
    apart = rng.uniform(-0.2, 0.2, (len(at), 2))
    return np.column_stack([np.concatenate([at, at + apart]), np.full(2 * len(at), 0.07)])


def scanned(
    place: Place, pose: Array, rng: np.random.Generator, *, half: bool, reach: float, sigma: float
) -> Sweep:
    """What a scanner at a pose sees: half a turn of 361 beams, or a whole one of 720."""
    beams = np.linspace(-np.pi / 2, np.pi / 2, 361)
    angles = beams if half else np.linspace(-np.pi, np.pi, 720, endpoint=False)
    ray = np.column_stack([np.cos(angles + pose[2]), np.sin(angles + pose[2])])
    ranges = np.minimum(_to_walls(place, pose, ray), _to_rounds(place.rounds, pose, ray))
    shared = np.convolve(rng.normal(0, 1, len(angles) + 10), np.ones(11), "valid") / np.sqrt(11)
    noisy = ranges + rng.normal(0, sigma, len(angles)) + 0.2 * sigma * shared
    noisy = np.round(np.maximum(noisy, 0.05), 2 if sigma > 0.005 else 3)
    noisy[rng.random(len(angles)) < 0.01] = np.inf
    return sweep(Scan(np.where(ranges < reach, noisy, np.inf), angles, range_max=reach))


def _to_walls(place: Place, pose: Array, ray: Array) -> Array:
    """(n,) distances to the nearest wall along each ray; a pane answers within 15 degrees."""
    start, along = place.walls[:, :2] - pose[:2], place.walls[:, 2:] - place.walls[:, :2]
    across = ray[:, :1] * along[:, 1] - ray[:, 1:] * along[:, 0]
    safe = np.where(np.abs(across) < 1e-9, 1e-9, across)
    distance = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / safe
    share = (start[:, 0] * ray[:, 1:] - start[:, 1] * ray[:, :1]) / safe
    squarely = np.abs(across) / np.hypot(*along.T) > np.cos(np.deg2rad(15))
    hit = (distance > 0.05) & (share >= 0) & (share <= 1) & (squarely | ~place.panes)
    return np.asarray(np.where(hit, distance, np.inf).min(1))


def _to_rounds(rounds: Array, pose: Array, ray: Array) -> Array:
    """(n,) distances to the nearest round thing along each ray."""
    if not len(rounds):
        return np.full(len(ray), np.inf)
    middle = rounds[:, :2] - pose[:2]
    ahead = ray @ middle.T
    off = (middle**2).sum(1) - ahead**2
    distance = ahead - np.sqrt(np.maximum(rounds[:, 2] ** 2 - off, 0))
    hit = (off < rounds[:, 2] ** 2) & (distance > 0.05)
    return np.asarray(np.where(hit, distance, np.inf).min(1))


def other_pair(number: int, seed: int) -> ScanPair:
    """One of a series of pairs: the kinds take turns, the first three of them good."""
    rng = np.random.default_rng([77, seed])
    kind = KINDS[number % len(KINDS)]
    place = passage(rng) if kind == "passage" else hall(rng)
    second = place
    if kind == "people":
        place, second = (one.with_rounds(people(rng, 3)) for one in (place, place))
    elif kind == "other_hall":
        second = hall(rng)
    elif kind == "emptied":
        keep = place.walls.shape[0]
        keep = int(min(keep, 5))
        second = Place(place.walls[:keep], place.panes[:keep], people(rng, 8))
    first = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(-np.pi, np.pi)])
    if kind == "passage":
        first = np.array([0.0, rng.uniform(-0.3, 0.3), rng.normal(0, 0.4)])
    truth = np.array([*rng.uniform(-0.8, 0.8, 2), rng.uniform(-0.5, 0.5)])
    if kind == "passage":
        truth = between(first, first + rng.uniform(-1, 1, 3) * [0.6, 0.2, 0.3])
    form = {
        "half": kind == "hall_half",
        "reach": 10.0 if kind == "passage" else 25.0,
        "sigma": float(rng.choice([0.003, 0.01])),
    }
    reference = scanned(place, first, rng, **form)
    moving = scanned(second, compose(first, truth), rng, **form)
    guess = truth + rng.uniform(-1, 1, 3) * [0.1, 0.1, np.deg2rad(5)]
    return ScanPair(reference, moving, truth, guess, kind)
