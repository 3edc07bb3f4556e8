"""Line scans of a scanner on the vehicle, and the point cloud that they make along the path."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from rtk_gt.path.orientation import matrix_of
from validation.errors import GtvalError
from validation.poses.angles import Array


@dataclass(frozen=True)
class LineScans:
    """Scans of one scanner.

    Parameters
    ----------
    times : (s,) array
        Seconds since 1970.
    angles : (b,) array
        Of the beams in the scan plane, from the scanner's x towards its y axis, in radians.
    ranges : (s, b) array
        Metres; NaN or infinite where nothing was hit.
    """

    times: Array
    angles: Array
    ranges: Array

    def __post_init__(self) -> None:
        if self.ranges.shape != (len(self.times), len(self.angles)):
            raise GtvalError(
                f"ranges {self.ranges.shape} do not belong to {len(self.times)} scans of "
                f"{len(self.angles)} beams"
            )

    def select(self, rows: npt.NDArray[np.bool_] | npt.NDArray[np.int64]) -> "LineScans":
        """The chosen scans."""
        return replace(self, times=self.times[rows], ranges=self.ranges[rows])


@dataclass(frozen=True)
class Cloud:
    """Points of all scans.

    Parameters
    ----------
    own : (n, 3) array
        In the scanner's frame, metres.
    scan : (n,) int array
        The scan that each came from.
    """

    own: Array
    scan: npt.NDArray[np.int64]

    def in_vehicle(self, sensor: Array) -> Array:
        """(n, 3) points in the vehicle frame, for a scanner at (6,) x, y, z, yaw, pitch, roll."""
        return np.asarray(self.own @ matrix_of(sensor[3:]).T + sensor[:3])

    def in_world(self, vehicle: Array, sensor: Array) -> Array:
        """(n, 3) points in the local frame, for vehicle poses (s, 6) at the times of the scans."""
        R = matrix_of(vehicle[:, 3:])[self.scan]
        return np.asarray(
            np.einsum("nij,nj->ni", R, self.in_vehicle(sensor)) + vehicle[self.scan, :3]
        )


def cloud_of(scans: LineScans, nearest: float = 0.5, farthest: float = 30.0) -> Cloud:
    """The points of all beams that hit something between two distances in metres."""
    with np.errstate(invalid="ignore"):
        hit = (scans.ranges > nearest) & (scans.ranges < farthest)
    scan, beam = np.nonzero(hit)
    r, a = scans.ranges[scan, beam], scans.angles[beam]
    own = np.column_stack([r * np.cos(a), r * np.sin(a), np.zeros(len(r))])
    return Cloud(own, scan)
