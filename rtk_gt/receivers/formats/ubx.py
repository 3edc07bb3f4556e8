"""u-blox logs (.ubx): positions of NAV-PVT and NAV-HPPOSLLH, errors of NAV-COV, HDOP of NAV-DOP.

Messages of one epoch have one iTOW. Their content is decoded by pyubx2 (the extra ``gnss``), after
the u-blox interface descriptions; frames are found, and their checksums tested, here.
"""

import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from rtk_gt.receivers.baselines import Baselines
from rtk_gt.receivers.fixes import AUTONOMOUS, DGPS, ESTIMATED, NO_FIX, RTK_FIXED, RTK_FLOAT, Fixes
from validation.errors import GtvalError, InputError, Problem

SYNC = b"\xb5\x62"
PVT, HIGH, COVARIANCE, DILUTION, RELATIVE = 0x07, 0x14, 0x36, 0x04, 0x3C
"""Numbers of NAV-PVT, NAV-HPPOSLLH, NAV-COV, NAV-DOP and NAV-RELPOSNED in the class NAV."""
TOW_AT = {PVT: 0, HIGH: 4, COVARIANCE: 0, DILUTION: 0, RELATIVE: 4}
"""Byte of the payload at which the time of week begins."""
LONGEST = 8192
"""Bytes of a payload; lengths beyond are a chance sync. The longest message has some 5000."""
NAV = 0x01


@dataclass
class _Epochs:
    """Messages by kind and time of week, with where each PVT began."""

    messages: dict[int, dict[int, Any]] = field(
        default_factory=lambda: {kind: {} for kind in TOW_AT}
    )
    order: list[tuple[int, int]] = field(default_factory=list)
    relative: list[tuple[int, Any, int]] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)


def frames(data: bytes, counts: Counter[str]) -> Iterator[tuple[int, int, int, bytes]]:
    """Place, class, number and whole frame of each message whose checksum holds; others counted."""
    at = data.find(SYNC)
    while at >= 0 and at + 8 <= len(data):
        length = int(struct.unpack_from("<H", data, at + 4)[0])
        end = at + 8 + length
        if length > LONGEST or end > len(data):
            counts["cut or damaged message skipped"] += 1
            at = data.find(SYNC, at + 2)
            continue
        body = np.frombuffer(data, np.uint8, length + 4, at + 2).astype(np.int64)
        first = int(body.sum()) & 255
        second = int((body * np.arange(len(body), 0, -1)).sum()) & 255
        if (first, second) != (data[end - 2], data[end - 1]):
            counts["damaged message skipped (checksum)"] += 1
            at = data.find(SYNC, at + 2)
            continue
        yield at, data[at + 2], data[at + 3], data[at:end]
        at = data.find(SYNC, end)


def _decoded(path: Path, data: bytes) -> _Epochs:
    try:
        from pyubx2 import UBXParseError, UBXReader  # noqa: PLC0415  (an extra)
    except ImportError:
        raise GtvalError(
            f"{path} is a log of u-blox: install what reads it, `pip install gtval[gnss]`, or let "
            "the receiver write NMEA"
        ) from None
    found = _Epochs()
    for at, kind, number, frame in frames(data, found.counts):
        if kind != NAV or number not in TOW_AT:
            continue
        try:
            message = UBXReader.parse(frame)
        except UBXParseError:
            found.counts["message of another version skipped"] += 1
            continue
        tow = int(struct.unpack_from("<I", frame, 6 + TOW_AT[number])[0])
        found.messages[number][tow] = message
        if number == PVT:
            found.order.append((tow, at))
        elif number == RELATIVE:
            found.relative.append((tow, message, at))
    return found


