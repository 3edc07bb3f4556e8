"""Delays and drifts of cameras over many drives: error, coverage, verdict, time.

Usage: python benchmarks/clock_delays.py [drives a level] [first seed] [odometry|mocap]
"""

import sys
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from data_samples.motion.drive import motion_drive
from validation.trajectories.clock.estimate import sync

ASKED = {1: (0.2, 0.5), 2: (0.6, 2.0), 3: (0.8, 3.5), 4: (2.5, 7.0)}
"""Median and 95 % quantile of the error of a delay, ms, that a ground truth's clock needs."""


def one_drive(job: tuple[int, int, str]) -> list[tuple[float, ...]]:
    """Of each camera: level, determined, error in ms, covered, drift covered; and the time."""
    level, seed, against = job
    drive = motion_drive(seed, level=level, minutes=7.0)
    reference = drive.odometry if against == "odometry" else drive.reference
    start = time.perf_counter()
    found = sync(reference, list(drive.cameras.values()))
    spent = time.perf_counter() - start
    rows = []
    for name, clock in drive.clocks.items():
        one = found[name]
        true = clock.delay_s + 1e-6 * clock.drift_ppm * (one.at_s - clock.at_s)
        covered = one.low_s <= true <= one.high_s
        drift = one.drift_low_ppm <= clock.drift_ppm <= one.drift_high_ppm
        told = one.verdict == "determined"
        rows.append((level, told, 1e3 * abs(one.delay_s - true), covered, drift, spent))
    return rows


def main(drives: int = 20, first: int = 0, against: str = "odometry") -> None:
    """Print the table."""
    jobs = [(level, first + k, against) for level in ASKED for k in range(drives)]
    with ProcessPoolExecutor(2) as pool:
        rows = np.array([row for found in pool.map(one_drive, jobs) for row in found])
    print("level  cameras  determined  median ms (asked)  p95 ms (asked)  holds  drift holds  s")
    for level, (median, quantile) in ASKED.items():
        own = rows[rows[:, 0] == level]
        told = own[own[:, 1] > 0]
        error = told[:, 2]
        print(
            f"{level:5d} {len(own):8d} {len(told) / len(own):11.3f} "
            f"{np.median(error):9.2f} ({median:4.1f}) {np.quantile(error, 0.95):10.2f} "
            f"({quantile:4.1f}) {told[:, 3].mean():7.3f} {told[:, 4].mean():11.3f} "
            f"{np.median(own[:, 5]):6.1f}"
        )
    told = rows[rows[:, 1] > 0]
    print(f"all: {told[:, 3].mean():.3f} of delays, {told[:, 4].mean():.3f} of drifts are held")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:4])
