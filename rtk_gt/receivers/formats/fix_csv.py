"""Fixes in a CSV file: one row a fix, under the names that programs give their columns."""

from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path

import numpy as np

from rtk_gt.receivers.fixes import FIX_NAMES, NO_FIX, RTK_FIXED, RTK_FLOAT, Fixes, Ints
from rtk_gt.receivers.formats.packed import contents
from rtk_gt.receivers.formats.table_times import check_pace, table_times, time_columns
from validation.errors import InputError, Problem
from validation.poses.angles import Array
from validation.poses.earth_frames import ecef_from_geodetic
from validation.text_files.csv_tables import Column, CsvTable, read_csv
from validation.text_files.lengths import split_heading
from validation.text_files.table_rows import table_rows

QUALITY = (
    Column("date", required=False, blank=True),
    Column("fix", required=False, blank=True),
    Column("rtklib_q", "number", required=False, blank=True, low=0, high=7),
    Column("separation", "number", required=False, blank=True, low=-200, high=200, unit="m"),
    Column("satellites", "number", required=False, blank=True, low=0, high=200),
    Column("hdop", "number", required=False, blank=True, low=0, high=1000),
    *(
        Column(f"sigma_{axis}", "number", required=False, blank=True, low=1e-6, high=1e5, unit="m")
        for axis in ("east", "north", "up")
    ),
)
DEGREES = (
    Column("latitude", "number", low=-90, high=90, unit="degrees"),
    Column("longitude", "number", low=-180, high=360, unit="degrees"),
    Column("height", "number", low=-1000, high=20000, unit="m"),
)
METRES = (
    Column("east", "number", low=-1e8, high=1e8, unit="m"),
    Column("north", "number", low=-1e8, high=1e8, unit="m"),
    Column("height", "number", low=-1e5, high=1e5, unit="m"),
)
"""Of coordinates in metres: UTM, the local frame, or from a moving base."""
NAMES: Mapping[str, tuple[str, ...]] = {
    "date": ("utc_date", "day"),
    "latitude": ("lat", "latitude_deg", "lat_deg", "latitude_wgs84"),
    "longitude": ("lon", "lng", "long", "longitude_deg", "lon_deg", "longitude_wgs84"),
    "height": ("ellipsoidal_height", "ellipsoid_height", "height_ellipsoid", "hae", "height_m",
               "h", "altitude", "alt", "elevation", "up", "z", "u"),
    "east": ("easting", "utm_east", "utm_easting", "x", "e"),
    "north": ("northing", "utm_north", "utm_northing", "y", "n"),
    "fix": ("quality", "fix_quality", "gps_qual", "gps_quality", "fix_type", "fixtype", "status",
            "solution", "solution_status", "fix_status", "gga_quality", "mode"),
    "rtklib_q": ("q", "rtklib_quality"),
    "separation": ("geoid_separation", "undulation", "geoid", "geoid_height", "geoidal_separation"),
    "satellites": ("sats", "sat", "num_sats", "nsat", "nsats", "ns", "numsv", "num_sv", "num_sat",
                   "satellites_used", "number_of_satellites", "no_of_satellites"),
    "hdop": ("h_dop",),
    "sigma_east": ("sde", "std_east", "sd_east", "sigma_e", "east_sigma", "rms_east",
                   "easting_rms", "std_e", "lon_sigma", "longitude_sigma", "east_rms"),
    "sigma_north": ("sdn", "std_north", "sd_north", "sigma_n", "north_sigma", "rms_north",
                    "northing_rms", "std_n", "lat_sigma", "latitude_sigma", "north_rms"),
    "sigma_up": ("sdu", "std_up", "sd_up", "sigma_u", "up_sigma", "rms_up", "elevation_rms",
                 "std_u", "height_sigma", "vertical_rms", "up_rms"),
}  # fmt: skip
"""Other names of each column, in small letters, without units and with _ for blanks."""
MAKERS = ("fix_type", "fixtype", "status", "solution", "solution_status", "fix_status", "mode")
"""Names under which makers number kinds each in a way of their own: words only are read there."""
SEA = {"altitude", "alt", "elevation"}
MAX_BYTES = 500_000_000
HEAD = 20_000
"""Bytes of a file among which its header is looked for."""
_WORDS = {
    **{name.lower(): kind for kind, name in FIX_NAMES.items()},
    "fixed": RTK_FIXED, "fix": RTK_FIXED, "rtk_fixed": RTK_FIXED, "rtk fix": RTK_FIXED,
    "rtk_fix": RTK_FIXED, "rtkfixed": RTK_FIXED, "rtk-fixed": RTK_FIXED, "r": RTK_FIXED,
    "narrow_int": RTK_FIXED, "wide_int": RTK_FIXED, "l1_int": RTK_FIXED, "int": RTK_FIXED,
    "ambiguity fixed": RTK_FIXED, "float": RTK_FLOAT, "rtk_float": RTK_FLOAT,
    "rtkfloat": RTK_FLOAT, "rtk-float": RTK_FLOAT, "f": RTK_FLOAT, "narrow_float": RTK_FLOAT,
    "l1_float": RTK_FLOAT, "single": 1, "spp": 1, "standalone": 1, "gps": 1, "3d": 1, "2d": 1,
    "3d fix": 1, "psrdiff": 2, "differential": 2, "no_fix": NO_FIX, "none": NO_FIX,
    "invalid": NO_FIX, "ppp": 6, "dr": 6,
}  # fmt: skip
_RTKLIB = {0: NO_FIX, 1: RTK_FIXED, 2: RTK_FLOAT, 3: 9, 4: 2, 5: 1, 6: 6, 7: 6}