def ubx_fixes(path: Path, data: bytes, receiver: str) -> Fixes:
    """The fixes of the contents of a u-blox log.

    Returns
    -------
    Fixes
        ``lines`` are the bytes at which the messages begin. Without NAV-COV the level error, which
        is stated as one number, is the same in all directions.

    Raises
    ------
    GtvalError
        If pyubx2 is not installed.
    InputError
        If the log has no NAV-PVT with a position.
    """
    found = _decoded(path, data)
    rows, without = [], 0
    for tow, at in found.order:
        message = found.messages[PVT][tow]
        kind = kind_of(message)
        if kind == NO_FIX or not (message.validDate and message.validTime):
            without += 1
            continue
        rows.append(_row(found, tow, at, message, kind))
    if not rows:
        said = "no NAV-PVT message with a position; let the receiver write UBX-NAV-PVT"
        if found.relative:
            said += ", or, where it is a rover of a moving base, state `base` at the receiver"
        raise InputError([Problem(path, said)])
    table = np.array([row for row, _ in rows])
    return Fixes(
        receiver=receiver,
        times=table[:, 0],
        geodetic=np.column_stack([np.radians(table[:, 1:3]), table[:, 3]]),
        kinds=table[:, 4].astype(np.int64),
        satellites=table[:, 5].astype(np.int64),
        hdop=table[:, 6],
        covariances=np.array([covariance for _, covariance in rows]),
        lines=table[:, 7].astype(np.int64),
        source=path,
        tolerated=dict(found.counts),
        without_fix=without,
    )


def _row(
    found: _Epochs, tow: int, at: int, message: Any, kind: int
) -> tuple[list[float], np.ndarray[Any, Any]]:
    """Time, place in degrees and metres, kind, satellites, HDOP and byte; and the covariance."""
    high, stated = found.messages[HIGH].get(tow), found.messages[COVARIANCE].get(tow)
    dilution = found.messages[DILUTION].get(tow)
    best = high if high is not None and not high.invalidLlh else message
    covariance = np.diag([(best.hAcc / 1000) ** 2 / 2] * 2 + [(best.vAcc / 1000) ** 2])
    if stated is not None and stated.posCovValid:
        nn, ne, nd = stated.posCovNN, stated.posCovNE, stated.posCovND
        ee, ed, dd = stated.posCovEE, stated.posCovED, stated.posCovDD
        covariance = np.array([[ee, ne, -ed], [ne, nn, -nd], [-ed, -nd, dd]])
    hdop = float("nan") if dilution is None else float(dilution.hDOP)
    row = [utc_of(message), best.lat, best.lon, best.height / 1000, kind, message.numSV, hdop, at]
    return [float(value) for value in row], covariance


def utc_of(message: Any) -> float:
    """Seconds since 1970 of a NAV-PVT, whose second is rounded and corrected by nanoseconds."""
    minute = datetime(
        message.year, message.month, message.day, message.hour, message.min, tzinfo=UTC
    )
    return round(minute.timestamp() + float(message.second) + float(message.nano) * 1e-9, 4)


def kind_of(message: Any) -> int:
    """Kind of fix, as GGA numbers them, of a NAV-PVT."""
    if not message.gnssFixOk or message.fixType in {0, 5}:
        return NO_FIX
    if message.fixType == 1:
        return ESTIMATED
    if message.carrSoln:
        return RTK_FIXED if message.carrSoln == 2 else RTK_FLOAT
    return DGPS if message.diffSoln else AUTONOMOUS


def ubx_baselines(path: Path, data: bytes, receiver: str) -> Baselines:
    """From a moving base to the receiver, of NAV-RELPOSNED with the time of NAV-PVT.

    Raises
    ------
    InputError
        If the log has none with a time.
    """
    found = _decoded(path, data)
    times, east, kinds, covariances, lines = [], [], [], [], []
    for tow, message, at in found.relative:
        own = found.messages[PVT].get(tow)
        if own is None or not (own.validDate and own.validTime and message.relPosValid):
            continue
        times.append(utc_of(own))
        east.append([message.relPosE / 100, message.relPosN / 100, -message.relPosD / 100])
        kinds.append({2: RTK_FIXED, 1: RTK_FLOAT}.get(message.carrSoln, DGPS))
        sigmas = np.array([message.accE, message.accN, message.accD]) / 1000
        covariances.append(np.diag(sigmas**2))
        lines.append(at)
    if not times:
        said = "no valid NAV-RELPOSNED with a NAV-PVT of its time; let the rover write both"
        raise InputError([Problem(path, said)])
    return Baselines(
        receiver, np.array(times), np.array(east), np.array(kinds), np.array(covariances),
        np.array(lines), path,
    )  # fmt: skip
