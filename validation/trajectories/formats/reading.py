"""Telling the format of a file, and reading it."""

from collections.abc import Callable, Mapping
from pathlib import Path

from validation.errors import GtvalError, InputError, Problem
from validation.poses.trajectory import Trajectory
from validation.text_files.time_units import SCALES
from validation.trajectories.formats.assembly import assembled
from validation.trajectories.formats.bags import MAGIC, bag_fault, read_bag
from validation.trajectories.formats.bare_columns import (
    EUROC,
    EUROC_STATE,
    KITTI,
    RAWSEEDS,
    RAWSEEDS_COVARIANCE,
    TUM,
    TUM_COVARIANCE,
    first_row,
    read_bare_euroc,
    read_kitti,
    read_rawseeds,
    read_tum,
    read_tum_covariance,
    separator_in,
)
from validation.trajectories.formats.motion_capture import (
    motion_capture_fault,
    read_motive,
    read_qualisys,
    read_vicon,
)
from validation.trajectories.formats.named_columns import Header, find_header, read_named
from validation.trajectories.formats.rawlog_objects import is_rawlog
from validation.trajectories.formats.records import Records
from validation.trajectories.formats.source import (
    HEAD_BYTES,
    Asked,
    Source,
    is_number,
    open_head,
    open_source,
)
from validation.trajectories.formats.total_station import (
    gsi_fault,
    landxml_fault,
    read_gsi,
    read_landxml,
)


def _read_euroc(source: Source, asked: Asked) -> Records:
    """EuRoC's ground truth with its header, or without."""
    header = find_header(source.lines[:200])
    return read_bare_euroc(source, asked) if header is None else _named_euroc(source)


def _named_euroc(source: Source) -> Records:
    records = read_named(source, "euroc")
    if records.unit is None:
        records.unit, records.assumed = "ns", True
    return records


READERS: Mapping[str, Callable[[Source, Asked], Records]] = {
    "csv": lambda source, _: read_named(source),
    "tum": read_tum,
    "tum_covariance": read_tum_covariance,
    "kitti": read_kitti,
    "euroc": _read_euroc,
    "rawseeds": read_rawseeds,
    "motive": read_motive,
    "vicon": read_vicon,
    "qualisys": read_qualisys,
    "gsi": read_gsi,
    "landxml": read_landxml,
    "bag": read_bag,
}
"""Formats that can be read, by name."""
NAMES = {
    "gtval": "csv",
    "rosbag1": "bag",
    "rosbag2": "bag",
    "mcap": "bag",
    "openvins": "tum_covariance",
}
"""Other names for them."""
WIDTHS = {
    "tum": (len(TUM),),
    "tum_covariance": (len(TUM_COVARIANCE),),
    "kitti": (len(KITTI),),
    "rawseeds": (len(RAWSEEDS), len(RAWSEEDS_COVARIANCE)),
    "euroc": (8, len(EUROC), len(EUROC_STATE)),
}
"""Numbers in a row of the formats that are told by it."""


def read_trajectory(
    path: Path,
    *,
    format: str | None = None,  # noqa: A002  (the word that users know)
    system: str | None = None,
    unit: str | None = None,
    topic: str | None = None,
    times: Path | None = None,
    degrees: bool | None = None,
    body: str | None = None,
    up: str | None = None,
) -> Trajectory:
    """The trajectory in a file, whatever its format.

    Parameters
    ----------
    path : Path
        A file, compressed with gzip or not, or the folder of a ROS 2 bag.
    format : str, optional
        One of `READERS`; by default told from the content and the name.
    system : str, optional
        Name of the system; by default the file's name without its endings.
    unit : {"s", "ms", "us", "ns"}, optional
        Of the stamps, where the file does not tell it.
    topic : str, optional
        Of a bag.
    times : Path, optional
        File with one time a line, for KITTI poses and points without times.
    degrees : bool, optional
        Whether angles are in degrees, where the file does not tell it.
    body : str, optional
        Rigid body of a motion capture, child frame of a transform.
    up : {"y", "z"}, optional
        Axis of a motion capture that points up.

    Returns
    -------
    Trajectory
        Its provenance has the format, the unit of the stamps, and notes on what was left out,
        sorted, or taken for granted.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place; naming the formats tried if none or
        several fit.
    GtvalError
        If a library is missing, or an option is none.
    """
    path = Path(path)
    if unit is not None and unit not in SCALES:
        raise GtvalError(f"'{unit}' is no unit of time; use {', '.join(SCALES)}")
    if up not in {None, "y", "z"}:
        raise GtvalError(f"'{up}' is no axis that points up; use y or z")
    asked = Asked(unit, topic, times, degrees, body, up)
    form = None if format is None else NAMES.get(format, format)
    if form is not None and form not in READERS:
        raise GtvalError(f"'{format}' is no format; there are {', '.join(READERS)}")
    source = _opened(path)
    if is_rawlog(source.data):
        raise source.error(RAWLOG)
    if form is None:
        form = _only(path, faults(source))
    if b"\0" in source.data[:HEAD_BYTES] and form != "bag":
        raise source.error("this is a binary file, not text")
    if form == "bag" and (fault := bag_fault(path, source.data)):
        raise source.error(f"not a bag: {fault}")
    return assembled(READERS[form](source, asked), asked, system)


def _opened(path: Path) -> Source:
    """A file as a whole; of a bag only its beginning, as its reader opens it again."""
    if path.is_dir():
        return Source(path, b"")
    try:
        with path.open("rb") as stream:
            head = stream.read(16)
    except (OSError, ValueError):
        head = b""
    return Source(path, head) if head.startswith(MAGIC) else open_source(path)


