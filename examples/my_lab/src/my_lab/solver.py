"""World points from distances to known marks: what a lab may have written itself."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def trilaterate(marks: Array, distances: Array, sigma: Array) -> tuple[Array, Array, float]:
    """A point, its covariance, and the misfit of its distances.

    Parameters
    ----------
    marks : (n, 2) array
        Known places, metres.
    distances, sigma : (n,) arrays
        To the point, with their standard deviations, metres.

    Returns
    -------
    tuple
        (2,) point, (2, 2) covariance, and chi-squared with n - 2 degrees of freedom. Of the
        solutions from four starts around the marks, the one that fits best.
    """
    around = marks.mean(0) + 5.0 * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    return min((_from(start, marks, distances, sigma) for start in around), key=lambda one: one[2])


def _from(point: Array, marks: Array, distances: Array, sigma: Array) -> tuple[Array, Array, float]:
    """Gauss-Newton from a start."""
    for _ in range(30):
        away = point - marks
        expected = np.hypot(*away.T)
        direction = away / expected[:, None] / sigma[:, None]
        left = (distances - expected) / sigma
        covariance = np.linalg.inv(direction.T @ direction)
        point = point + covariance @ direction.T @ left
    left = (distances - np.hypot(*(point - marks).T)) / sigma
    return point, covariance, float(left @ left)


def world_points(
    start: Sequence[str],
    end: Sequence[str],
    distance: Array,
    sigma: Array,
    vframe: Mapping[str, tuple[float, float]],
    vframe_sigma: float,
) -> dict[str, tuple[Array, Array, float]]:
    """Every point that was measured from the Vframe points, from those readings alone."""
    readings: dict[str, list[int]] = {}
    for row, (mark, point) in enumerate(zip(start, end, strict=True)):
        if mark in vframe and point not in vframe:
            readings.setdefault(point, []).append(row)
    found = {}
    for name, rows in readings.items():
        marks = np.array([vframe[start[row]] for row in rows])
        spread = np.hypot(sigma[rows], vframe_sigma)  # the marks are not exact either
        found[name] = trilaterate(marks, distance[rows], spread)
    return found
