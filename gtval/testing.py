"""Samples whose truth is known, for testing a system of one's own.

Each function draws a synthetic room or drive from a seed and gives what instruments record there
together with what is true. The same seed and options give the same sample. With gtval installed,
pytest has them as fixtures too: see `gtval.fixtures`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import RigidTransform

from data_samples.drives.drive import DriveSettings, simulate_drive
from data_samples.drives.files import true_poses, write_drive
from data_samples.motion import drive as motion
from data_samples.rendering.campaign import movie_photographs
from data_samples.rendering.files import make_room_with_cameras
from data_samples.rendering.image import Scene, render
from data_samples.room_campaign import write_room
from data_samples.rooms.cameras import MARKER_FAMILY, VisionSettings
from data_samples.rooms.laser_campaign import LaserSimulation, room_panels
from data_samples.rooms.rooms import RoomSettings
from data_samples.rooms.rooms import make_room as draw_room
from data_samples.rooms.scanners import FULL_TURN, take_scan
from data_samples.rooms.simulate import ExampleSystem, SimulationSettings
from gtval import Camera, Fixes, PoseTable, Scan
from laser_gt.scans.planar import between
from validation.poses.angles import Array
from validation.shown import Shown

SampleMotion = motion.SampleMotion


@dataclass(frozen=True, repr=False)
class SampleRoom(Shown):
    """A synthetic room with its hand-laser survey.

    Parameters
    ----------
    truth : PoseTable
        True poses of the stops, in the GTV frame.
    walls : (m, 2, 2) array
        Start and end of each wall and of each side of an obstacle, metres, in the GTV frame.
    world_points : mapping of str to (float, float)
        True places, metres, in the GTV frame.
    survey : mapping
        What `gtval.solve_survey` takes: readings, names and nominal points.
    folder : Path
        The campaign; its files under truth/ are read by no computation.
    """

    truth: PoseTable
    walls: Array
    world_points: Mapping[str, tuple[float, float]]
    survey: Mapping[str, object]
    folder: Path


@dataclass(frozen=True, repr=False)
class SampleScans(Shown):
    """Scans of a full turn at neighbouring stops.

    Parameters
    ----------
    scans : tuple of Scan
        n of them; the sensor frame is the robot frame.
    poses : (n, 3) array
        True poses of the n stops, in the GTV frame: x, y (metres), theta (radians).
    truth : (n - 1, 3) array
        Each scan but the first, seen from the one before.
    guesses : (n - 1, 3) array
        The same as odometry has it, to 0.05 m and 0.04 rad.
    """

    scans: tuple[Scan, ...]
    poses: Array
    truth: Array
    guesses: Array


@dataclass(frozen=True, repr=False)
class SampleImages(Shown):
    """Images of a robot that carries markers.

    Parameters
    ----------
    images : tuple of (h, w) arrays of uint8
        Grey levels.
    camera : Camera
        That took them, exactly known.
    sides : mapping of int to float
        Sides of the markers, metres.
    family : str
        Of the markers.
    truth : tuple of mapping of int to RigidTransform
        T_camera_marker of every marker for each image, whether it is seen there or not.
    """

    images: tuple[npt.NDArray[np.uint8], ...]
    camera: Camera
    sides: Mapping[int, float]
    family: str
    truth: tuple[Mapping[int, RigidTransform], ...]


@dataclass(frozen=True, repr=False)
class SampleDrive(Shown):
    """A drive of a vehicle with three RTK-GPS receivers.

    Parameters
    ----------
    records : tuple of Fixes
        Of the receivers: rear, front left, front right.
    heights : tuple of float
        z of their antennas on the vehicle, metres.
    distances : (3,) array
        True distances of the antennas: rear to left, rear to right, left to right, metres.
    truth : PoseTable
        True poses in space at every second of the rear receiver, in the frame of the campaign.
    folder : Path
        The campaign; its files under truth/ are read by no computation.
    """

    records: tuple[Fixes, ...]
    heights: tuple[float, ...]
    distances: Array
    truth: PoseTable
    folder: Path


def make_room(
    folder: Path,
    *,
    seed: int = 1,
    stops: int = 12,
    world_points: int = 16,
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0),
    blunders: int = 0,
    laser: bool = False,
    vision: bool = False,
) -> SampleRoom:
    """A campaign folder with the survey of a room and an example ground truth.

    Parameters
    ----------
    folder : Path
        Made if missing.
    seed : int
        Of all that is drawn.
    stops, world_points : int
        How many.
    bias : (float, float, float)
        Of the ground truth 'example_gt' of the campaign: x, y (metres), theta (radians).
    blunders : int
        Readings of the survey that are off by 0.1 m.
    laser : bool
        The campaign has the scans of two scanners on the robot, too.
    vision : bool
        It has the images of a camera network, too: about a minute.

    Raises
    ------
    GtvalError
        If the folder cannot be written.

    Examples
    --------
    >>> room = gtval.testing.make_room(folder, seed=1, stops=6)
    >>> len(room.truth), (room.folder / "survey" / "readings.csv").exists()
    (6, True)
    """
    made = write_room(
        folder,
        seed,
        RoomSettings(stops=stops, world_points=world_points),
        SimulationSettings(systems=(ExampleSystem(bias=bias),), blunders=blunders),
        LaserSimulation() if laser else None,
        VisionSettings() if vision else None,
    )
    room, readings, rig = made.room, made.readings, made.robot_frame
    survey = {
        "start": readings.start,
        "end": readings.end,
        "distance": readings.distance,
        "sigma": readings.sigma,
        "world_points": room.world_names,
        "vframe": room.vframe.points,
        "vframe_sigma": room.vframe.sigma,
        "robot_frame": rig.points,
        "marking_sigma": rig.marking_sigma,
    }
    places = dict(zip(room.world_names, map(tuple, room.world_points.tolist()), strict=True))
    return SampleRoom(made.truth.poses, room.segments, places, survey, folder)


def make_scans(*, seed: int = 1, stops: int = 4) -> SampleScans:
    """Laser scans of a room, with where they were taken.

    Parameters
    ----------
    seed : int
        Of all that is drawn.
    stops : int
        How many of the first stops of 26 in the room.

    Examples
    --------
    >>> len(gtval.testing.make_scans(seed=1, stops=3).scans)
    3
    """
    rng = np.random.default_rng(seed)
    room = draw_room(RoomSettings(stops=max(stops, 26)), rng)
    poses = room.stops[:stops]
    scans = tuple(take_scan(room_panels(room), FULL_TURN, pose, rng) for pose in poses)
    truth = between(poses[:-1], poses[1:])
    guesses = truth + rng.normal(0, 1, truth.shape) * [0.05, 0.05, 0.04]
    return SampleScans(scans, poses, truth, guesses)


def make_images(*, seed: int = 1, images: int = 1) -> SampleImages:
    """Images of a robot with markers, taken around it.

    Parameters
    ----------
    seed : int
        Of all that is drawn.
    images : int
        How many; a second each.

    Examples
    --------
    >>> gtval.testing.make_images(seed=1).images[0].shape
    (960, 1280)
    """
    rng = np.random.default_rng(seed)
    _, made = make_room_with_cameras(RoomSettings(stops=1), VisionSettings(movie=images), rng)
    taken = movie_photographs(made, rng)
    layout = made.layout
    return SampleImages(
        tuple(
            render(one.camera, one.T_world_camera, Scene(one.sheets), one.optics, rng)
            for one in taken
        ),
        made.movie_camera,
        dict(zip(layout.numbers, layout.sides.tolist(), strict=True)),
        MARKER_FAMILY.name,
        tuple(
            {
                number: one.T_world_camera.inv() * layout.T_robot_marker[row]
                for row, number in enumerate(layout.numbers)
            }
            for one in taken
        ),
    )


def make_drive(
    folder: Path, *, seed: int = 1, loops: int = 2, false_fixes: float = 0.0
) -> SampleDrive:
    """A campaign folder with a drive over a campus: records of three RTK-GPS receivers.

    Parameters
    ----------
    folder : Path
        Made if missing.
    seed : int
        Of all that is drawn.
    loops : int
        Round trips of about 75 s.
    false_fixes : float
        Share of the fixes that are off by 0.3 m.

    Raises
    ------
    GtvalError
        If the folder cannot be written.

    Examples
    --------
    >>> [record.receiver for record in gtval.testing.make_drive(folder, seed=1).records]
    ['rear', 'front_left', 'front_right']
    """
    drive = simulate_drive(seed, DriveSettings(loops=loops, false_fixes=false_fixes))
    write_drive(folder, drive)
    heights = tuple(drive.antennas[:, 2].tolist())
    return SampleDrive(drive.records, heights, drive.distances, true_poses(drive), folder)


def make_motion(*, seed: int = 1, level: int = 1, minutes: float = 5.0) -> SampleMotion:
    """A robot that drives through a room, seen by four cameras with clocks of their own.

    Parameters
    ----------
    seed : int
        Of all that is drawn.
    level : {1, 2, 3, 4}
        How bad the cameras are: noise of 3, 8, 15 or 30 mm; latencies that scatter by 0, 2, 10
        or 30 ms; 0.5 to 5 % of wrong poses; clocks that run away by 0, 0, 100 or 200 ppm.
    minutes : float
        How long it drives.

    Raises
    ------
    GtvalError
        If a camera never sees the robot, as may happen in less than two minutes.

    Examples
    --------
    >>> drive = gtval.testing.make_motion(seed=1, minutes=2)
    >>> sorted(drive.cameras)
    ['camera_1', 'camera_2', 'camera_3', 'camera_4']
    """
    return motion.motion_drive(seed, level=level, minutes=minutes)
