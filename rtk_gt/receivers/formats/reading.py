"""A receiver's file of any kind: told by its content, read by its reader."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

import numpy as np

from rtk_gt.receivers.baselines import Baselines
from rtk_gt.receivers.digits import decimal_digit, level_digit
from rtk_gt.receivers.fixes import Fixes
from rtk_gt.receivers.formats.bags import bag_fixes
from rtk_gt.receivers.formats.fix_csv import csv_fixes, csv_metres
from rtk_gt.receivers.formats.foreign import foreign
from rtk_gt.receivers.formats.gpx import gpx_fixes
from rtk_gt.receivers.formats.nmea import nmea_fixes
from rtk_gt.receivers.formats.novatel import LOGS, novatel_fixes
from rtk_gt.receivers.formats.packed import contents, inner_suffix
from rtk_gt.receivers.formats.rawlog import rawlog_of
from rtk_gt.receivers.formats.rtklib import BARE, pos_baselines, pos_fixes
from rtk_gt.receivers.formats.ubx import SYNC, ubx_baselines, ubx_fixes
from rtk_gt.receivers.utm import geodetic_of_utm
from validation.errors import GtvalError, InputError, Problem
from validation.pieces.results import kept_result
from validation.poses.earth_frames import LocalFrame
from validation.trajectories.formats.bags import MAGIC, bag_fault
from validation.trajectories.formats.rawlog_objects import is_rawlog

FORMATS = ("nmea", "rtklib", "rawlog", "csv", "ubx", "gpx", "novatel", "bag")
ENDINGS = {
    ".nmea": "nmea", ".ubx": "ubx", ".pos": "rtklib", ".llh": "rtklib", ".rawlog": "rawlog",
    ".csv": "csv", ".gpx": "gpx", ".mcap": "bag", ".bag": "bag",
}  # fmt: skip
HEAD = 4096
_SENTENCE = re.compile(rb"\$(?:G[A-Z]|BD|QZ)[A-Z]{3},")
_NOVATEL = re.compile(rb"(?m)^#(?:" + "|".join(LOGS).encode() + rb"),")
_BARE = re.compile(BARE.pattern.encode())


@dataclass(frozen=True)
class Stated:
    """What campaign.toml says of a receiver's file.

    Parameters
    ----------
    receiver : str
        Name for the record.
    form : str
        One of `FORMATS`, or 'auto'.
    label : str
        Name inside a rawlog, or topic of a bag.
    day : date, optional
        Of the first sentence of a log without dates.
    skip_damaged : bool, optional
        See `read_nmea`.
    all_fixed : bool
        Whether fixes whose kind a file cannot tell are RTK-fixed.
    coordinates : str
        'degrees', 'utm' or 'local'.
    zone : str
        Of UTM: '32N'.
    frame : LocalFrame, optional
        That local coordinates belong to.
    """

    receiver: str
    form: str = "auto"
    label: str = ""
    day: date | None = None
    skip_damaged: bool | None = None
    all_fixed: bool = False
    coordinates: str = "degrees"
    zone: str = ""
    frame: LocalFrame | None = None


def read_receiver(path: Path, stated: Stated) -> Fixes:
    """The fixes of a file of any kind that is known, compressed or not, and how fine they are.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place, or that the kind is not known.
    GtvalError
        If a library is missing.
    """
    found = _read(path, stated)
    if stated.coordinates != "degrees":
        return found
    return replace(found, level_digit=level_digit(found.geodetic[found.fixed]))


def _read(path: Path, stated: Stated) -> Fixes:
    """The fixes of a file, by the reader of its kind."""
    form, data = _told(path, stated)
    if form == "bag":
        return bag_fixes(path, stated.receiver, stated.label or None)
    return _fixes_of(form, path, data, stated)


@kept_result()
def _fixes_of(form: str, path: Path, data: bytes, stated: Stated) -> Fixes:
    """The fixes of the content of a file."""
    if stated.coordinates != "degrees":
        if form != "csv":
            said = f"coordinates in metres are read of tables (csv), not of {form}"
            raise InputError([Problem(path, said, field="coordinates", value=stated.coordinates)])
        return _of_metres(path, data, stated)
    name = stated.receiver
    readers: dict[str, Callable[[], Fixes]] = {
        "nmea": lambda: nmea_fixes(
            path, data, name, day=stated.day, skip_damaged=stated.skip_damaged
        ),
        "rtklib": lambda: pos_fixes(path, data, name),
        "csv": lambda: csv_fixes(path, data, name, stated.day),
        "ubx": lambda: ubx_fixes(path, data, name),
        "gpx": lambda: gpx_fixes(path, data, name, all_fixed=stated.all_fixed),
        "novatel": lambda: novatel_fixes(path, data, name),
        "rawlog": lambda: _of_rawlog(path, data, stated),
    }
    return readers[form]()


def read_baselines(path: Path, stated: Stated) -> Baselines:
    """From a moving base to a receiver: of RTKLIB, u-blox, or a table with east, north, height.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place, or for other kinds of files.
    """
    form, data = _told(path, stated)
    if form == "rtklib":
        return pos_baselines(path, data, stated.receiver)
    if form == "ubx":
        return ubx_baselines(path, data, stated.receiver)
    if form != "csv":
        said = (
            f"baselines from a moving base are read of RTKLIB (.pos), u-blox (.ubx) and tables, "
            f"not of {form}"
        )
        raise InputError([Problem(path, said, field="base")])
    record, metres = csv_metres(path, data, stated.receiver, stated.day)
    return Baselines(
        stated.receiver, record.times, metres, record.kinds, record.covariances, record.lines, path
    )


def _told(path: Path, stated: Stated) -> tuple[str, bytes]:
    """The kind of a file, and its contents; of bags none, as their reader opens them again."""
    if path.is_dir():
        if bag_fault(path, b""):
            said = "a folder, and no bag (it has no metadata.yaml); name the file in it"
            raise InputError([Problem(path, said)])
        return "bag", b""
    try:
        with path.open("rb") as stream:
            head = stream.read(16)
    except OSError:
        head = b""
    if head.startswith(MAGIC[:2]) or stated.form == "bag":
        return "bag", b""
    data = contents(path)
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):  # PowerShell writes so what it redirects
        data = data.decode("utf-16", errors="replace").encode()
    form = stated.form if stated.form != "auto" else form_of(path, data)
    stranger = foreign(data) if form not in {"gpx", "ubx", "rawlog"} else None
    if stranger is not None:
        raise InputError([Problem(path, f"this is {stranger}", 1)])
    if form is None:
        said = (
            "a kind of file that neither its content nor its name tells; set format to one of "
            f"{', '.join(FORMATS)}"
        )
        raise InputError([Problem(path, said)])
    if not data.strip():
        said = "the file is empty; was it copied while it was written?"
        raise InputError([Problem(path, said, 1)])
    return form, data


def form_of(path: Path, data: bytes) -> str | None:
    """The kind of a file by its content, else by its name; None where neither tells."""
    head = data[:HEAD]
    signs = {
        "rawlog": is_rawlog(data),
        "ubx": SYNC in head,
        "gpx": b"<gpx" in head,
        "novatel": _NOVATEL.search(data[: 100 * HEAD]),
        "rtklib": head.lstrip().startswith(b"%") or _BARE.match(head),
        "nmea": _SENTENCE.search(head),
    }
    told = next((form for form, sign in signs.items() if sign), None)
    if told is not None:
        return told
    form = ENDINGS.get(inner_suffix(path))
    if form is None and inner_suffix(path) in {".txt", ".log"}:
        first = head.splitlines()[0] if head.strip() else b""
        return "csv" if first.count(b",") + first.count(b";") + first.count(b"\t") > 2 else "nmea"
    return form


def _of_rawlog(path: Path, data: bytes, stated: Stated) -> Fixes:
    label = stated.label or stated.receiver
    found = rawlog_of(path, data).fixes
    if label not in found:
        expected = f"no receiver of that label; the rawlog has {', '.join(sorted(found))}"
        raise InputError([Problem(path, expected, field="label", value=label)])
    return replace(found[label], receiver=stated.receiver)


def _of_metres(path: Path, data: bytes, stated: Stated) -> Fixes:
    """The fixes of a table with UTM or local coordinates."""
    record, metres = csv_metres(path, data, stated.receiver, stated.day)
    record = replace(record, level_digit=decimal_digit(metres[record.fixed, :2]))
    if stated.coordinates == "local":
        if stated.frame is None:
            said = "local coordinates need the place of their origin: state [rtk.origin]"
            raise InputError([Problem(path, said, field="coordinates", value="local")])
        return replace(record, geodetic=stated.frame.to_geodetic(metres))
    try:
        places = geodetic_of_utm(metres[:, :2], stated.zone)
    except GtvalError as error:
        raise InputError([Problem(path, str(error), field="zone", value=stated.zone)]) from None
    return replace(record, geodetic=np.column_stack([places, metres[:, 2]]))
