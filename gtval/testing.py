"""Samples whose truth is known, for testing a system of one's own.

Each function draws a synthetic room or drive from a seed and gives what instruments record there
together with what is true. The same seed and options give the same sample. `make_survey`,
`make_scans`, `make_images`, `make_fixes` and `make_motion` write nothing; `make_room` and
`make_drive` make a campaign folder. With gtval installed, pytest has them as fixtures too: see
`gtval.fixtures`.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from data_samples.drives.drive import Drive, DriveSettings, simulate_drive
from data_samples.drives.files import true_poses, write_drive
from data_samples.motion import drive as motion
from data_samples.rendering.campaign import movie_photographs, sun_blade
from data_samples.rendering.files import make_room_with_cameras
from data_samples.rendering.image import Scene, render
from data_samples.room_campaign import write_room
from data_samples.rooms.cameras import MARKER_FAMILY, SIZE, VisionSettings
from data_samples.rooms.laser_campaign import (
    chained,
    scans_at_stops,
    with_faults,
)
from data_samples.rooms.rooms import RoomSettings
from data_samples.rooms.rooms import make_room as draw_room
from data_samples.rooms.scanners import FULL_TURN
from data_samples.rooms.simulate import (
    ExampleSystem,
    SimulatedCampaign,
    SimulationSettings,
    simulate_survey,
)
from gtval import Fixes, PoseTable
from gtval.samples import (
    SampleDrive,
    SampleFixes,
    SampleImages,
    SampleRoom,
    SampleScans,
    SampleSurvey,
)
from laser_gt.scans.planar import between, compose
from validation.errors import GtvalError
from validation.poses.angles import Array

SampleMotion = motion.SampleMotion
__all__ = ["SampleDrive", "SampleFixes", "SampleImages", "SampleMotion", "SampleRoom"]
__all__ += ["SampleScans", "SampleSurvey", "make_drive", "make_fixes", "make_images"]
__all__ += ["make_motion", "make_room", "make_scans", "make_survey"]

STOPS_OF_SCANS = 26


def _from(low: float, high: float, **values: float) -> None:
    """Raise where a value is not in a range, both ends included."""
    for name, value in values.items():
        if not low <= value <= high:
            right = f"{low} or more" if high == math.inf else f"from {low} to {high}"
            raise GtvalError(f"{name} = {value}: expected {right}")


def make_survey(
    *,
    seed: int = 1,
    stops: int = 12,
    world_points: int = 16,
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0),
    blunders: int = 0,
    typos: int = 0,
    missing: float = 0.0,
    mirrored: bool = False,
    pillars: int = 0,
) -> SampleSurvey:
    """The survey of a room and an example ground truth, in memory: a few milliseconds.

    Parameters
    ----------
    seed : int
        Of all that is drawn.
    stops, world_points : int
        How many.
    bias : (float, float, float)
        Of the ground truth 'example_gt': x, y (metres), theta (radians).
    blunders, typos : int
        Readings of the survey that are off by 0.1 m, and that have two digits exchanged.
    missing : float
        Share of the readings that were not taken, 0 to 1.
    mirrored : bool
        The labels X and Y of the Vframe are exchanged in the readings, and nothing says so.
    pillars : int
        Columns that hide some marks.

    Raises
    ------
    GtvalError
        If the room is too small for all that, or there are fewer readings than faults.

    Examples
    --------
    >>> room = gtval.testing.make_survey(seed=1, stops=6, blunders=2)
    >>> len(room.truth), len(room.wrong_readings)
    (6, 2)
    """
    _from(0, math.inf, seed=seed, blunders=blunders, typos=typos, pillars=pillars)
    _from(1, math.inf, stops=stops)
    _from(2, math.inf, world_points=world_points)
    _from(0, 1, missing=missing)
    rng = np.random.default_rng(seed)
    room = draw_room(RoomSettings(stops=stops, world_points=world_points, pillars=pillars), rng)
    settings = SimulationSettings(
        systems=(ExampleSystem(bias=bias),),
        blunders=blunders,
        typos=typos,
        missing=missing,
        mirror_trap=mirrored,
    )
    return SampleSurvey(*_told(simulate_survey(room, settings, rng)))


Told = tuple[
    PoseTable,
    Array,
    Mapping[str, tuple[float, float]],
    Mapping[str, object],
    PoseTable,
    tuple[int, ...],
]


def _told(made: SimulatedCampaign) -> Told:
    """What a sample tells of a simulated campaign, in the order of its fields."""
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
    wrong = tuple(fault.row for fault in made.truth.faults)
    return made.truth.poses, room.segments, places, survey, made.systems[0], wrong


def make_room(
    folder: Path,
    *,
    seed: int = 1,
    stops: int = 12,
    world_points: int = 16,
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0),
    blunders: int = 0,
    laser: bool = False,
    laser_faults: Collection[str] = (),
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
    laser_faults : collection of str
        What is wrong with them, as for `make_scans`.
    vision : bool
        It has the images of a camera network, too: about a minute.

    Raises
    ------
    GtvalError
        If the folder cannot be written.
    ValueError
        If there is no fault of that name.

    Examples
    --------
    >>> room = gtval.testing.make_room(folder, seed=1, stops=6)
    >>> len(room.truth), (room.folder / "survey" / "readings.csv").exists()
    (6, True)
    """
    _from(0, math.inf, seed=seed, blunders=blunders)
    _from(1, math.inf, stops=stops)
    _from(2, math.inf, world_points=world_points)
    made = write_room(
        folder,
        seed,
        RoomSettings(stops=stops, world_points=world_points),
        SimulationSettings(systems=(ExampleSystem(bias=bias),), blunders=blunders),
        with_faults(laser_faults) if laser or laser_faults else None,
        VisionSettings() if vision else None,
    )
    return SampleRoom(*_told(made), folder)


