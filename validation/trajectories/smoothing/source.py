"""What goes into a fusion and what comes out of it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.poses.trajectory import Trajectory
from validation.results import Finding
from validation.shown import Shown

NORMAL_95 = 1.96
"""Half of a 95 % interval in standard deviations."""


@dataclass(frozen=True)
class Source:
    """One source of poses of the robot, with what is known of its clock and noise.

    Parameters
    ----------
    trajectory : Trajectory
        Poses of the robot in the common frame. Covariances, where stated, are taken up to a factor.
    delay_s : float
        Added to its stamps to get the common time.
    delay_sigma_s : float
        Standard deviation of the delay, common to all its frames.
    drift_ppm, drift_sigma_ppm : float
        Change of the delay, in millionths of the time, and its standard deviation.
    at_s : float, optional
        When the delay holds, in seconds since the trajectory's epoch; the middle by default.
    noise : (float, float), optional
        Standard deviation of a position in each axis, m, and of an angle, rad. Estimated where it
        is not given.
    """

    trajectory: Trajectory
    delay_s: float = 0.0
    delay_sigma_s: float = 0.0
    drift_ppm: float = 0.0
    drift_sigma_ppm: float = 0.0
    at_s: float | None = None
    noise: tuple[float, float] | None = None


@dataclass(frozen=True)
class SourceNoise:
    """What a fusion found of one source.

    Parameters
    ----------
    system : str
        Its name.
    position : float
        Standard deviation of a position in each axis, m; a factor of the stated one where
        covariances are stated.
    angle : float
        The same of an angle, rad; NaN without orientation.
    jitter_s : float
        Standard deviation of the stamps about the times used, seconds.
    smoothed_stamps : float
        Standard deviation of the jitter that was taken off the stamps of a source with a rate,
        seconds; 0 where the stamps are used as they are.
    outliers : float
        Share of its frames.
    delay_s, delay_sigma_s : float
        The delay, with what the fusion adds to it.
    """

    system: str
    position: float
    angle: float
    jitter_s: float
    smoothed_stamps: float
    outliers: float
    delay_s: float
    delay_sigma_s: float


@dataclass(frozen=True, repr=False)
class Fused(Shown):
    """One trajectory out of several sources.

    Parameters
    ----------
    trajectory : Trajectory
        Poses with covariances, in the frame of the sources, at the times asked for.
    supported : (n,) array of bool
        Whether poses that are no outliers stand on both sides, and no gap in between.
    rates : (n, m) array
        Velocity, m/s, and angular velocity, rad/s, along and about the fixed axes.
    noise : tuple of SourceNoise
        Of each source.
    strengths : mapping
        Strength of the prior: of 'x' and so on, m^2/s^3 or rad^2/s^3.
    odometry : mapping
        Standard deviations of the odometry and its errors of scale; empty without odometry.
    weights : tuple of arrays
        For each source the probability, for each frame, that it is no outlier.
    flips : tuple of arrays of bool
        For each source whether a frame's heading is off by half a turn.
    findings : tuple of Finding
        What a user should know, in words.
    shared : (n, m, m) array or None
        What errors that all sources share add to the covariances, where such were given.
    """

    trajectory: Trajectory
    supported: npt.NDArray[np.bool_]
    rates: Array
    noise: tuple[SourceNoise, ...]
    strengths: Mapping[str, float]
    odometry: Mapping[str, float]
    weights: tuple[Array, ...]
    flips: tuple[npt.NDArray[np.bool_], ...]
    findings: tuple[Finding, ...]
    shared: Array | None = None
