"""Readers: what they accept and count, and what they refuse, by file, line and field."""

import gzip

import numpy as np
import pytest
from rtk_samples import FRAGMENT, needs_fragment

from rtk_gt.receivers.fix_checks import check_fixes
from rtk_gt.receivers.fixes import AUTONOMOUS, RTK_FIXED, RTK_FLOAT
from rtk_gt.receivers.formats.fix_csv import read_fix_csv
from rtk_gt.receivers.formats.nmea import read_nmea
from rtk_gt.receivers.formats.rawlog import read_rawlog
from rtk_gt.receivers.formats.rtklib import read_pos
from rtk_gt.receivers.gps_time import gps_minus_utc
from rtk_gt.receivers.steps import common_steps
from validation.errors import InputError
from validation.poses.earth_frames import LocalFrame


def sentence(body):
    value = 0
    for character in body:
        value ^= ord(character)
    return f"${body}*{value:02X}"


def gga(clock="100915.00", kind=4, latitude="3642.9846633", height="3.2433", more="45.0,M,,"):
    return sentence(f"GPGGA,{clock},{latitude},N,00428.5497034,W,{kind},10,1.05,{height},M,{more}")


def gst(clock="100915.00", ellipse="0.012,0.007,30.0,0.0110,0.0086,0.021"):
    return sentence(f"GPGST,{clock},0.02,{ellipse}")


def short_gga(trial):
    height = f"{'-' * (trial % 2)}{3 + trial % 7}.{'1' * (1 + trial % 4)}"
    return gga(clock=f"10091{trial % 4 + 6}.00", height=height, more=f"{trial},,,")


def written(tmp_path, *lines, name="rear.nmea"):
    path = tmp_path / name
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_gga_sentence_is_read(tmp_path):
    found = read_nmea(written(tmp_path, gga(), gst()), "rear")
    assert found.kinds.tolist() == [RTK_FIXED]
    assert found.satellites.tolist() == [10]
    assert np.degrees(found.geodetic[0, 0]) == pytest.approx(36 + 42.9846633 / 60, abs=1e-12)
    assert np.degrees(found.geodetic[0, 1]) == pytest.approx(-(4 + 28.5497034 / 60), abs=1e-12)
    assert found.geodetic[0, 2] == pytest.approx(48.2433)
    # Ellipse 30 degrees from north: the stated sigmas are 11.0 mm north and 8.6 mm east.
    north = np.hypot(12 * np.cos(np.pi / 6), 7 * np.sin(np.pi / 6))
    assert north == pytest.approx(11.0, abs=0.05)
    covariance = found.covariances[0]
    assert covariance[0, 1] == pytest.approx((0.012**2 - 0.007**2) * 0.5 * np.sqrt(0.75), rel=1e-6)
    assert not [note for note in found.notes if "orientation" in note]


def test_an_ellipse_counted_from_east_is_noticed(tmp_path):
    path = written(tmp_path, gga(), gst(ellipse="0.012,0.007,60.0,0.0110,0.0086,0.021"))
    found = read_nmea(path, "rear")
    assert any("from east" in note for note in found.notes)
    assert found.covariances[0, 1, 1] == pytest.approx(0.011**2)
    assert found.covariances[0, 0, 1] > 0


def test_an_ellipse_that_fits_nothing_is_not_used(tmp_path):
    path = written(tmp_path, gga(), gst(ellipse="0.050,0.040,10.0,0.0110,0.0086,0.021"))
    found = read_nmea(path, "rear")
    assert any("not used" in note for note in found.notes)
    assert found.covariances[0, 0, 1] == 0


