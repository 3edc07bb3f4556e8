"""A robot that finds its way on a map of walls by its laser scanner."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

import gtval

Array = npt.NDArray[np.float64]
REACH = 0.5
"""Beams that end further than this from all walls, in metres, met something that is not mapped."""


def localise(scans: Sequence[gtval.Scan], start: Array, steps: Array, walls: Array) -> Array:
    """The poses at which scans were taken.

    Parameters
    ----------
    scans : sequence of n gtval.Scan
        One for each stop.
    start : (3,) array
        About where the first was taken: x, y, theta in the map.
    steps : (n - 1, 3) array
        Odometry: each stop seen from the one before.
    walls : (m, 2, 2) array
        Start and end of each wall of the map, metres.

    Returns
    -------
    (n, 3) array
        x, y, theta in the map.
    """
    poses = [_on_the_map(scans[0], start, walls)]
    for scan, step in zip(scans[1:], steps, strict=True):
        last = poses[-1]
        guess = np.array([*(last[:2] + _turn(last[2]) @ step[:2]), last[2] + step[2]])
        poses.append(_on_the_map(scan, guess, walls))
    return np.array(poses)


def _turn(angle: float) -> Array:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _on_the_map(scan: gtval.Scan, pose: Array, walls: Array) -> Array:
    """Points moved onto the nearest walls, again and again with less reach."""
    met = np.isfinite(scan.ranges)
    ends = scan.ranges[met, None] * np.column_stack(
        [np.cos(scan.angles[met]), np.sin(scan.angles[met])]
    )
    along = walls[:, 1] - walls[:, 0]
    length = np.hypot(*along.T)
    along = along / length[:, None]
    normal = np.column_stack([-along[:, 1], along[:, 0]])
    for reach in np.geomspace(REACH, 0.05, 30):
        points = ends @ _turn(pose[2]).T + pose[:2]
        away = points[:, None] - walls[:, 0]
        beside = np.einsum("pwi,wi->pw", away, normal)
        position = np.einsum("pwi,wi->pw", away, along)
        outside = np.maximum(np.maximum(-position, position - length), 0)
        distance = np.hypot(beside, outside)
        nearest = distance.argmin(1)
        rows = np.flatnonzero(distance.min(1) < reach)
        wall = nearest[rows]
        lever = points[rows] - pose[:2]
        turned = lever[:, 0] * normal[wall, 1] - lever[:, 1] * normal[wall, 0]
        slope = np.column_stack([normal[wall], turned])
        pose = pose - np.linalg.lstsq(slope, beside[rows, wall], rcond=None)[0]
    return pose
