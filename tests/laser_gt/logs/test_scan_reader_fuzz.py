"""Readers given damaged files: scans, or an error that names the file and the line."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from laser_gt.logs.carmen import read_carmen
from laser_gt.logs.decision_file import HEADER, read_decisions
from laser_gt.logs.rawseeds import read_rawseeds_hokuyo, read_rawseeds_odometry, read_rawseeds_sick
from laser_gt.logs.scan_csv import read_scan_csv, scan_csv
from laser_gt.scans.scan import Scan
from validation.errors import InputError

RANGES = [f"{2 + 0.05 * i:.2f}" for i in range(12)]
POSES = "1 2 0.5 1.1 2.1 0.6"
CARMEN = "".join(
    f"FLASER 12 {' '.join(RANGES)} {POSES} {time}.25 host 0.5\n"
    f"ROBOTLASER1 0 -1.570796 3.141593 0.2618 81.90 0.01 0 12 {' '.join(RANGES)} 0 "
    f"{POSES} 0 0 0 0 0 {time}.5 host 1.0\n"
    for time in range(3)
)
SICK = "".join(f"{time}.5, 12, 2, {', '.join(RANGES)}\n" for time in range(3))
HOKUYO = "".join(f"{time}.5, 12, {', '.join(RANGES)}\n" for time in range(3))
ODOMETRY = "".join(f"{time}.5, {time}, 10, 20, 0.5, 0.25, 1.5\n" for time in range(4))
CSV = scan_csv(
    [(str(stop), Scan(np.full(12, 2.5), np.linspace(-1, 1, 12), time=stop)) for stop in range(3)]
)
DECISIONS = (
    f'{",".join(HEADER)}\n2024-03-04T10:00,1,2,accept,,,,"me",\n,2,3,guess,0.5,0.1,-0.3,,"so"\n'
)
READERS = {
    "carmen": (read_carmen, CARMEN),
    "sick": (read_rawseeds_sick, SICK),
    "hokuyo": (read_rawseeds_hokuyo, HOKUYO),
    "odometry": (read_rawseeds_odometry, ODOMETRY),
    "csv": (read_scan_csv, CSV),
    "decisions": (lambda path: read_decisions(path, ("1", "2", "3")), DECISIONS),
}
WORDS = st.sampled_from(
    ["", "nan", "inf", "-inf", "-1", "1e400", "-0", "x", "9" * 30, '"', ",", "\n", "\0", "٣", "1_0"]
)


@st.composite
def damaged(draw, text):
    """The text cut, or with some of its words replaced, doubled or left out."""
    data = text
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(data)))
        end = draw(st.integers(start, min(start + 12, len(data))))
        kind = draw(st.sampled_from(["cut", "word", "text", "double"]))
        if kind == "cut":
            data = data[:end]
        elif kind == "word":
            data = data[:start] + draw(WORDS) + data[end:]
        elif kind == "text":
            data = data[:start] + draw(st.text(max_size=5)) + data[end:]
        else:
            data = data[:end] + data[start:]
    return data


@pytest.mark.parametrize("name", READERS)
@given(data=st.data())
@settings(
    max_examples=25,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
def test_a_damaged_file_is_read_or_refused_by_name(tmp_path, name, data):
    reader, text = READERS[name]
    path = tmp_path / f"{name}.txt"
    path.write_bytes(data.draw(damaged(text)).encode("utf-8", "surrogatepass"))
    _read_or_refused(reader, path)


@pytest.mark.parametrize("name", READERS)
@given(raw=st.binary(max_size=300))
@settings(
    max_examples=25,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
def test_any_bytes_are_read_or_refused_by_name(tmp_path, name, raw):
    reader, _ = READERS[name]
    path = tmp_path / "any.txt"
    path.write_bytes(raw)
    _read_or_refused(reader, path)


def _read_or_refused(reader, path):
    """What is read can be used, and what is not is named; nothing else is raised."""
    refused = None
    try:
        found = reader(path)
    except InputError as error:
        refused = error
    if refused is None:
        _check(found)
    else:
        assert refused.problems
        assert all(problem.file == path for problem in refused.problems)
        assert path.name in str(refused)


def _check(found):
    """What was read holds only numbers that can be used."""
    if isinstance(found, dict):
        guesses = [one.guess for one in found.values() if one.guess is not None]
        assert np.isfinite(np.array(guesses)).all()
        return
    if isinstance(found, tuple):
        assert all(np.isfinite(part).all() for part in found)
        return
    for record in found:
        assert isinstance(record.scan, Scan)
        assert np.isfinite(record.scan.points).all()
        for pose in (record.odometry, record.laser_odometry):
            assert pose is None or np.isfinite(pose).all()


@pytest.mark.parametrize("name", READERS)
def test_the_undamaged_file_is_read(tmp_path, name):
    reader, text = READERS[name]
    path = tmp_path / "good.txt"
    path.write_text(text, encoding="utf-8")
    found = reader(path)
    _check(found)
    assert len(found[0] if isinstance(found, tuple) else found) >= 3