def test_what_receivers_get_away_with_is_counted(tmp_path):
    whole = gga()
    # The first digit of the checksum depends on the number of letters, signs and digits.
    zero = next(s for s in map(short_gga, range(400)) if s[-2] == "0")
    lines = [
        "\x00\x01" + whole,
        zero[:-2] + zero[-1],
        gga(clock="101000.00").rsplit("*", 1)[0],
        sentence("GPGGA,101001.00,,,,,0,00,,,M,,M,,"),
        "$PTNL,whatever,1*00",
        sentence("GPGSV,3,1,11,03,03,111,00,04,15,270,00,06,01,010,00,13,06,292,00"),
    ]
    found = read_nmea(written(tmp_path, *lines), "rear")
    assert len(found) == 3
    assert found.tolerated == {
        "bytes before the sentence": 1,
        "checksum of one digit": 1,
        "no checksum": 1,
        "GGA without a fix": 1,
    }


def test_dates_and_midnight(tmp_path):
    rmc = sentence("GPRMC,235959.00,A,3642.98,N,00428.54,W,7.2,80.9,091108,,,A")
    lines = [rmc, gga(clock="235959.00"), gga(clock="000000.00"), gga(clock="000001.00")]
    found = read_nmea(written(tmp_path, *lines), "rear")
    assert np.diff(found.times).tolist() == [1.0, 1.0]
    assert found.times[0] == 1226275199.0
    assert any("no date" in note for note in read_nmea(written(tmp_path, gga()), "r").notes)


def test_a_date_written_after_midnight_is_of_the_new_day(tmp_path):
    rmc = sentence("GPRMC,000000.50,A,3642.98,N,00428.54,W,7.2,80.9,101108,,,A")
    lines = [gga(clock="235959.00"), gga(clock="000000.00"), rmc, gga(clock="000001.00")]
    found = read_nmea(written(tmp_path, *lines), "rear")
    assert found.times.tolist() == [1226275199.0, 1226275200.0, 1226275201.0]


def test_errors_written_after_the_fix_of_the_new_day(tmp_path):
    ellipse = "0.012,0.007,30.0,0.0110,0.0086,0.021"
    lines = [gga(clock="235959.00"), gga(clock="000000.00"), gst(ellipse=ellipse)]
    lines[2] = sentence(f"GPGST,235959.00,0.02,{ellipse}")
    found = read_nmea(written(tmp_path, *lines, gga(clock="000001.00")), "rear")
    assert np.diff(found.times).tolist() == [1.0, 1.0]
    assert np.isfinite(found.covariances).all((1, 2)).tolist() == [True, False, False]


def test_a_negative_deviation_is_an_error(tmp_path):
    path = written(tmp_path, gga(), gst(ellipse="0.012,0.007,30.0,-0.0110,0.0086,0.021"))
    with pytest.raises(InputError, match="cannot be negative") as raised:
        read_nmea(path, "rear")
    assert raised.value.problems[0].field == "GST latitude sigma"


@pytest.mark.parametrize(
    ("line", "field", "words"),
    [
        (gga()[:40], "sentence", "cut|not a whole"),
        (gga()[:-1] + ("0" if gga()[-1] != "0" else "1"), "sentence", "checksum"),
        (gga(latitude="3642,9846633"), "GGA", "decimal comma"),
        (gga(latitude="3671.5"), "latitude", "71.5 minutes"),
        (gga(latitude="9100.5"), "latitude", "out of range"),
        (gga(latitude="00428.5"), "latitude", "exchanged"),
        (gga(height="high"), "altitude", "not a number"),
        (gga(clock="256161.00"), "time", "hhmmss"),
        ("no sentence at all", "sentence", "no sentence begins"),
    ],
)
def test_bad_sentences_name_line_and_field(tmp_path, line, field, words):
    path = written(tmp_path, gga(clock="100900.00"), line)
    with pytest.raises(InputError, match=words) as raised:
        read_nmea(path, "rear")
    problem = raised.value.problems[0]
    assert (problem.file, problem.line, problem.field) == (path, 2, field)


