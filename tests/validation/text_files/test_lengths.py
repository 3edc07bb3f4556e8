"""Lengths with their units, beside the definitions: an inch is 25.4 mm, a foot is 12 inches."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from validation.text_files.lengths import METRES, split_heading, with_unit

INCH = Fraction(254, 10000)


@pytest.mark.parametrize(
    ("text", "metres"),
    [
        ("2.504 m", 2.504),
        ("2,504m", 2.504),
        ("2504 mm", 2.504),
        ("250.4 cm", 2.504),
        ("2504MM", 2.504),
        ("8.215 ft", 8.215 * 0.3048),
        ("8.215'", 8.215 * 0.3048),
        ("98 5/8 in", 98.625 * 0.0254),
        ('98.58"', 98.58 * 0.0254),
        ("11' 4 7/8\"", 136.875 * 0.0254),
        ("11'4-7/8\"", 136.875 * 0.0254),
        ("11'-4 7/8\"", 136.875 * 0.0254),
        ("11′ 4⅞″", 136.875 * 0.0254),
        ("11 ft 4 7/8 in", 136.875 * 0.0254),
        ("11ft 4.875in", 136.875 * 0.0254),
        ("11' 7/8\"", 132.875 * 0.0254),
        ("11' 4''", 136 * 0.0254),
        ("11' 4 7/8", 136.875 * 0.0254),
        ('7/8"', 0.875 * 0.0254),
    ],
)
def test_a_length_with_its_unit(text, metres):
    found = with_unit(text)
    assert found is not None
    assert found[0] == pytest.approx(metres, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    ["2.504", "m", "2.5 V", "11' 14\"", "11.5' 4\"", "4 7/0 in", "2 m 5", "", "1" * 99, "-3'"],
)
def test_what_states_no_length_is_none(text):
    assert with_unit(text) is None


@given(feet=st.integers(0, 300), inches=st.integers(0, 11), eighths=st.integers(1, 7))
def test_feet_and_inches_are_what_they_are_by_definition(feet, inches, eighths):
    exact = float((12 * feet + inches + Fraction(eighths, 8)) * INCH)
    for text in (f"{feet}' {inches} {eighths}/8\"", f"{feet} ft {inches}-{eighths}/8 in"):
        assert with_unit(text)[0] == pytest.approx(exact, rel=1e-14)


@given(number=st.integers(1, 10**7), unit=st.sampled_from(["m", "cm", "mm"]))
def test_whole_millimetres_are_the_nearest_doubles(number, unit):
    decimals = {"m": 3, "cm": 1, "mm": 0}[unit]
    written = f"{number / 10**decimals:.{decimals}f} {unit}"
    assert with_unit(written)[0] == number / 1000
    assert METRES[unit] * 10**-decimals == pytest.approx(1e-3)


@pytest.mark.parametrize(
    ("heading", "name", "unit"),
    [
        ("Distance", "distance", ""),
        ("distance [mm]", "distance", "mm"),
        ("DISTANCE (Metres)", "distance", "metres"),
        ("distance_cm", "distance", "cm"),
        ("distance in feet", "distance", "feet"),
        ("Distance, m", "distance", "m"),
        ("World point", "world_point", ""),
        ("from", "from", ""),
    ],
)
def test_a_heading_is_a_name_and_perhaps_a_unit(heading, name, unit):
    assert split_heading(heading) == (name, unit)
