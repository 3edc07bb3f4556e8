"""A match done both ways: each sweep's points on the lines of the other."""

import numpy as np

from laser_gt.matching.local import LAST_STEPS, Alignment, align, influence
from laser_gt.scans.noise import smeared
from laser_gt.scans.planar import (
    CONTRADICTION,
    inverse,
    inverse_covariance_of,
    inverse_jacobian,
    wrapped,
)
from laser_gt.scans.surfaces import Surface
from validation.poses.angles import Array

REACH = 0.05
"""The way back starts at the result of the way there; it may be off by this, in metres. A
judgement: ten times what a right match is off."""

LEAST_OWN = 0.05
"""Least share of a point's variance that is its own. A judgement: no scanner is known whose
neighbouring beams err alike to the last twentieth."""


def both_ways(
    reference: Surface, moving: Surface, found: Alignment, row: int = 0
) -> tuple[Array, Array]:
    """Pose and covariance from a match of the moving sweep and its counterpart the other way.

    Parameters
    ----------
    reference, moving : Surface
        The two sweeps.
    found : Alignment
        Of the moving sweep in the frame of the reference.
    row : int
        Which of its starts is meant.

    Returns
    -------
    (3,), (3, 3) arrays
        Moving frame in the reference frame, and its covariance.

    Notes
    -----
    One way, only points of one sweep and only lines of the other are used, and where they are
    sparse or short the answer depends on which is which. The result is the mean of both, weighted
    by their information: a direction that one way does not determine is taken from the other.
    Both see the same noise: the covariance comes from what the noise of each point of either
    sweep does to the mean of the two (`laser_gt.matching.local.influence`).

    If the ways contradict each other, neither can be preferred on their own say: the pose given
    stays, and the difference is added to its covariance. If one way determines nothing at all,
    pose and covariance stay as given.
    """
    pose = found.pose[row]
    if not found.determined[row]:
        return pose, np.full((3, 3), np.inf)
    there = influence(reference, moving, found, row)
    covariance = there.covariance
    back = align(
        moving, reference, inverse(pose), reach=REACH, max_steps=LAST_STEPS, covariance=False
    )
    if not back.determined[0]:
        return pose, covariance
    again = influence(moving, reference, back)
    other = inverse_covariance_of(back.pose[0], again.covariance)
    difference = wrapped(inverse(back.pose[0]) - pose)
    if difference @ np.linalg.solve(covariance + other, difference) > CONTRADICTION:
        return pose, covariance + np.outer(difference, difference)
    # In the basis of the sum of both covariances: the mean weighted by information.
    share = covariance @ np.linalg.inv(covariance + other)
    mean = wrapped(pose + share @ difference)
    turned = share @ inverse_jacobian(back.pose[0])
    rest = np.eye(3) - share
    by_moving = rest @ there.moving + turned @ again.reference
    by_reference = rest @ there.reference + turned @ again.moving
    own = (by_moving * there.variances) @ by_moving.T
    own += (by_reference * again.variances) @ by_reference.T
    shared, smooth = np.zeros((3, 3)), np.zeros((3, 3))
    for by_point, swept in ((by_moving, moving), (by_reference, reference)):
        if swept.shared.any():
            alike = by_point * swept.shared_across
            shared += alike @ alike.T
            smooth += smeared(alike, swept.shared_beams) @ alike.T
    joint = smooth + independent_part(own, shared)
    return mean, (joint + joint.T) / 2


def independent_part(own: Array, shared: Array) -> Array:
    """(3, 3) covariance by noise that no two points share.

    Parameters
    ----------
    own : (3, 3) array
        By what the residuals of each point show, with its part of what neighbours share.
    shared : (3, 3) array
        By that part alone, as if it were independent.

    Notes
    -----
    The difference of the two, in the coordinates in which the first is the identity; residuals
    that are small by chance would make it negative there.
    """
    lower = np.linalg.cholesky(own + 1e-12 * np.trace(own) * np.eye(3))
    back = np.linalg.inv(lower)
    values, axes = np.linalg.eigh(back @ shared @ back.T)
    turned = lower @ axes
    return np.asarray((turned * np.maximum(1 - values, LEAST_OWN)) @ turned.T)
