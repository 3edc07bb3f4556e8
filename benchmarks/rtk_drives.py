"""Paths, sensor paths and scanners' places on simulated drives, against their truth.

Normalised errors (NEES) of whole paths and of a camera's path on hills of 10 degrees, for three to
five receivers, with fixes missing or false; then two vertical scanners whose places were measured
by hand to 2 cm and 2 degrees, found together from scans along the path that the receivers
measured, beside each of them found alone, and the matching of passes along that path. Numbers on
the command line: first seed, drives a condition, drives with scans, and their figures of eight.
"""

import sys
import time
from dataclasses import replace

import numpy as np
from scipy import stats
from trials.drives import (
    CONDITIONS,
    HAND_SIGMAS,
    calibration_drive,
    normalised_squares,
    offset_errors,
    placement_error,
    scanner_trial,
    solve_drive,
)

from data_samples.drives.drive import LEFT_SCANNER, RIGHT_SCANNER, DriveSettings, simulate_drive
from rtk_gt.path.leaps import leaping_poses
from rtk_gt.sensors.pass_matching import match_passes
from rtk_gt.sensors.scans import cloud_of
from validation.poses.angles import Array

FALSE = replace(DriveSettings(), false_fixes=0.01)
UNMARKED = "... without the poses marked"


def nees(first: int, drives: int) -> None:
    low, high = stats.chi2(6 * drives).ppf([0.025, 0.975]) / drives
    # The noise comes from about 100 steps of three distances: each drive is off by a factor.
    wide = 1.96 * np.sqrt((2 / 170 + 2 / 300) / drives)
    print(f"NEES over {drives} drives, slopes up to 10 degrees (95 % intervals in brackets)")
    print(f"  {'':30} {'offsets':>14} {'path, a component':>18}   {'camera, of 6':>12}")
    print(
        f"  {'expected':30} {'1.00':>14} [{1 - wide:.2f}, {1 + wide:.2f}]   [{low:.2f}, {high:.2f}]"
    )
    conditions = {**CONDITIONS, "1 % false fixes": FALSE, UNMARKED: FALSE}
    for name, settings in conditions.items():
        found = []
        for seed in range(first, first + drives):
            solved = solve_drive(simulate_drive(seed, settings))
            if name == UNMARKED:
                path = solved.path.select(~leaping_poses(solved.path, 2.0))
                solved = replace(solved, path=path)
            squares = normalised_squares(solved)
            error = offset_errors(solved)
            offsets = error @ np.linalg.solve(solved.offsets.covariance, error) / len(error)
            found.append([offsets, squares.path / squares.count, squares.sensor])
        means = np.mean(found, axis=0)
        print(f"  {name:30} {means[0]:14.2f} {means[1]:14.2f} {means[2]:18.2f}", flush=True)


def said(error: Array) -> str:
    place, turn = 1000 * np.abs(error[:3]).max(), np.degrees(np.abs(error[3:]).max())
    return f"{place:7.1f} mm {turn:7.3f} deg"


TRUTHS = {"left": LEFT_SCANNER, "right": RIGHT_SCANNER}


def scanners(first: int, drives: int, loops: int) -> None:
    print(f"\nVertical scanners, {drives} drives of {loops} eights; asked: 10 mm, 0.1 degrees")
    print(
        f"  {'':14} {'greatest error':>20} {'greatest sigma':>22} {'NEES of 6':>10}  settled  s"
        f"  {'alone':>20}  passes alone"
    )
    for seed in range(first, first + drives):
        drive = simulate_drive(seed, calibration_drive(loops))
        trajectory = solve_drive(drive).trajectory()
        trial = scanner_trial(drive, *TRUTHS.values())
        begin = time.perf_counter()
        both = trial.calibrated(trajectory)
        seconds = time.perf_counter() - begin
        for (name, truth), found, mounted in zip(TRUTHS.items(), both, trial.mounted, strict=True):
            error = placement_error(found.pose, truth)
            value = error @ np.linalg.solve(found.covariance, error)
            one = replace(trial, mounted=(mounted,)).calibrated(trajectory)[0]
            scans = mounted.scans.select(trajectory.spline.covers(mounted.scans.times))
            passes = match_passes(
                cloud_of(scans), scans.times, trajectory.spline.poses(scans.times), mounted.start,
                HAND_SIGMAS, ground=trial.ground,
            )  # fmt: skip
            print(
                f"  {seed:6d} {name:6} {said(error)} {said(found.sigmas)} {value:9.1f}  "
                f"{'yes' if found.settled else 'no':7} {seconds:3.0f} "
                f"{said(placement_error(one.pose, truth))}"
                f"{said(placement_error(passes.pose, truth))}",
                flush=True,
            )


def main() -> None:
    given = [int(n) for n in sys.argv[1:]]
    first, drives, scanned, loops = (given + [1000, 40, 2, 12][len(given) :])[:4]
    if drives:
        nees(first, drives)
    scanners(first, scanned, loops)


if __name__ == "__main__":
    main()
