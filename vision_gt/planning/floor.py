"""Which part of a floor cameras see."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from vision_gt.optics.camera import inside_image, project, undistort
from vision_gt.planning.mounting import MountedCamera

Mask = npt.NDArray[np.bool_]

COVERAGE_POINTS = 20_000
"""Of the grid on which shares of the floor are counted: lines of 140 points, so that a straight rim
across it is placed to a 300th of its width, and a share of the floor to less than one in a hundred.
"""
_SAME_RAY = 1e-4
"""Of undistorted coordinates: a lens model folds far points back into the image; what `undistort`
does not bring back to its ray was folded."""


@dataclass(frozen=True)
class FloorGrid:
    """Points evenly over a floor.

    Parameters
    ----------
    outline : (k, 2) array
        Corners of the floor, metres, GTV frame.
    points : (n, 2) array
        Middles of the cells.
    step : float
        Side of a cell, metres.
    """

    outline: Array
    points: Array
    step: float


@dataclass(frozen=True)
class Hole:
    """A part of the floor that no camera sees.

    Parameters
    ----------
    middle : (2,) array
        Metres.
    area : float
        Square metres.
    """

    middle: Array
    area: float


def area_of(outline: Array) -> float:
    """Area of a polygon (k, 2), square metres: the shoelace formula."""
    x, y = outline.T
    return float(0.5 * abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def sides_that_cross(outline: Array) -> tuple[tuple[int, int], tuple[int, int]] | None:
    """The first two sides of a polygon (k, 2) that cross, by their corners from 1; or None.

    Sides that only touch do not cross.
    """
    ends = np.roll(outline, -1, axis=0)
    count = len(outline)

    def side_of(point: Array, i: int) -> float:
        """On which side of side i a point is: the sign of twice the area of the triangle."""
        (ax, ay), (bx, by), (x, y) = outline[i], ends[i], point
        return float(np.sign((bx - ax) * (y - ay) - (by - ay) * (x - ax)))

    for i, j in combinations(range(count), 2):
        apart = side_of(outline[i], j) * side_of(ends[i], j)
        if apart < 0 and side_of(outline[j], i) * side_of(ends[j], i) < 0:
            return (i + 1, (i + 1) % count + 1), (j + 1, (j + 1) % count + 1)
    return None


def inside_outline(points: Array, outline: Array) -> Mask:
    """(n,) whether points (n, 2) are inside a polygon (k, 2), by the sides to their right."""
    a, b = outline, np.roll(outline, -1, axis=0)
    x, y = points[:, None, 0], points[:, None, 1]
    crosses = (a[:, 1] > y) != (b[:, 1] > y)
    with np.errstate(all="ignore"):
        at = a[:, 0] + (y - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    return np.asarray((crosses & (at > x)).sum(1) % 2 == 1)


def floor_grid(outline: Array, count: int = COVERAGE_POINTS) -> FloorGrid:
    """About ``count`` points evenly inside a polygon (k, 2)."""
    step = np.sqrt(area_of(outline) / count)
    low, high = outline.min(0), outline.max(0)
    cells = np.maximum(np.ceil((high - low) / step), 1).astype(int)
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in cells), indexing="ij"), -1).reshape(-1, 2)
    points = low + (grid + 0.5) * step
    return FloorGrid(outline, points[inside_outline(points, outline)], float(step))


def pixels_of(points: Array, mount: MountedCamera) -> Array:
    """Pixels (..., 2) of points (..., 3) of the GTV frame; NaN where the camera cannot see them."""
    R = mount.T_gtv_camera.rotation.as_matrix()
    seen = (np.asarray(points) - mount.eye) @ R
    pixels = project(seen, mount.camera.parameters)
    with np.errstate(all="ignore"):
        rays = undistort(pixels, mount.camera.parameters)
        same = np.abs(rays - seen[..., :2] / seen[..., 2:]).max(-1) < _SAME_RAY
    shown = same & inside_image(pixels, mount.camera.size)
    return np.where(shown[..., None], pixels, np.nan)


def floor_seen(points: Array, mounts: Sequence[MountedCamera]) -> Mask:
    """(c, n) whether each camera has points (n, 2) of the floor in its image.

    Nothing is in the way: walls, things and the robot itself are not known to a plan.
    """
    flat = np.column_stack([points, np.zeros(len(points))])
    return np.array([np.isfinite(pixels_of(flat, one)).all(-1) for one in mounts])


def holes(grid: FloorGrid, covered: Mask, most: int = 5) -> list[Hole]:
    """Connected parts of the floor that are not covered (n,), the largest first."""
    from scipy.ndimage import label  # noqa: PLC0415  (only a plan with holes needs it)

    cells = np.rint((grid.points - grid.points.min(0)) / grid.step).astype(int)
    image = np.zeros(cells.max(0) + 1, dtype=bool)
    image[tuple(cells[~covered].T)] = True
    numbers, count = label(image)
    own = np.where(covered, 0, numbers[tuple(cells.T)])
    sizes = np.bincount(own, minlength=count + 1)[1:]
    order = np.argsort(-sizes, kind="stable")[:most]
    return [Hole(grid.points[own == k + 1].mean(0), float(sizes[k] * grid.step**2)) for k in order]
