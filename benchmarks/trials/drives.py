"""Synthetic drives, solved, beside their truth: what tests and benchmarks of the drive share."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation

from data_samples.drives.drive import LEFT_CAMERA, ROOF, Drive, DriveSettings, scan_along
from rtk_gt.campaign.pose_tables import vehicle_table
from rtk_gt.offsets.estimate import Offsets, estimate_offsets
from rtk_gt.offsets.noise import GpsNoise
from rtk_gt.path.antennas import Antennas, antenna_positions
from rtk_gt.path.composition import compose
from rtk_gt.path.orientation import pose_of, transform_of
from rtk_gt.path.vehicle_path import VehiclePath, vehicle_path
from rtk_gt.receivers.steps import Steps, common_steps
from rtk_gt.sensors.ground import KnownGround
from rtk_gt.sensors.pass_matching import ScannerCalibration, perturbed
from rtk_gt.sensors.scanner_calibration import MountedScans, calibrate_scanners
from rtk_gt.sensors.scanner_equations import ScannerSettings
from rtk_gt.sensors.trajectory import KNOT_SPACINGS, Trajectory, smooth_trajectory
from validation.poses.angles import Array
from validation.poses.pose_table import SPATIAL, pose_difference

CONDITIONS = {
    "three receivers": DriveSettings(),
    "four receivers": DriveSettings(receivers=4),
    "five receivers": DriveSettings(receivers=5),
    "a tenth of the fixes missing": DriveSettings(missing=0.1),
    "twice the noise, eta 2.5": DriveSettings(noise=GpsNoise(0.0128, 2.5), loops=3),
    "slopes of 5 degrees": DriveSettings(steepest=float(np.radians(5.0)), loops=3),
}
SENSOR_SIGMAS = np.array([0.002] * 3 + [np.radians(0.1)] * 3)
"""How well the camera of a trial is known on the vehicle."""
HAND_SIGMAS = np.array([0.02] * 3 + [np.radians(2.0)] * 3)
"""How well a scanner is measured by hand."""
TAPE, LEVEL = 0.003, float(np.radians(0.03))
"""Floor below the roof to 3 mm; antennas measured from a level floor, to 0.5 mm over 1.1 m."""


@dataclass(frozen=True)
class SolvedDrive:
    """A drive with its solution: recorded steps, offsets, antennas, noise and path."""

    drive: Drive
    steps: Steps
    offsets: Offsets
    antennas: Antennas
    noise: GpsNoise
    path: VehiclePath

    def trajectory(self, spacings: Sequence[float] = KNOT_SPACINGS) -> Trajectory:
        """The smooth path; stretches end at pauses of 2 s."""
        return smooth_trajectory(
            self.steps, self.path, self.offsets, self.antennas, self.noise, 2.0, spacings
        )


def solve_drive(drive: Drive) -> SolvedDrive:
    """Offsets and path from the records of a drive; steps with false fixes give no pose."""
    steps = common_steps(drive.records, drive.frame)
    offsets = estimate_offsets(steps, eta=drive.settings.noise.eta)
    others = drive.antennas[3:] if len(drive.antennas) > 3 else None
    antennas = antenna_positions(offsets.distances, drive.antennas[:3, 2], others)
    rows = np.flatnonzero(steps.complete)[offsets.weights > 0]
    noise = GpsNoise(offsets.sigma, offsets.eta)
    path = vehicle_path(steps.select(rows), offsets, antennas, noise)
    return SolvedDrive(drive, steps, offsets, antennas, noise, path)


def offset_errors(solved: SolvedDrive) -> Array:
    """Errors of the offsets of all receivers but the first, then of the distances, metres."""
    off = (solved.offsets.offsets.values - solved.drive.offsets.values)[1:].ravel()
    return np.concatenate([off, solved.offsets.distances - pdist(solved.drive.antennas)])


@dataclass(frozen=True)
class Squares:
    """Sum of normalised squares ``path`` of ``count`` numbers, and ``sensor`` of 6."""

    path: float
    count: int
    sensor: float


def normalised_squares(solved: SolvedDrive) -> Squares:
    """Every fourth pose of the path together, and one pose of the camera's path.

    One, as the error of the offsets, which all poses share, is new in each drive only.
    """
    drive, seed = solved.drive, solved.drive.seed
    path = solved.path.select(np.arange(seed % 4, len(solved.path), 4))
    errors = pose_difference(path.poses, drive.poses(path.times), SPATIAL).ravel()
    whole = np.asarray(vehicle_table(path).joint_covariance, dtype=float)
    joint = errors @ np.linalg.solve(whole, errors)
    generator = np.random.default_rng([seed, 3])
    one = path.select(np.array([generator.integers(len(path))]))
    camera = LEFT_CAMERA + generator.standard_normal(6) * SENSOR_SIGMAS
    truth = pose_of(drive.T_local_vehicle(one.times) * transform_of(camera[None]))
    found = compose(one.poses, one.covariances, LEFT_CAMERA, np.diag(SENSOR_SIGMAS**2))
    error = pose_difference(found.poses, truth, SPATIAL)[0]
    sensor = error @ np.linalg.solve(found.covariances[0], error)
    return Squares(float(joint), errors.size, float(sensor))


def placement_error(pose: Array, truth: Array) -> Array:
    """(6,) error of a sensor's place: a translation and a rotation vector in the vehicle frame."""
    turn = Rotation.from_euler("ZYX", pose[3:]) * Rotation.from_euler("ZYX", truth[3:]).inv()
    return np.concatenate([pose[:3] - truth[:3], turn.as_rotvec()])


@dataclass(frozen=True)
class ScannerTrial:
    """What scanners are calibrated from, all knowledge drawn from its standard deviations."""

    truths: Array
    mounted: tuple[MountedScans, ...]
    ground: KnownGround

    def calibrated(
        self, trajectory: Trajectory, settings: ScannerSettings | None = None
    ) -> tuple[ScannerCalibration, ...]:
        """The scanners' places from the scans along a measured path."""
        return calibrate_scanners(trajectory, self.mounted, ground=self.ground, settings=settings)


def scanner_trial(
    drive: Drive, *scanners: Array, every: float = 0.2, beams: int = 121
) -> ScannerTrial:
    """Scans of a drive, places measured by hand, and a floor measured under the vehicle."""
    generator = np.random.default_rng([drive.seed, 7])
    mounted = []
    for truth in scanners:
        scans = scan_along(drive, truth, generator, every=every, beams=beams)
        start = perturbed(truth, HAND_SIGMAS * generator.standard_normal(6))
        mounted.append(MountedScans(scans, start, HAND_SIGMAS))
    height, *slopes = generator.standard_normal(3) * [TAPE, LEVEL, LEVEL]
    ground = KnownGround(height - ROOF, TAPE, slopes[0], slopes[1], LEVEL)
    return ScannerTrial(np.array(scanners), tuple(mounted), ground)


def calibration_drive(loops: int) -> DriveSettings:
    """Figures of eight between buildings, the antennas always in sight of the satellites."""
    return replace(DriveSettings(), loops=loops, route="eight", straight=60.0, shadow=0.0)
