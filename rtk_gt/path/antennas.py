"""Where the antennas are on the vehicle, from their distances and stated heights."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from rtk_gt.offsets.noise import pair_incidence
from rtk_gt.receivers.steps import pair_differences
from validation.errors import GtvalError
from validation.poses.angles import Array


@dataclass(frozen=True)
class Antennas:
    """Antenna positions in the vehicle frame.

    Parameters
    ----------
    positions : (r, 3) array
        Metres; x forward, y left, z up.
    by_distance : (3 r, p) array
        Derivative of the positions with respect to the distances.
    misfit : (p,) array
        Distance of the positions minus the distance given, metres; 0 for three receivers.
    """

    positions: Array
    by_distance: Array
    misfit: Array


def antenna_positions(
    distances: Array, heights: Array, others: Array | None = None, first: Array | None = None
) -> Antennas:
    """Antenna positions that fulfil the distances, with the freedom that is left stated.

    Parameters
    ----------
    distances : (p,) array
        Between the antennas of each pair, metres, in the order of `receiver_pairs`. The first
        receiver is the rear one, the second front left, the third front right.
    heights : (3,) array
        z of the first three antennas, metres. Distances do not determine them: with three
        antennas two of them are free, and 27 mm of one makes 0.9 degrees of pitch. They decide
        which plane of the vehicle is called level.
    others : (r - 3, 3) array, optional
        Rough positions of further antennas, which tell their mirror images apart.
    first : (2,) array, optional
        x and y of the first antenna; the origin by default.

    Raises
    ------
    GtvalError
        If the distances fit no triangle, or further antennas have no rough position.

    Notes
    -----
    Blanco 2009, Eq. 11 and 12: the first antenna on the z axis, the x axis bisecting the front
    pair, which is taken as y_2 = -y_3.
    """
    receivers = round((1 + np.sqrt(1 + 8 * len(distances))) / 2)
    begin = np.zeros(2) if first is None else np.asarray(first, dtype=float)
    rough = np.empty((0, 3)) if others is None else np.asarray(others, dtype=float).reshape(-1, 3)
    if receivers != 3 + len(rough):
        raise GtvalError(
            f"{receivers} receivers need rough positions of {receivers - 3}, not {len(rough)}"
        )
    incidence = pair_incidence(receivers)

    def positions(unknown: Array) -> Array:
        x2, y, x3 = unknown[:3]
        front = np.array([[x2, y, heights[1]], [x3, -y, heights[2]]])
        return np.vstack([[*begin, heights[0]], front, unknown[3:].reshape(-1, 3)])

    spread = np.zeros((3 * receivers, 3 + 3 * len(rough)))  # derivative of the positions
    spread[3, 0] = spread[4, 1] = spread[6, 2] = 1.0
    spread[7, 1] = -1.0
    spread[9:, 3:] = np.eye(3 * len(rough))

    def jacobian(unknown: Array) -> Array:
        rods = pair_differences(positions(unknown))
        along = rods / np.linalg.norm(rods, axis=1, keepdims=True)
        by_position = (incidence[:, :, None] * along[:, None, :]).reshape(len(rods), -1)
        return np.asarray(by_position @ spread)

    def residuals(unknown: Array) -> Array:
        rods = pair_differences(positions(unknown))
        return np.asarray(np.linalg.norm(rods, axis=1) - distances)

    half = distances[receivers - 1] / 2
    ahead = [np.sqrt(max(distances[k] ** 2 - half**2, 1e-4)) for k in (0, 1)]
    start = np.array([begin[0] + ahead[0], half, begin[0] + ahead[1], *rough.ravel()])
    found = least_squares(residuals, start, jacobian, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    misfit = np.asarray(found.fun)
    if receivers == 3 and np.abs(misfit).max() > 1e-6:  # no root; far above rounding, below noise
        said = ", ".join(f"{d:.4f}" for d in distances)
        raise GtvalError(
            f"the distances {said} m make no triangle with antennas at the heights "
            f"{', '.join(f'{h:.3f}' for h in heights)} m"
        )
    return Antennas(positions(found.x), spread @ np.linalg.pinv(jacobian(found.x)), misfit)


def check_antennas(positions: Array) -> None:
    """Raise if the antennas are so nearly in one line that the roll about it is open.

    Raises
    ------
    GtvalError
        If the triangle is narrower than a thousandth of its length.
    """
    widths = np.linalg.svd(positions - positions.mean(0), compute_uv=False)
    if widths[1] < 1e-3 * widths[0]:  # a judgement: 2 mm on a car, as much as a fix is off
        raise GtvalError(
            "the antennas are in one line: the rotation about that line cannot be found"
        )
