"""PLICP, the point-to-line matcher of Censi (2008), written down from the paper.

With the settings that its author's program, the Canonical Scan Matcher, has as defaults where they
matter: pairs within 0.5 m, the worst tenth left out, and all that are twice as far as the 70 %
quantile; one moving point for each point of the reference.
"""

import numpy as np
from scipy.spatial import cKDTree

from laser_gt.scans.planar import rotation, transform
from validation.poses.angles import Array

MOST_STEPS, SMALL = 100, 1e-6
FARTHEST, KEPT, ORDER, TIMES = 0.5, 0.9, 0.7, 2.0


def plicp(reference: Array, moving: Array, guess: Array) -> Array:
    """(3,) pose of a scan's points, (m, 2), in the frame of another's, (n, 2), from a guess."""
    tree, pose = cKDTree(reference), np.array(guess, dtype=float)
    for _ in range(MOST_STEPS):
        points = transform(pose, moving)
        distance, first = tree.query(points, distance_upper_bound=FARTHEST)
        rows = np.flatnonzero(np.isfinite(distance))
        rows = rows[np.argsort(distance[rows], kind="stable")]
        rows = rows[np.sort(np.unique(first[rows], return_index=True)[1])]
        limit = np.quantile(distance[rows], KEPT)
        limit = min(limit, TIMES * np.quantile(distance[rows], ORDER))
        rows = rows[distance[rows] <= limit]
        near = first[rows]
        sides = np.clip(near[:, None] + np.array([-1, 1]), 0, len(reference) - 1)
        away = np.hypot(*np.moveaxis(reference[sides] - points[rows, None], -1, 0))
        away[sides == near[:, None]] = np.inf
        second = sides[np.arange(len(rows)), away.argmin(1)]
        along = reference[second] - reference[near]
        along /= np.maximum(np.hypot(*along.T), 1e-9)[:, None]
        normal = np.column_stack([-along[:, 1], along[:, 0]])
        new = _solved(pose, moving[rows], reference[near], normal)
        done = np.abs(new - pose).max() < SMALL
        pose = new
        if done:
            break
    return pose


def _solved(pose: Array, moving: Array, place: Array, normal: Array) -> Array:
    """The pose that brings points nearest to lines through places, by Gauss-Newton."""
    pose = pose.copy()
    for _ in range(10):
        arm = moving @ rotation(pose[2]).T
        residual = (normal * (arm + pose[:2] - place)).sum(1)
        turn = normal[:, 1] * arm[:, 0] - normal[:, 0] * arm[:, 1]
        step = -np.linalg.lstsq(np.column_stack([normal, turn]), residual, rcond=None)[0]
        pose += step
        if np.abs(step).max() < 1e-9:
            break
    return pose