def make_scans(*, seed: int = 1, stops: int = 4, faults: Collection[str] = ()) -> SampleScans:
    """Laser scans of a room, with where they were taken: some hundredths of a second.

    Parameters
    ----------
    seed : int
        Of all that is drawn.
    stops : int
        How many of the first stops of 26 in the room, 1 to 26.
    faults : collection of str
        What is wrong: 'boxes' that stand elsewhere at every stop, beams that mix ranges at
        'edges', an uneven 'floor', windows of 'glass', ranges longer where 'grazing', walls that
        'lean', 'lost' beams, a 'tilt' of the scanner.

    Raises
    ------
    ValueError
        If there is no fault of that name.

    Examples
    --------
    >>> len(gtval.testing.make_scans(seed=1, stops=3).scans)
    3
    """
    _from(0, math.inf, seed=seed)
    _from(1, STOPS_OF_SCANS, stops=stops)
    rng = np.random.default_rng(seed)
    room = draw_room(RoomSettings(stops=STOPS_OF_SCANS), rng)
    faulty = with_faults(faults)
    names = ("divergence", "incidence_bias", "drop_rate", "tilt")
    like = {name: getattr(faulty.scanners[0], name) for name in names}
    simulation = replace(faulty, scanners=[replace(FULL_TURN, **like)])
    poses = room.stops[:stops]
    scans = tuple(scan for (scan,) in scans_at_stops(room, poses, simulation, rng))
    truth = between(poses[:-1], poses[1:])
    guesses = truth + rng.normal(0, 1, truth.shape) * [0.05, 0.05, 0.04]
    odometry = compose(poses[0], chained(guesses))
    names_of = room.stop_names[:stops]
    return SampleScans(scans, poses, truth, guesses, names_of, odometry, room.segments)


def make_images(
    *, seed: int = 1, images: int = 1, blur: float = 0.7, noise: float = 2.0, blades: int = 0
) -> SampleImages:
    """Images of a robot with markers, taken around it.

    Parameters
    ----------
    seed : int
        Of all that is drawn.
    images : int
        How many; a second each.
    blur, noise : float
        Standard deviations of the lens blur in pixels and of the sensor noise in grey levels.
    blades : int
        Stripes of sunlight across the robot in each image.

    Examples
    --------
    >>> gtval.testing.make_images(seed=1).images[0].shape
    (960, 1280)
    """
    _from(0, math.inf, seed=seed, blur=blur, noise=noise, blades=blades)
    _from(1, math.inf, images=images)
    rng = np.random.default_rng(seed)
    settings = VisionSettings(movie=images, blur=blur, noise=noise)
    _, made = make_room_with_cameras(RoomSettings(stops=1), settings, rng)
    taken = movie_photographs(made, rng)
    middle = np.array(SIZE) / 2
    layout = made.layout
    return SampleImages(
        tuple(
            render(
                one.camera,
                one.T_world_camera,
                Scene(one.sheets, blades=[sun_blade(middle, rng) for _ in range(blades)]),
                one.optics,
                rng,
            )
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


def make_fixes(
    *, seed: int = 1, loops: int = 2, false_fixes: float = 0.0, missing: float = 0.0
) -> SampleFixes:
    """Records of three RTK-GPS receivers on a vehicle that drives over a campus, in memory.

    Parameters
    ----------
    seed : int
        Of all that is drawn.
    loops : int
        Round trips of about 75 s.
    false_fixes, missing : float
        Shares of the fixes that are off by 0.3 m, and that never arrived.

    Examples
    --------
    >>> [record.receiver for record in gtval.testing.make_fixes(seed=1).records]
    ['rear', 'front_left', 'front_right']
    """
    _from(0, math.inf, seed=seed)
    _from(1, math.inf, loops=loops)
    _from(0, 1, false_fixes=false_fixes, missing=missing)
    settings = DriveSettings(loops=loops, false_fixes=false_fixes, missing=missing)
    return SampleFixes(*_driven(simulate_drive(seed, settings)))


def _driven(drive: Drive) -> tuple[tuple[Fixes, ...], tuple[float, ...], Array, PoseTable]:
    """What a sample tells of a drive, in the order of its fields."""
    heights = tuple(drive.antennas[:, 2].tolist())
    return drive.records, heights, drive.distances, true_poses(drive)


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
    _from(0, math.inf, seed=seed)
    _from(1, math.inf, loops=loops)
    _from(0, 1, false_fixes=false_fixes)
    drive = simulate_drive(seed, DriveSettings(loops=loops, false_fixes=false_fixes))
    write_drive(folder, drive)
    return SampleDrive(*_driven(drive), folder)


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
    _from(0, math.inf, seed=seed, minutes=minutes)
    _from(1, 4, level=level)
    return motion.motion_drive(seed, level=level, minutes=minutes)
