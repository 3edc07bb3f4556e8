"""Directions of satellites from a place, and the dilution of precision that they give."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame

Bools = npt.NDArray[np.bool_]
_LEAST_EIGENVALUE = 1e-6
"""Of the information of four unknowns, where a direction counts 1: less is a DOP above 1000."""


def directions(frame: LocalFrame, ecef: Array) -> tuple[Array, Array]:
    """Azimuths (from north over east, 0 to 2 pi) and elevations (...), rad, of places (..., 3)."""
    east, north, up = np.moveaxis(frame.from_ecef(ecef), -1, 0)
    return np.mod(np.arctan2(east, north), 2 * np.pi), np.arctan2(up, np.hypot(east, north))


@dataclass(frozen=True)
class Dilution:
    """Dilution of precision over time; NaN where the satellites determine no position.

    Parameters
    ----------
    position, horizontal, vertical : (t,) array
        PDOP, HDOP and VDOP.
    """

    position: Array
    horizontal: Array
    vertical: Array


def dilution(azimuth: Array, elevation: Array, used: Bools, systems: tuple[str, ...]) -> Dilution:
    """PDOP, HDOP and VDOP of the satellites that are used.

    Parameters
    ----------
    azimuth, elevation : (s, t) array
        Directions, rad.
    used : (s, t) array of bool
        Which satellites count at each time.
    systems : (s,) tuple of str
        Letter of the system of each satellite. The receiver's clock is an unknown of its own for
        each system, as their times differ; a single satellite of a system therefore adds nothing.

    Returns
    -------
    Dilution
        Roots of sums of the diagonal of (G^T G)^-1, G having a row (e, n, u, 1) for each
        satellite: its direction, and the clock (Langley, "Dilution of precision", GPS World
        10(5), 1999). All satellites weigh the same.
    """
    letters = sorted(set(systems))
    own = np.array([[one == letter for letter in letters] for one in systems], dtype=float)
    level = np.cos(elevation)
    e, n, u = level * np.sin(azimuth), level * np.cos(azimuth), np.sin(elevation)
    G = (
        np.concatenate(
            [
                np.stack([e, n, u], axis=-1),
                np.broadcast_to(own[:, None], (*azimuth.shape, len(letters))),
            ],
            axis=-1,
        )
        * used[..., None]
    )  # (s, t, 3 + systems)
    N = np.einsum("sti,stj->tij", G, G)
    clocks = np.arange(3, 3 + len(letters))
    # The clock of a system without a satellite hangs on nothing: any value for it does.
    N[:, clocks, clocks] += N[:, clocks, clocks] == 0
    values, vectors = np.linalg.eigh(N)
    with np.errstate(divide="ignore"):
        inverse = np.where(values > _LEAST_EIGENVALUE, 1 / values, np.nan)
    diagonal = np.einsum("tik,tk,tik->ti", vectors, inverse, vectors)
    return Dilution(
        np.sqrt(diagonal[:, :3].sum(1)), np.sqrt(diagonal[:, :2].sum(1)), np.sqrt(diagonal[:, 2])
    )
