"""What hides the sky at a place: a horizon that was typed, and buildings."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.text_files.csv_tables import Column, read_csv

COLUMNS = (
    Column("azimuth", "number", low=0, high=360, unit="degrees"),
    Column("elevation", "number", low=-10, high=90, unit="degrees"),
)


@dataclass(frozen=True)
class Building:
    """A building with upright walls and a flat roof.

    Parameters
    ----------
    name : str
        For messages.
    corners : (c, 2) array
        East and north of its outline, metres from the place, in order.
    above : float
        Metres from the antenna up to the roof; below 0 it hides nothing above the horizon.
    """

    name: str
    corners: Array
    above: float


@dataclass(frozen=True)
class Horizon:
    """The lowest elevation that is free of obstacles, by direction.

    Parameters
    ----------
    rows : (n, 2) array
        Azimuths, ascending within 0 to 2 pi, and elevations, rad; straight lines lie between
        them, also from the last to the first. Two rows of one azimuth are an upright edge.
    buildings : tuple of Building
        Around the place.
    """

    rows: Array
    buildings: tuple[Building, ...] = ()

    def elevation(self, azimuths: Array) -> Array:
        """Elevations (...), rad, above which the sky is free at azimuths (...)."""
        turned = np.mod(azimuths, 2 * np.pi)
        found = np.full(turned.shape, -np.pi / 2)
        if len(self.rows):
            before, after = self.rows[-1] - [2 * np.pi, 0], self.rows[0] + [2 * np.pi, 0]
            at, height = np.vstack([before, self.rows, after]).T
            found = np.interp(turned, at, height)
        for building in self.buildings:
            found = np.maximum(found, roof_elevation(building, turned))
        return found


OPEN = Horizon(np.empty((0, 2)))
"""A place without obstacles."""


def roof_elevation(building: Building, azimuths: Array) -> Array:
    """Elevations (...), rad, of a building's upper edge at azimuths (...); -pi/2 beside it.

    The ray from the place along an azimuth meets a wall from A to B at the distance
    (A x B) / (d x (B - A)), d being its direction; the nearest of the walls stands highest.

    Raises
    ------
    GtvalError
        If the place is inside of the outline and below the roof.
    """
    if building.above > 0 and surrounds(building.corners):
        raise GtvalError(
            f"the place lies inside of building '{building.name}' and below its roof: correct the "
            "place, the corners or the height"
        )
    d = np.stack([np.sin(azimuths), np.cos(azimuths)], axis=-1)[..., None, :]
    A = building.corners
    edge = np.roll(A, -1, axis=0) - A
    across = d[..., 0] * edge[:, 1] - d[..., 1] * edge[:, 0]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        distance = (A[:, 0] * edge[:, 1] - A[:, 1] * edge[:, 0]) / across
        along = (A[:, 0] * d[..., 1] - A[:, 1] * d[..., 0]) / across
    met = (distance > 0) & (along >= 0) & (along <= 1)
    nearest = np.where(met, distance, np.inf).min(-1)
    return np.where(np.isfinite(nearest), np.arctan2(building.above, nearest), -np.pi / 2)


def surrounds(corners: Array) -> bool:
    """Whether the origin lies inside of an outline (c, 2): by the turns around it."""
    angles = np.arctan2(corners[:, 1], corners[:, 0])
    steps = np.diff(angles, append=angles[:1])
    return bool(abs((np.mod(steps + np.pi, 2 * np.pi) - np.pi).sum()) > np.pi)


def typed_horizon(rows: Sequence[tuple[float, float]]) -> Array:
    """Rows (n, 2) of a `Horizon`, rad, of azimuths and elevations in degrees in any order."""
    table = np.radians(np.array(rows, dtype=float).reshape(-1, 2))
    return np.asarray(table[np.argsort(table[:, 0], kind="stable")])


def read_horizon(path: Path) -> Array:
    """Rows (n, 2) of a `Horizon`, rad, from a file with columns azimuth and elevation in degrees.

    Azimuths count from north over east; elevations are those up to which the sky is hidden.

    Raises
    ------
    InputError
        Naming line, field and value of every bad place.
    """
    table = read_csv(path, COLUMNS)
    table.raise_problems()
    return typed_horizon(
        list(zip(table.numbers["azimuth"], table.numbers["elevation"], strict=True))
    )
