"""How large the errors of fused trajectories are, and whether their covariances say so.

Simulated drives of a robot through a room: four cameras of 10 Hz that see parts of the path, with
delays, drift, jitter of receipt, outliers and headings off by half a turn, and odometry that
drifts. Delays are given with errors of the size that a clock estimate has. Four levels of noise;
rms of the position error where data stand on both sides, and squared errors over their covariance
(3 expected), with odometry and with cameras only.

    python benchmarks/fusion_errors.py [--drives 20] [--seconds 300]
"""

import argparse
import resource
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/validation/trajectories/smoothing"))

import numpy as np
from fusion_drives import drive, score

from validation.poses.trajectory import Trajectory
from validation.trajectories.smoothing.fusion import fuse
from validation.trajectories.smoothing.source import Source

ASKED = {True: (1.5, 4.0, 8.0, 18.0), False: (3.5, 8.0, 15.0, 32.0)}


def table(drives: int, seconds: float) -> None:
    print("level  odometry  rms mm  worst  asked  NEES  worst  supported  s a drive")
    for level in range(4):
        found = {True: [], False: []}
        for seed in range(drives):
            made = drive(seed, level, seconds)
            for with_odometry, rows in found.items():
                start = time.process_time()
                fused = fuse(made.sources, odometry=made.odometry if with_odometry else None)
                rows.append((*score(made, fused), time.process_time() - start))
        for with_odometry, rows in found.items():
            rms, nees, share, spent = np.mean(rows, axis=0)
            worst, most = np.max(rows, axis=0)[:2]
            print(
                f"{level + 1:5d}  {'yes' if with_odometry else 'no':>8}  {rms:6.2f}  {worst:5.2f}  "
                f"{ASKED[with_odometry][level]:5.1f}  {nees:4.2f}  {most:5.2f}  {share:9.0%}  "
                f"{spent:9.1f}",
                flush=True,
            )


def speed(count: int = 100_000) -> None:
    """Time and memory of smoothing many poses in the plane and in space."""
    rng = np.random.default_rng(1)
    times = 0.01 * np.arange(count)
    turn = times / 10
    places = np.column_stack([np.sin(times / 3), np.cos(times / 4)])
    plane = np.column_stack([places, turn]) + rng.normal(0, 0.005, (count, 3))
    half = turn / 2 + rng.normal(0, 0.002, count)
    space = np.zeros((count, 7))
    space[:, :2], space[:, 5], space[:, 6] = plane[:, :2], np.sin(half), np.cos(half)
    space[:, 2:5] = rng.normal(0, 0.003, (count, 3))
    for kind, poses in (("plane", plane), ("space", space)):
        start, clock = time.process_time(), time.perf_counter()
        fuse([Source(Trajectory("one", times, poses, kind))])
        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        spent = time.process_time() - start
        print(
            f"{count:,} poses, {kind}: {spent:.1f} s of processor, "
            f"{time.perf_counter() - clock:.1f} s by the clock, at most {most:.0f} MB so far"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=300.0)
    given = parser.parse_args()
    speed()
    if given.drives:
        table(given.drives, given.seconds)


if __name__ == "__main__":
    main()
