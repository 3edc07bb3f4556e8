"""Where the antennas are on the vehicle, from their distances and stated heights."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from rtk_gt.offsets.noise import pair_incidence
from rtk_gt.receivers.steps import pair_differences
from validation.errors import GtvalError
from validation.poses.angles import Array

_ROUNDS = 50
_SETTLED = 1e-6
"""Metres: far above rounding, far below noise."""


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
        If there are fewer than three antennas, the distances fit no triangle, or further antennas
        have no rough position.

    Notes
    -----
    Blanco 2009, Eq. 11 and 12: the first antenna on the z axis, the x axis bisecting the front
    pair, which is taken as y_2 = -y_3.
    """
    receivers = round((1 + np.sqrt(1 + 8 * len(distances))) / 2)
    begin = np.zeros(2) if first is None else np.asarray(first, dtype=float)
    rough = np.empty((0, 3)) if others is None else np.asarray(others, dtype=float).reshape(-1, 3)
    if receivers < 3:
        raise GtvalError("at least three receivers are needed for a pose in space")
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


@dataclass(frozen=True)
class Places:
    """What is stated of where the antennas are on the vehicle.

    Parameters
    ----------
    heights : (r,) array
        z of the antennas, metres.
    others : (r - 3, 3) array, optional
        Rough positions from the fourth antenna on.
    positions : (r, 3) array, optional
        Of all antennas, in any layout. Without it they are the rear one, then front left and front
        right, and others.
    """

    heights: Array
    others: Array | None = None
    positions: Array | None = None

    def antennas(self, distances: Array) -> Antennas:
        """The antennas with the distances found.

        Raises
        ------
        GtvalError
            As `antenna_positions` and `antennas_near`.
        """
        if self.positions is not None:
            return antennas_near(self.positions, distances)
        return antenna_positions(distances, self.heights[:3], self.others)

    @property
    def order(self) -> str:
        """In which order the receivers must be listed, in words."""
        if self.positions is not None:
            return "The receivers must be those of the stated positions"
        return "The receivers must be listed as rear, front left, front right"


def antennas_near(stated: Array, distances: Array) -> Antennas:
    """Antenna positions that fulfil the distances and are nearest to stated ones.

    Parameters
    ----------
    stated : (r, 3) array
        Positions on the vehicle, metres; they say where its x axis is and what is level. Heights of
        the first three are kept.
    distances : (p,) array
        Between the antennas of each pair, metres, in the order of `receiver_pairs`.

    Raises
    ------
    GtvalError
        If the distances are not those of antennas near the stated positions.

    Notes
    -----
    Gauss-Newton with the shortest step: what distances do not see, a move or a turn of all
    antennas together, stays as stated.
    """
    receivers = len(stated)
    incidence = pair_incidence(receivers)
    free = np.ones((receivers, 3), dtype=bool)
    free[:3, 2] = False
    spread = np.eye(3 * receivers)[:, free.ravel()]
    places = stated.astype(float)
    for _ in range(_ROUNDS):
        rods = pair_differences(places)
        lengths = np.linalg.norm(rods, axis=1)
        along = rods / lengths[:, None]
        jacobian = (incidence[:, :, None] * along[:, None, :]).reshape(len(rods), -1) @ spread
        step = np.linalg.pinv(jacobian) @ (distances - lengths)
        places = places + (spread @ step).reshape(-1, 3)
        if np.abs(step).max() < _SETTLED:
            break
    misfit = np.linalg.norm(pair_differences(places), axis=1) - distances
    off = float(np.linalg.norm(places - stated, axis=1).max())
    arm = float(np.linalg.norm(pair_differences(stated), axis=1).min())
    if not off < arm / 2 or (receivers == 3 and np.abs(misfit).max() > _SETTLED):
        said = ", ".join(f"{d:.3f}" for d in distances)
        raise GtvalError(
            f"the distances of the antennas, {said} m, are not those of the stated positions of "
            "the receivers; check `position` of each, and which file belongs to which"
        )
    return Antennas(places, spread @ np.linalg.pinv(jacobian), misfit)


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
