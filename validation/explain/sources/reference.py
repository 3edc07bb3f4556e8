"""Which stop tied a system to the GTV frame, where a table does not say it.

A mount error A that also goes into the frame through a reference pose P makes the frame part of
the errors equal to P A P^-1. So a free fit of frame and mount shows it: the frame part turns the
other way than the mount part and is as long, and its direction is that of P. Each stop is then
asked how well it would do as P, given that its own validation pose has an error.
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from validation.explain.fitting.fit import known_part
from validation.explain.fitting.noise import regular
from validation.explain.fitting.settled import Settled
from validation.poses.angles import Array, wrap
from validation.poses.pose_table import PoseTable

_STEP = 1e-6
"""Of numerical slopes, in metres and radians: errors of a central difference are of the order of
its square, 1e-12, and of rounding over it, 1e-10."""

RULED_OUT = 0.05
"""A stop whose slip is less likely than this is not the reference: the level of all intervals."""


@dataclass(frozen=True)
class ReferenceEvidence:
    """What the frame part of a free fit says about the reference pose.

    Parameters
    ----------
    ids : tuple of str
        Stops with a validation pose.
    slips : (n, 3) array
        Error that the validation pose of each would need to have, were it the reference.
    p_values : (n,) array
        Chance of at least so large a slip.
    shares : (n,) array
        Share of belief in each, given that one of them is the reference.
    odds : float
        How much more likely the frame part is if one of the stops is the reference than if frame
        and mount have nothing to do with each other.
    heading, heading_sigma : float
        Direction that the reference must have had, in radians.
    certain : bool
        Whether it is known from elsewhere that one of the stops is the reference.
    """

    ids: tuple[str, ...]
    slips: Array
    p_values: Array
    shares: Array
    odds: float
    heading: float
    heading_sigma: float
    certain: bool = False

    @property
    def best(self) -> str:
        """The most likely stop."""
        return self.ids[int(np.argmax(self.shares))]

    @property
    def possible(self) -> tuple[str, ...]:
        """Stops that are not ruled out, the most likely first."""
        order = np.argsort(-self.shares, kind="stable")
        return tuple(self.ids[row] for row in order if self.p_values[row] >= RULED_OUT)

    @property
    def accepted(self) -> bool:
        """Whether a reference explains the frame part: known, or likelier than coincidence."""
        return (self.certain or self.odds > 1) and bool(self.possible)


def infer_reference(
    settled: Settled,
    validation: PoseTable,
    noise: Array | None = None,
    *,
    certain: bool = False,
) -> ReferenceEvidence:
    """The evidence for each stop from a settled fit of 'frame_mount'.

    Parameters
    ----------
    settled : Settled
        Fit of a free frame and a free mount, no reference assumed.
    validation : PoseTable
        Candidates for the reference.
    noise : (2,) array, optional
        Standard deviation of a validation pose's position and heading, where it is not stated;
        by default that of this system's residuals, which is at least as large.
    certain : bool
        Whether it is known from elsewhere that the system was tied by one of the stops.
    """
    values, covariance = settled.values[:6], known_part(settled.covariance[:6, :6])
    poses = validation.poses
    slips = _slips(values, poses)
    steps = _STEP * np.eye(6)
    slopes = np.stack(
        [(_slips(values + h, poses) - _slips(values - h, poses)) / (2 * _STEP) for h in steps], -1
    )
    own = _pose_noise(settled, validation, noise)
    total = regular(own + slopes @ covariance @ np.swapaxes(slopes, -1, -2))
    squares = np.einsum("ni,nij,nj->n", slips, np.linalg.inv(total), slips)
    log_density = -0.5 * (squares + np.linalg.slogdet(2 * np.pi * total)[1])
    p_values = _tail(squares, settled)
    shares = np.exp(log_density - log_density.max())
    average = log_density.max() + np.log(shares.mean())
    heading, sigma = _heading(values, covariance, poses, own)
    odds = float(np.exp(min(average - _log_coincidence(values, total), 700.0)))
    return ReferenceEvidence(
        validation.ids, slips, p_values, shares / shares.sum(), odds, heading, sigma, certain
    )


def _tail(squares: Array, settled: Settled) -> Array:
    """Chance of squares so large, with as many degrees of freedom as the noise level has."""
    if not settled.fit.estimated:
        return np.asarray(special.chdtrc(3, squares))
    return np.asarray(special.fdtrc(3, max(float(settled.dof.sum()), 1.0), squares / 3))


def _slips(values: Array, poses: Array) -> Array:
    """(n, 3) what frame . (P A P^-1)^-1 does to each pose P, as a shift of P and a turn."""
    frame, turn = values[0] + 1j * values[1], values[2]
    mount, alpha = values[3] + 1j * values[4], values[5]
    p, phi = poses[:, 0] + 1j * poses[:, 1], poses[:, 2]
    before = p - np.exp(1j * (phi - alpha)) * mount
    shift = frame + np.exp(1j * turn) * before - p
    angle = np.broadcast_to(wrap(turn - alpha), shift.shape)
    return np.stack([shift.real, shift.imag, angle], -1)


def _pose_noise(settled: Settled, validation: PoseTable, noise: Array | None) -> Array:
    """(n, 3, 3) covariances of validation poses."""
    if settled.pairs.stated:
        return validation.covariances
    size = (settled.fit.scale[0] if noise is None else noise)[[0, 0, 1]]
    return np.broadcast_to(np.diag(size**2), (len(validation), 3, 3))


def _log_coincidence(values: Array, total: Array) -> float:
    """Log density of the frame part if it has nothing to do with the mount part.

    A normal about zero whose size is the frame part's own, which favours coincidence as much as
    can be.
    """
    shift = float(values[0] ** 2 + values[1] ** 2) / 2
    noise = np.median(np.diagonal(total, axis1=1, axis2=2), axis=0)
    variances = noise + np.array([shift, shift, float(values[2] ** 2)])
    squares = values[:3] ** 2 / variances
    return float(-0.5 * (squares + np.log(2 * np.pi * variances)).sum())


def _heading(values: Array, covariance: Array, poses: Array, own: Array) -> tuple[float, float]:
    """Direction of the reference and its standard deviation, in radians.

    Taken at the centre of the poses, as the frame part turns about the reference by the small
    angle alpha; the slip of an unknown reference makes it less sure.
    """
    centre = poses[:, :2].mean(0)
    middle = centre[0] + 1j * centre[1]

    def direction(v: Array) -> float:
        shift = v[0] + 1j * v[1] - (1 - np.exp(1j * v[2])) * middle
        return float(np.angle(shift) - np.angle(v[3] + 1j * v[4]))

    at = direction(values)
    slopes = np.array(
        [
            wrap(direction(values + h) - direction(values - h)) / (2 * _STEP)
            for h in _STEP * np.eye(6)
        ]
    )
    arm = max(float(np.hypot(values[3], values[4])), 1e-9)
    noise = float(np.median((own[:, 0, 0] + own[:, 1, 1]) / 2)) / arm**2
    return float(wrap(at)), float(np.sqrt(slopes @ covariance @ slopes + noise))
