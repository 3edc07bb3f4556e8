"""Logs as they come: spoilt, foreign, cut. Each is read rightly, or refused with what to do."""

import re

import numpy as np
import pytest

from rtk_gt.receivers.fix_checks import check_fixes
from rtk_gt.receivers.fixes import Fixes
from rtk_gt.receivers.formats.reading import Stated, read_receiver
from validation.errors import InputError

SECONDS = 40


def sentence(body):
    value = 0
    for character in body:
        value ^= ord(character)
    return f"${body}*{value:02X}"


def log(**cells):
    """A log of GGA once a second, whose cells are replaced by number: c9='F'."""
    lines = [sentence("GPRMC,090000.00,A,4528.68,N,00913.92,E,0.1,0.0,100424,,,R")]
    for k in range(SECONDS):
        body = f"GPGGA,0900{k:02d}.00,4528.68,N,00913.92,E,4,12,0.9,112.0,M,48.0,M,1.0,0000".split(
            ","
        )
        for name, value in cells.items():
            body[int(name[1:])] = value(k) if callable(value) else value
        lines.append(sentence(",".join(body)))
    return "\n".join(lines) + "\n"


def read(tmp_path, content, name="rear.nmea"):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_receiver(path, Stated("rear"))


GOOD = log()
POS = "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix)\n"
POS += "%  GPST  latitude(deg) longitude(deg) height(m)\n"
POS += "".join(
    f"2024/04/10 09:00:{18 + k} 45.478 9.232 160.0 1 12 0.01 0.01 0.02 0 0 0 1.0 9.9\n"
    for k in range(20)
)


@pytest.mark.parametrize(
    ("content", "count"),
    [
        (GOOD.encode("utf-16"), SECONDS),
        (b"\xef\xbb\xbf" + GOOD.encode(), SECONDS),
        (GOOD.replace("\n", "\r\n"), SECONDS),
        (GOOD.replace("\n", "\r"), SECONDS),
        (re.sub(r"\*..", "", GOOD), SECONDS),
        (re.sub(r"\*..", lambda end: end[0].lower(), GOOD), SECONDS),
        (GOOD[:-30], SECONDS - 1),
        (POS, 20),
        (POS[:-30], 19),
    ],
    ids=["utf-16", "mark", "crlf", "cr", "no sums", "small sums", "cut", "pos", "pos cut"],
)
def test_these_are_read_as_what_they_are(tmp_path, content, count):
    found = read(tmp_path, content, "rear.log")
    assert len(found) == count
    np.testing.assert_allclose(np.degrees(found.geodetic[:, :2]), [[45.478, 9.232]] * count)
    np.testing.assert_allclose(found.geodetic[:, 2], 160.0)
    assert found.times[0] == 1_712_739_600.0


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\x89PNG\r\n\x1a\n" + bytes(99), "a picture"),
        ("<!DOCTYPE html><html>404</html>", "a web page.*download it anew"),
        ('{"type": "FeatureCollection"}', "JSON; export"),
        ('<?xml version="1.0"?><kml></kml>', "KML.*export GPX"),
        ("  3.04  OBSERVATION DATA  M  RINEX VERSION / TYPE\n", "RINEX.*RTKLIB"),
        (b"\xaa\x44\x12\x1c" + bytes(99), "binary log of NovAtel; let"),
        (b"$@" + bytes(99), "Septentrio.*convert"),
        (b"\xd3\x00\x13" + bytes(99), "RTCM corrections.*NMEA"),
        (b"7z\xbc\xaf" + bytes(99), "7z archive; unpack"),
        (bytes(range(7, 99)), "no whole NMEA sentence in the file; name"),
        (b"", "empty"),
        (log(c10="F"), "line 2, field 'unit of the altitude': 'F' — not metres"),
        (log(c1="090000.00"), "stands still"),
        (log(c2="9128.68"), "line 2, field 'latitude'"),
        (log(c6="x"), "line 2, field 'fix quality'"),
        (log(c2="4528,68"), "line 2, field 'GGA'.*decimal comma"),
        (POS.replace("GPST", "JST "), "out-timesys"),
        (POS.replace("ellipsoidal", "geodetic"), "out-height"),
        (POS.replace(" 1 12", " 8 12"), "line 3, field 'Q'"),
        (sentence("GPRMC,090000.00,A,4528.68,N,00913.92,E,0.1,0.0,100424,,,R"), "write GGA"),
    ],
    ids=lambda value: value[:12] if isinstance(value, str) else None,
)
def test_these_are_refused_with_what_to_do(tmp_path, content, words):
    with pytest.raises(InputError, match=f"(?s){words}") as raised:
        read(tmp_path, content)
    assert "rear.nmea" in str(raised.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("time,latitude,longitude,height\n", "no rows below the header"),
        ("1712739600,45.478,9.232,160\n1712739601,45.478,9.232,160\n", "write a first line"),
        ("time,latitude,longitude\n1712739600,45.4,9.2\n", "field 'height': the column is missing"),
        ("time,latitude,longitude,height\nnoon,45.478,9.232,160\n", "line 2, field 'time': 'noon'"),
        ("time,latitude,longitude,height\n1712739600,45.478,9.232,160000\n", "20000 m"),
    ],
)  # fmt: skip
def test_these_tables_are_refused_with_what_to_do(tmp_path, content, words):
    with pytest.raises(InputError, match=words) as raised:
        read(tmp_path, content, "rear.csv")
    assert "rear.csv" in str(raised.value)


