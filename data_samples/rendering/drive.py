"""A drive filmed by the cameras of the synthetic room: frames on clocks of their own."""

import json
from dataclasses import asdict, dataclass, replace

import numpy as np
from scipy.spatial.transform import RigidTransform

from data_samples.motion.path import TruePath, through
from data_samples.motion.sensors import TrueClock, odometry
from data_samples.rendering.campaign import Photograph
from data_samples.rendering.image import Optics
from data_samples.rendering.objects import robot_sheets
from data_samples.rooms.cameras import VisionTruth
from validation.poses.angles import wrap
from validation.poses.trajectory import Trajectory
from validation.trajectories.formats import trajectory_text
from vision_gt.optics.camera import inside_image, project
from vision_gt.optics.transforms import planar_pose, planar_transform
from vision_gt.robot.marker_poses import Layout

EPOCH = 1_700_000_000
"""Second at which the drives begin."""
MARGIN = 30
"""Pixels from the rim within which the middle of the robot is out of view."""
DELAYS = (-0.34, 0.0)
"""Seconds added to a camera's stamps to get the time of the odometry: images are stamped late, as
they arrive."""


@dataclass(frozen=True)
class DriveSettings:
    """A drive, and how it is filmed.

    Parameters
    ----------
    seconds : float
        How long.
    rate : float
        Frames a second of each camera.
    jitter : float
        Standard deviation of the way from the camera to the stamp, seconds.
    lost : float
        Share of the frames that are lost.
    spurious : float
        Share of the frames in which a marker that faces the camera and another one have each
        other's prints.
    """

    seconds: float = 20.0
    rate: float = 10.0
    jitter: float = 0.003
    lost: float = 0.02
    spurious: float = 0.0


@dataclass(frozen=True)
class FilmedDrive:
    """Frames to be rendered, and all that is true.

    Parameters
    ----------
    photographs : list of Photograph
        One a frame.
    files : dict of str to str
        Odometry, and the truth, by their names relative to the campaign.
    """

    photographs: list[Photograph]
    files: dict[str, str]


def film(truth: VisionTruth, settings: DriveSettings, rng: np.random.Generator) -> FilmedDrive:
    """The frames of all cameras that have the robot in view: vision/drive/CAMERA/TIME.png.

    Parameters
    ----------
    truth : VisionTruth
        Cameras and robot; it drives between its stops.
    settings : DriveSettings
        How long and how often.
    rng : numpy.random.Generator
        Of the way, the clocks and the frames that are lost.
    """
    path = through(planar_pose(truth.T_gtv_robot), settings.seconds, rng)
    prints = rng.spawn(1)[0]
    photographs: list[Photograph] = []
    spurious: list[str] = []
    clocks = {}
    for number, camera in enumerate(truth.cameras):
        delay = float(rng.uniform(*DELAYS))
        clock = TrueClock(delay, settings.seconds / 2, 0.0, settings.jitter)
        clocks[camera.name] = asdict(clock)
        first = rng.uniform(0, 1 / settings.rate)
        times = np.arange(first, path.times[-1], 1 / settings.rate)
        times = times[rng.random(len(times)) >= settings.lost]
        stamps = clock.stamps(times) + settings.jitter * (rng.gamma(4.0, 0.5, len(times)) - 2)
        bad = prints.random(len(times)) < settings.spurious
        for time, stamp, wrong in zip(times, stamps, bad, strict=True):
            T_robot = planar_transform(path.at(np.array([time]))[0])
            layout = truth.layout
            if wrong:
                layout = _misprinted(layout, T_robot, truth.T_gtv_camera[number], prints)
            one = _frame(replace(truth, layout=layout), number, T_robot, float(stamp))
            photographs += [] if one is None else [one]
            spurious += [one.name] if wrong and one is not None else []
    files = _files(path, clocks, rng)
    if settings.spurious:
        files["truth/drive_spurious.csv"] = "\n".join(["frame", *spurious]) + "\n"
    return FilmedDrive(photographs, files)


def _misprinted(
    layout: Layout, T_robot: RigidTransform, T_camera: RigidTransform, rng: np.random.Generator
) -> Layout:
    """A robot on which the marker that faces a camera most has the print of another one."""
    T = T_robot * layout.T_robot_marker
    facing = T.rotation.as_matrix()[:, :, 2]
    away = T_camera.translation - T.translation
    same = np.flatnonzero(layout.sides == np.median(layout.sides))
    slants = (facing * away).sum(1) / np.linalg.norm(away, axis=1)
    order = list(range(len(layout.numbers)))
    one = int(same[np.argmax(slants[same])])
    other = int(rng.choice(same[same != one]))
    order[one], order[other] = other, one
    return replace(layout, numbers=tuple(layout.numbers[i] for i in order))


def _frame(
    truth: VisionTruth, number: int, T_robot: RigidTransform, stamp: float
) -> Photograph | None:
    """The frame with the robot at a place; None where it is out of view."""
    camera, T = truth.cameras[number], truth.T_gtv_camera[number]
    centre = T.inv().apply(T_robot.apply(np.array([-0.35, 0.0, 0.4])))
    if centre[2] < 0.3 or (np.abs(centre[:2] / centre[2]) > 0.8).any():
        return None
    if not inside_image(project(centre, camera.parameters), camera.size, MARGIN):
        return None
    sheets = robot_sheets(truth.layout, T_robot, T.translation)
    name = f"vision/drive/{camera.name}/{EPOCH + stamp:.6f}.png"
    optics = Optics(blur=truth.settings.blur, noise=truth.settings.noise)
    return Photograph(name, camera, T, sheets, optics)


def _files(
    path: TruePath, clocks: dict[str, dict[str, float]], rng: np.random.Generator
) -> dict[str, str]:
    """Odometry of the campaign, and the truth."""
    seen = odometry(path, rng)
    wheels = Trajectory("odometry", seen.stamps, seen.poses, epoch=EPOCH)
    true = path.poses.copy()
    true[:, 2] = wrap(true[:, 2])
    every = slice(None, None, 4)
    truth = Trajectory("truth", path.times[every], true[every], epoch=EPOCH, frame="room")
    return {
        "vision/odometry.csv": trajectory_text(wheels, "csv"),
        "truth/drive.csv": trajectory_text(truth, "csv"),
        "truth/drive_clocks.json": json.dumps(clocks, indent=2) + "\n",
        "campaign.toml": '\n[vision.drive]\nodometry = "vision/odometry.csv"\nstamps = "receipt"\n',
    }
