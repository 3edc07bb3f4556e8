"""Heights whose last digit is coarse: their rounding counts as noise upwards."""

from pathlib import Path

import numpy as np
import pytest

from rtk_gt.receivers.digits import coarsest, last_digits, level_digit, rounded_eta
from rtk_gt.receivers.fixes import RTK_FIXED, Fixes
from rtk_gt.receivers.formats.reading import Stated, read_receiver

COUNT = 400


def record(name, digit, seed=1):
    """A receiver on hills, whose heights are written to a digit, over a geoid of 47.3 m."""
    noise = np.random.default_rng(seed).normal(0, 0.01, COUNT)
    heights = 160 + 2 * np.sin(np.arange(COUNT) / 30) + noise
    heights = np.round(heights / digit) * digit + 47.3
    return Fixes(
        receiver=name,
        times=1.7e9 + 0.2 * np.arange(COUNT),
        geodetic=np.column_stack([np.full(COUNT, 0.79), np.full(COUNT, 0.16), heights]),
        kinds=np.full(COUNT, RTK_FIXED),
        satellites=np.full(COUNT, 12),
        hdop=np.full(COUNT, 0.9),
        covariances=np.full((COUNT, 3, 3), np.nan),
        lines=np.arange(COUNT),
        source=Path(f"{name}.nmea"),
    )


@pytest.mark.parametrize("digit", [0.1, 0.01, 0.001])
def test_the_last_digit_is_told(digit):
    steps = last_digits(record("rear", digit).geodetic)
    assert steps[2] == pytest.approx(digit, rel=1e-6)
    assert (steps[:2] == 0).all()  # a latitude and a longitude that never change tell none


@pytest.mark.parametrize(
    ("decimals", "of_minutes", "metres"),
    [(5, 0, 1.117), (6, 0, 0.1117), (7, 0, 0.01117), (4, 1, 0.1862), (5, 1, 0.01862)],
)
def test_the_last_digit_of_level_positions_is_told_with_few_of_them(decimals, of_minutes, metres):
    generator = np.random.default_rng(decimals)
    fine = np.column_stack([45.478 + generator.uniform(0, 1e-3, 40), np.full(40, 9.232)])
    scale = 60 if of_minutes else 1
    written = np.round(fine * scale, decimals) / scale
    heights = np.full((40, 1), 160.0)
    assert level_digit(np.hstack([np.radians(written), heights])) == pytest.approx(metres, rel=1e-2)
    assert level_digit(np.hstack([np.radians(fine), heights])) == 0


@pytest.mark.parametrize(("decimals", "noise", "metres"), [(9, 6e-8, 0.0), (7, 6e-7, 0.01117)])
def test_millimetres_about_a_round_degree_are_not_written_in_degrees(decimals, noise, metres):
    # Noise of 7 mm, and of 7 cm, about a place of whole hundredths of a degree.
    place = np.array([45.06, 7.66])
    written = place + np.random.default_rng(decimals).normal(0, noise, (400, 2))
    written = np.round(written, decimals)
    stood = np.hstack([np.radians(written), np.full((400, 1), 280.0)])
    assert level_digit(stood) == pytest.approx(metres, rel=1e-2, abs=1e-4)


def test_a_table_in_metres_tells_its_digits(tmp_path):
    rows = [f"{1.7e9 + k:.0f},{5e5 + 3.1 * k:.1f},{5_036_000 + k:.1f},160.0" for k in range(40)]
    path = tmp_path / "rear.csv"
    path.write_text("\n".join(["time,east,north,height", *rows]))
    found = read_receiver(path, Stated("rear", coordinates="utm", zone="32N"))
    assert found.level_digit == pytest.approx(0.1)


def test_rounding_counts_where_it_is_beside_the_noise():
    coarse, fine = record("rear", 0.1), record("front", 0.001)
    assert coarsest([fine, coarse])[0] == "rear"
    # Uniform over 0.1 m: 28.9 mm beside 1.75 times 6 mm.
    assert 0.006 * rounded_eta([fine, coarse], 0.006, 1.75) == pytest.approx(
        np.hypot(0.0105, 0.1 / np.sqrt(12)), rel=1e-6
    )
    assert rounded_eta([fine], 0.006, 1.75) == 1.75
    assert rounded_eta([fine], 0.006, 0.05) == 0.05
