"""Facts about small sets of readings, of places and poses drawn at random."""

import numpy as np
import pytest
from scipy.stats import chi2

from survey.entry.room import fits
from survey.entry.room.fits import information_covariance, predicted_distances
from survey.entry.room.judgement import MISFIT_CHANCE, judge, misfit_limit
from survey.estimation.distance_fit import place_fit

SIGMA = 0.002
CORNERS = np.array([[0.0, 0.0], [6.0, 0.2], [6.5, 8.0], [-0.4, 7.5], [3.0, 9.0], [-1.0, 4.0]])


def simulated_fit(rng, n=5, wrong=None, size=0.2):
    place = rng.uniform([1, 1], [5, 6])
    known_sigma = np.full(n, 0.001)
    known = CORNERS[:n] + rng.normal(0, 0.001, (n, 2))
    distance = np.hypot(*(CORNERS[:n] - place).T) + rng.normal(0, SIGMA, n)
    if wrong is not None:
        distance[wrong] += size
    return place, place_fit(known, known_sigma, distance, np.full(n, SIGMA))


@pytest.mark.parametrize("k", [1, 2, 3, 5, 10, 40])
def test_the_limit_is_the_quantile_of_chi_squared(k):
    # The approximation errs towards fewer alarms with few readings, by 8 % at most.
    assert 0.999 < misfit_limit(k) / chi2.isf(MISFIT_CHANCE, k) < 1.08


def test_one_reading_leaves_a_circle_and_two_leave_two_places():
    rng = np.random.default_rng(1)
    _, fit = simulated_fit(rng)
    assert judge(fit.select(np.array([0]))).why_open is not None
    place, fit = simulated_fit(rng)
    two = judge(fit.select(np.array([0, 1])))
    assert len(two.states) == 2
    assert np.hypot(*(two.states - place).T).min() < 0.02


def test_correct_readings_are_hardly_ever_suspected():
    rng = np.random.default_rng(2)
    judged = [judge(simulated_fit(rng)[1]) for _ in range(400)]
    assert sum(bool(j.explanations) for j in judged) <= 2  # the chance of one is below 1e-3
    assert all(j.is_unique for j in judged if not j.explanations)


def test_predictions_are_as_sure_as_they_say():
    rng = np.random.default_rng(3)
    z = []
    for _ in range(400):
        place, fit = simulated_fit(rng, 5)
        judged = judge(fit)
        new = np.array([8.0, 3.0])
        distance, variance = predicted_distances(judged.states[:1], judged.covariances[:1], new)
        z.append((distance[0] - np.hypot(*(new - place))) / np.sqrt(variance[0]))
    # 400 normal deviates: rms within 1 +- 4 / sqrt(800).
    assert 0.86 < np.sqrt(np.mean(np.square(z))) < 1.14


def test_of_five_readings_the_wrong_one_is_found():
    rng = np.random.default_rng(4)
    found = 0
    for trial in range(100):
        judged = judge(simulated_fit(rng, 5, wrong=trial % 5)[1])
        assert trial % 5 in judged.suspects
        found += judged.suspects == (trial % 5,)
    assert found >= 90


def test_of_three_readings_with_one_wrong_all_are_suspected():
    rng = np.random.default_rng(5)
    judged = judge(simulated_fit(rng, 3, wrong=1, size=0.7)[1])
    assert set(judged.suspects) == {0, 1, 2}


def test_redundancy_adds_up_and_w_is_standard_normal():
    rng = np.random.default_rng(6)
    values = []
    for _ in range(300):
        _, fit = simulated_fit(rng, 6)
        state = judge(fit).states[0]
        w, redundancy = fits.test_values(fit, state)
        assert redundancy.sum() == pytest.approx(4, abs=1e-3)
        values.append(w)
    assert 0.9 < np.std(values) < 1.1
    assert np.all(np.linalg.eigvalsh(information_covariance(fit, state)) > 0)
