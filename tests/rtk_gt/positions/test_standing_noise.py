"""The noise of receivers that stand, and its ratio upwards, with an interval that holds."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from rtk_gt.positions.standing import standing_noise
from rtk_gt.receivers.fixes import RTK_FIXED, Fixes
from validation.errors import GtvalError, InputError
from validation.poses.earth_frames import LocalFrame

SITE = LocalFrame.from_degrees(45.478, 9.232, 160.0)


def standing(seed, eta=1.75, count=1800, memory=0.0, moved=0.0):
    """A receiver that stands: white noise, or noise with a memory of some fixes."""
    generator = np.random.default_rng(seed)
    noise = generator.standard_normal((count, 3))
    if memory:
        phi = np.exp(-1 / memory)
        noise = np.sqrt(1 - phi**2) * lfilter([1.0], [1.0, -phi], noise, axis=0)
    places = noise * [0.006, 0.006, 0.006 * eta]
    places[:, 0] += np.linspace(0, moved, count)
    return Fixes(
        receiver="base",
        times=1.7e9 + np.arange(count),
        geodetic=SITE.to_geodetic(places),
        kinds=np.full(count, RTK_FIXED),
        satellites=np.full(count, 12),
        hdop=np.full(count, 0.9),
        covariances=np.full((count, 3, 3), np.nan),
        lines=np.arange(count),
        source=Path("base.nmea"),
    )


@pytest.mark.parametrize("memory", [0.0, 10.0])
def test_the_interval_of_eta_holds_the_truth(memory):
    """95 % of 100 intervals: 88 to 99 are within the binomial's 0.5 % ends. White noise: 2 %."""
    found = [standing_noise(standing(seed, memory=memory)) for seed in range(100)]
    held = sum(one.low <= 1.75 <= one.high for one in found)
    assert 88 <= held <= 100
    widths = np.array([one.high / one.low for one in found])
    # Of n independent fixes: exp(2 * 1.96 sqrt(3 / (4 n))) for the ratio of one and two variances.
    worth = 1.0 if memory == 0 else 2 * memory
    expected = np.exp(2 * 1.96 * np.sqrt(3 / 4 / (1800 / worth)))
    assert abs(np.log(np.median(widths)) / np.log(expected) - 1) < 0.35
    assert np.median([one.sigmas[0] for one in found]) == pytest.approx(0.006, rel=0.05)


def test_a_receiver_that_moved_or_was_hardly_fixed_is_refused():
    with pytest.raises(GtvalError, match=r"moved by 0\.9"):
        standing_noise(standing(1, moved=1.0))
    with pytest.raises(GtvalError, match="20 RTK-fixed positions"):
        standing_noise(standing(1, count=20))


def test_a_pause_of_a_year_and_a_receiver_that_hung_are_named():
    one = standing(1)
    late = replace(one, times=np.where(np.arange(1800) < 900, one.times, one.times + 3.5e7))
    with pytest.raises(InputError, match="leaps of days"):
        standing_noise(late)
    places = one.geodetic.copy()
    places[600:700] = places[600]
    with pytest.raises(InputError, match="hung: 100 positions of 99 s") as told:
        standing_noise(replace(one, geodetic=places))
    assert told.value.problems[0].line == 600
    places = one.geodetic.copy()
    places[:, 1] = places[0, 1]
    with pytest.raises(GtvalError, match="longitude of all 1800"):
        standing_noise(replace(one, geodetic=places))


def test_an_eta_that_no_receiver_has_is_remarked():
    assert "eta of 9" in standing_noise(standing(1, eta=92.0)).remark
    assert standing_noise(standing(1)).remark is None
