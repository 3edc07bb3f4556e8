"""Local matching of scans: accuracy, time and convergence beside small_gicp and kiss-icp.

All see the same pairs: one furnished room, 1 cm range noise. small_gicp gets the scans as points
in space at three heights, so that its planes stand upright; kiss-icp gets them at z = 0. Times are
processor times of the whole pair, the preparation of both scans included. The lines under a table
are those of the local matcher and of a judged match both ways, scans prepared and the guess good
to 5 cm and 50 mrad. Other programs on the machine slow all of it: the last figure is how long a
judged match takes over a fixed calculation with arrays as small, timed before and after each.
"""

import time
from collections.abc import Callable

import numpy as np
from laser_lines import Lines, arguments
from trials.scan_pairs import ScanPair, draw_pair

from data_samples.rooms.scanners import FULL_TURN, HALF_TURN, Scanner
from laser_gt.matching.judgement import MatchSettings, match
from laser_gt.matching.kiss import register
from laser_gt.matching.local import align
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.surfaces import surface
from validation.poses.angles import Array, wrap

Method = Callable[[ScanPair], Array]
CLOSE = (0.05, float(np.deg2rad(2)))
ASKED = 4.0
"""Milliseconds of a judged match both ways that are wanted, at 722 beams."""


def local(pair: ScanPair) -> Array:
    """Our local matcher."""
    return align(surface(pair.reference), surface(pair.moving), pair.guess).pose[0]


def judged(pair: ScanPair) -> Array:
    """Our whole chain for an uncertain guess: search, polish, judgement."""
    settings = MatchSettings(guess_length=0.3, guess_angle=0.3)
    return match(Prepared(pair.reference), Prepared(pair.moving), pair.guess, settings).pose


def kiss(pair: ScanPair) -> Array:
    """Point-to-point registration of kiss-icp, voxel 0.1 m."""
    return register(Prepared(pair.reference), Prepared(pair.moving), pair.guess)


def small_gicp(pair: ScanPair) -> Array:
    """Generalised ICP on scans repeated at three heights."""
    import small_gicp as peer

    clouds = [
        np.concatenate([np.column_stack([points, np.full(len(points), z)]) for z in (-0.1, 0, 0.1)])
        for points in (pair.reference.points, pair.moving.points)
    ]
    start = np.eye(4)
    c, s = np.cos(pair.guess[2]), np.sin(pair.guess[2])
    start[:2, :2], start[:2, 3] = [[c, -s], [s, c]], pair.guess[:2]
    found = peer.align(
        clouds[0],
        clouds[1],
        init_T_target_source=start,
        registration_type="GICP",
        downsampling_resolution=0.02,
        max_correspondence_distance=0.5,
        num_threads=1,
    ).T_target_source
    return np.array([found[0, 3], found[1, 3], np.arctan2(found[1, 0], found[0, 0])])


METHODS: dict[str, Method] = {
    "gtval align": local,
    "gtval match": judged,
    "small_gicp": small_gicp,
    "kiss-icp": kiss,
}


