"""Where a point or a robot frame can be, given a few readings to known points.

Two problems with one face: a place (x, y), and a pose (x, y, theta). Readings are taken as
independent here, which is quick and errs towards larger sigmas; what readings share is in the
covariances that `knowledge` reports.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np
import numpy.typing as npt

from survey.estimation.geometry import rotate
from survey.estimation.measurement import Linearised, independent_variance, linearise
from survey.estimation.robot_frames import (
    PRIOR_SIGMA,
    PoseReadings,
    fitting_poses,
    pose_starts,
    why_undetermined,
)
from survey.estimation.world_points import circle_starts, fitting_places
from validation.poses.angles import Array

Rows = npt.NDArray[np.intp]
_HEADINGS = 12
_CIRCLES = 12
"""So many meeting points of circles lead to every place that fits: more repeat them."""


class Fit(Protocol):
    """The readings of one unknown place or pose."""

    @property
    def unknowns(self) -> int:
        """2 for a place, 3 for a pose."""
        ...

    def __len__(self) -> int:
        """Readings."""
        ...

    def select(self, rows: Rows) -> Self:
        """The given readings."""
        ...

    def why_open(self) -> str | None:
        """Why the readings leave a whole line of solutions; None where they do not."""
        ...

    def solutions(self, near: Array | None = None) -> tuple[Array, Array]:
        """All solutions (k, unknowns) and their costs (k,), the best first.

        ``near`` (s, unknowns) are first guesses; without them they are found.
        """
        ...

    def equations(self, state: Array) -> tuple[Array, Array, Array]:
        """The equations h (m,), H (m, unknowns) and the variances of h (m,) at a state."""
        ...


@dataclass(frozen=True)
class PlaceFit:
    """A place from distances to known points.

    Parameters
    ----------
    known : (m, 2) array
        The known points, metres, Vframe.
    known_sigma : (m,) array
        Root mean square standard deviation of their coordinates, metres.
    distance, sigma : (m,) array
        Readings, metres.
    """

    known: Array
    known_sigma: Array
    distance: Array
    sigma: Array
    unknowns: int = 2

    def __len__(self) -> int:
        return len(self.distance)

    def select(self, rows: Rows) -> Self:
        """The given readings."""
        return replace(
            self,
            known=self.known[rows],
            known_sigma=self.known_sigma[rows],
            distance=self.distance[rows],
            sigma=self.sigma[rows],
        )

    def why_open(self) -> str | None:
        """Why the readings leave a whole circle; None where they do not."""
        if len(np.unique(self.known, axis=0)) < 2:
            return "readings to two known points are needed"
        return None

    def solutions(self, near: Array | None = None) -> tuple[Array, Array]:
        """Places (k, 2) that fit, and their costs (k,), the best first."""
        starts = circle_starts(self.known, self.distance) if near is None else near
        return fitting_places(starts, self.known, self.known_sigma, self.distance, self.sigma)

    def equations(self, state: Array) -> tuple[Array, Array, Array]:
        """The equations h (m,), H (m, 2) and the variances of h (m,) at a place."""
        at = linearise(np.append(state, 0.0), self.known, np.zeros_like(self.known), self.distance)
        return at.h, at.H_position, independent_variance(at, self.sigma, self.known_sigma, 0.0)


@dataclass(frozen=True)
class PoseFit:
    """A pose from distances between its marks and known points."""

    own: PoseReadings
    unknowns: int = 3

    def __len__(self) -> int:
        return len(self.own)

    def select(self, rows: Rows) -> Self:
        """The given readings."""
        return replace(self, own=self.own.select(rows))

    def why_open(self) -> str | None:
        """Why the readings leave a line of poses; None where they do not."""
        return why_undetermined(self.own)

    def solutions(self, near: Array | None = None) -> tuple[Array, Array]:
        """Poses (k, 3) that fit, and their costs (k,), the best first."""
        return fitting_poses(_pose_starts(self.own) if near is None else near, self.own)

    def equations(self, state: Array) -> tuple[Array, Array, Array]:
        """The equations h (m,), H (m, 3) and the variances of h (m,) at a pose."""
        own = self.own
        at = linearise(state, own.known, own.body, own.distance)
        H = np.column_stack([at.H_position, at.H_heading])
        return at.h, H, independent_variance(at, own.sigma, own.known_sigma, own.body_sigma)


def _pose_starts(own: PoseReadings) -> Array:
    """(s, 3) first guesses that lead to every pose that may fit.

    In the room one mark is read after the other: as soon as one of them has a place of its own,
    only the heading about it is open.
    """
    headings = np.arange(_HEADINGS) * 2 * np.pi / _HEADINGS
    starts = []
    for mark in np.unique(own.rig_index):
        rows = own.rig_index == mark
        known, distance = own.known[rows], own.distance[rows]
        if len(np.unique(own.world_index[rows])) < 2:
            continue
        guesses = circle_starts(known, distance)[:_CIRCLES]
        places, _ = fitting_places(guesses, known, own.known_sigma[rows], distance, own.sigma[rows])
        origins = places[:2, None] - rotate(headings, own.body[rows][:1])
        turned = np.broadcast_to(headings[:, None], (*origins.shape[:2], 1))
        starts.append(np.concatenate([origins, turned], axis=-1).reshape(-1, 3))
    return np.concatenate(starts) if starts else pose_starts(own)


def information_covariance(fit: Fit, state: Array) -> Array:
    """Covariance (unknowns, unknowns) of a solution, readings being independent."""
    _, H, variance = fit.equations(state)
    prior = np.diag(1 / np.square(PRIOR_SIGMA[: fit.unknowns]))
    return np.asarray(np.linalg.inv((H / variance[:, None]).T @ H + prior))


def test_values(fit: Fit, state: Array) -> tuple[Array, Array]:
    """Baarda's w (m,) of each reading, and its redundancy number (m,).

    Notes
    -----
    w = v / sqrt(r) with the standardised residual v and r = 1 - the diagonal of
    H (H^T H)^-1 H^T, whitened. Where r is nearly nothing, w is 0: nothing checks the reading.
    """
    h, H, variance = fit.equations(state)
    white = H / np.sqrt(variance)[:, None]
    prior = np.diag(1 / np.square(PRIOR_SIGMA[: fit.unknowns]))
    hat = np.einsum("mi,ij,mj->m", white, np.linalg.inv(white.T @ white + prior), white)
    redundancy = np.clip(1 - hat, 0.0, 1.0)
    checked = redundancy > 1e-6
    w = np.where(checked, h / np.sqrt(variance * np.where(checked, redundancy, 1.0)), 0.0)
    return w, redundancy


def predicted_distances(
    states: Array, covariances: Array, known: Array, body: Array | None = None
) -> tuple[Array, Array]:
    """Distances from a mark to a known point, and the variance that the states give them.

    Parameters
    ----------
    states : (k, 2) or (k, 3) array
        Places of the mark, or poses.
    covariances : (k, n, n) array
        Of the states.
    known : (2,) array
        The known point, metres, Vframe.
    body : (2,) array, optional
        The mark in the robot frame, for poses.

    Returns
    -------
    distance, variance : (k,) array
        Metres and square metres.
    """
    states = np.atleast_2d(states)
    n = states.shape[-1]
    full = states if n == 3 else np.column_stack([states, np.zeros(len(states))])
    arm = np.zeros(2) if body is None else np.asarray(body, dtype=float)
    at: Linearised = linearise(full, known[None], arm[None], np.zeros(1))
    distance = np.sqrt(at.squared_range[..., 0])
    slope = at.H[..., 0, :n] / (2 * np.maximum(distance, 1e-6))[:, None]
    return distance, np.einsum("ki,kij,kj->k", slope, covariances, slope)


def stacked(states: Sequence[Array], unknowns: int) -> Array:
    """(k, unknowns) array of states, also of none."""
    return np.array(states, dtype=float).reshape(-1, unknowns)