def test_damaged_sentences_are_skipped_and_counted_on_request(tmp_path):
    path = written(tmp_path, gga(), gga(clock="100916.00")[:30])
    found = read_nmea(path, "rear", skip_damaged=True)
    assert len(found) == 1
    assert sum(found.tolerated.values()) == 1
    assert any("1 damaged" in note for note in found.notes)


def test_stated_errors_of_no_fix_are_counted(tmp_path):
    found = read_nmea(written(tmp_path, gga(), gst(clock="100930.00")), "rear")
    assert found.tolerated["GST of a time without a fix"] == 1


def test_an_empty_log(tmp_path):
    with pytest.raises(InputError, match="no GGA"):
        read_nmea(written(tmp_path, ""), "rear")
    with pytest.raises(InputError, match="no such file"):
        read_nmea(tmp_path / "nowhere.nmea", "rear")


POS_HEAD = (
    "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp)\n"
    "%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)"
    "   sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio\n"
)
POS_ROW = (
    "2020/03/01 10:00:{:06.3f}   36.716411055   -4.475828390    48.2433   {}   9   0.0060   0.0050"
    "   0.0120  -0.0020   0.0010   0.0030   0.00    3.2\n"
)


def test_rtklib_solutions(tmp_path):
    path = tmp_path / "rear.pos"
    path.write_text(POS_HEAD + POS_ROW.format(0, 1) + POS_ROW.format(1, 2) + POS_ROW.format(2, 5))
    found = read_pos(path, "rear")
    assert found.kinds.tolist() == [RTK_FIXED, RTK_FLOAT, AUTONOMOUS]
    assert found.times[0] == 1583056800.0 - 18  # GPS time is 18 s ahead of UTC
    assert found.covariances[0, 0, 0] == pytest.approx(0.005**2)
    assert found.covariances[0, 0, 1] == pytest.approx(-(0.002**2))


def test_leap_seconds():
    assert gps_minus_utc(1226225355.0) == 14
    assert gps_minus_utc(1583056800.0) == 18


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("48.2433", "48,2433"), "decimal comma"),
        (("2020/03/01", "2020-03-01"), "not a time"),
        (("   1   9", "   8   9"), "solution status"),
        (("0.0060", "abc"), "not a number"),
        (("   0.0050   0.0120  -0.0020   0.0010   0.0030   0.00    3.2", ""), "columns"),
    ],
)
def test_bad_solutions(tmp_path, change, words):
    path = tmp_path / "rear.pos"
    path.write_text(POS_HEAD + POS_ROW.format(0, 1).replace(*change))
    with pytest.raises(InputError, match=words) as raised:
        read_pos(path, "rear")
    assert raised.value.problems[0].line == 3


def test_heights_above_the_geoid_are_refused(tmp_path):
    path = tmp_path / "rear.pos"
    path.write_text(POS_HEAD.replace("ellipsoidal", "geodetic") + POS_ROW.format(0, 1))
    with pytest.raises(InputError, match="out-height"):
        read_pos(path, "rear")


def test_csv_fixes(tmp_path):
    path = written(
        tmp_path,
        "time,latitude,longitude,height,fix,sigma_east,sigma_north,sigma_up",
        "2008-11-09T10:09:15,36.7,-4.4,48.2,fixed,0.006,0.007,0.012",
        "1226225356,36.7,-4.4,48.2,float,,,",
        name="rear.csv",
    )
    found = read_fix_csv(path, "rear")
    assert found.times.tolist() == [1226225355.0, 1226225356.0]
    assert found.kinds.tolist() == [RTK_FIXED, RTK_FLOAT]
    assert np.isnan(found.covariances[1]).all()
    bad = written(tmp_path, "time,latitude,longitude,height", "noon,95,0,1", name="bad.csv")
    with pytest.raises(InputError, match="not a time") as raised:
        read_fix_csv(bad, "rear")
    assert len(raised.value.problems) == 2


