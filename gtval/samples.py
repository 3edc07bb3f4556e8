"""What the samples of `gtval.testing` hold: what instruments record, and what is true."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import RigidTransform

from gtval.markers import Camera
from gtval.receivers import Fixes
from gtval.scans import Scan
from gtval.tables import PoseTable
from validation.poses.angles import Array
from validation.shown import Shown


@dataclass(frozen=True, repr=False)
class SampleSurvey(Shown):
    """A synthetic room with its hand-laser survey, in memory.

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
    example : PoseTable
        Poses of a ground truth 'example_gt' as they come: true ones with noise of 20 mm and
        10 mrad, which its covariances state, and with the bias, which they do not.
    wrong_readings : tuple of int
        Rows of the survey's readings that a blunder or a typing error has spoilt.
    """

    truth: PoseTable
    walls: Array
    world_points: Mapping[str, tuple[float, float]]
    survey: Mapping[str, object]
    example: PoseTable
    wrong_readings: tuple[int, ...]


@dataclass(frozen=True, repr=False)
class SampleRoom(SampleSurvey):
    """The same as a campaign folder.

    Parameters
    ----------
    folder : Path
        The campaign; its files under truth/ are read by no computation. The others are those of
        `SampleSurvey`.
    """

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
    stops : tuple of str
        Names of the n stops.
    odometry : (n, 3) array
        The guesses chained from the first true pose, in the GTV frame.
    walls : (m, 2, 2) array
        A map: start and end of each wall and of each side of an obstacle, metres, in the GTV
        frame. Things that faults put up are not in it.
    """

    scans: tuple[Scan, ...]
    poses: Array
    truth: Array
    guesses: Array
    stops: tuple[str, ...]
    odometry: Array
    walls: Array


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
class SampleFixes(Shown):
    """A drive of a vehicle with three RTK-GPS receivers, in memory.

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
    """

    records: tuple[Fixes, ...]
    heights: tuple[float, ...]
    distances: Array
    truth: PoseTable


@dataclass(frozen=True, repr=False)
class SampleDrive(SampleFixes):
    """The same as a campaign folder.

    Parameters
    ----------
    folder : Path
        The campaign; its files under truth/ are read by no computation. The others are those of
        `SampleFixes`.
    """

    folder: Path
