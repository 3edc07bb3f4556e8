"""Readers on damaged files: an answer or an error that names the place, never a traceback."""

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from data_samples.drives.drive import LEFT_SCANNER, DriveSettings, scan_along, simulate_drive
from data_samples.drives.files import nmea_text, scan_text
from rtk_gt.receivers.fix_checks import check_fixes
from rtk_gt.receivers.formats.fix_csv import read_fix_csv
from rtk_gt.receivers.formats.nmea import read_nmea
from rtk_gt.receivers.formats.rawlog import read_rawlog
from rtk_gt.receivers.formats.rtklib import read_pos
from rtk_gt.sensors.sensor_files import read_imu, read_line_scans, read_seen_points
from validation.errors import GtvalError, InputError

DRIVE = simulate_drive(0, DriveSettings(loops=1, straight=20.0))
NMEA = "\n".join(nmea_text(DRIVE.records[0]).splitlines()[:20]) + "\n"
CSV = "time,latitude,longitude,height,fix,sigma_east,sigma_north,sigma_up\n" + "".join(
    f"{1712739600 + k},36.714{k:03d},-4.478{k:03d},48.{k},fixed,0.006,0.007,0.012\n"
    for k in range(12)
)
POS = (
    "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,5:single,ns=# of satellites)\n"
    "%  UTC                   latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)"
    "   sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio\n"
) + "".join(
    f"2024/04/10 09:00:{k:02d}.000   36.71445{k:04d}   -4.47895{k:04d}    48.12{k:02d}   1  10"
    "   0.0080   0.0060   0.0150   0.0010   0.0010  -0.0010   1.00    9.9\n"
    for k in range(12)
)
SCANS = scan_text(scan_along(DRIVE, LEFT_SCANNER, np.random.default_rng(0), every=4.0, beams=9))
IMU = "time,yaw,pitch,roll\n" + "".join(f"{k},0.{k},0.01,-0.02\n" for k in range(9))
SEEN = "time,x,y,z,u,v\n" + "".join(f"{k},1.{k},2,3,400,300.5\n" for k in range(9))
READERS = {
    "nmea": (lambda path: read_nmea(path, "rear"), NMEA, ".nmea"),
    "pos": (lambda path: read_pos(path, "rear"), POS, ".pos"),
    "csv": (lambda path: read_fix_csv(path, "rear"), CSV, ".csv"),
    "scans": (read_line_scans, SCANS, ".csv"),
    "imu": (read_imu, IMU, ".csv"),
    "seen points": (read_seen_points, SEEN, ".csv"),
    "rawlog": (read_rawlog, "not a rawlog", ".rawlog"),
}
FUZZ = settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@st.composite
def damages(draw):
    """What happens to files: a place (share of the length), and what is done there."""
    kind = draw(st.sampled_from(["cut", "insert", "replace", "delete", "swap", "twice"]))
    return kind, draw(st.floats(0, 1)), draw(st.text(min_size=1, max_size=4))


def damaged(text, damage):
    kind, share, junk = damage
    at = round(share * len(text))
    if kind == "cut":
        return text[:at]
    if kind == "insert":
        return text[:at] + junk + text[at:]
    if kind == "replace":
        return text[:at] + junk + text[at + len(junk) :]
    if kind == "delete":
        return text[:at] + text[at + 3 :]
    lines = text.splitlines(keepends=True)
    row = min(round(share * len(lines)), len(lines) - 1)
    if kind == "twice":
        return "".join([*lines[: row + 1], *lines[row:]])
    return "".join([*lines[row:], *lines[:row]])


def outcome_of(reader, path):
    """What was read, or the words of the error; any other exception fails the test."""
    try:
        return reader(path), ""
    except GtvalError as error:
        return None, str(error)


@pytest.mark.parametrize("name", READERS)
@given(damage=damages())
@example(damage=("insert", 0.5, "\0"))
@example(damage=("insert", 0.5, ","))
@example(damage=("cut", 0.0, "x"))
@example(damage=("replace", 0.99, "nan"))
@FUZZ
def test_damaged_files_give_an_answer_or_an_error_with_its_place(tmp_path, name, damage):
    reader, text, ending = READERS[name]
    path = tmp_path / f"file{ending}"
    path.write_text(damaged(text, damage), encoding="utf-8", errors="surrogatepass", newline="")
    found, said = outcome_of(reader, path)
    if found is None:
        assert path.name in said
    elif hasattr(found, "geodetic"):
        assert np.isfinite(found.geodetic).all()
        assert np.isfinite(found.times).all()


@pytest.mark.parametrize("name", READERS)
@given(junk=st.binary(max_size=300))
@FUZZ
def test_bytes_that_are_no_text(tmp_path, name, junk):
    reader, _, ending = READERS[name]
    path = tmp_path / f"junk{ending}"
    path.write_bytes(junk)
    found, said = outcome_of(reader, path)
    assert found is not None or path.name in said


def with_cell(text, line, column, value):
    rows = [row.split(",") for row in text.splitlines()]
    rows[line - 1][column] = value
    return "\n".join(",".join(row) for row in rows) + "\n"


@pytest.mark.parametrize(
    ("text", "column", "value", "field"),
    [
        (CSV, 1, "36;7", "latitude"),
        (CSV, 3, "48.1 l", "height"),
        (CSV, 2, "nan", "longitude"),
        (CSV, 1, "367144", "latitude"),
        (CSV, 0, "25:61", "time"),
        (CSV, 5, "-0.006", "sigma_east"),
    ],
)
def test_errors_name_file_line_field_and_value(tmp_path, text, column, value, field):
    path = tmp_path / "rear.csv"
    path.write_text(with_cell(text, 6, column, value))
    with pytest.raises(InputError) as raised:
        read_fix_csv(path, "rear")
    said = str(raised.value)
    for part in ("rear.csv", "line 6", field, value):
        assert part in said


def test_decimal_commas_are_refused_in_every_format(tmp_path):
    """36,714 in a comma-separated file makes a column too many; elsewhere it is no number."""
    for name, text in (("csv", CSV), ("pos", POS), ("nmea", NMEA)):
        reader, _, ending = READERS[name]
        path = tmp_path / f"comma{ending}"
        path.write_text(re.sub(r"(36)\.?(\d\d)", r"\1,\2", text, count=3))
        with pytest.raises(InputError) as raised:
            reader(path)
        assert raised.value.problems[0].line is not None


def test_exchanged_latitude_and_longitude_in_one_file(tmp_path):
    """Nothing in the file itself tells; the other receivers do."""
    records = []
    for name in ("rear", "left", "right"):
        text = CSV
        if name == "left":
            rows = [row.split(",") for row in CSV.splitlines()]
            text = "\n".join(",".join([r[0], r[2], r[1], *r[3:]]) for r in rows[1:])
            text = CSV.splitlines()[0] + "\n" + text + "\n"
        path = tmp_path / f"{name}.csv"
        path.write_text(text)
        records.append(read_fix_csv(path, name))
    with pytest.raises(InputError, match="exchanged") as raised:
        check_fixes(records)
    assert raised.value.problems[0].file.name == "left.csv"
