import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from data_samples.faults.room_faults import decimals, draw_faults, rounded, transpositions
from validation.campaign.folder import Instrument
from validation.errors import GtvalError

LASER = Instrument()
shown = st.integers(50, 50_000).map(lambda millimetres: millimetres / 1000)


def test_exchanged_neighbours_of_a_printed_reading():
    assert transpositions(5.321, LASER) == [3.521, 5.231, 5.312]
    assert transpositions(2.222, LASER) == []
    assert transpositions(30.049, Instrument(range_max=40)) == [3.049, 30.094, 30.409]


@given(shown)
def test_a_typo_keeps_the_digits_and_the_range(reading):
    for wrong in transpositions(reading, LASER):
        assert wrong != reading
        assert LASER.range_min <= wrong <= LASER.range_max
        assert sorted(f"{wrong:06.3f}") == sorted(f"{reading:06.3f}")


@pytest.mark.parametrize(
    ("resolution", "digits"), [(0.001, 3), (0.01, 2), (0.0005, 4), (1.0, 0), (0.0, 6)]
)
def test_digits_that_an_instrument_shows(resolution, digits):
    assert decimals(Instrument(resolution=resolution)) == digits


def test_readings_are_multiples_of_the_resolution():
    readings = rounded(np.array([1.23449, 1.2346, 0.0]), Instrument(resolution=0.001))
    assert readings.tolist() == [1.234, 1.235, 0.0]


def test_faults_are_as_many_and_as_large_as_asked_and_in_different_rows():
    readings = rounded(np.linspace(0.06, 49.97, 500), LASER)
    rng = np.random.default_rng(1)
    faults = draw_faults(readings, LASER, rng, blunders=50, blunder_size=0.1, typos=40)
    rows = [fault.row for fault in faults]
    assert rows == sorted(set(rows))
    blunders = [fault for fault in faults if fault.kind == "blunder"]
    typos = [fault for fault in faults if fault.kind == "typo"]
    assert (len(blunders), len(typos)) == (50, 40)
    assert {abs(fault.size) for fault in blunders} == {0.1}
    assert {np.sign(fault.size) for fault in blunders} == {-1, 1}
    wrong = np.array([readings[fault.row] + fault.size for fault in faults])
    assert (wrong >= LASER.range_min).all()
    assert (wrong <= LASER.range_max).all()


def test_more_faults_than_readings_are_refused():
    with pytest.raises(GtvalError, match="too few"):
        draw_faults(
            np.array([1.23, 2.34]),
            LASER,
            np.random.default_rng(0),
            blunders=1,
            blunder_size=0.1,
            typos=2,
        )
