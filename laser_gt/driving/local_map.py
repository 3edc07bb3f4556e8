"""Several sweeps as one surface: what is seen around a place."""

from collections.abc import Sequence

import numpy as np

from laser_gt.scans.planar import rotation, transform
from laser_gt.scans.scan import Flags
from laser_gt.scans.surfaces import Surface
from validation.poses.angles import Array


def merged(surfaces: Sequence[Surface], poses: Array) -> Surface:
    """Surfaces of sweeps as one, in the frame in which the poses of the sweeps are given.

    Parameters
    ----------
    surfaces : sequence of Surface
        Each in its sweep's frame.
    poses : (k, 3) array
        Of the sweeps.

    Returns
    -------
    Surface
        All points with their lines. Each line stays that of its own sweep: a point that is matched
        finds the nearest point of any of them.
    """
    turns = rotation(poses[:, 2])
    offsets = np.cumsum([0, *(len(one) for one in surfaces[:-1])])

    def joined(name: str) -> Array:
        return np.concatenate([getattr(one, name) for one in surfaces])

    def turned(name: str) -> Array:
        parts = zip(surfaces, turns, strict=True)
        return np.concatenate([getattr(one, name) @ turn.T for one, turn in parts])

    def placed(name: str) -> Array:
        parts = zip(surfaces, poses, strict=True)
        return np.concatenate([transform(pose, getattr(one, name)) for one, pose in parts])

    def shifted(name: str) -> Array:
        parts = zip(surfaces, offsets, strict=True)
        return np.concatenate([getattr(one, name) + offset for one, offset in parts])

    return Surface(
        points=placed("points"),
        beams=turned("beams"),
        ranges=joined("ranges"),
        sigmas=joined("sigmas"),
        centres=placed("centres"),
        normals=turned("normals"),
        first=shifted("first").astype(np.intp),
        last=shifted("last").astype(np.intp),
        normal_sigmas=joined("normal_sigmas"),
        flat=joined("flat").astype(bool),
        spacing=joined("spacing"),
        scatter=joined("scatter"),
        shared=joined("shared"),
        widths=joined("widths"),
        shared_beams=max(one.shared_beams for one in surfaces),
    )


def on_map(surface: Surface, points: Array, tolerance: float) -> Flags:
    """(n,) whether points, (n, 2), lie on the surface: near one of its points."""
    near = surface.grid.index(points[:, 0], points[:, 1])
    squared = ((points - surface.points[near]) ** 2).sum(-1)
    return np.asarray(squared < (tolerance + 0.6 * surface.spacing[near]) ** 2)
