"""Files of each kind: what is read, what is left out and said, and what is refused, and where."""

import gzip
import re
import sys
from datetime import date

import numpy as np
import pytest
from skies import DAY, almanac, both_systems

from data_samples.sky.constellation import gps_rows
from data_samples.sky.texts import navigation_text, sem_text, two_line_text, yuma_text
from rtk_gt.planning.almanacs.orbits import GPS_EPOCH, WEEK
from rtk_gt.planning.almanacs.reading import midnight, read_almanac
from rtk_gt.planning.almanacs.tokens import nearest_week
from validation.errors import GtvalError, InputError


def written(folder, text, name="file.txt"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("form", ["yuma", "sem", "tle", "rinex2", "rinex3"])
def test_the_kind_of_a_file_is_told_by_what_stands_in_it(tmp_path, form):
    found = almanac(tmp_path, form)
    assert found.kind == {"rinex2": "RINEX", "rinex3": "RINEX"}.get(form, form.upper())
    assert found.names == tuple(f"G{prn:02d}" for prn in range(1, 28))
    assert np.abs(found.ages(np.array([midnight(DAY)]))).max() < 1.0


def test_a_file_may_be_compressed(tmp_path):
    path = tmp_path / "sky.alm.gz"
    path.write_bytes(gzip.compress(yuma_text(gps_rows(DAY)).encode()))
    assert len(read_almanac(path, DAY).names) == 24


@pytest.mark.parametrize("text", [yuma_text, sem_text])
@pytest.mark.parametrize("day", [date(2008, 9, 1), date(2019, 4, 6), date(2019, 4, 8), DAY])
def test_weeks_written_modulo_1024_are_those_nearest_to_the_day(tmp_path, text, day):
    """6 and 8 April 2019 lie on both sides of a roll-over, 2008 before it."""
    path = written(tmp_path, text(gps_rows(day)))
    for wanted in (date(day.year, day.month, 1), day):
        age = read_almanac(path, wanted).ages(np.array([midnight(day)]))
        assert np.abs(age).max() < 1.0


@pytest.mark.parametrize("years", [-9, -1, 0, 1, 9])
def test_an_almanac_within_nine_years_of_the_day_is_of_its_own_week(years):
    week, seconds = 1495, 319488.0
    gps = week * WEEK + seconds + years * 365.25 * 86400
    assert nearest_week(week % 1024, seconds, gps) == week
    assert nearest_week(week, seconds, gps) == week


def test_weeks_are_never_before_gps():
    assert nearest_week(1000, 0.0, 10 * WEEK) == 1000


def test_unhealthy_satellites_are_left_out_and_named(tmp_path):
    ill = {"G05": 63, "G11": 1}
    rows = gps_rows(DAY)
    for text in (yuma_text(rows, ill), sem_text(rows, ill), navigation_text(rows, 3, ill)):
        found = read_almanac(written(tmp_path, text), DAY)
        assert found.unhealthy == ("G05", "G11")
        assert len(found.names) == 22
        assert len(found.ecef(np.array([midnight(DAY)]))) == 22
    all_ill = dict.fromkeys(rows, 63)
    with pytest.raises(GtvalError, match="no healthy satellite"):
        read_almanac(written(tmp_path, yuma_text(rows, all_ill)), DAY)


GLONASS = """\
R01 2026 11 30 00 15 00 5.000000000000D-05 0.000000000000D+00 8.640000000000D+04
     1.000000000000D+04 1.000000000000D+00 0.000000000000D+00 0.000000000000D+00
     1.000000000000D+04 1.000000000000D+00 0.000000000000D+00 1.000000000000D+00
     2.000000000000D+04 1.000000000000D+00 0.000000000000D+00 0.000000000000D+00
"""


def test_galileo_is_read_and_glonass_is_skipped_and_counted(tmp_path):
    text = navigation_text(both_systems(), 3) + GLONASS + GLONASS
    found = read_almanac(written(tmp_path, text), DAY)
    assert len([one for one in found.names if one[0] == "E"]) == 24
    assert found.notes == ("Records that are not read here were skipped: 2 of GLONASS.",)
    header = "".join(navigation_text({}, 3))
    with pytest.raises(GtvalError, match=r"no record of GPS.*2 of GLONASS"):
        read_almanac(written(tmp_path, header + GLONASS + GLONASS), DAY)


def test_a_glonass_file_of_version_2_says_what_it_is(tmp_path):
    head = f"{'2.11':>9s}{'':11s}{'G: GLONASS NAV DATA':40s}RINEX VERSION / TYPE\n"
    lines = [" 1 26 11 30 00 15  0.0" + 3 * " 0.100000000000D-05"]
    lines += ["   " + 4 * " 0.100000000000D+01"] * 3
    text = head + f"{'':60s}END OF HEADER\n" + "\n".join(lines) + "\n"
    with pytest.raises(GtvalError, match="1 of GLONASS"):
        read_almanac(written(tmp_path, text), DAY)


def fortran(match):
    """0.266619887041D+01 of 2.666198870410D+00."""
    sign, first, digits, exponent = match.groups()
    shift = int(exponent) + (first + digits != "0" * 13)
    return f"{sign}.{first}{digits[:11]}D{shift:+03d} "[:19].rjust(19)


def test_numbers_of_rinex_are_read_however_they_are_written(tmp_path):
    text = navigation_text(gps_rows(DAY), 2)
    at = np.array([midnight(DAY)])
    expected = read_almanac(written(tmp_path, text), DAY).ecef(at)
    shifted = re.sub(r"([ -])(\d)\.(\d{12})D([+-]\d\d)", fortran, text)
    assert shifted != text
    for form in (
        text.replace("D+", "E+").replace("D-", "E-"),
        re.sub(r"(\d)D", r"\1d", text),
        shifted,
    ):
        found = read_almanac(written(tmp_path, form), DAY)
        assert np.abs(found.ecef(at) - expected).max() < 1.0


NAMES = {
    "GPS BIIR-2  (PRN 13)": "G13",
    "NAVSTAR 43 (USA 132)": "G-24876",
    "GSAT0101 (PRN E11)": "E11",
    "GSAT0210 (GALILEO 14)": "E-24876",
    "COSMOS 2433 (720)": "R-24876",
    "BEIDOU-3 M1": "C-24876",
    "QZS-2 (MICHIBIKI-2)": "J-24876",
    "(PRN 7)": "G07",
    "": "X-24876",
}


@pytest.mark.parametrize(("title", "name"), NAMES.items())
def test_names_of_two_line_elements_tell_system_and_number(tmp_path, title, name):
    lines = two_line_text(gps_rows(DAY)).splitlines()[1:3]
    first, second = (line[:2] + "24876" + line[7:68] for line in lines)
    text = "\n".join([title, *(f"{one}{checksum(one)}" for one in (first, second))])
    assert read_almanac(written(tmp_path, text.strip()), DAY).names == (name,)


def checksum(line):
    return sum(int(one) if one.isdigit() else one == "-" for one in line) % 10


def test_two_line_elements_without_their_library_say_what_to_install(tmp_path, monkeypatch):
    path = written(tmp_path, two_line_text(gps_rows(DAY)))
    monkeypatch.setitem(sys.modules, "sgp4.api", None)
    with pytest.raises(GtvalError, match=r"need an extra: pip install 'gtval\[gnss\]'"):
        read_almanac(path, DAY)


def yuma(**changes):
    """A YUMA almanac in whose second satellite a value is another."""
    lines = yuma_text(gps_rows(DAY)).splitlines()
    for key, value in changes.items():
        at = next(n for n, line in enumerate(lines) if n > 15 and key in line.lower())
        lines[at] = None if value is None else f"{lines[at].partition(':')[0]}: {value}"
    return "\n".join(line for line in lines if line is not None)


def navigation(line, column, cell, version=3):
    lines = navigation_text(gps_rows(DAY), version).splitlines()
    lines[line - 1] = lines[line - 1][:column] + cell + lines[line - 1][column + len(cell) :]
    return "\n".join(lines)


def two_lines(line, column, cell):
    lines = two_line_text(gps_rows(DAY)).splitlines()
    lines[line - 1] = lines[line - 1][:column] + cell + lines[line - 1][column + len(cell) :]
    return "\n".join(lines)


BAD = {
    "YUMA: a word": (yuma(eccentricity="none"), "line 19, field 'eccentricity': 'none' — not a n"),
    "YUMA: degrees": (
        yuma(inclination="55.0"),
        "line 21, field 'orbital inclination': '55.0' — out",
    ),
    "YUMA: kilometres": (yuma(sqrt="26559.7"), "line 23, field 'sqrt(a)': '26559.7' — out of ran"),
    "YUMA: cut": (yuma(anom=None), "line 16, field 'mean anom': missing below this heading"),
    "YUMA: a line": (yuma(id="1\nNavigation"), "line 18, field 'line': 'Navigation' — not a line"),
    "YUMA: twice": (yuma(id="01"), "field 'ID': 'G01' — this satellite stands in the file twice"),
    "YUMA: health": (yuma(health="ok"), "line 18, field 'health': 'ok' — expected a whole number"),
    "SEM: cut": (
        "\n".join(sem_text(gps_rows(DAY)).splitlines()[:-4]),
        "line 1, field 'number of records': '24' — 328 numbers after line 2; 24 satellites have",
    ),
    "SEM: a word": (
        sem_text(gps_rows(DAY)).replace("5.1536", "x5.1536", 1),
        "line 8, field 'root of the semi-major axis': 'x5.15361",
    ),
    "RINEX: a letter": (navigation(4, 25, "O"), "line 4, field 'crs': '0O000000000000D+00' — not"),
    "RINEX: moved": (
        navigation(5, 61, "26560000.0"),
        "line 5, field 'root_a': '26560000.0",
    ),
    "RINEX: month": (navigation(3, 9, "13"), "line 3, field 'epoch': 'G01 2026 13 30 00 00 18'"),
    "RINEX: no end": (
        navigation_text(gps_rows(DAY), 3).replace("END OF HEADER", ""),
        "line 1, field 'header': there is no line 'END OF HEADER'",
    ),
    "RINEX: cut": (
        "\n".join(navigation_text(gps_rows(DAY), 2).splitlines()[:-3]),
        "a record of 5 lines, expected 8; was the file cut?",
    ),
    "TLE: a digit": (two_lines(3, 10, "9"), "line 3, field 'checksum': '2' — the line sums up to"),
    "TLE: short": (two_lines(3, 60, "\n"), "line 3, field 'line 2':"),
    "TLE: other number": (
        two_lines(3, 6, "0").replace("2.00570957    12", "2.00570957    11", 1),
        "line 3, field 'satellite number': '90000' — line 1 is of 90001",
    ),
    "TLE: a letter": (
        two_lines(3, 52, "x"),
        "line 3, field 'mean motion': 'x2.00570957' — not a number",
    ),
    "a picture": ("\x89PNG nothing", "neither a YUMA or SEM almanac, nor two-line elements"),
    "empty": ("", "neither a YUMA or SEM almanac"),
}


@pytest.mark.parametrize("what", BAD)
def test_a_bad_file_is_refused_with_its_place(tmp_path, what):
    text, said = BAD[what]
    path = written(tmp_path, text)
    with pytest.raises(InputError) as error:
        read_almanac(path, DAY)
    assert str(path) in str(error.value)
    assert said in str(error.value)


def test_versions_and_kinds_of_rinex_that_are_not_read_are_named(tmp_path):
    text = navigation_text(gps_rows(DAY), 3)
    with pytest.raises(GtvalError, match=r"line 1: RINEX version 4\.00; versions 2 and 3"):
        read_almanac(written(tmp_path, text.replace("3.04", "4.00", 1)), DAY)
    with pytest.raises(GtvalError, match="of kind 'O', not of navigation data"):
        read_almanac(written(tmp_path, text.replace("N: GNSS", "O: GNSS", 1)), DAY)


@pytest.mark.parametrize("form", ["yuma", "sem", "tle", "rinex2", "rinex3"])
def test_no_damage_to_a_file_ends_in_a_traceback(tmp_path, form):
    """Lines cut, doubled, exchanged and characters changed: read, or an error in plain words."""
    rng = np.random.default_rng(3)
    whole = almanac(tmp_path, form).source.read_text()
    path, refused = tmp_path / "damaged", 0
    for _ in range(60):
        lines = whole.splitlines()
        at = int(rng.integers(len(lines)))
        kind = rng.integers(5)
        if kind == 0:
            del lines[at]
        elif kind == 1:
            lines.insert(at, lines[int(rng.integers(len(lines)))])
        elif kind == 2:
            lines = lines[:at]
        elif lines[at]:
            column = int(rng.integers(len(lines[at])))
            new = "" if kind == 3 else chr(int(rng.integers(32, 127)))
            lines[at] = lines[at][:column] + new + lines[at][column + 1 :]
        path.write_text("\n".join(lines))
        try:
            found = read_almanac(path, DAY)
            assert np.isfinite(found.ecef(np.array([midnight(DAY)]))).all()
        except GtvalError:
            refused += 1
    assert refused > 12


def test_the_epoch_of_gps_is_where_it_is():
    assert midnight(date(1980, 1, 6)) == GPS_EPOCH