def records(tmp_path, **changes):
    """Three receivers near each other; ``changes`` gives the rows of some of them."""
    found = []
    for name in ("rear", "left", "right"):
        rows = changes.get(name, ["0,36.7,-4.4,48", "1,36.7,-4.4,48", "2,36.7,-4.4,48"])
        path = written(tmp_path, "time,latitude,longitude,height", *rows, name=f"{name}.csv")
        found.append(read_fix_csv(path, name))
    return found


@pytest.mark.parametrize(
    ("rows", "line", "words"),
    [
        (["0,36.7,-4.4,48", "5,36.7,-4.4,48", "2,36.7,-4.4,48"], 4, "3 s earlier"),
        (["0,36.7,-4.4,48", "0,36.7,-4.4,48", "2,36.7,-4.4,48"], 3, "the same time"),
        (["0,36.7,-4.4,48", "1,36.7,-4.4,48", "900000,36.7,-4.4,48"], 4, "leaps of days"),
        (["0,-4.4,36.7,48", "1,-4.4,36.7,48", "2,-4.4,36.7,48"], 2, "exchanged"),
        (["0,4.4,-36.7,48", "1,4.4,-36.7,48", "2,4.4,-36.7,48"], 2, "without their hemispheres"),
        (["0,-36.7,-4.4,48", "1,-36.7,-4.4,48", "2,-36.7,-4.4,48"], 2, "N and S are exchanged"),
        (["0,36.7,4.4,48", "1,36.7,4.4,48", "2,36.7,4.4,48"], 2, "E and W are exchanged"),
        (["0,46.7,-4.4,48", "1,46.7,-4.4,48", "2,46.7,-4.4,48"], 2, "km from"),
        (["0,36.7,-4.4,48", "1,36.9,-4.4,48", "2,36.7,-4.4,48"], 3, "22.2 km from the fix"),
    ],
)
def test_leaps_and_exchanged_coordinates(tmp_path, rows, line, words):
    with pytest.raises(InputError, match=words) as raised:
        check_fixes(records(tmp_path, left=rows))
    assert raised.value.problems[0].line == line


def test_steps_bring_the_same_times_together(tmp_path):
    found = common_steps(
        records(tmp_path, left=["0.001,36.7,-4.4,48", "1.5,36.7,-4.4,48"]),
        LocalFrame.from_degrees(36.7, -4.4, 48),
    )
    assert found.times.tolist() == [0.0, 1.0, 1.5, 2.0]
    assert found.complete.tolist() == [True, False, False, False]


def test_files_that_are_no_rawlog(tmp_path):
    path = tmp_path / "a.rawlog"
    for data, words in (
        (b"no rawlog", "no object"),
        (gzip.compress(bytes(range(256)))[:60], "gzip"),
        (b"\x91CObservationImage\x00", "class CObservationImage"),
        (b"", "no GPS position"),
    ):
        path.write_bytes(data)
        with pytest.raises(InputError, match=words):
            read_rawlog(path)


@needs_fragment
def test_a_rawlog_cut_anywhere_is_an_error(tmp_path):
    data = gzip.decompress(FRAGMENT.read_bytes())
    path = tmp_path / "cut.rawlog"
    for size in np.random.default_rng(0).integers(1, len(data) - 1, 60):
        path.write_bytes(data[:size])
        try:
            found = read_rawlog(path)
        except InputError:
            continue
        # A cut between two observations leaves a shorter log that is whole.
        assert data[size - 1] == 0x88
        assert sum(len(one) for one in found.fixes.values()) < 691


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize(("name", "read"), [("rear.nmea", read_nmea), ("rear.pos", read_pos)])
def test_a_log_saved_as_utf_16_is_told_in_one_line(tmp_path, name, read, encoding):
    path = tmp_path / name
    path.write_bytes("\n".join([gga()] * 50).encode(encoding))
    with pytest.raises(InputError) as caught:
        read(path, "rear")
    assert [one.expected for one in caught.value.problems] == [
        "saved as UTF-16; save the file as UTF-8"
    ]
