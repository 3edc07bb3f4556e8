"""Offsets and path from the fixes of RTK-GPS receivers."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np
import numpy.typing as npt

from gtval.arguments import said_plainly
from rtk_gt.campaign.pose_tables import vehicle_table
from rtk_gt.offsets.estimate import Offsets, estimate_offsets
from rtk_gt.path.antennas import antenna_positions
from rtk_gt.path.vehicle_path import VehiclePath, vehicle_path
from rtk_gt.receivers.fixes import RTK_FIXED, Fixes
from rtk_gt.receivers.formats.reading import Stated, read_receiver
from rtk_gt.receivers.steps import Steps, common_steps
from validation.errors import GtvalError
from validation.poses.earth_frames import LocalFrame
from validation.poses.pose_table import PoseTable

__all__ = ["Fixes", "Offsets", "VehiclePath"]
__all__ += ["find_offsets", "find_path", "fixes", "path_table", "read_fixes"]


@said_plainly
def fixes(
    receiver: str,
    times: npt.ArrayLike,
    places: npt.ArrayLike,
    kinds: npt.ArrayLike | int = RTK_FIXED,
) -> Fixes:
    """The record of one receiver from arrays.

    Parameters
    ----------
    receiver : str
        Its name.
    times : (n,) array_like
        Seconds since 1970 UTC, increasing.
    places : (n, 3) array_like
        Latitude and longitude in degrees, height above the WGS84 ellipsoid in metres.
    kinds : int or (n,) array_like
        As the GGA sentence numbers them: 4 is RTK fixed, 5 RTK float.

    Raises
    ------
    GtvalError
        If the arrays differ in length.

    Examples
    --------
    >>> record = gtval.fixes("rear", [0.0, 1.0], [[36.7, -4.4, 38.9], [36.7, -4.4, 38.9]])
    >>> record.fixed.tolist()
    [True, True]
    """
    seconds = np.array(times, dtype=float)
    n = len(seconds)
    return Fixes(
        receiver=receiver,
        times=seconds,
        geodetic=np.asarray(places, dtype=float) * [np.pi / 180, np.pi / 180, 1.0],
        kinds=np.broadcast_to(np.asarray(kinds, dtype=np.int64), (n,)).copy(),
        satellites=np.full(n, -1),
        hdop=np.full(n, np.nan),
        covariances=np.full((n, 3, 3), np.nan),
        lines=np.arange(1, n + 1),
        source=Path(receiver),
    )


@said_plainly
def read_fixes(path: str | PathLike[str], receiver: str = "") -> Fixes:
    """The record of one receiver from a file: NMEA, RTKLIB, u-blox, NovAtel, GPX, a bag, a table.

    Parameters
    ----------
    path : path
        The file, compressed or not; its content tells its form. A table has the columns time,
        latitude, longitude (degrees) and height.
    receiver : str
        Its name; by default that of the file.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    GtvalError
        If a library is missing that reads it.

    Examples
    --------
    >>> drive = gtval.testing.make_drive(folder, seed=1)
    >>> gtval.read_fixes(folder / "rtk" / "rear.nmea").receiver
    'rear'
    """
    file = Path(path)
    return read_receiver(file, Stated(receiver or file.stem))


@said_plainly
def find_offsets(records: Sequence[Fixes], *, eta: float = 1.75) -> Offsets:
    """Offsets between receivers on different base stations, and the distances of their antennas.

    Parameters
    ----------
    records : sequence of Fixes
        Three or more on one vehicle; the first has offset 0.
    eta : float
        Ratio of the vertical to the horizontal standard deviation of a position.

    Returns
    -------
    Offsets
        ``offsets`` in the local frame at the first fixed position of the first receiver (x east,
        y north, z up) and ``distances``, metres, with their ``covariance``.

    Raises
    ------
    GtvalError
        If there are fewer than two receivers, or ten times at which all are RTK fixed.

    Notes
    -----
    Blanco, Moreno and Gonzalez, Autonomous Robots 27 (2009), Eq. 6 to 9.

    Examples
    --------
    >>> drive = gtval.testing.make_drive(folder, seed=1)
    >>> offsets = gtval.find_offsets(drive.records)
    >>> bool(abs(offsets.distances - drive.distances).max() < 0.01)
    True
    """
    return estimate_offsets(_steps(records), eta=eta)


@said_plainly
def find_path(
    records: Sequence[Fixes],
    offsets: Offsets,
    heights: Sequence[float],
    *,
    others: npt.ArrayLike | None = None,
) -> VehiclePath:
    """The poses of a vehicle wherever all its receivers are RTK fixed together.

    Parameters
    ----------
    records : sequence of Fixes
        As for `find_offsets`: the rear receiver, the front left one, the front right one, others.
    offsets : Offsets
        Of the same records; times whose fixes they call false are left out.
    heights : (3,) sequence of float
        z of the first three antennas on the vehicle, metres.
    others : (r - 3, 3) array_like, optional
        Rough places of further antennas on the vehicle, metres: x forward, y left, z up.

    Returns
    -------
    VehiclePath
        ``poses`` (n, 6) as x, y, z, yaw, pitch, roll in the local frame of `find_offsets` with
        ``covariances``; `path_table` makes a pose table of it.

    Raises
    ------
    GtvalError
        If the antennas fit no triangle, or at no time are all receivers RTK fixed.

    Notes
    -----
    Blanco, Moreno and Gonzalez, Autonomous Robots 27 (2009), Eq. 10 to 12.

    Examples
    --------
    >>> drive = gtval.testing.make_drive(folder, seed=1)
    >>> path = gtval.find_path(drive.records, gtval.find_offsets(drive.records), drive.heights)
    >>> path.poses.shape == (len(path), 6)
    True
    """
    steps = _steps(records)
    rows = np.flatnonzero(steps.complete)
    rough = None if others is None else np.asarray(others, dtype=float)
    antennas = antenna_positions(offsets.distances, np.asarray(heights, dtype=float), rough)
    return vehicle_path(steps.select(rows[offsets.weights > 0]), offsets, antennas)


@said_plainly
def path_table(path: VehiclePath) -> PoseTable:
    """A path as the pose table of a system 'rtk', to be compared or written.

    Parameters
    ----------
    path : VehiclePath
        Of `find_path`.

    Returns
    -------
    PoseTable
        x, y, z, yaw, pitch, roll in the local frame of the path, named by their times in seconds
        since 1970 UTC, with what the poses share.

    Examples
    --------
    >>> drive = gtval.testing.make_drive(folder, seed=1)
    >>> path = gtval.find_path(drive.records, gtval.find_offsets(drive.records), drive.heights)
    >>> gtval.path_table(path).ids[0]
    '1712739600.000'
    """
    return vehicle_table(path)


def _steps(records: Sequence[Fixes]) -> Steps:
    """All records by their common times, in the local frame."""
    fixed = records[0].geodetic[records[0].fixed]
    if len(fixed) == 0:
        raise GtvalError(f"receiver {records[0].receiver} is never RTK fixed")
    latitude, longitude, height = (float(value) for value in fixed[0])
    return common_steps(records, LocalFrame(latitude, longitude, height))
