"""Matching beside the Cramer-Rao bound: errors over the least that any unbiased matcher can have.

Known to the bound are which panel each beam meets and the range noise; unknown are the pose and the
two numbers of every line, in both scans. The figure is the root of the mean squared error in units
of the bound, over three: 1 for a matcher that knows what is a line and wastes nothing. Part of the
bound is what panels with one to four beams on them say, which no scan shows to be lines: beside the
figure stands that over the bound without them.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from laser_lines import Lines, arguments
from laser_matching import small_gicp
from trials.plicp import plicp
from trials.scan_pairs import ScanPair

from data_samples.rooms.scanners import (
    FULL_TURN,
    HALF_TURN,
    Panels,
    Scanner,
    cast,
    furnished_room,
    take_sweep,
)
from laser_gt.matching.both_ways import both_ways
from laser_gt.matching.judgement import match
from laser_gt.matching.local import align
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import between, wrapped
from validation.poses.angles import Array

SIGMA = 0.01
"""Range noise in metres."""


@dataclass(frozen=True)
class BoundedPair:
    """A pair of scans and the least covariance that a match of it can have."""

    pair: ScanPair
    bound: Array
    without_small: Array


def drawn(seed: int, scanner: Scanner) -> BoundedPair:
    """A pair in a furnished room."""
    rng = np.random.default_rng([seed, 6])
    scanner = replace(scanner, sigma=SIGMA, resolution=0.0)
    room = furnished_room(rng)
    first = np.array([*rng.uniform([2.2, 2.0], [5.8, 4.6]), rng.uniform(-np.pi, np.pi)])
    second = first + np.array([*rng.uniform(-0.3, 0.3, 2), rng.uniform(-0.35, 0.35)])
    reference, moving = (take_sweep(room, [scanner], pose, rng) for pose in (first, second))
    truth = between(first, second)
    guess = truth + rng.uniform(-1, 1, 3) * [0.1, 0.1, 0.087]
    bound = cramer_rao(room, scanner, first, second)
    without = cramer_rao(room, scanner, first, second, 5)
    return BoundedPair(ScanPair(reference, moving, truth, guess, "room"), bound, without)


def cramer_rao(
    room: Panels, scanner: Scanner, first: Array, second: Array, fewest: int = 1
) -> Array:
    """(3, 3) bound of the pose of the second scan in the first, both knowing the panels only.

    Panels with fewer than ``fewest`` beams on them in one of the scans say nothing.

    A range on a line with normal n (towards the sensor) changes by 1 / cos of the incidence for a
    shift of the line along n, and by the place along it for a turn. The pose moves the points of
    the second scan against the lines.
    """
    size = 3 + 2 * len(room)
    information = np.zeros((size, size))
    along = room.ends - room.starts
    along /= np.hypot(*along.T)[:, None]
    turn = first[2]
    blocks, panels = [], []
    for pose, moves in ((first, False), (second, True)):
        heading = pose[2] + scanner.angles
        beams = np.column_stack([np.cos(heading), np.sin(heading), np.zeros(len(heading))])
        met = cast(room, np.array([*pose[:2], scanner.height]), beams)
        hit = (met.panel >= 0) & (met.ranges < scanner.range_max)
        panel = met.panel[hit]
        points = pose[:2] + met.ranges[hit, None] * beams[hit, :2]
        normal = np.column_stack([-along[panel, 1], along[panel, 0]])
        rows = np.zeros((len(panel), size))
        place = np.arange(len(panel))
        rows[place, 3 + 2 * panel] = -1.0
        rows[place, 4 + 2 * panel] = -((points - room.starts[panel]) * along[panel]).sum(1)
        if moves:
            c, s = np.cos(turn), np.sin(turn)
            rows[:, :2] = normal @ np.array([[c, -s], [s, c]])
            arm = points - pose[:2]
            rows[:, 2] = normal[:, 1] * arm[:, 0] - normal[:, 0] * arm[:, 1]
        across = SIGMA * np.maximum(met.cosines[hit], 1e-3)
        blocks.append(rows / across[:, None])
        panels.append(panel)
    beams_on = np.min([np.bincount(panel, minlength=len(room)) for panel in panels], axis=0)
    for rows, panel in zip(blocks, panels, strict=True):
        kept = rows[beams_on[panel] >= fewest]
        information += kept.T @ kept
    lines = information[3:, 3:] + 1e-6 * np.eye(size - 3)
    cross = information[:3, 3:]
    left = information[:3, :3] - cross @ np.linalg.solve(lines, cross.T)
    return np.asarray(np.linalg.inv(left), dtype=float)


def judged(pair: ScanPair) -> Array:
    """Our whole chain."""
    return match(Prepared(pair.reference), Prepared(pair.moving), pair.guess).by_scans[0]


def one_way(pair: ScanPair) -> Array:
    """The local matcher alone."""
    reference, moving = Prepared(pair.reference).surface, Prepared(pair.moving).surface
    pose: Array = align(reference, moving, pair.guess).pose[0]
    return pose


def two_ways(pair: ScanPair) -> Array:
    """The local matcher in both directions, the last steps with short lines too."""
    reference, moving = Prepared(pair.reference), Prepared(pair.moving)
    first = align(reference.surface, moving.surface, pair.guess).pose[0]
    found = align(reference.fine, moving.fine, first)
    return both_ways(reference.fine, moving.fine, found)[0]


def by_plicp(pair: ScanPair) -> Array:
    """PLICP, written down from the paper."""
    return plicp(pair.reference.points, pair.moving.points, pair.guess)


METHODS: dict[str, Callable[[ScanPair], Array]] = {
    "one way": one_way,
    "both ways": two_ways,
    "judged": judged,
    "PLICP": by_plicp,
    "small_gicp": small_gicp,
}
ASKED = 1.18
"""Times the bound that is wanted. Reached on 600 pairs is 1.19 on a full turn and 1.17 on a half:
two thirds of the excess are of panels with few beams."""


def show(lines: Lines, name: str, pairs: list[BoundedPair]) -> None:
    """One line for each matcher."""
    for who, method in METHODS.items():
        try:
            off = np.array([wrapped(method(one.pair) - one.pair.truth) for one in pairs])
        except ImportError:
            print(f"  {name}, {who}: not installed (pip install 'gtval[bench]')")
            continue
        squared = _squared(off, np.array([one.bound for one in pairs]))
        known = _squared(off, np.array([one.without_small for one in pairs]))
        near = squared < 50  # pairs that a matcher has lost say nothing of its efficiency
        ratio = float(np.sqrt(squared[near].mean()))
        doubt = float(squared[near].std() / np.sqrt(near.sum()) / 2 / ratio)
        text = f"{name}, {who}: over the bound ({near.sum()} of {len(pairs)}, +- {doubt:.2f})"
        if who in {"both ways", "judged"}:
            lines.at_most(text, ratio, ASKED, "times")
        else:
            print(f"  {text} {ratio:.2f}")
        print(f"    without panels of few beams: {np.sqrt(known[near].mean()):.2f}")


def _squared(off: Array, bounds: Array) -> Array:
    """(n,) squared errors in units of bounds, (n, 3, 3), over three."""
    squared = (off * np.linalg.solve(bounds, off[..., None])[..., 0]).sum(1) / 3
    return np.asarray(squared, dtype=float)


if __name__ == "__main__":
    chosen = arguments(__doc__, 0, pairs=600)
    lines = Lines()
    for name, scanner in (("722 beams, full turn", FULL_TURN), ("361 beams, half turn", HALF_TURN)):
        seeds = range(chosen.seed, chosen.seed + chosen.pairs)
        show(lines, name, [drawn(seed, scanner) for seed in seeds])
