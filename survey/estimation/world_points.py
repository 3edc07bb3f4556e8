"""World points by trilateration from the Vframe points."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from survey.estimation.geometry import circle_intersections
from survey.estimation.iterated_ekf import Estimate, Model, iterated_ekf, iterated_ekf_batch
from survey.estimation.measurement import Linearised, independent_variance, linearise
from survey.estimation.vframe import VframeEstimate
from survey.readings.readings import Readings
from validation.poses.angles import Array

PRIOR_SIGMA = np.array([100.0, 100.0])
"""sigma[0] of the document, metres."""
TIE = 13.8
"""Costs nearer than this (chi-squared, 2 degrees of freedom, 0.1 %) do not tell solutions apart."""
GOOD_REST = 11.0
"""Chi-squared for each degree of freedom up to which readings agree (0.1 %)."""
_SAME = 0.01
"""Solutions nearer than this, in metres, are one minimum reached twice."""


@dataclass(frozen=True)
class Rejected:
    """The best of the other solutions.

    Parameters
    ----------
    position : (2,) array
        Metres.
    cost : float
        Its h^T R^-1 h.
    is_minimum : bool
        Whether the filter rests there; otherwise it is the mirrored meeting point of two circles,
        from which the filter comes back to the chosen solution.
    """

    position: Array
    cost: float
    is_minimum: bool


@dataclass(frozen=True)
class WorldPoint:
    """A located point.

    Parameters
    ----------
    name : str
        Its name.
    position : (2,) array
        x, y in metres, in the Vframe.
    covariance : (2, 2) array
        Square metres.
    cost : float
        Chi-squared of its readings with ``redundancy`` degrees of freedom.
    redundancy : int
        Readings less two.
    rejected : Rejected or None
        The other solution.
    by_vframe : (2, 2 n) array
        Derivative of the position by the coordinates of the Vframe points.
    passes : int
        Passes of the filter.
    """

    name: str
    position: Array
    covariance: Array
    cost: float
    redundancy: int
    rejected: Rejected | None
    by_vframe: Array
    passes: int


@dataclass(frozen=True)
class NotLocated:
    """A point without a position, and why.

    ``candidates`` (c, 2) are the places that fit equally well, if any.
    """

    name: str
    reason: str
    candidates: Array


@dataclass(frozen=True)
class WorldPoints:
    """All points that could be located, with their joint covariance.

    Parameters
    ----------
    points : tuple of WorldPoint
        n of them.
    covariance : (2 n, 2 n) array
        Jointly: all hang on the same Vframe points, hence are correlated.
    missing : tuple of NotLocated
        The others.
    """

    points: tuple[WorldPoint, ...]
    covariance: Array
    missing: tuple[NotLocated, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the located points."""
        return tuple(point.name for point in self.points)

    @property
    def positions(self) -> Array:
        """(n, 2) positions, metres."""
        return np.array([point.position for point in self.points]).reshape(-1, 2)


def locate_world_points(
    names: Sequence[str], readings: Readings, vframe: VframeEstimate
) -> WorldPoints:
    """Positions of the world points from their distances to the Vframe points.

    Parameters
    ----------
    names : sequence of str
        The points wanted.
    readings : Readings
        All readings; those between a world point and a Vframe point are used.
    vframe : VframeEstimate
        The frame.

    Notes
    -----
    AD2.3, "Determination of the coordinates of the world-points": iterated EKF from the meeting
    points of two circles. Here every pair of circles is tried with both its solutions; what the
    filter reaches from them is compared by cost.
    """
    found, missing = [], []
    for name in names:
        own = readings.touching([name], vframe.names)
        result = _locate(name, own, vframe)
        if isinstance(result, WorldPoint):
            found.append(result)
        else:
            missing.append(result)
    return WorldPoints(tuple(found), joint_covariance(found, vframe), tuple(missing))


