"""Nearest points of a fixed set by table look-up: a distance transform with labels."""

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from laser_gt.scans.scan import Indices
from validation.poses.angles import Array

if TYPE_CHECKING:
    from scipy.spatial import cKDTree


class NearestGrid:
    """A table of the nearest point for every cell around a point set.

    A look-up costs a few nanoseconds whatever the number of points, and works on any batch
    shape; a kd-tree costs some 600. The label of a cell is a point of the nearest occupied cell,
    so the answer may be further away than the nearest point by up to about a cell. Queries
    outside of the table get the answer of its border.

    Parameters
    ----------
    points : (n, 2) array
        Metres.
    cell : float
        Edge of a cell in metres; made larger where the area would need too many cells.
    margin : float
        How far around the points the table goes, in metres.
    """

    MAX_CELLS = 400_000
    """A judgement: 44 m by 44 m at the usual cell, and 12 bytes each, so that the tables of all
    stops stay in memory."""

    def __init__(self, points: Array, cell: float = 0.07, margin: float = 0.5) -> None:
        self.points = points
        self.x, self.y = np.ascontiguousarray(points.T)
        self.low = points.min(0) - margin
        extent = points.max(0) + margin - self.low
        self.cell = max(cell, float(np.sqrt(extent.prod() / self.MAX_CELLS)))
        self.columns, self.rows = (np.ceil(extent / self.cell).astype(int) + 1).tolist()

    @cached_property
    def _tables(self) -> tuple[Indices, npt.NDArray[np.float32]]:
        """(cells,) point that stands for each cell, and distance to the nearest occupied cell."""
        import cv2  # noqa: PLC0415  (loaded when the first table is made)

        image = np.full((self.rows, self.columns), 255, dtype=np.uint8)
        cells = self._cells(self.x, self.y)
        image.ravel()[cells] = 0
        distances, labels = cv2.distanceTransformWithLabels(
            image, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
        )
        flat = labels.ravel()
        point_of_label = np.zeros(len(self.points) + 1, dtype=np.intp)
        point_of_label[flat[cells]] = np.arange(len(self.points))
        return point_of_label[flat], np.asarray(distances.ravel() * self.cell, dtype=np.float32)

    def _cells(self, x: Array, y: Array) -> Indices:
        """Flat cell index of each point, of the border for points outside."""
        cells = self._along(y, 1, self.rows)
        cells *= self.columns
        cells += self._along(x, 0, self.columns)
        return cells

    def _along(self, values: Array, axis: int, count: int) -> Indices:
        """Column or row of each point."""
        place = values - self.low[axis]
        place *= 1 / self.cell
        np.maximum(place, 0, out=place)
        np.minimum(place, count - 1, out=place)
        return np.asarray(place.astype(np.intp))

    def index(self, x: Array, y: Array) -> Indices:
        """Index of the nearest point to each (x, y), any shape."""
        return np.asarray(self._tables[0].take(self._cells(x, y)))

    def squared_distance(self, x: Array, y: Array) -> Array:
        """Squared distance to the nearest point, exact but for the choice of the point."""
        index = self.index(x, y)
        return np.asarray((x - self.x.take(index)) ** 2 + (y - self.y.take(index)) ** 2)

    def distance(self, x: Array, y: Array) -> npt.NDArray[np.float32]:
        """Distance to the nearest point to about half a cell; one look-up, for many queries."""
        return self._tables[1].take(self._cells(x, y))


DROPPED = 5
"""Worst points that do not count in the document's fitness: AD2.3, "Using two laser range finder
with a genetic algorithm"."""


def published_fitness(reference: "cKDTree", moving: Array) -> float:
    """The document's fitness of a match: the smaller the better.

    Parameters
    ----------
    reference : scipy.spatial.cKDTree
        Points of the reference, metres.
    moving : (m, 2) array
        Points of the other scan, in the frame of the reference.

    Returns
    -------
    float
        Sum of the squared distances of the moving points to the closest points of the reference,
        less the worst `DROPPED`, in square metres.
    """
    squared = np.sort(reference.query(moving)[0] ** 2)
    return float(squared[: max(len(squared) - DROPPED, 0)].sum())