def _only(path: Path, why: Mapping[str, str | None]) -> str:
    """The one format that fits.

    Raises
    ------
    InputError
        If none fits, with the reason for each; if several do.
    """
    fitting = [name for name, fault in why.items() if fault is None]
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        raise InputError(
            [
                Problem(
                    path,
                    f"this may be {' or '.join(fitting)}: {AMBIGUOUS}. Say which with --from "
                    f"{' or --from '.join(fitting)}",
                )
            ]
        )
    alike: dict[str | None, list[str]] = {}
    for name, fault in why.items():
        alike.setdefault(fault, []).append(name)
    reasons = "; ".join(f"{', '.join(names)}: {fault}" for fault, names in alike.items())
    raise InputError([Problem(path, f"no format of a trajectory fits. {reasons}")])


RAWLOG = (
    "this is a rawlog of MRPT: sensors' records, no trajectory. Its laser scans are made one by "
    '`gtval laser drive` ([laser_drive] format = "rawlog"), its GPS positions by `gtval rtk` '
    '([[rtk.receivers]] format = "rawlog")'
)
AMBIGUOUS = "eight columns without names, with qw last (tum) or first (euroc)"
"""The one case in which the content does not decide."""


def faults(source: Source) -> dict[str, str | None]:
    """For every format why the file is not of it; None where it fits."""
    bag = bag_fault(source.path, source.data[:16])
    if bag is None:
        return {name: None if name == "bag" else "this is a bag" for name in READERS}
    if source.path.is_dir() or b"\0" in source.data[:HEAD_BYTES]:
        binary = "this is a folder" if source.path.is_dir() else "this is a binary file, not text"
        return {name: bag if name == "bag" else binary for name in READERS}
    why: dict[str, str | None] = dict.fromkeys(READERS)
    why["bag"] = bag
    for name in ("motive", "vicon", "qualisys"):
        why[name] = motion_capture_fault(source, name)
    why["gsi"], why["landxml"] = gsi_fault(source), landxml_fault(source)
    special = [n for n in ("motive", "vicon", "qualisys", "gsi", "landxml") if why[n] is None]
    tables = ("csv", *WIDTHS)
    if special:
        return why | dict.fromkeys(tables, f"this is {special[0]}")
    header = find_header(source.lines[:200])
    return why | (_bare_faults(source) if header is None else _named_faults(header))


def _named_faults(header: Header) -> dict[str, str | None]:
    """Why a table with named columns is of none or one of the formats that have some."""
    if "pose" in header.headings and header.names[header.headings["pose"].column].strip() == "pose":
        said = "the column 'pose' makes this a table of named stops"
        return dict.fromkeys(("csv", *WIDTHS), said)
    if header.lacks:
        named = ", ".join(f"'{name}'" for name in header.names[:8])
        said = f"no column for {', '.join(header.lacks)} among {named}"
        return dict.fromkeys(("csv", *WIDTHS), said)
    form = "csv"
    wanted = ["time", "x", "y", "z", "qx", "qy", "qz", "qw"]
    lower = [name.strip().lower() for name in header.names]
    if any(name.startswith("p_rs") for name in lower):
        form = "euroc"
    elif lower[8:9] == ["pr11"] and header.order[:8] == wanted:
        form = "tum_covariance"
    elif header.order == wanted and header.separator == " ":
        form = "tum"
    why: dict[str, str | None] = dict.fromkeys(("csv", *WIDTHS), f"its columns are those of {form}")
    return why | {form: None}


def _bare_faults(source: Source) -> dict[str, str | None]:
    """Why rows of numbers are of none or some of the formats that a count tells."""
    row, separator = first_row(source), separator_in(source)
    numbers = sum(map(is_number, row))
    why: dict[str, str | None] = {"csv": "the columns have no names"}
    for name, widths in WIDTHS.items():
        counts = " or ".join(map(str, widths))
        why[name] = None if len(row) in widths else f"{len(row)} columns, not {counts}"
        if why[name] is None and numbers < len(row) / 2:
            why[name] = "the rows are not of numbers"
    if why["euroc"] is None and separator == " ":
        why["euroc"] = "blanks between the columns, not commas"
    if why["tum"] is None and why["euroc"] is None:
        _told_by_name(source, why)
    if why["rawseeds"] is None and len(row) == 4 and len(row[0].partition(".")[0]) > 12:
        why["rawseeds"] = "stamps of more than 12 digits; RAWSEEDS has seconds. Name the columns"
    return why


def _told_by_name(source: Source, why: dict[str, str | None]) -> None:
    """Eight columns with commas: the ending '.tum' tells them, else both stay possible."""
    if source.suffix == ".tum":
        why["euroc"] = "the name ends with .tum"


def is_trajectory(path: Path) -> bool:
    """Whether a file looks like poses at times, not like a table of named stops; cheap.

    Only its beginning is read. A file that is missing, or of none of the formats, is none; one that
    may be of two is one.
    """
    path = Path(path)
    try:
        if path.is_dir():
            return bag_fault(path, b"") is None
        source = open_head(path)
        if not source.data.strip() or source.data.startswith((b"\xff\xfe", b"\xfe\xff")):
            return False
        return any(fault is None for fault in faults(source).values())
    except (OSError, ValueError, GtvalError):
        return False


def format_of(path: Path) -> str:
    """The name of a file's format.

    Raises
    ------
    InputError
        If none or several fit.
    """
    return _only(path, faults(_opened(path)))
