"""How far apart stops may be, by field of view: the share of matches that are used, and how good.

Pairs of scans in furnished rooms of 8 m by 7 m and along corridors with doors, with distances and
turns between the stops, at 10 mm range noise and a guess by odometry. It is what sets the advice on
the spacing of stops in docs/laser.md.
"""

import numpy as np
from laser_lines import arguments

from data_samples.rooms.scanners import Panels, Scanner, corridor, furnished_room, take_sweep
from laser_gt.matching.judgement import MatchSettings, match
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import between
from validation.poses.angles import Array

VIEWS = {"a whole turn": 2 * np.pi, "270 degrees": 1.5 * np.pi, "half a turn": np.pi}
APART = (0.5, 1.0, 2.0, 3.0)
TURNED = ((0, 30), (30, 60), (60, 90), (90, 180))


def place(rng: np.random.Generator, hall: bool) -> tuple[Panels, Array, Array]:
    """What there is, and the least and greatest x and y of a stop."""
    if hall:
        return corridor(rng, 30, 2.0, doors=12), np.array([-12, -0.6]), np.array([12, 0.6])
    return furnished_room(rng), np.array([1.2, 1.2]), np.array([6.8, 5.6])


def drawn(rng: np.random.Generator, apart: float, turned: tuple[int, int], hall: bool) -> Array:
    """Two stops, (2, 3), at a distance and with a turn between them, in the room; and the room."""
    _, low, high = place(np.random.default_rng(0), hall)
    while True:
        first = np.array([*rng.uniform(low, high), rng.uniform(-np.pi, np.pi)])
        way, turn = rng.uniform(-np.pi, np.pi), np.deg2rad(rng.uniform(*turned))
        step = apart * np.array([np.cos(way), np.sin(way)])
        second = np.array([*(first[:2] + step), first[2] + turn * rng.choice([-1, 1])])
        if (second[:2] > low).all() and (second[:2] < high).all():
            return np.array([first, second])


def one(
    seed: int, scanner: Scanner, apart: float, turned: tuple[int, int], hall: bool
) -> tuple[str, float]:
    """Verdict, and how far the match is off in metres."""
    rng = np.random.default_rng([seed, round(10 * apart), turned[0], hall])
    room, _, _ = place(rng, hall)
    stops = drawn(rng, apart, turned, hall)
    both = [Prepared(take_sweep(room, [scanner], pose, rng)) for pose in stops]
    truth = between(*stops)
    guess = truth + rng.normal(0, [0.05, 0.05, 0.03])
    settings = MatchSettings(guess_length=0.05, guess_angle=0.03)
    found = match(both[0], both[1], guess, settings)
    return found.verdict, float(np.hypot(*(found.pose - truth)[:2]))


if __name__ == "__main__":
    chosen = arguments(__doc__, 0, pairs=30)
    seeds = range(chosen.seed, chosen.seed + chosen.pairs)
    for hall in (False, True):
        for name, view in VIEWS.items():
            scanner = Scanner(round(np.rad2deg(view) * 2) + 1, view, sigma=0.01, resolution=0.0)
            where = "corridors with doors" if hall else "furnished rooms"
            print(f"{where}, {name}: accepted, used, median in mm that those are off")
            for apart in APART:
                cells = []
                for turned in TURNED:
                    told = [one(seed, scanner, apart, turned, hall) for seed in seeds]
                    used = [off for verdict, off in told if verdict in {"accepted", "imprecise"}]
                    good = sum(verdict == "accepted" for verdict, _ in told) / len(told)
                    off = 1e3 * float(np.median(used)) if used else np.nan
                    share = len(used) / len(told)
                    cells.append(f"{turned[0]}-{turned[1]}: {good:4.0%} {share:4.0%} {off:4.1f}")
                print(f"  {apart:.1f} m, degrees   " + "   ".join(cells), flush=True)