def _locate(name: str, own: Readings, vframe: VframeEstimate) -> WorldPoint | NotLocated:
    """One point, or why it cannot be located."""
    index = np.array([vframe.names.index(end) for end in own.end], dtype=int)
    none = np.empty((0, 2))
    if len(set(own.end)) < 2:
        return NotLocated(
            name,
            f"{len(own)} reading(s) to {len(set(own.end))} Vframe point(s); measure it from three "
            "or more",
            none,
        )
    known, known_sigma = vframe.points[index], vframe_sigma(vframe)[index]
    starts = circle_starts(known, own.distance)
    minima, costs = fitting_places(starts, known, known_sigma, own.distance, own.sigma)
    if len(minima) == 0:
        return _hopeless(name, own, known, known_sigma)
    if len(set(own.end)) < 3:
        return NotLocated(
            name,
            "only two usable readings: two places fit equally well; measure a third",
            minima,
        )
    if len(minima) > 1 and costs[1] - costs[0] < TIE:
        return NotLocated(
            name,
            "two places fit equally well (costs "
            f"{costs[0]:.1f} and {costs[1]:.1f}): its Vframe points lie nearly on a line; measure "
            "it from a point off that line",
            minima[:2],
        )
    return _finish(name, own, vframe, index, minima, costs, starts)


def _hopeless(name: str, own: Readings, known: Array, known_sigma: Array) -> NotLocated:
    """A point whose readings contradict each other, with those that could be wrong by metres."""
    places, suspects = [], []
    for row in range(len(own)):
        rest = np.arange(len(own)) != row
        if len({own.end[i] for i in np.flatnonzero(rest)}) < 3:
            continue
        starts = circle_starts(known[rest], own.distance[rest])
        found, costs = fitting_places(
            starts, known[rest], known_sigma[rest], own.distance[rest], own.sigma[rest]
        )
        if len(found) and costs[0] < GOOD_REST * (len(own) - 3):
            places.append(found[0])
            line = f" (line {own.line[row]})" if own.line[row] else ""
            suspects.append(f"{own.end[row]}{line}: {own.distance[row]:.3f} m")
    reason = "its readings contradict each other by far"
    if suspects:
        reason += f"; the others agree without that to {' or without that to '.join(suspects)}"
    return NotLocated(name, f"{reason}. Measure again", np.array(places).reshape(-1, 2))


def circle_starts(centres: Array, distances: Array) -> Array:
    """Both meeting points of every pair of circles about different centres, (s, 2)."""
    pairs = [
        (i, j)
        for i, j in combinations(range(len(centres)), 2)
        if np.linalg.norm(centres[i] - centres[j]) > _SAME
    ]
    rows = np.array(pairs, dtype=int).reshape(-1, 2)
    return circle_intersections(centres[rows], distances[rows]).reshape(-1, 2)


def _batch_costs(states: Array, known: Array, own: Readings, known_sigma: Array) -> Array:
    """Cost of each of b states, readings taken as independent."""
    at = linearise(_with_heading(states), known, np.zeros_like(known), own.distance)
    return np.asarray((at.h**2 / independent_variance(at, own.sigma, known_sigma, 0.0)).sum(-1))


def fitting_places(
    starts: Array, known: Array, known_sigma: Array, distance: Array, sigma: Array
) -> tuple[Array, Array]:
    """Different places at which the filter rests, and their costs, the best first.

    Parameters
    ----------
    starts : (s, 2) array
        First guesses, metres, Vframe; see `circle_starts`.
    known : (m, 2) array
        Known point of each reading, metres, Vframe.
    known_sigma : (m,) array
        Root mean square standard deviation of its coordinates, metres.
    distance, sigma : (m,) array
        Readings and their standard deviations, metres, taken as independent.

    Returns
    -------
    places : (k, 2) array
        Metres, Vframe.
    costs : (k,) array
        Chi-squared of each.
    """

    def model(states: Array) -> tuple[Array, Array, Array]:
        at = linearise(_with_heading(states), known, np.zeros_like(known), distance)
        return at.h, at.H_position, independent_variance(at, sigma, known_sigma, 0.0)

    ended = iterated_ekf_batch(model, starts, PRIOR_SIGMA)
    usable = ended.converged & np.isfinite(ended.cost)
    order = np.flatnonzero(usable)[np.argsort(ended.cost[usable])]
    kept: list[int] = []
    for i in order:
        if all(np.linalg.norm(ended.state[i] - ended.state[k]) > _SAME for k in kept):
            kept.append(int(i))
    return ended.state[kept], ended.cost[kept]


def place_model(own: Readings, vframe: VframeEstimate) -> Model:
    """State (2,) -> h (m,), H (m, 2), R (m, m), errors of the frame shared by the readings.

    Parameters
    ----------
    own : Readings
        Readings of one world point, turned to start there.
    vframe : VframeEstimate
        The frame.
    """

    def model(state: Array) -> tuple[Array, Array, Array]:
        at, by_vframe = _by_frame(state, own, vframe)
        R = np.diag((at.W_distance * own.sigma) ** 2)
        return at.h, at.H_position, R + by_vframe @ vframe.covariance @ by_vframe.T

    return model


