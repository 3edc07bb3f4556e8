"""A receiver that states less than it scatters where the vehicle stands."""

import numpy as np
import pytest

from rtk_gt.positions.scatter import scatter_beside_stated
from rtk_gt.receivers.fixes import RTK_FIXED, Fixes


def record(rng, sigma, stated, speeds, rate=5.0):
    n = len(speeds)
    along = np.cumsum(speeds) / rate
    places = np.column_stack([along, 0 * along, 0 * along])
    places += rng.normal(0, 1, places.shape) * sigma * np.array([1, 1, 1.75])
    covariance = np.diag([1, 1, 1.75**2]) * stated**2
    return places, Fixes(
        receiver="rear", times=1.7e9 + np.arange(n) / rate, geodetic=places,
        kinds=np.full(n, RTK_FIXED), satellites=np.full(n, 12), hdop=np.ones(n),
        covariances=np.tile(covariance, (n, 1, 1)), lines=np.arange(n) + 2, source="rear.csv",
    )  # fmt: skip


def speeds_with_stops(stop):
    cycle = np.r_[np.arange(0, 8, 0.4), np.full(60, 8.0), np.arange(8, 0, -0.4), np.zeros(stop)]
    return np.tile(cycle, 4)


@pytest.mark.parametrize(("sigma", "stated"), [(0.02, 0.003), (0.008, 0.005), (0.02, 0.02)])
def test_where_it_stands_its_noise_is_seen(sigma, stated):
    """Medians of 12 or more windows of 56 freedoms: the mean of 20 drives to 3 %."""
    ratios, factors = [], []
    for seed in range(20):
        places, one = record(np.random.default_rng(seed), sigma, stated, speeds_with_stops(150))
        found = scatter_beside_stated(one, places)
        ratios.append(found.seen / (sigma * np.array([1, 1.75])))
        factors.append(found.factors)
    np.testing.assert_allclose(np.mean(ratios, axis=0), 1.0, atol=0.03)
    if sigma == stated:
        np.testing.assert_array_equal(factors, 1.0)
    else:
        np.testing.assert_allclose(np.mean(factors, axis=0), sigma / stated, rtol=0.03)


def test_a_receiver_that_never_stands_shows_nothing():
    places, one = record(np.random.default_rng(1), 0.02, 0.003, np.full(900, 8.0))
    assert scatter_beside_stated(one, places) is None
