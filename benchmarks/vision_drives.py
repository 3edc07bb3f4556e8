"""Filmed drives of two minutes: delays, fused trajectories and their covariances, on made poses.

Four cameras of 10 Hz that are late by 0 to 340 ms, with jitter, lost frames and 3 % of frames with
wrong markers; places, lenses and markers a little off what is known (the drives of
tests/vision_gt/driving). A line a drive: rms of the fused positions and headings where a camera
sees the robot, mean and largest squared error over covariance (mean of 3 expected), the largest
ratio of standard deviations of two neighbouring poses while the same cameras see the robot, frames
with wrong markers that were kept, and for each camera the error of its delay with half of its
interval, and the error of AD2.3's own way, the largest correlation of headings. A drive takes half
a minute.

    python benchmarks/vision_drives.py [--drives 20] [--seconds 120] [--noise 0.2]
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/vision_gt"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests/vision_gt/driving"))

import numpy as np
from filmed_drives import Filmed, filmed, leap

from validation.errors import GtvalError
from validation.trajectories.clock.correlation import correlate_headings
from vision_gt.driving.drive import DriveOutcome, solve_drive


def published(one: Filmed) -> dict[str, float]:
    """The delay of each camera by AD2.3's way, seconds."""
    found = {}
    for stream in one.streams:
        seen = stream.trajectory()
        try:
            assert seen is not None
            found[stream.camera] = correlate_headings(one.odometry, seen).after.delay_s
        except (AssertionError, GtvalError):
            found[stream.camera] = np.nan
    return found


def score(one: Filmed, solved: DriveOutcome) -> tuple[float, float, float, float, float]:
    """Rms in mm and mrad, mean and largest squared error over covariance, and `leap`."""
    assert solved.trajectory is not None
    off, inside = one.errors(solved.trajectory)
    some = inside & solved.supported
    off, covariances = off[some], solved.trajectory.covariances[some]
    squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(covariances), off)
    rms = np.sqrt([np.square(off[:, :2]).sum(1).mean(), np.square(off[:, 2]).mean()])
    return (*(1e3 * rms).tolist(), float(squares.mean()), float(squares.max()), leap(solved))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--noise", type=float, default=0.2, help="of the corners, pixels")
    given = parser.parse_args()
    delays, drives = [], []
    print(
        "drive  mm    mrad  NEES  most  leap  wrong kept  delays: error, half, AD2.3's error [ms]"
    )
    for seed in range(given.drives):
        one = filmed(seed, given.seconds, noise=given.noise)
        solved, other = solve_drive(one.streams, one.odometry), published(one)
        drives.append(score(one, solved))
        wrong = sum(int((s.kept & one.spurious[s.camera]).sum()) for s in solved.streams)
        said = []
        for name, true in one.delays.items():
            clock = solved.clocks.get(name)
            if clock is None or clock.verdict != "determined":
                said.append(f"{name} not told")
                continue
            row = (clock.delay_s - true, (clock.high_s - clock.low_s) / 2, other[name] - true)
            delays.append(row)
            said.append("{:+.2f} {:.2f} {:+.0f}".format(*(1e3 * np.array(row))))
        numbers = "  ".join(f"{value:4.2f}" for value in drives[-1])
        print(f"{seed:5d}  {numbers}  {wrong:10d}  {'; '.join(said)}")
        sys.stdout.flush()
    off, half, theirs = np.abs(np.array(delays)).T
    mm, mrad, nees, most, leaps = np.array(drives).T
    print(
        f"delays: {np.sum(off <= half)} of {len(off)} in their intervals, "
        f"median {1e3 * np.median(off):.2f} ms, most {1e3 * off.max():.2f} ms; "
        f"AD2.3's way: median {1e3 * np.nanmedian(theirs):.0f} ms, most "
        f"{1e3 * np.nanmax(theirs):.0f} ms"
    )
    print(
        f"trajectories: median {np.median(mm):.2f} mm, {np.median(mrad):.2f} mrad; most "
        f"{mm.max():.2f} mm, {mrad.max():.2f} mrad; mean NEES of drives {nees.mean():.2f}, "
        f"of a pose at most {most.max():.1f}; neighbours differ by {leaps.max():.3f} times at most"
    )


if __name__ == "__main__":
    main()