def _by_frame(state: Array, own: Readings, vframe: VframeEstimate) -> tuple[Linearised, Array]:
    """The readings at a place (2,), and the derivative of h by the frame's coordinates (m, 2 n)."""
    index: Array = np.array([vframe.names.index(end) for end in own.end], dtype=int)
    columns = (2 * index[:, None] + np.arange(2)).ravel()
    at = linearise(
        _with_heading(state), vframe.points[index], np.zeros((len(own), 2)), own.distance
    )
    return at, _scatter(at.W_known, columns, vframe.points.size)


def place_at(name: str, position: Array, own: Readings, vframe: VframeEstimate) -> WorldPoint:
    """The point at a place where the filter rests: its covariance, cost and hold on the frame.

    Parameters
    ----------
    name : str
        Its name.
    position : (2,) array
        Metres, Vframe.
    own : Readings
        Its readings, turned to start there, to two Vframe points at least.
    vframe : VframeEstimate
        The frame.
    """
    h, H, R = place_model(own, vframe)(position)
    weighted = np.linalg.solve(R, H).T
    covariance = np.linalg.inv(weighted @ H)
    _, by_vframe = _by_frame(position, own, vframe)
    return WorldPoint(
        name=name,
        position=position,
        covariance=(covariance + covariance.T) / 2,
        cost=float(h @ np.linalg.solve(R, h)),
        redundancy=len(own) - 2,
        rejected=None,
        by_vframe=-covariance @ weighted @ by_vframe,
        passes=0,
    )


def _finish(
    name: str,
    own: Readings,
    vframe: VframeEstimate,
    index: Array,
    minima: Array,
    costs: Array,
    starts: Array,
) -> WorldPoint:
    """The best minimum, refined with the frame's full covariance."""
    known = vframe.points[index]
    estimate = iterated_ekf(place_model(own, vframe), minima[0], PRIOR_SIGMA)
    return replace(
        place_at(name, estimate.state, own, vframe),
        rejected=_rejected(estimate, minima, costs, starts, known, own, vframe, index),
        passes=estimate.passes,
    )


def _rejected(
    estimate: Estimate,
    minima: Array,
    costs: Array,
    starts: Array,
    known: Array,
    own: Readings,
    vframe: VframeEstimate,
    index: Array,
) -> Rejected | None:
    """The second minimum, or else the best meeting point on the wrong side."""
    if len(minima) > 1:
        return Rejected(minima[1], float(costs[1]), is_minimum=True)
    far = np.linalg.norm(starts - estimate.state, axis=1)
    pairs = far.reshape(-1, 2)
    wrong = starts.reshape(-1, 2, 2)[np.arange(len(pairs)), pairs.argmax(1)]
    wrong = wrong[pairs.max(1) > 10 * _SAME]
    if len(wrong) == 0:
        return None
    cost = _batch_costs(wrong, known, own, vframe_sigma(vframe)[index])
    best = int(cost.argmin())
    return Rejected(wrong[best], float(cost[best]), is_minimum=False)


def joint_covariance(found: Sequence[WorldPoint], vframe: VframeEstimate) -> Array:
    """Covariance of all points: their own, and what they share through the Vframe."""
    if not found:
        return np.empty((0, 0))
    gains = np.concatenate([point.by_vframe for point in found])
    joint = gains @ vframe.covariance @ gains.T
    for i, point in enumerate(found):
        joint[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = point.covariance
    return np.asarray((joint + joint.T) / 2)


def vframe_sigma(vframe: VframeEstimate) -> Array:
    """(n,) root mean square standard deviation of each point's coordinates."""
    variance = np.diagonal(vframe.covariance).reshape(-1, 2).mean(1)
    return np.asarray(np.sqrt(variance))


def _scatter(W: Array, columns: Array, size: int) -> Array:
    """(m, size) derivative by a stacked vector from each row's derivative by its own two."""
    m = len(W)
    out = np.zeros((m, size))
    out[np.repeat(np.arange(m), 2), columns] = W.ravel()
    return out


def _with_heading(states: Array) -> Array:
    """Positions as states of `linearise`, whose heading a world point does not have."""
    return np.concatenate([states, np.zeros((*states.shape[:-1], 1))], axis=-1)
