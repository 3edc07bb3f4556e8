"""World points by trilateration from the Vframe points."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from survey.estimation.distance_fit import (
    PLACE_PRIOR_SIGMA,
    SAME,
    DistanceFit,
    coordinate_sigma,
    place_fit,
    with_heading,
)
from survey.estimation.geometry import circle_intersections
from survey.estimation.iterated_ekf import Model, iterated_ekf
from survey.estimation.measurement import Linearised, linearise
from survey.estimation.vframe import VframeEstimate
from survey.readings.readings import Readings
from validation.poses.angles import Array

TIE = 13.8
"""Costs nearer than this (chi-squared, 2 degrees of freedom, 0.1 %) do not tell solutions apart."""
FLAT = 1e-6
"""Metres off one line, together, below which Vframe points seen from a place leave its second
coordinate open: a thousandth of what any reading resolves."""
MOST_CIRCLES = 12
"""Circles whose meeting points are starts where there are many: 132 starts, of which one near each
place that may fit would do. All pairs of a mark read from 500 stops would be a million."""
GOOD_REST = 11.0
"""Chi-squared for each degree of freedom up to which readings agree: 0.1 % with one, more rarely
with more."""


@dataclass(frozen=True)
class Rejected:
    """The best of the other solutions.

    Where the filter rests at no other, the mirrored meeting point of two circles, from which it
    comes back to the chosen solution.

    Parameters
    ----------
    position : (2,) array
        Metres.
    cost : float
        Its h^T R^-1 h.
    """

    position: Array
    cost: float


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


def place_readings(own: Readings, vframe: VframeEstimate) -> DistanceFit:
    """The readings of one world point, turned to start there, to points of the frame."""
    index = np.array([vframe.names.index(end) for end in own.end], dtype=int)
    sigma = coordinate_sigma(vframe.covariance)[index]
    return place_fit(vframe.points[index], sigma, own.distance, own.sigma)


def _locate(name: str, own: Readings, vframe: VframeEstimate) -> WorldPoint | NotLocated:
    """One point, or why it cannot be located."""
    none = np.empty((0, 2))
    if len(set(own.end)) < 2:
        return NotLocated(
            name,
            f"{len(own)} reading(s) to {len(set(own.end))} Vframe point(s); measure it from three "
            "or more",
            none,
        )
    fit = place_readings(own, vframe)
    starts = circle_starts(fit.known, fit.distance)
    minima, costs = fit.solutions(starts)
    if len(minima) == 0:
        return _hopeless(name, own, fit)
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
    estimate = iterated_ekf(place_model(own, vframe), minima[0], PLACE_PRIOR_SIGMA)
    rejected = (
        Rejected(minima[1], float(costs[1]))
        if len(minima) > 1
        else _mirrored(estimate.state, starts, fit)
    )
    if np.linalg.matrix_rank(fit.known - estimate.state, tol=FLAT) < 2:
        return NotLocated(
            name,
            "it lies on the line of its Vframe points, or its readings contradict each other; "
            "measure it from a point off that line",
            minima[:1],
        )
    located = place_at(name, estimate.state, own, vframe)
    return replace(located, rejected=rejected, passes=estimate.passes)


def _hopeless(name: str, own: Readings, fit: DistanceFit) -> NotLocated:
    """A point whose readings contradict each other, with those that could be wrong by metres."""
    places, suspects = [], []
    for row in range(len(own)):
        rest = np.arange(len(own)) != row
        if len({own.end[i] for i in np.flatnonzero(rest)}) < 3:
            continue
        others = fit.select(rest)
        found, costs = others.solutions(circle_starts(others.known, others.distance))
        if len(found) and costs[0] < GOOD_REST * (len(own) - 3):
            places.append(found[0])
            line = f" (line {own.line[row]})" if own.line[row] else ""
            suspects.append(f"{own.end[row]}{line}: {own.distance[row]:.3f} m")
    reason = "its readings contradict each other by far"
    if suspects:
        reason += f"; the others agree without that to {' or without that to '.join(suspects)}"
    return NotLocated(name, f"{reason}. Measure again", np.array(places).reshape(-1, 2))


def circle_starts(centres: Array, distances: Array, most: int | None = None) -> Array:
    """Both meeting points of every pair of circles about different centres, (s, 2).

    Of more than ``most`` circles so many are taken, evenly among them.
    """
    used = range(len(centres))
    if most is not None and most < len(centres):
        used = np.linspace(0, len(centres) - 1, most).astype(int).tolist()
    pairs = [
        (i, j) for i, j in combinations(used, 2) if np.linalg.norm(centres[i] - centres[j]) > SAME
    ]
    rows = np.array(pairs, dtype=int).reshape(-1, 2)
    return circle_intersections(centres[rows], distances[rows]).reshape(-1, 2)


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
    at = linearise(with_heading(state), vframe.points[index], np.zeros((len(own), 2)), own.distance)
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
    # From the filter's own prior, so that a point in line with the frame is no division by zero.
    covariance = np.linalg.inv(weighted @ H + np.diag(1 / PLACE_PRIOR_SIGMA**2))
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


def _mirrored(place: Array, starts: Array, fit: DistanceFit) -> Rejected | None:
    """The best meeting point of two circles on the wrong side."""
    pairs = np.linalg.norm(starts - place, axis=1).reshape(-1, 2)
    wrong = starts.reshape(-1, 2, 2)[np.arange(len(pairs)), pairs.argmax(1)]
    wrong = wrong[pairs.max(1) > 10 * SAME]
    if len(wrong) == 0:
        return None
    cost = fit.costs(wrong)
    best = int(cost.argmin())
    return Rejected(wrong[best], float(cost[best]))


def joint_covariance(found: Sequence[WorldPoint], vframe: VframeEstimate) -> Array:
    """Covariance of all points: their own, and what they share through the Vframe."""
    if not found:
        return np.empty((0, 0))
    gains = np.concatenate([point.by_vframe for point in found])
    joint = gains @ vframe.covariance @ gains.T
    for i, point in enumerate(found):
        joint[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = point.covariance
    return np.asarray((joint + joint.T) / 2)


def _scatter(W: Array, columns: Array, size: int) -> Array:
    """(m, size) derivative by a stacked vector from each row's derivative by its own two."""
    m = len(W)
    out = np.zeros((m, size))
    out[np.repeat(np.arange(m), 2), columns] = W.ravel()
    return out