def read_fix_csv(path: Path, receiver: str) -> Fixes:
    """The fixes of a CSV file, compressed or not, in degrees; see `csv_fixes`."""
    return csv_fixes(path, contents(path, MAX_BYTES, "a table"), receiver)


def csv_fixes(path: Path, data: bytes, receiver: str, day: date | None = None) -> Fixes:
    """The fixes of the contents of a CSV file.

    Columns ``time`` (seconds since 1970 UTC, or ISO 8601 taken as UTC; hhmmss where ``day`` or a
    column ``date`` tells the day; or ``gps_week`` and ``tow``), ``latitude``,
    ``longitude`` in degrees, ``height`` above the ellipsoid; optional ``fix`` (fixed, float,
    DGPS, ... or the number of GGA; fixed where blank), ``satellites``, ``hdop``,
    ``sigma_east``, ``sigma_north``, ``sigma_up``. Other common names of these are known, see
    `NAMES`.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    table, written, unit = _table(path, data, DEGREES)
    number = {name: np.array(values) for name, values in table.numbers.items()}
    places = np.column_stack(
        [
            np.radians(number["latitude"]),
            np.radians(number["longitude"]),
            number["height"] + np.nan_to_num(number["separation"]),
        ]
    )
    metres = ecef_from_geodetic(places)
    return _record(table, written, receiver, places, metres, (unit, day))


def csv_metres(
    path: Path, data: bytes, receiver: str, day: date | None = None
) -> tuple[Fixes, Array]:
    """The fixes of a CSV file with ``east``, ``north`` and ``height`` in metres, and these (n, 3).

    The places of the fixes are still open: what the metres count from the caller knows.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    table, written, unit = _table(path, data, METRES)
    metres = np.column_stack([np.array(table.numbers[one.name]) for one in METRES])
    nowhere = np.full(metres.shape, np.nan)
    return _record(table, written, receiver, nowhere, metres, (unit, day)), metres


