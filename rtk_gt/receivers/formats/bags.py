"""Positions in bags of ROS and MCAP files: NavSatFix, GPSFix, and NMEA sentences."""

from pathlib import Path
from typing import Any

import numpy as np

from rtk_gt.receivers.fixes import AUTONOMOUS, DGPS, RTK_FIXED, RTK_FLOAT, SBAS, Fixes, Ints
from rtk_gt.receivers.formats.nmea import nmea_fixes
from validation.poses.angles import Array
from validation.trajectories.formats.bags import header_stamps, topic_messages
from validation.trajectories.formats.source import Source

NAV, SENTENCE = "sensor_msgs/msg/NavSatFix", "nmea_msgs/msg/Sentence"
GPS = ("gps_msgs/msg/GPSFix", "gps_common/msg/GPSFix")
KINDS = (NAV, *GPS, SENTENCE)
GPS_STATUS = {
    0: AUTONOMOUS, 1: SBAS, 2: DGPS, 18: DGPS, 33: SBAS, 19: RTK_FIXED, 20: RTK_FLOAT,
}  # fmt: skip
"""Status of a GPSFix: fix, SBAS, ground based, DGPS, WAAS, RTK fixed and float."""
FIXED_SIGMA = 0.1
"""Metres of level sigma up to which a ground-based fix counts as RTK-fixed. NavSatFix has one
status for fixed and float; receivers state one to three centimetres of fixed ambiguities, and
decimetres of float ones."""
TOLD_BY_SIGMA = (
    "NavSatFix does not tell RTK fixed from float: where the stated level sigma is at most "
    f"{100 * FIXED_SIGMA:g} cm a fix with ground corrections is taken as fixed."
)


def bag_fixes(path: Path, receiver: str, topic: str | None = None) -> Fixes:
    """The fixes on one topic of a bag.

    Parameters
    ----------
    path : Path
        The file, or the folder of a ROS 2 bag.
    receiver : str
        Name for the record.
    topic : str, optional
        Of the receiver; by default the only one with positions.

    Raises
    ------
    GtvalError
        If rosbags is not installed.
    InputError
        If the bag is damaged or has no such topic, or several and none is stated.
    """
    source = Source(path, b"")
    _, kind, messages = topic_messages(source, KINDS, topic, "positions")
    if kind == SENTENCE:
        lines = [f"{received / 1e9:.6f} {message.sentence}" for received, message in messages]
        text = "\n".join(line.rstrip() for line in lines)
        return nmea_fixes(path, text.encode("latin-1", errors="replace"), receiver)
    stamps, _, notes = header_stamps(messages)
    found = [message for _, message in messages]
    places = np.array([(m.latitude, m.longitude, m.altitude) for m in found], dtype=float)
    covariances = np.array([m.position_covariance for m in found], dtype=float).reshape(-1, 3, 3)
    unknown = np.array([m.position_covariance_type for m in found]) == 0
    covariances[unknown | ~(np.diagonal(covariances, axis1=1, axis2=2) > 0).all(1)] = np.nan
    status = np.array([int(m.status.status) for m in found])
    good = (status >= 0) & np.isfinite(places).all(1) & (np.abs(places[:, 0]) <= 90)
    if not good.any():
        raise source.error("no message has a fix")
    gps = kind in GPS
    kinds = _gps_kinds(status) if gps else _nav_kinds(status, covariances)
    if not gps and ((status == 2) & good).any():
        notes.append(TOLD_BY_SIGMA)
    order = np.flatnonzero(good)
    order = order[np.argsort(stamps[order], kind="stable")]
    later = np.diff(stamps[order], prepend=stamps[order[0]] - 1) > 0
    counts = {"message of the same time left out": int((~later).sum())} if not later.all() else {}
    order = order[later]
    return Fixes(
        receiver=receiver,
        times=stamps[order] / 1e9,
        geodetic=np.column_stack([np.radians(places[order, :2]), places[order, 2]]),
        kinds=kinds[order],
        satellites=_satellites(found, order, gps),
        hdop=_hdop(found, order, gps),
        covariances=covariances[order],
        lines=order + 1,
        source=path,
        notes=tuple(notes),
        tolerated=counts,
        without_fix=int((~good).sum()),
    )


def _satellites(found: list[Any], order: Ints, gps: bool) -> Ints:
    """Of the messages of GPSFix; -1 where not told."""
    if not gps:
        return np.full(len(order), -1)
    return np.array([int(found[row].status.satellites_used) for row in order])


def _hdop(found: list[Any], order: Ints, gps: bool) -> Array:
    """Of the messages of GPSFix; NaN where not told."""
    if not gps:
        return np.full(len(order), np.nan)
    values = np.array([float(found[row].hdop) for row in order])
    return np.where(values > 0, values, np.nan)


def _gps_kinds(status: Ints) -> Ints:
    return np.array([GPS_STATUS.get(int(one), AUTONOMOUS) for one in status])


def _nav_kinds(status: Ints, covariances: Array) -> Ints:
    """Ground-based fixes are fixed or float by what they state; fixed where they state nothing."""
    level = np.sqrt(np.maximum(covariances[:, 0, 0], covariances[:, 1, 1]))
    ground = np.where(level > FIXED_SIGMA, RTK_FLOAT, RTK_FIXED)
    return np.select([status == 2, status == 1], [ground, np.int64(SBAS)], np.int64(AUTONOMOUS))
