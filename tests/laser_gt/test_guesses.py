"""What accepted matches say of the guesses they started from."""

from dataclasses import dataclass

import numpy as np
import pytest

from laser_gt.guesses import FEWEST, guess_growth, guess_scatter


@dataclass
class Judged:
    pose: np.ndarray
    guess: np.ndarray
    verdict: str = "accept"


def _matches(seed, n, growth=1.0):
    rng = np.random.default_rng(seed)
    off = rng.normal(size=(n, 3)) * [0.03, 0.03, 0.01] * np.broadcast_to(growth, n)[:, None]
    poses = rng.uniform(-3, 3, (n, 3))
    return [Judged(pose, pose - o) for pose, o in zip(poses, off, strict=True)]


def test_the_scatter_of_normal_guesses_is_their_standard_deviation():
    # the median of n sizes of normal numbers is good to 1.17 / sqrt(n) of itself; x and y share
    n = 4000
    found = guess_scatter(_matches(1, n))
    assert found[0] == pytest.approx(0.03, rel=4 * 1.17 / np.sqrt(2 * n))
    assert found[1] == pytest.approx(0.01, rel=4 * 1.17 / np.sqrt(n))


def test_guesses_over_several_stops_are_brought_to_one():
    growth = [guess_growth(apart) for apart in range(1000)]
    assert growth[0] == growth[1] == 1
    assert growth[4] == 2
    assert growth[999] == 5
    found = guess_scatter(_matches(2, 1000, growth), growth)
    assert found == pytest.approx([0.03, 0.01], rel=4 * 1.17 / np.sqrt(1000))


def test_wild_guesses_and_matches_not_accepted_do_not_count():
    right = _matches(3, 1000)
    refused = [Judged(one.pose, one.guess + 1, "look") for one in _matches(4, 500)]
    assert (guess_scatter([*right, *refused]) == guess_scatter(right)).all()
    wild = [Judged(one.pose, one.guess + 1) for one in _matches(5, 100)]
    # a tenth of the sizes beyond moves the median to the 0.55 quantile: 12 %
    assert guess_scatter([*right, *wild]) == pytest.approx(guess_scatter(right), rel=0.2)


def test_headings_across_the_turn_are_near_each_other():
    matches = [Judged(np.array([0, 0, 3.1]), np.array([0.01, 0.01, -3.1])) for _ in range(FEWEST)]
    assert guess_scatter(matches)[1] < 0.13


def test_a_handful_of_matches_says_nothing():
    assert guess_scatter(_matches(6, FEWEST - 1)) is None
    assert guess_scatter([]) is None
