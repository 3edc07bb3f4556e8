"""Two receivers: where the first one is, and where the line to the second one points."""

from dataclasses import dataclass

import numpy as np

from rtk_gt.offsets.estimate import Offsets
from rtk_gt.offsets.minima import Minima
from rtk_gt.offsets.noise import GpsNoise
from rtk_gt.offsets.prior import LEAN
from rtk_gt.path.choice import AHEAD, LARGEST_HEADING
from rtk_gt.path.motion_check import strides
from rtk_gt.receivers.steps import Steps
from validation.errors import GtvalError
from validation.poses.angles import Array, wrap

FEWEST = 10
"""Steps that show where a vehicle drives: a judgement."""


@dataclass(frozen=True)
class Headings:
    """Positions of the first antenna and headings, where both receivers are RTK-fixed.

    Parameters
    ----------
    times : (n,) array
        Seconds since 1970 UTC.
    poses : (n, 4) array
        x, y, z in metres, yaw in radians.
    noise_covariances : (n, 4, 4) array
        From the receivers' noise, independent from pose to pose.
    by_offset : (n, 4, 3) array
        How an error of the second receiver's offset moves each pose.
    offset_covariance : (3, 3) array
        Of that offset, the same for the whole drive, m^2.
    offsets : Offsets
        Of the two receivers, and their distance.
    off_motion : float, optional
        Mean angle of the heading to the left of the motion, radians; None where it hardly moves.
    left : tuple of Offsets
        Other solutions, whose heading points against the motion.
    """

    times: Array
    poses: Array
    noise_covariances: Array
    by_offset: Array
    offset_covariance: Array
    offsets: Offsets
    off_motion: float | None
    left: tuple[Offsets, ...] = ()

    @property
    def covariances(self) -> Array:
        """(n, 4, 4) of each pose, noise and offset together."""
        J = self.by_offset
        shared = J @ self.offset_covariance @ np.swapaxes(J, -1, -2)
        return np.asarray(self.noise_covariances + shared)

    @property
    def shared_factor(self) -> Array:
        """(4 n, 3) F: F F^T is what the error of the offset does to all poses."""
        values, vectors = np.linalg.eigh(self.offset_covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        return np.asarray((self.by_offset @ root).reshape(4 * len(self.times), 3))


def headings(
    minima: Minima, steps: Steps, arm: Array, noise: GpsNoise | None, max_gap: float
) -> Headings:
    """Positions and headings from the steps of two receivers.

    Parameters
    ----------
    minima : Minima
        Offsets that the steps allow.
    steps : Steps
        As recorded.
    arm : (3,) array
        From the first to the second antenna on the vehicle, metres; its direction in the plane says
        where the nose points.
    noise : GpsNoise, optional
        Of each receiver; that of the residuals by default.
    max_gap : float
        Poses farther apart in time show no motion, seconds.

    Raises
    ------
    GtvalError
        If the heading is open, or points ahead in none or several of the solutions.

    Notes
    -----
    A vehicle that leans moves the second antenna sideways by its height above the first times the
    lean; `LEAN` of that counts as noise.
    """
    every = (minima.best, *minima.others)
    found = [_along(steps, one, arm, noise, max_gap) for one in every]
    if len(found) > 1:
        ahead = [
            one for one in found
            if one.off_motion is not None and np.cos(one.off_motion) > AHEAD
        ]  # fmt: skip
        if len(ahead) != 1:
            raise GtvalError(
                f"the steps allow {len(found)} headings that differ by up to half a turn, and the "
                "motion does not tell which; state [rtk.known_offsets], or drive a turn"
            )
        (best,) = ahead
    else:
        (best,) = found
    J = best.by_offset[:, 3]
    sigma = float(np.sqrt(np.median(np.einsum("ti,ij,tj->t", J, best.offset_covariance, J))))
    if sigma > LARGEST_HEADING:
        raise GtvalError(
            f"the heading is open by {np.degrees(min(sigma, np.pi)):.0f} degrees (one standard "
            "deviation): the vehicle turned too little to tell the receivers' offset. State "
            "[rtk.known_offsets], zero where both have one base station, or drive turns"
        )
    left = tuple(one for one in every if one is not best.offsets)
    return Headings(**{**best.__dict__, "left": left})


def _along(
    steps: Steps, offsets: Offsets, arm: Array, noise: GpsNoise | None, max_gap: float
) -> Headings:
    """Positions and headings of one solution."""
    rows = np.flatnonzero(steps.complete)[offsets.weights > 0]
    used = steps.select(rows).corrected(offsets.offsets)
    first = used.positions[:, 0]
    rod = used.positions[:, 1] - first
    level = np.hypot(rod[:, 0], rod[:, 1])
    yaw = wrap(np.arctan2(rod[:, 1], rod[:, 0]) - np.arctan2(arm[1], arm[0]))
    slope = np.zeros((len(rows), 3))
    slope[:, 0], slope[:, 1] = -rod[:, 1] / level**2, rod[:, 0] / level**2
    C = (noise or GpsNoise(offsets.sigma, offsets.eta)).covariance
    covariance = np.zeros((len(rows), 4, 4))
    covariance[:, :3, :3] = C
    covariance[:, :3, 3] = covariance[:, 3, :3] = -slope @ C
    covariance[:, 3, 3] = 2 * np.einsum("ti,ij,tj->t", slope, C, slope)
    covariance[:, 3, 3] += (LEAN * arm[2] / level) ** 2
    by_offset = np.zeros((len(rows), 4, 3))
    by_offset[:, 3] = slope
    poses = np.column_stack([first, yaw])
    off = _off_motion(used.times, poses, max_gap)
    own = offsets.offset_covariance
    return Headings(used.times, poses, covariance, by_offset, own, offsets, off)


def _off_motion(times: Array, poses: Array, max_gap: float) -> float | None:
    """Mean angle of the heading to the left of the motion; None where the vehicle hardly moves."""
    start, end = strides(times, poses[:, :3], max_gap)
    if len(start) < FEWEST:
        return None
    way = poses[end, :2] - poses[start, :2]
    length = np.hypot(way[:, 0], way[:, 1])
    turn = np.exp(1j * (poses[start, 3] - np.arctan2(way[:, 1], way[:, 0])))
    return float(np.angle((turn * length).sum()))
