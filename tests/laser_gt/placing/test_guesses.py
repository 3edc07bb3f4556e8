"""What accepted matches say of the guesses they started from."""

from dataclasses import dataclass

import numpy as np
import pytest

from laser_gt.placing.guesses import FEWEST, guess_deviations, guess_scatter
from laser_gt.scans.planar import compose


@dataclass
class Judged:
    pose: np.ndarray
    guess: np.ndarray
    verdict: str = "accepted"


def _matches(seed, n, growth=1.0):
    rng = np.random.default_rng(seed)
    off = rng.normal(size=(n, 3)) * [0.03, 0.03, 0.01] * growth
    poses = rng.uniform(-3, 3, (n, 3))
    return [Judged(pose, pose - o) for pose, o in zip(poses, off, strict=True)]


def test_the_scatter_of_normal_guesses_is_their_standard_deviation():
    # the median of n sizes of normal numbers is good to 1.17 / sqrt(n) of itself; x and y share
    n = 4000
    found = guess_scatter(_matches(1, n))
    assert found[0] == pytest.approx(0.03, rel=4 * 1.17 / np.sqrt(2 * n))
    assert found[1] == pytest.approx(0.01, rel=4 * 1.17 / np.sqrt(n))


def test_guesses_over_several_stops_are_brought_to_one():
    growth = np.random.default_rng(7).uniform(1, 5, (1000, 2))
    found = guess_scatter(_matches(2, 1000, growth[:, [0, 0, 1]]), growth)
    assert found == pytest.approx([0.03, 0.01], rel=4 * 1.17 / np.sqrt(1000))


def test_a_chain_of_motions_is_as_uncertain_as_a_simulated_one():
    rng = np.random.default_rng(8)
    motions = np.array([[1.5, 0, 0.4], [1.0, 0.2, -0.9], [2.0, 0, 0.1], [0.5, 0.5, 1.0]])
    poses = [np.zeros(3)]
    for motion in motions:
        poses.append(compose(poses[-1], motion))
    noisy = motions + rng.normal(size=(4000, 4, 3)) * [0.03, 0.03, 0.02]
    end = np.zeros((4000, 3))
    for step in range(4):
        end = compose(end, noisy[:, step])
    # the worst direction of the position, and the heading; a deviation of 4,000 is good to 1.1 %
    worst = np.sqrt(np.linalg.eigvalsh(np.cov(end[:, :2].T))[-1])
    length, angle = guess_deviations(np.array(poses), 0, 4, (0.03, 0.02))
    assert angle == pytest.approx(end[:, 2].std(), rel=0.045)
    # The formula takes the turned parts as all in one direction: no less than the truth, and no
    # more than the root of the sum over both.
    both = np.sqrt(np.trace(np.cov(end[:, :2].T)))
    assert 0.955 * worst < length < 1.045 * both
    assert guess_deviations(np.array(poses), 4, 0, (0.03, 0.02)) == pytest.approx([length, angle])
    assert guess_deviations(np.array(poses), 1, 2, (0.03, 0.02)) == pytest.approx([0.03, 0.02])


def test_wild_guesses_and_matches_not_accepted_do_not_count():
    right = _matches(3, 1000)
    refused = [Judged(one.pose, one.guess + 1, "may be wrong") for one in _matches(4, 500)]
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
