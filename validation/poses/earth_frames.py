"""Geodetic, geocentric (ECEF) and local coordinates on the WGS84 ellipsoid.

A local frame is a point and a meaning of 'up'. Two frames at the same point with different
'up' differ by up to 0.19 degrees, which at Malaga makes 9 cm of height over offsets of 145 m:
vectors therefore carry their frame, and mixing frames is an error.

Source: Blanco, Moreno and Gonzalez, "A collection of outdoor robotic datasets with
centimeter-accuracy ground truth", Autonomous Robots 27 (2009), section 4.1 (called Blanco 2009
below).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from validation.errors import GtvalError
from validation.poses.angles import Array

SEMI_MAJOR_AXIS = 6378137.0
"""a of WGS84, in metres."""
FLATTENING = 1 / 298.257223563
"""f of WGS84."""
ECCENTRICITY_SQUARED = FLATTENING * (2 - FLATTENING)
"""e^2 = sin^2 of the angular eccentricity of Blanco 2009, Eq. 3."""

Up = Literal["ellipsoid", "geocentric"]


def ecef_from_geodetic(geodetic: npt.ArrayLike) -> Array:
    """Geocentric Cartesian coordinates of points on, above or below the ellipsoid.

    Parameters
    ----------
    geodetic : (..., 3) array_like
        Latitude and longitude in radians, height above the ellipsoid in metres.

    Returns
    -------
    (..., 3) array
        x, y, z in metres, in the Earth-centred, Earth-fixed frame.

    Notes
    -----
    Blanco 2009, Eq. 2 and 3. The z there needs cos^2 of the angular eccentricity, 1 - e^2.
    """
    latitude, longitude, height = np.moveaxis(np.asarray(geodetic, dtype=float), -1, 0)
    sine, cosine = np.sin(latitude), np.cos(latitude)
    N = SEMI_MAJOR_AXIS / np.sqrt(1 - ECCENTRICITY_SQUARED * sine**2)
    across = (N + height) * cosine
    return np.stack(
        [
            across * np.cos(longitude),
            across * np.sin(longitude),
            (N * (1 - ECCENTRICITY_SQUARED) + height) * sine,
        ],
        axis=-1,
    )


def geodetic_from_ecef(ecef: npt.ArrayLike) -> Array:
    """Latitude, longitude (radians) and ellipsoidal height (metres) of geocentric points.

    Parameters
    ----------
    ecef : (..., 3) array_like
        x, y, z in metres; farther than 100 km from the Earth's centre.

    Raises
    ------
    GtvalError
        If a point is so near to the centre that latitude has no meaning.

    Notes
    -----
    Bowring's iteration on the reduced latitude; two rounds leave under 1e-9 m up to 1,000 km of
    height, a third is made for good measure. At the poles the longitude is that of the input's
    arctangent, 0 on the axis itself.
    """
    x, y, z = np.moveaxis(np.asarray(ecef, dtype=float), -1, 0)
    across = np.hypot(x, y)
    if (np.hypot(across, z) < 1e5).any():
        raise GtvalError("a point within 100 km of the Earth's centre has no latitude")
    b = SEMI_MAJOR_AXIS * (1 - FLATTENING)
    second = ECCENTRICITY_SQUARED / (1 - ECCENTRICITY_SQUARED)
    reduced = np.arctan2(z * SEMI_MAJOR_AXIS, across * b)
    latitude = reduced
    for _ in range(3):
        latitude = np.arctan2(
            z + second * b * np.sin(reduced) ** 3,
            across - ECCENTRICITY_SQUARED * SEMI_MAJOR_AXIS * np.cos(reduced) ** 3,
        )
        reduced = np.arctan2((1 - FLATTENING) * np.sin(latitude), np.cos(latitude))
    sine, cosine = np.sin(latitude), np.cos(latitude)
    N = SEMI_MAJOR_AXIS / np.sqrt(1 - ECCENTRICITY_SQUARED * sine**2)
    # Along the normal: well conditioned from the equator to the poles.
    height = across * cosine + z * sine - SEMI_MAJOR_AXIS**2 / N
    return np.stack([latitude, np.arctan2(y, x), height], axis=-1)


@dataclass(frozen=True)
class LocalFrame:
    """A Cartesian frame at a point of the Earth: x east, y north, z up.

    Parameters
    ----------
    latitude, longitude : float
        Of the origin, in radians.
    height : float
        Of the origin above the ellipsoid, in metres.
    up : {"ellipsoid", "geocentric"}
        Direction of z: the normal of the ellipsoid (ENU as in the textbooks), or the line from
        the Earth's centre through the origin, as in the published Malaga data (Blanco 2009,
        footnote 10). y completes the frame, so 'north' is tilted with it.

    Raises
    ------
    GtvalError
        If the origin is no place on Earth.
    """

    latitude: float
    longitude: float
    height: float
    up: Up = "ellipsoid"

    def __post_init__(self) -> None:
        if not (abs(self.latitude) <= np.pi / 2 and abs(self.longitude) <= 2 * np.pi):
            raise GtvalError(
                f"latitude {np.degrees(self.latitude):g}, longitude "
                f"{np.degrees(self.longitude):g} degrees is no place on Earth"
            )
        if not abs(self.height) < 1e5:
            raise GtvalError(f"a height of {self.height:g} m is not on the Earth's surface")

    @classmethod
    def from_degrees(
        cls, latitude: float, longitude: float, height: float, up: Up = "ellipsoid"
    ) -> "LocalFrame":
        """The frame at a place given in degrees and metres."""
        return cls(np.radians(latitude).item(), np.radians(longitude).item(), height, up)

    @property
    def origin(self) -> Array:
        """(3,) the origin in ECEF, metres."""
        return ecef_from_geodetic([self.latitude, self.longitude, self.height])

    @property
    def axes(self) -> Array:
        """(3, 3) rows: east, north and up in ECEF (u, v, w of Blanco 2009, Eq. 4)."""
        east = np.array([-np.sin(self.longitude), np.cos(self.longitude), 0.0])
        if self.up == "geocentric":
            up = self.origin / np.linalg.norm(self.origin)
        else:
            up = np.array(
                [
                    np.cos(self.latitude) * np.cos(self.longitude),
                    np.cos(self.latitude) * np.sin(self.longitude),
                    np.sin(self.latitude),
                ]
            )
        return np.stack([east, np.cross(up, east), up])

    def from_ecef(self, ecef: npt.ArrayLike) -> Array:
        """Local coordinates (..., 3) of geocentric points (..., 3), metres.

        Blanco 2009, Eq. 5: subtract first, then rotate.
        """
        return np.asarray((np.asarray(ecef, dtype=float) - self.origin) @ self.axes.T)

    def to_ecef(self, local: npt.ArrayLike) -> Array:
        """Geocentric coordinates (..., 3) of local points (..., 3), metres."""
        return np.asarray(np.asarray(local, dtype=float) @ self.axes + self.origin)

    def from_geodetic(self, geodetic: npt.ArrayLike) -> Array:
        """Local coordinates (..., 3), metres, of (latitude, longitude, height); radians."""
        return self.from_ecef(ecef_from_geodetic(geodetic))

    def to_geodetic(self, local: npt.ArrayLike) -> Array:
        """Latitude, longitude (radians) and height (..., 3) of local points (..., 3)."""
        return geodetic_from_ecef(self.to_ecef(local))

    def rotation_from(self, other: "LocalFrame") -> Array:
        """(3, 3) matrix that turns a vector's coordinates in ``other`` into those in this."""
        return np.asarray(self.axes @ other.axes.T)

    def __str__(self) -> str:
        up = "normal of the ellipsoid" if self.up == "ellipsoid" else "line from the centre"
        return (
            f"latitude {np.degrees(self.latitude):.9f}, longitude "
            f"{np.degrees(self.longitude):.9f} degrees, height {self.height:.4f} m, up: {up}"
        )