def _table(
    path: Path, data: bytes, places: Sequence[Column]
) -> tuple[CsvTable, dict[str, str], str]:
    """The table, the name under which each column was written, and the unit of its times."""
    # The header is in the first lines; a sheet, which is an archive, is read as a whole.
    first = data if data.startswith(b"PK") else data[:HEAD].rpartition(b"\n")[0] or data
    rows = table_rows(path, MAX_BYTES, first)
    header = [cell.strip() for cell in rows[0][1]] if rows else []
    times = time_columns(path, rows[0][0] if rows else 1, header)
    columns = [*times.columns, *places, *QUALITY]
    renamed, written = dict(times.renamed), {}
    alike = {cell: split_heading(cell.lstrip("# ")) for cell in header}
    for column in columns[len(times.columns) :]:
        if any(name == column.name for name, _ in alike.values()):
            continue
        also = NAMES.get(column.name, ())
        found = next(
            (cell for one in also for cell, (name, _) in alike.items() if name == one), None
        )
        if found is not None:
            unit = alike[found][1]
            if column.unit == "degrees" and unit in {"rad", "radians"}:
                said = "radians; write degrees"
                raise InputError([Problem(path, said, rows[0][0], column.name, found)])
            of_length = column.unit == "m" and unit
            renamed[found] = f"{column.name} [{unit}]" if of_length else column.name
            written[column.name] = alike[found][0]
    for cell, (name, _) in alike.items():
        wanted = next((one for one in columns[len(times.columns) :] if one.name == name), None)
        if wanted is not None and wanted.unit != "m" and cell != name:
            renamed[cell] = name
    given = None if not rows else rows[0][1]
    if given is not None:
        renamed = {cell: renamed[cell.strip()] for cell in given if cell.strip() in renamed}
    table = read_csv(path, columns, max_bytes=MAX_BYTES, data=data, renamed=renamed)
    if len(table) == 0:
        table.raise_problems()
        raise InputError([Problem(path, "no rows below the header; was the file cut?", 1)])
    return table, written, times.unit


def _record(
    table: CsvTable,
    written: Mapping[str, str],
    receiver: str,
    places: Array,
    metres: Array,
    told: tuple[str, date | None],
) -> Fixes:
    times, notes, sure = table_times(table, *told)
    kinds = _kinds(table, written)
    check_pace(table, times, metres, kinds == RTK_FIXED, stated=sure)
    table.raise_problems()
    n = len(table)
    if written.get("height") in SEA and not np.isfinite(table.numbers["separation"]).any():
        notes.append(f"The column {written['height']} is taken as height above the ellipsoid.")
    covariances = np.broadcast_to(np.nan, (n, 3, 3))
    sigmas = np.column_stack(
        [np.array(table.numbers[f"sigma_{axis}"]) for axis in ("east", "north", "up")]
    )
    stated = np.isfinite(sigmas).all(1)
    if stated.any():
        covariances = covariances.copy()
        covariances[stated] = sigmas[stated][:, :, None] ** 2 * np.eye(3)
    return Fixes(
        receiver=receiver,
        times=times,
        geodetic=places,
        kinds=kinds,
        satellites=np.nan_to_num(table.numbers["satellites"], nan=-1).astype(np.int64),
        hdop=np.array(table.numbers["hdop"]),
        covariances=covariances,
        lines=np.array(table.lines, dtype=np.int64),
        source=table.path,
        notes=tuple(notes),
    )


def _kinds(table: CsvTable, written: Mapping[str, str]) -> Ints:
    """(n,) kinds of fixes; RTK-fixed where the table tells none."""
    q = np.array(table.numbers["rtklib_q"])
    if np.isfinite(q).any() and not any(table.text["fix"]):
        return np.array([_RTKLIB.get(int(one), 1) if one == one else 1 for one in q])  # noqa: PLR0124
    by_maker = written.get("fix") in MAKERS
    return np.array(
        [_kind(table, row, text, by_maker) for row, text in enumerate(table.text["fix"])],
        dtype=np.int64,
    )


def _kind(table: CsvTable, row: int, text: str, by_maker: bool) -> int:
    if not text:
        return RTK_FIXED
    kind = _WORDS.get(text.strip().lower())
    if kind is not None:
        return kind
    if text.isdigit() and int(text) in FIX_NAMES and not by_maker:
        return int(text)
    said = "not a fix kind; expected fixed, float, DGPS, autonomous or 0 to 9"
    if text.isdigit() and by_maker:
        said = (
            "makers number kinds each in a way of their own; name the column fix if these are "
            "GGA's (4 fixed, 5 float), or Q if they are RTKLIB's (1 fixed, 2 float), or use words"
        )
    table.flag(row, "fix", said)
    return RTK_FIXED