def run(
    lines: Lines, scanner: Scanner, guess_length: float, guess_angle: float, seeds: range
) -> None:
    """One table."""
    pairs = [
        draw_pair(
            np.random.default_rng(seed),
            "room",
            scanner,
            apart=0.3,
            turned=0.35,
            guess_length=guess_length,
            guess_angle=guess_angle,
        )
        for seed in seeds
    ]
    print(
        f"\n{scanner.beams} beams, guess off by up to {guess_length} m and "
        f"{np.rad2deg(guess_angle):.0f} degrees, {len(pairs)} pairs"
    )
    print(f"{'method':>12} {'median mm':>10} {'95 % mm':>9} {'mrad':>7} {'right %':>8} {'ms':>7}")
    for name, method in METHODS.items():
        try:
            errors, seconds = _timed(method, pairs)
        except ImportError:
            print(f"{name:>12}  not installed (pip install 'gtval[bench]')")
            continue
        right = (errors[:, 0] < CLOSE[0]) & (errors[:, 1] < CLOSE[1])
        print(
            f"{name:>12} {np.median(errors[:, 0]) * 1e3:10.2f} "
            f"{np.quantile(errors[:, 0], 0.95) * 1e3:9.2f} {np.median(errors[:, 1]) * 1e3:7.2f} "
            f"{right.mean():8.1%} {np.median(seconds) * 1e3:7.2f}"
        )
    print(f"gtval align, both scans prepared: {np.median(_prepared(pairs)) * 1e3:.2f} ms")
    if guess_length <= 2 * GOOD.guess_length:
        seconds, times = _judged(pairs)
        text = f"a judged match both ways, {scanner.beams} beams"
        lines.at_most(text, float(np.median(seconds)) * 1e3, ASKED, "ms")
        print(f"  {np.median(times):.0f} times the fixed calculation")


GOOD = MatchSettings(guess_length=0.05, guess_angle=0.05)
"""A guess from which no search is needed."""


def fixed_calculation(times: int = 60) -> float:
    """Processor seconds of some operations on arrays as small as those of a match, of one of many.

    The median of five runs.
    """
    values = np.arange(1.0, 723.0)
    seconds = []
    for _ in range(5):
        start = time.process_time()
        for _ in range(times // 5):
            roots = np.sqrt(values * values + 1)
            angles = np.arctan2(roots, values)
            np.linalg.inv(np.outer(angles[:3], roots[:3]) + np.eye(3))
            (angles * roots).sum()
        seconds.append((time.process_time() - start) / (times // 5))
    return float(np.median(seconds))


def _judged(pairs: list[ScanPair]) -> tuple[Array, Array]:
    """(n,) processor seconds of a judged match, the best of ten, and over the fixed calculation."""
    seconds, over = [], []
    for pair in pairs:
        reference, moving = Prepared(pair.reference), Prepared(pair.moving)
        match(reference, moving, pair.guess, GOOD)  # makes the tables that later matches share
        best, ratios = np.inf, []
        for _ in range(10):
            before = fixed_calculation()
            start = time.process_time()
            match(reference, moving, pair.guess, GOOD)
            used = time.process_time() - start
            best = min(best, used)
            ratios.append(2 * used / (before + fixed_calculation()))
        seconds.append(best)
        over.append(np.median(ratios))
    return np.array(seconds), np.array(over)


def _prepared(pairs: list[ScanPair]) -> list[float]:
    """Processor seconds of the local matcher alone, the best of 20 for each pair."""
    seconds = []
    for pair in pairs:
        reference, moving = surface(pair.reference), surface(pair.moving)
        align(reference, moving, pair.guess)  # makes the tables that later matches share
        best = np.inf
        for _ in range(20):
            start = time.process_time()
            align(reference, moving, pair.guess)
            best = min(best, time.process_time() - start)
        seconds.append(best)
    return seconds


def _timed(method: Method, pairs: list[ScanPair]) -> tuple[Array, Array]:
    """(n, 2) errors in length and angle, and (n,) processor seconds, the best of three."""
    errors, seconds = [], []
    for pair in pairs:
        best = np.inf
        for _ in range(3):
            start = time.process_time()
            pose = method(pair)
            best = min(best, time.process_time() - start)
        difference = pose - pair.truth
        errors.append([np.hypot(*difference[:2]), abs(wrap(difference[2]))])
        seconds.append(best)
    return np.array(errors), np.array(seconds)


if __name__ == "__main__":
    chosen = arguments(__doc__, 0, pairs=150)
    seeds = range(chosen.seed, chosen.seed + chosen.pairs)
    lines = Lines()
    for scanner in (FULL_TURN, HALF_TURN):
        run(lines, scanner, 0.1, float(np.deg2rad(5)), seeds)
        run(lines, scanner, 0.5, float(np.deg2rad(30)), seeds)
