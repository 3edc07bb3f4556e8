"""An interval is widened where the fit does not rise as its model says, and only so far."""

from types import SimpleNamespace

import pytest

from validation.trajectories.clock import judging
from validation.trajectories.clock.judging import FINE, MOST_WIDER, _verdict

HALF, PERIOD = 1e-4, 0.2


@pytest.fixture
def verdict(monkeypatch):
    """The verdict on a fit that is flat up to so many seconds around its delay."""
    rates = SimpleNamespace(rate_variance=(0.0, 0.0))
    fit = SimpleNamespace(path=rates, rows=[0.0] * 100, with_heading=True)
    best = SimpleNamespace(
        candidate=SimpleNamespace(fit=fit, state=None, delay=0.0),
        variances=SimpleNamespace(position=1.0, heading=1.0),
        rivals=(),
    )
    monkeypatch.setattr(judging, "motion_in_words", lambda _fit, _state: "the robot moves")
    monkeypatch.setattr(judging, "_rough_share", lambda _one, _variances: 0.0)

    def told(flat, half=HALF, period=PERIOD):
        def within(_best, tried):
            return tried if tried < flat else 0.0

        monkeypatch.setattr(judging, "_flat", within)
        return _verdict(best, 1e-8, half, period)

    return told


def test_a_fit_that_rises_as_it_must_keeps_its_interval(verdict):
    assert verdict(0.0) == ("determined", "", 1.0)


@pytest.mark.parametrize(("flat", "wider"), [(1.5, 2.0), (3.0, 4.0), (7.5, 8.0)])
def test_a_fit_that_is_less_sharp_has_an_interval_as_wide_as_it_is_flat(verdict, flat, wider):
    assert verdict(flat * HALF) == ("determined", "", wider)


def test_a_fit_flatter_than_the_most_is_refused_and_the_first_step_told(verdict):
    told, reason, wider = verdict(1.01 * MOST_WIDER * HALF)
    assert told == "not_determinable"
    assert "moved by 0.0001 s it fits as well" in reason
    assert wider == 1.0


def test_no_interval_grows_beyond_a_part_of_the_time_between_stamps(verdict):
    half = 0.3 * FINE * PERIOD
    assert verdict(1.5 * half, half=half)[0] == "determined"  # 0.6 of that part
    assert verdict(3.0 * half, half=half)[0] == "not_determinable"  # would be 1.2 of it