@dataclass(frozen=True)
class FrameVectors:
    """Vectors, such as receiver offsets, that belong to one local frame.

    Parameters
    ----------
    frame : LocalFrame
        Whose axes the numbers refer to.
    values : (..., 3) array
        Metres.
    """

    frame: LocalFrame
    values: Array

    def within(self, frame: LocalFrame) -> Array:
        """The numbers, if they belong to this very frame.

        Raises
        ------
        GtvalError
            If they belong to another; `turned_to` converts them openly.
        """
        if frame != self.frame:
            angle = rotation_angle(frame.rotation_from(self.frame))
            worst = float(np.linalg.norm(self.turned_to(frame).values - self.values, axis=-1).max())
            raise GtvalError(
                f"offsets of one frame were used in another: they belong to ({self.frame}), the "
                f"positions to ({frame}). The axes differ by {np.degrees(angle):.4f} degrees, "
                f"which is {worst:.3f} m here. State the offsets' frame, or turn them first"
            )
        return self.values

    def turned_to(self, frame: LocalFrame) -> "FrameVectors":
        """The same vectors with the axes of another frame."""
        return FrameVectors(frame, self.values @ frame.rotation_from(self.frame).T)


def rotation_angle(rotation: Array) -> float:
    """Angle of a rotation matrix (3, 3), in radians, exact also for tiny angles."""
    skew = rotation - rotation.T
    sine = np.linalg.norm([skew[2, 1], skew[0, 2], skew[1, 0]]) / 2
    return float(np.arctan2(sine, (np.trace(rotation) - 1) / 2))
