"""Hypotheses are ranked by what the data say and by what their freedom costs."""

import numpy as np
import pytest

from validation.statistics.hypotheses import Tried, parameter, ranked


def test_a_parameter_costs_the_share_of_its_range_that_the_data_leave():
    # Evidence of a normal likelihood of standard deviation s under a flat prior of width r:
    # sqrt(2 pi) s / r, here by summing it.
    width, sigma, value = 1.0, 0.01, 0.1
    grid = np.linspace(-width / 2, width / 2, 200_001)
    evidence = np.exp(-(((grid - value) / sigma) ** 2) / 2).mean()
    told = parameter("offset", "m", value, sigma, width)
    assert told.cost == pytest.approx(-2 * np.log(evidence), abs=1e-3)
    assert (told.low, told.high) == pytest.approx((value - 0.0196, value + 0.0196), abs=1e-5)


def test_the_hypothesis_that_pays_for_its_freedom_is_first():
    none = Tried("none", 160.0, 100)
    offset = Tried("offset", 101.0, 99, (parameter("offset", "m", 0.01, 0.001, 1.0),))
    blunders = Tried("blunders", 95.0, 90, (parameter("row", "m", 0.02, 0.002, 1.0),) * 10)
    ranking = ranked([none, blunders, offset])
    assert [one.what for one in ranking.tried] == ["offset", "none", "blunders"]
    gap = none.criterion - offset.criterion
    assert ranking.odds(none) == pytest.approx(np.exp(gap / 2))


def test_places_searched_lower_the_odds_as_many_times():
    one, many = Tried("a", 10.0, 10), Tried("b", 10.0, 10, (), 50.0)
    assert ranked([many, one]).odds(many) == pytest.approx(50.0)


def test_noise_of_any_size_costs_less_than_far_misfit():
    # Chi-squared of 400 with 100 degrees of freedom is a scatter of 2: 100 (1 + log 4) and its
    # cost, not 400.
    plain = Tried("none", 400.0, 100)
    assert plain.criterion == pytest.approx(100 * (1 + np.log(4)) + 2 * np.log(20))


def test_a_hypothesis_within_odds_of_three_to_one_is_a_tie():
    tried = [Tried(name, chi, 100) for name, chi in (("a", 90.0), ("b", 92.0), ("c", 92.5))]
    assert [one.what for one in ranked(tried).ties()] == ["b"]
    assert [one.what for one in ranked(tried).rivals()] == ["b", "c"]
