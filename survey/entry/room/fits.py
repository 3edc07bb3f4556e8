"""Where a point or a robot frame can be, given a few readings to known points.

Two problems with one face: a place (x, y), and a pose (x, y, theta). Readings are taken as
independent here, which is quick and errs towards larger sigmas; what readings share is in the
covariances that `knowledge` reports.
"""

from collections.abc import Sequence

import numpy as np

from survey.estimation.distance_fit import DistanceFit, place_fit, with_heading
from survey.estimation.geometry import rotate
from survey.estimation.measurement import linearise
from survey.estimation.robot_frames import PoseReadings, pose_starts, why_undetermined
from survey.estimation.world_points import circle_starts
from validation.poses.angles import Array

_HEADINGS = 12
"""First headings in equal steps: none is more than 15 degrees off, and every start within 60
degrees led to the solution (`gtval convergence`)."""
_CIRCLES = 12
"""So many meeting points of circles lead to every place that fits: more repeat them."""


def why_open(fit: DistanceFit) -> str | None:
    """Why the readings leave a whole line of solutions; None where they do not."""
    if isinstance(fit, PoseReadings):
        return why_undetermined(fit)
    if len(np.unique(fit.known, axis=0)) < 2:
        return "readings to two known points are needed"
    return None


def room_starts(fit: DistanceFit) -> Array:
    """(s, n) first guesses that lead to every solution that may fit."""
    if isinstance(fit, PoseReadings):
        return _pose_starts(fit)
    return circle_starts(fit.known, fit.distance)


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
        alone = place_fit(known, own.known_sigma[rows], distance, own.sigma[rows])
        places, _ = alone.solutions(circle_starts(known, distance)[:_CIRCLES])
        origins = places[:2, None] - rotate(headings, own.body[rows][:1])
        turned = np.broadcast_to(headings[:, None], (*origins.shape[:2], 1))
        starts.append(np.concatenate([origins, turned], axis=-1).reshape(-1, 3))
    return np.concatenate(starts) if starts else pose_starts(own)


def information_covariance(fit: DistanceFit, state: Array) -> Array:
    """Covariance (unknowns, unknowns) of a solution, readings being independent."""
    _, H, variance = fit.equations(state)
    prior = np.diag(1 / np.square(fit.prior_sigma))
    return np.asarray(np.linalg.inv((H / variance[:, None]).T @ H + prior))


def test_values(fit: DistanceFit, state: Array) -> tuple[Array, Array]:
    """Baarda's w (m,) of each reading, and its redundancy number (m,).

    Notes
    -----
    w = v / sqrt(r) with the standardised residual v and r = 1 - the diagonal of
    H (H^T H)^-1 H^T, whitened. Where r is nearly nothing, w is 0: nothing checks the reading.
    """
    h, H, variance = fit.equations(state)
    white = H / np.sqrt(variance)[:, None]
    prior = np.diag(1 / np.square(fit.prior_sigma))
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
    arm = np.zeros(2) if body is None else np.asarray(body, dtype=float)
    at = linearise(with_heading(states), known[None], arm[None], np.zeros(1))
    distance = np.sqrt(at.squared_range[..., 0])
    slope = at.H[..., 0, :n] / (2 * np.maximum(distance, 1e-6))[:, None]
    return distance, np.einsum("ki,kij,kj->k", slope, covariances, slope)


def stacked(states: Sequence[Array], unknowns: int) -> Array:
    """(k, unknowns) array of states, also of none."""
    return np.array(states, dtype=float).reshape(-1, unknowns)
