"""A receiver that hangs while the vehicle drives, and one that holds its position as it stands."""

from pathlib import Path

import numpy as np
import pytest

from rtk_gt.receivers.fixes import ESTIMATED, RTK_FIXED, Fixes
from rtk_gt.receivers.frozen import frozen_stretches, without_frozen
from validation.poses.earth_frames import LocalFrame

FRAME = LocalFrame(0.7937, 0.1611, 161.5)


def record(places, rate=5.0, digit=1e-9):
    """Fixes at places (n, 3), metres, their angles rounded to a digit in degrees."""
    n = len(places)
    geodetic = np.degrees(FRAME.to_geodetic(places))
    geodetic[:, :2] = np.radians(np.round(geodetic[:, :2] / digit) * digit)
    geodetic[:, 2] = np.round(np.radians(geodetic[:, 2]), 3)
    return Fixes(
        receiver="rear", times=1.7e9 + np.arange(n) / rate, geodetic=geodetic,
        kinds=np.full(n, RTK_FIXED), satellites=np.full(n, 12), hdop=np.ones(n),
        covariances=np.full((n, 3, 3), np.nan), lines=np.arange(n) + 2, source=Path("rear.nmea"),
    )  # fmt: skip


def drive(rng, speeds, rate=5.0):
    along = np.cumsum(speeds) / rate
    return np.column_stack([along, 0 * along, 0 * along]) + rng.normal(0, 0.006, (len(speeds), 3))


@pytest.mark.parametrize("rate", [1.0, 5.0, 20.0])
@pytest.mark.parametrize("seconds", [6, 30])
def test_a_position_that_repeats_while_the_vehicle_drives_is_not_fixed(rate, seconds):
    places = drive(np.random.default_rng(1), np.full(900, 8.0), rate)
    stretch = slice(100, 100 + round(seconds * rate))
    places[stretch] = places[99]
    found = record(places, rate)
    (frozen,), rows = frozen_stretches(found)
    assert frozen.fixes == 1 + round(seconds * rate)
    assert frozen.leap == pytest.approx(8.0 * (seconds + 1 / rate), abs=0.05)
    assert frozen.line == 101
    np.testing.assert_array_equal(rows, np.arange(900)[stretch])
    (marked,) = without_frozen([found])
    assert (marked.kinds[stretch] == ESTIMATED).all()
    assert marked.fixed.sum() == 900 - len(rows)


@pytest.mark.parametrize("rate", [1.0, 5.0, 20.0])
def test_a_receiver_that_holds_its_position_while_it_stands_is_right(rate):
    """It starts with 3 m/s^2 and stops so, as cars do at most."""
    seconds = np.arange(0, 60, 1 / rate)
    speeds = np.clip(np.minimum(3 * (20 - seconds), 8), 0, 8)
    speeds += np.clip(3 * (seconds - 40), 0, 8)
    places = drive(np.random.default_rng(2), speeds, rate)
    standing = (seconds > 21) & (seconds <= 40)
    places[standing] = places[standing][0]
    assert frozen_stretches(record(places, rate))[0] == []


def test_coarse_digits_of_a_slow_vehicle_are_not_a_receiver_that_hung():
    """1e-5 degrees are 1.1 m, which a vehicle of 1 m/s passes in 5 fixes."""
    places = drive(np.random.default_rng(3), np.ones(600))
    places[:, 2] = 0.0
    assert frozen_stretches(record(places, digit=1e-5))[0] == []


def test_clean_drives_have_none():
    rng = np.random.default_rng(4)
    for _ in range(20):
        assert frozen_stretches(record(drive(rng, rng.uniform(0, 15, 500))))[0] == []
