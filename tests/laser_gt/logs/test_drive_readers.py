"""Logs of drives: CSM's JSON, BreezySLAM's, scans with times only, bags with odometry."""

import contextlib
import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_scan_reader_fuzz import damaged

from laser_gt.logs.breezyslam import BEAMS, read_breezyslam
from laser_gt.logs.csm_json import read_csm
from laser_gt.logs.read import LOGS
from laser_gt.logs.scan_csv import scan_csv
from laser_gt.scans.scan import Scan
from validation.errors import GtvalError, InputError

CSM = "".join(
    json.dumps(
        {
            "nrays": 5,
            "min_theta": -1.0,
            "max_theta": 1.0,
            "theta": [-1.0, -0.5, 0.0, 0.5, 1.0],
            "readings": [1.0, 2.0, None, 3.0, 4.0],
            "valid": [1, 1, 0, 1, 0],
            "odometry": [0.1 * second, 0.0, 0.0],
            "timestamp": [second, 250000],
        },
        indent=1,
    )
    + "\n"
    for second in range(3)
)
HEAD = "{time} 1 {left} {right}" + " 0" * 20
BREEZY = "".join(
    HEAD.format(time=100000 * n, left=100 * n, right=100 * n)
    + "".join(f" {1000 + beam}" for beam in range(BEAMS))
    + " \n"
    for n in range(3)
)


def test_csm_scans_have_their_rays_odometry_and_time(tmp_path):
    path = tmp_path / "log.json"
    path.write_text(CSM)
    first, second, _ = read_csm(path)
    assert first.scan.returned.tolist() == [True, True, False, True, False]
    assert np.allclose(first.scan.angles, [-1, -0.5, 0, 0.5, 1])
    assert (first.scan.time, second.scan.time) == (0.25, 1.25)
    assert np.allclose(second.odometry, [0.1, 0, 0])
    assert second.line > first.line


def test_csm_directions_that_are_null_are_spread_evenly_and_falling_ones_turned(tmp_path):
    path = tmp_path / "log.json"
    scan = {"min_theta": 1.0, "max_theta": -1.0, "theta": [None] * 3, "readings": [1, 2, 3]}
    path.write_text(json.dumps(scan))
    (found,) = read_csm(path)
    assert np.allclose(found.scan.angles, [-1, 0, 1])
    assert found.scan.ranges.tolist() == [3, 2, 1]
    assert np.isnan(found.scan.time)


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ("{}", 1, "no readings"),
        ('\n{"readings": [1, 2]}', 2, "directions"),
        ('{"readings": [1, "x"], "min_theta": 0, "max_theta": 1}', 1, "not a number"),
        ('{"readings": [1, 2], "min_theta": 0, "max_theta": 1, "timestamp": [1]}', 1, "seconds"),
        ('{"readings": [1, 2], "min_theta": 0, "max_theta": 1, "valid": [1]}', 1, "1 values"),
        ('{"readings": [1', 1, "not JSON"),
        ("[1]", 1, "object"),
        ("", None, "no scan"),
    ],
)
def test_bad_csm_logs_are_refused_by_line(tmp_path, text, line, says):
    path = tmp_path / "log.json"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_csm(path)
    assert caught.value.problems[0].line == line
    assert says in str(caught.value)


def test_breezyslam_ticks_become_a_way_and_millimetres_metres(tmp_path):
    path = tmp_path / "exp.dat"
    path.write_text(BREEZY)
    first, second, third = read_breezyslam(path)
    # both wheels of 77 mm by 100 ticks of pi / 2000 each, added
    assert np.allclose(third.odometry, [2 * 2 * 0.077 * 100 * np.pi / 2000, 0, 0])
    assert np.isclose(second.scan.time, 0.1)
    assert first.scan.ranges[300] == 1.3
    assert not first.scan.returned[:70].any()
    assert np.isclose(np.ptp(first.scan.angles), np.deg2rad(240))


def test_scans_of_a_drive_need_a_time_and_no_stop(tmp_path):
    path = tmp_path / "scans.csv"
    scan = Scan(np.full(12, 2.5), np.linspace(-1, 1, 12), time=1.5)
    path.write_text(scan_csv([("", scan)]))
    (found,) = LOGS["csv"](path)
    assert found.scan.time == 1.5
    path.write_text(scan_csv([("", Scan(scan.ranges, scan.angles))]))
    with pytest.raises(InputError, match="time"):
        LOGS["csv"](path)


@pytest.mark.parametrize(("reader", "text"), [(read_csm, CSM), (read_breezyslam, BREEZY)])
@given(data=st.data())
@settings(
    max_examples=25,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
def test_damaged_logs_are_read_or_refused_in_words(tmp_path, reader, text, data):
    path = tmp_path / "log"
    path.write_bytes(data.draw(damaged(text)).encode("utf-8", "surrogatepass"))
    with contextlib.suppress(GtvalError):
        records = reader(path)
        assert all(np.isfinite(one.scan.angles).all() for one in records)
