"""What a drive is made from, and what is made of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from laser_gt.driving.odometer import Odometer
from laser_gt.driving.sweeps import Sensor
from laser_gt.placing.mounts import MountCheck
from laser_gt.placing.survey_check import SurveyDoubt
from laser_gt.scans.scan import Flags, Indices, Scan, Sweep
from validation.poses.angles import Array
from validation.poses.trajectory import Trajectory
from validation.trajectories.clock.result import ClockEstimate

Report = Callable[[str, float], None]
"""Told what is being done and the share done."""


@dataclass(frozen=True)
class SurveyedStop:
    """A stop with a surveyed pose of the robot.

    Parameters
    ----------
    name : str
        Of the stop.
    start, end : float
        Seconds, on the clock of the odometry.
    pose, covariance : (3,), (3, 3) arrays
        In the GTV frame.
    assumed : bool
        Whether nobody has said how good the survey is.
    """

    name: str
    start: float
    end: float
    pose: Array
    covariance: Array
    assumed: bool = False


@dataclass(frozen=True)
class DriveInputs:
    """A log.

    Parameters
    ----------
    scans : mapping of str to sequence of Scan
        By scanner, in the order of time; the first one's frame is the laser frame.
    sensors : mapping of str to Sensor
        Of the same names.
    mount_sigmas : (3,) array
        How well the first one's mount was measured.
    odometer : Odometer or None
        Odometry.
    own_clock : bool
        Whether odometry has stamps of its own, of another clock than the scans.
    stops : sequence of SurveyedStop
        Anchors; without any the first pose of the robot is the origin.
    epoch : int
        Whole seconds that were taken off all times.
    max_delay : float
        Between scans of several scanners, seconds.
    """

    scans: Mapping[str, Sequence[Scan]]
    sensors: Mapping[str, Sensor]
    mount_sigmas: Array
    odometer: Odometer | None = None
    own_clock: bool = False
    stops: Sequence[SurveyedStop] = ()
    epoch: int = 0
    max_delay: float = 0.05


@dataclass(frozen=True)
class DriveOutcome:
    """What follows from a log.

    Parameters
    ----------
    trajectory : Trajectory
        Of the robot, on the clock of the odometry where it has one of its own.
    matched : (n,) bool array
        Poses whose scan was used; the others are those of odometry from the nearest that was.
    scans : int
        In the log.
    corrected : int
        Scans corrected for the motion of the robot.
    keyframes : (k,) int array
        Poses that the map is made of.
    sweeps : sequence of Sweep
        Of all poses.
    mount : (3,) array
        Laser frame in the robot frame, as it fits best.
    links, loops : int
        Links between keyframes, and those of them that close loops.
    switched_off : int
        Links that the others contradict.
    misfit : float
        Mean square of the links' residuals over its expectation.
    clock : ClockEstimate or None
        Of the scans against the odometry.
    delay_s : float
        Added to the scans' stamps to get the trajectory's.
    anchors : tuple of str
        Surveyed stops that hold the trajectory.
    odometry_noise : (float, float)
        Of the odometry over a metre: metres, radians; NaN without odometry.
    doubt : SurveyDoubt or None
        What is wrong where the surveyed stops contradict the drive.
    mount_check : MountCheck or None
        The stated mount against the one by matches and odometry; None without odometry.
    slips : tuple of float
        Stamps of the keyframes to which the odometry is not believed, seconds since the epoch.
    """

    trajectory: Trajectory
    matched: Flags
    scans: int
    corrected: int
    keyframes: Indices
    sweeps: Sequence[Sweep]
    mount: Array
    links: int
    loops: int
    switched_off: int
    misfit: float
    clock: ClockEstimate | None
    delay_s: float
    anchors: tuple[str, ...]
    odometry_noise: tuple[float, float]
    doubt: SurveyDoubt | None = None
    mount_check: MountCheck | None = None
    slips: tuple[float, ...] = ()
