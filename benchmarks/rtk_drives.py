"""Paths, sensor paths and a scanner's place on simulated drives, against their truth.

Normalised errors (NEES) of whole paths and of a camera's path on hills of 10 degrees, for three to
five receivers, with fixes missing or false; then a vertical scanner whose place was measured by
hand to 2 cm and 2 degrees, from scans along the path that the receivers measured, beside the
matching of passes along that path. Numbers on the command line: first seed, drives a condition,
drives with scans.
"""

import sys

import numpy as np
from scipy import stats
from scipy.spatial.transform import Rotation

from data_samples.drives import (
    LEFT_CAMERA,
    LEFT_SCANNER,
    RIGHT_SCANNER,
    ROOF,
    Drive,
    DriveSettings,
    scan_along,
    simulate_drive,
)
from rtk_gt.antennas import antenna_positions
from rtk_gt.composition import compose
from rtk_gt.ground import KnownGround
from rtk_gt.noise import GpsNoise
from rtk_gt.offsets import estimate_offsets
from rtk_gt.orientation import pose_of, transform_of
from rtk_gt.pass_matching import match_passes, perturbed
from rtk_gt.path import VehiclePath, vehicle_path
from rtk_gt.scanner_calibration import calibrate_scanner
from rtk_gt.scans import cloud_of
from rtk_gt.steps import common_steps
from rtk_gt.trajectory import Trajectory, smooth_trajectory
from validation.angles import Array
from validation.poses import SPATIAL, pose_difference

SENSOR_COVARIANCE = np.diag(np.square([0.002] * 3 + [np.radians(0.1)] * 3))
HAND_SIGMAS = np.array([0.02] * 3 + [np.radians(2.0)] * 3)
TAPE, LEVEL = 0.003, np.radians(0.03)
"""How well the floor below the vehicle frame was measured, metres and radians."""
CONDITIONS = {
    "three receivers": DriveSettings(),
    "four receivers": DriveSettings(receivers=4),
    "five receivers": DriveSettings(receivers=5),
    "a tenth of the fixes missing": DriveSettings(missing=0.1),
    "1 % false fixes": DriveSettings(false_fixes=0.01),
    "twice the noise, eta 2.5": DriveSettings(noise=GpsNoise(0.0128, 2.5), loops=3),
}


def solved(drive: Drive) -> tuple[VehiclePath, Trajectory]:
    """The path, pose by pose and smooth."""
    steps = common_steps(drive.records, drive.frame)
    eta = drive.settings.noise.eta
    offsets = estimate_offsets(steps, eta=eta)
    others = drive.antennas[3:] if len(drive.antennas) > 3 else None
    antennas = antenna_positions(offsets.distances, drive.antennas[:3, 2], others)
    rows = np.flatnonzero(steps.complete)[offsets.weights > 0]
    noise = GpsNoise(offsets.sigma, eta)
    path = vehicle_path(steps.select(rows), offsets, antennas, noise)
    return path, smooth_trajectory(steps, path, offsets, antennas, noise, 2.0, (1.0,))


def normalised(drive: Drive, path: VehiclePath, seed: int) -> tuple[float, float]:
    """NEES of the whole path over its degrees of freedom, and of one pose of the camera."""
    path = path.select(np.arange(seed % 4, len(path), 4))
    errors = pose_difference(path.poses, drive.poses(path.times), SPATIAL)
    joint = errors.ravel() @ np.linalg.solve(path.joint_covariance, errors.ravel())
    generator = np.random.default_rng([seed, 3])
    one = path.select(np.array([generator.integers(len(path))]))
    camera = LEFT_CAMERA + generator.standard_normal(6) * np.sqrt(np.diag(SENSOR_COVARIANCE))
    truth = pose_of(drive.T_local_vehicle(one.times) * transform_of(camera[None]))
    found = compose(one.poses, one.covariances, LEFT_CAMERA, SENSOR_COVARIANCE)
    error = pose_difference(found.poses, truth, SPATIAL)[0]
    return float(joint / errors.size), float(error @ np.linalg.solve(found.covariances[0], error))


def nees(first: int, drives: int) -> None:
    low, high = stats.chi2(6 * drives).ppf([0.025, 0.975]) / drives
    # The noise comes from about 100 steps of three distances: each drive is off by a factor.
    wide = 1.96 * np.sqrt((2 / 170 + 2 / 300) / drives)
    print(f"NEES over {drives} drives, slopes up to 10 degrees (95 % intervals in brackets)")
    print(f"  {'':30} {'path, a component':>18}   {'camera, of 6':>12}")
    print(f"  {'expected':30} [{1 - wide:.2f}, {1 + wide:.2f}]        [{low:.2f}, {high:.2f}]")
    for name, settings in CONDITIONS.items():
        found = []
        for seed in range(first, first + drives):
            drive = simulate_drive(seed, settings)
            found.append(normalised(drive, solved(drive)[0], seed))
        path, camera = np.mean(found, axis=0)
        print(f"  {name:30} {path:14.2f} {camera:18.2f}", flush=True)


def error_of(pose: Array, truth: Array) -> Array:
    turn = Rotation.from_euler("ZYX", pose[3:]) * Rotation.from_euler("ZYX", truth[3:]).inv()
    return np.concatenate([pose[:3] - truth[:3], turn.as_rotvec()])


def said(error: Array) -> str:
    place, turn = 1000 * np.abs(error[:3]).max(), np.degrees(np.abs(error[3:]).max())
    return f"{place:7.1f} mm {turn:7.3f} deg"


def scanners(first: int, drives: int) -> None:
    print(f"\nVertical scanner, {drives} drives of 12 figures of eight; asked: 10 mm, 0.1 degrees")
    print(
        f"  {'':14} {'greatest error':>20} {'greatest sigma':>22} {'NEES of 6':>10}  passes alone"
    )
    for seed in range(first, first + drives):
        settings = DriveSettings(loops=12, straight=60.0, shadow=0.0, route="eight")
        drive = simulate_drive(seed, settings)
        trajectory = solved(drive)[1]
        for name, truth in (("left", LEFT_SCANNER), ("right", RIGHT_SCANNER)):
            generator = np.random.default_rng([seed, 7])
            scans = scan_along(drive, truth, generator, every=0.2)
            start = perturbed(truth, HAND_SIGMAS * generator.standard_normal(6))
            height, *slopes = generator.standard_normal(3) * [TAPE, LEVEL, LEVEL]
            ground = KnownGround(height - ROOF, TAPE, slopes[0], slopes[1], LEVEL)
            found = calibrate_scanner(trajectory, scans, start, HAND_SIGMAS, ground=ground)
            error = error_of(found.pose, truth)
            value = error @ np.linalg.solve(found.covariance, error)
            scans = scans.select(trajectory.spline.covers(scans.times))
            alone = match_passes(
                cloud_of(scans), scans.times, trajectory.spline.poses(scans.times), start,
                HAND_SIGMAS, ground=ground,
            )  # fmt: skip
            print(
                f"  {seed:6d} {name:6} {said(error)} {said(found.sigmas)} {value:9.1f}  "
                f"{said(error_of(alone.pose, truth))}",
                flush=True,
            )


def main() -> None:
    first, drives, scanned = ([int(n) for n in sys.argv[1:]] + [1000, 40, 2][len(sys.argv) - 1 :])[
        :3
    ]
    nees(first, drives)
    scanners(first, scanned)


if __name__ == "__main__":
    main()
