import pytest
from hypothesis import given
from hypothesis import strategies as st

from survey.entry.record.numbers import both_units, parse_distance, plain
from survey.entry.room.checks import has_too_many_decimals
from validation.campaign.folder import Instrument

LASER = Instrument()


@pytest.mark.parametrize(
    ("text", "metres"),
    [
        ("5.378", 5.378),
        ("5,378", 5.378),
        ("5378", 5.378),
        ("5378mm", 5.378),
        ("5378 MM", 5.378),
        ("5.378 m", 5.378),
        (" 5.378\t", 5.378),
        (".378", 0.378),
        ("5", 5.0),
        ("50", 50.0),
        ("50 mm", 0.05),
        ("51", 0.051),
        ("49999", 49.999),
        ("537.85 mm", 0.53785),
    ],
)
def test_metres_and_millimetres_are_told_apart_by_size_or_unit(text, metres):
    assert parse_distance(text, LASER).metres == pytest.approx(metres, abs=1e-12)


@pytest.mark.parametrize(
    "text",
    ["", "abc", "5.378.1", "5 378", "-5", "1e3", "nan", "inf", "5.378 km", "٥", "1" * 50, "5,3,7"],
)
def test_what_is_no_distance_is_refused(text):
    with pytest.raises(ValueError, match="expected a number"):
        parse_distance(text, LASER)


@pytest.mark.parametrize("text", ["0.04", "49 mm", "50.001", "53.78", "537.8", "50001", "0"])
def test_what_the_instrument_cannot_show_is_refused_with_its_range(text):
    # 53.78 is the slip of a point: too far for metres, and millimetres have no decimals.
    with pytest.raises(ValueError, match=r"0.05 to 50 m"):
        parse_distance(text, LASER)


@given(st.integers(51, 50_000))
def test_every_reading_is_understood_in_both_units_and_echoed_in_both(millimetres):
    in_metres = parse_distance(f"{millimetres / 1000:.3f}", LASER).metres
    assert in_metres == parse_distance(str(millimetres), LASER).metres
    assert both_units(in_metres) == f"{millimetres / 1000:.3f} m = {millimetres} mm"


def test_plain_keeps_the_decimals_that_there_are():
    assert [plain(x) for x in (5.0, 5.378, 5.3785)] == ["5.000", "5.378", "5.3785"]


@pytest.mark.parametrize(
    ("text", "units", "metres"),
    [
        ("17' 7 3/4\"", "m", 5.37845),
        ("17.65 ft", "m", 5.37972),
        ("537.8 cm", "m", 5.378),
        ("17.65", "ft", 5.37972),
        ("537.8", "cm", 5.378),
        ("45", "mm", None),
        ("5378", "mm", 5.378),
        ("5.378 m", "ft", 5.378),
    ],
)
def test_a_number_without_unit_is_in_that_of_the_campaign(text, units, metres):
    if metres is None:
        with pytest.raises(ValueError, match="out of range"):
            parse_distance(text, Instrument(), units)
    else:
        assert parse_distance(text, Instrument(), units).metres == pytest.approx(metres, abs=1e-6)


@pytest.mark.parametrize(
    ("text", "units", "too_many"),
    [
        ("5.3784", "m", True),
        ("5.378", "m", False),
        ("537.84 cm", "ft", True),
        ("17' 7 3/4\"", "m", False),
        ("17.65", "ft", False),
        ("5.3784 m", "ft", True),
    ],
)
def test_only_metric_numbers_may_have_more_decimals_than_are_shown(text, units, too_many):
    # An instrument that shows eighths of an inch shows no millimetres.
    assert has_too_many_decimals(parse_distance(text, LASER, units), LASER) == too_many