def test_geoid_separations_that_are_missing_are_those_of_the_rest(tmp_path):
    """48 m of height would else come and go; a log without any says what its heights are."""
    some = read(tmp_path, log(c11=lambda k: "" if k % 3 else "48.0"))
    np.testing.assert_allclose(some.geodetic[:, 2], 160.0)
    assert some.tolerated["no geoid separation: that of the rest of the log"] == 26
    none = read(tmp_path, log(c11=""))
    assert any("without geoid separation" in note for note in none.notes)


def test_radians_are_named(tmp_path):
    near = read(tmp_path, GOOD)
    far: Fixes = near.select(np.arange(len(near)))
    object.__setattr__(far, "geodetic", np.radians(near.geodetic) * [1, 1, 180 / np.pi])
    with pytest.raises(InputError, match="in radians; write degrees"):
        check_fixes([near, far, near])


def test_a_folder_and_a_tar_archive_are_named(tmp_path):
    (tmp_path / "logs").mkdir()
    with pytest.raises(InputError, match="a folder, and no bag"):
        read_receiver(tmp_path / "logs", Stated("rear"))
    tar = bytes(257) + b"ustar" + bytes(250)
    with pytest.raises(InputError, match="a tar archive; unpack it"):
        read(tmp_path, tar, "rear.tar")


def test_many_damaged_lines_are_one_mistake_with_one_line(tmp_path):
    spoilt = "\n".join(
        one.replace("4528", f"45{k % 10}8") if k % 2 else one
        for k, one in enumerate(GOOD.split("\n"))
    )
    with pytest.raises(InputError, match=r"20 of 41 lines are damaged.*baud rate") as raised:
        read(tmp_path, spoilt)
    assert len(str(raised.value).splitlines()) == 1
    assert raised.value.problems[0].line == 2


def test_many_positions_of_nowhere_are_one_mistake_with_one_line(tmp_path):
    zeros = {"c2": lambda k: "0000.00" if k % 3 else "4528.68"}
    zeros |= {"c4": lambda k: "00000.00" if k % 3 else "00913.92"}
    with pytest.raises(InputError, match=r"line 3, .*26 positions of .* are 0, 0") as raised:
        check_fixes([read(tmp_path, log(**zeros))])
    assert len(str(raised.value).splitlines()) == 1
    far = log(c2=lambda k: f"{45 - k % 2}28.68")
    with pytest.raises(InputError, match="39 positions of this file are so far") as raised:
        check_fixes([read(tmp_path, far)])
    assert len(str(raised.value).splitlines()) == 1


@pytest.mark.parametrize("gap", ["\0" * 4096, "\0\0", "\x1b[2J\x1b[2J"])
def test_a_loss_of_power_within_a_sentence_costs_that_sentence(tmp_path, gap):
    """Bytes that come in pairs cancel in the checksum."""
    lines = GOOD.split("\n")
    lines[5] = lines[5].replace("00913", f"009{gap}13")
    found = read(tmp_path, "\n".join(lines))
    assert len(found) == SECONDS - 1
    assert any("1 damaged sentences were left out" in note for note in found.notes)
