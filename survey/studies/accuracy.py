"""The accuracy experiment: a known small motion between two surveyed stops.

AD2.3, "Accuracy experiments": the robot frame was moved by 1 cm along both axes and turned by one
degree, both stops were surveyed, and the motion found was compared with the real one. Here the
comparison has the uncertainty that it needs: the two poses hang on the same world points, the same
Vframe and the same rig, so their errors are alike and largely leave the difference.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import chdtrc, chdtri, chndtrinc, ndtri

from survey.estimation.geometry import rotate
from validation.poses.angles import Array, wrap

CONFIDENCE = 0.95
POWER = 0.8
"""Usual levels of a test, and of the chance that it sees what is there."""

Frame = Literal["robot", "gtv"]


@dataclass(frozen=True)
class MotionCheck:
    """A motion as measured against the real one; lengths in metres, angles in radians.

    Parameters
    ----------
    real, measured, error : (3,) array
        dx, dy, dtheta; the error is measured minus real, its angle in (-pi, pi].
    covariance : (3, 3) array
        Of the error; NaN where the poses have none.
    normalised : (3,) array
        Error over its standard deviation.
    squared : float
        Error^T covariance^-1 error, chi-squared with 3 degrees of freedom.
    p_value : float
        Chance of an error at least as large if the stated uncertainties hold.
    correlated : bool
        Whether the correlation between the two poses was known.
    """

    real: Array
    measured: Array
    error: Array
    covariance: Array
    normalised: Array
    squared: float
    p_value: float
    correlated: bool


@dataclass(frozen=True)
class DetectableMotion:
    """The smallest motion that the survey tells from none.

    Parameters
    ----------
    components : (..., 3) array
        Along x alone, along y alone, a turn alone: metres, metres, radians.
    any_direction : (...) array
        A shift that is found whatever its direction, metres.
    confidence, power : float
        A motion is called one with this confidence, and found with this chance.
    """

    components: Array
    any_direction: Array
    confidence: float = CONFIDENCE
    power: float = POWER


def pose_motion(start: Array, end: Array, frame: Frame) -> tuple[Array, Array]:
    """The motion from one pose to another, and its derivative by both.

    Parameters
    ----------
    start, end : (..., 3) array
        x, y, theta in the GTV frame, metres and radians.
    frame : {"robot", "gtv"}
        Axes along which the motion is stated: the start pose's own, or those of the GTV frame.

    Returns
    -------
    motion : (..., 3) array
        dx, dy, dtheta, the angle in (-pi, pi].
    jacobian : (..., 3, 6) array
        Derivative by (start, end).
    """
    shift = end[..., :2] - start[..., :2]
    turn = wrap(end[..., 2] - start[..., 2])
    heading = start[..., 2] if frame == "robot" else np.zeros_like(start[..., 2])
    along = rotate(-heading, shift)
    jacobian = np.zeros((*turn.shape, 3, 6))
    axes = np.stack([np.cos(heading), np.sin(heading), -np.sin(heading), np.cos(heading)], axis=-1)
    axes = axes.reshape(*turn.shape, 2, 2)
    jacobian[..., :2, 0:2] = -axes
    jacobian[..., :2, 3:5] = axes
    if frame == "robot":
        jacobian[..., 0, 2] = along[..., 1]
        jacobian[..., 1, 2] = -along[..., 0]
    jacobian[..., 2, 2] = -1.0
    jacobian[..., 2, 5] = 1.0
    return np.concatenate([along, turn[..., None]], axis=-1), jacobian


def check_motion(
    start: Array,
    end: Array,
    covariance: Array | None,
    real: Array,
    frame: Frame = "gtv",
    real_sigma: Array | None = None,
    *,
    correlated: bool = True,
) -> MotionCheck:
    """A surveyed motion against the real one.

    Parameters
    ----------
    start, end : (3,) array
        The two surveyed poses, GTV frame.
    covariance : (6, 6) array or None
        Of (start, end) together; None if not stated.
    real : (3,) array
        dx, dy, dtheta as made.
    frame : {"robot", "gtv"}
        Axes of ``real``.
    real_sigma : (3,) array, optional
        How well ``real`` is known; exactly, where not given.
    correlated : bool
        Whether ``covariance`` holds the correlation between the poses.
    """
    measured, jacobian = pose_motion(start, end, frame)
    of_error = np.full((3, 3), np.nan)
    if covariance is not None and np.isfinite(covariance).all():
        of_error = jacobian @ covariance @ jacobian.T
        if real_sigma is not None:
            of_error = of_error + np.diag(np.square(real_sigma))
    return judge_motion(real, measured, of_error, correlated=correlated)


def judge_motion(
    real: Array, measured: Array, covariance: Array, *, correlated: bool = True
) -> MotionCheck:
    """A measured motion against the real one.

    Parameters
    ----------
    real, measured : (3,) array
        dx, dy, dtheta, metres and radians.
    covariance : (3, 3) array
        Of their difference; NaN where it is not known.
    correlated : bool
        Whether it counts the correlation between the two poses.
    """
    error = measured - real
    error[2] = wrap(error[2])
    squared = np.nan
    if np.isfinite(covariance).all():
        squared = float(error @ np.linalg.solve(covariance, error))
    return MotionCheck(
        real=np.asarray(real, dtype=float),
        measured=measured,
        error=error,
        covariance=covariance,
        normalised=error / np.sqrt(np.diagonal(covariance)),
        squared=squared,
        p_value=float(chdtrc(3, squared)),
        correlated=correlated,
    )


def detectable_motion(
    covariance: Array, confidence: float = CONFIDENCE, power: float = POWER
) -> DetectableMotion:
    """The smallest motion that would be noticed.

    Parameters
    ----------
    covariance : (..., 3, 3) array
        Of a measured motion.
    confidence : float
        1 - chance of seeing a motion where there is none.
    power : float
        Chance of seeing a motion of the size stated.

    Notes
    -----
    One component: (z_{(1 + confidence) / 2} + z_power) sigma, 2.80 sigma at 95 % and 80 %. A shift
    of unknown direction: tested by chi-squared with two degrees of freedom, whose power is that of
    the non-central distribution; sqrt(9.63) = 3.10 times the standard deviation of the worst
    direction at 95 % and 80 %.
    """
    covariance = np.asarray(covariance, dtype=float)
    quantiles = ndtri((1 + confidence) / 2) + ndtri(power)
    sigma = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    worst = np.sqrt(np.linalg.eigvalsh(covariance[..., :2, :2])[..., -1])
    return DetectableMotion(
        quantiles * sigma, np.sqrt(noncentrality(2, confidence, power)) * worst, confidence, power
    )


def noncentrality(degrees_of_freedom: int, confidence: float, power: float) -> float:
    """How far off, as a squared length in standard deviations, a chi-squared test sees.

    Parameters
    ----------
    degrees_of_freedom : int
        Of the test.
    confidence, power : float
        As in `detectable_motion`.
    """
    critical = float(chdtri(degrees_of_freedom, 1 - confidence))
    return float(chndtrinc(critical, degrees_of_freedom, 1 - power))
