import numpy as np
import pytest
from laser_rooms import error, pair_of, prepared
from trials.scan_pairs import CORRIDOR_GUESS, corridor_pair, mixed_pair

from laser_gt.matching.judgement import MatchSettings, match
from laser_gt.scans.evidence import Prepared

LIMITS = MatchSettings(guess_length=0.06, guess_angle=0.06)


def _judge_many(seeds):
    """Accepted wrong ones, good ones, and those of the good that were not accepted."""
    wrong, good, held_up = [], 0, 0
    for seed in seeds:
        pair = mixed_pair(seed, seed)
        found = match(*prepared(pair), pair.guess, LIMITS)
        length, angle = error(found.pose, pair.truth)
        if found.verdict == "accepted" and (length > 0.02 or angle > 0.01):
            wrong.append((seed, pair.kind, length, angle))
        if pair.kind == "room":
            good += 1
            held_up += found.verdict != "accepted"
    return wrong, good, held_up


def test_no_wrong_match_is_accepted_and_hardly_a_good_one_held_up():
    wrong, good, held_up = _judge_many(range(150))
    assert wrong == []
    assert held_up <= 0.05 * good


def test_another_room_with_the_same_corner_is_not_accepted():
    """All walls in sight agree; only the side of a box is where the other saw the wall behind."""
    pair = mixed_pair(594, 77594)
    assert pair.kind == "little_overlap"
    found = match(*prepared(pair), pair.guess, LIMITS)
    assert error(found.pose, pair.truth)[0] > 0.1
    assert found.verdict == "may be wrong"
    assert found.intruder == pytest.approx(0.55, abs=0.02)
    assert "a surface of 0.6 m stands where the other scanner saw free space" in found.reasons


@pytest.mark.full
def test_judgement_of_a_thousand_pairs():
    wrong, good, held_up = _judge_many(range(2000, 3000))
    assert wrong == []
    assert held_up <= 0.05 * good


def test_along_a_corridor_the_stated_deviation_is_that_of_the_guess_and_true():
    errors, stated = [], []
    for seed in range(25):
        pair, along = corridor_pair(seed)
        settings = MatchSettings(guess_length=CORRIDOR_GUESS[0], guess_angle=CORRIDOR_GUESS[1])
        found = match(Prepared(pair.reference), Prepared(pair.moving), pair.guess, settings)
        errors.append(along @ (found.pose - pair.truth)[:2])
        stated.append(np.sqrt(along @ found.covariance[:2, :2] @ along))
        assert found.verdict != "accepted"
        assert any("corridor" in reason for reason in found.reasons)
    ratio = np.sqrt(np.mean(np.square(stated))) / np.sqrt(np.mean(np.square(errors)))
    assert 0.5 < ratio < 2


def test_moved_furniture_shows_in_free_space():
    found = [
        match(*prepared(p), p.guess, LIMITS)
        for p in (pair_of(seed, "moved_furniture") for seed in range(6))
    ]
    assert all(one.violating > 0.03 for one in found)
    assert all(
        one.violating < 0.01
        for one in (match(*prepared(p), p.guess, LIMITS) for p in map(pair_of, range(6)))
    )


def test_a_match_that_contradicts_its_guess_is_for_a_person_to_look_at():
    """The same match with a guess 0.1 m off: stated with 20 mm it contradicts, with 60 mm not."""
    pair = pair_of(3)
    guess = pair.truth + np.array([0.1, 0.0, 0.0])
    doubted = match(*prepared(pair), guess, MatchSettings(guess_length=0.02, guess_angle=0.06))
    believed = match(*prepared(pair), guess, LIMITS)
    assert doubted.surprise == pytest.approx(25, rel=0.1)
    assert doubted.verdict == "may be wrong"
    assert len(doubted.reasons) == 1
    assert doubted.reasons[0].startswith("it contradicts its guess: ")
    assert believed.surprise == pytest.approx((0.1 / 0.06) ** 2, rel=0.1)
    assert believed.verdict == "accepted"


def test_right_matches_hardly_ever_contradict_honest_guesses():
    """The squared distance from the guess is chi-squared with 3 degrees of freedom."""
    rng = np.random.default_rng(11)
    surprises = []
    for seed in range(60):
        pair = pair_of(seed)
        guess = pair.truth + rng.normal(0, 1, 3) * [0.06, 0.06, 0.06]
        surprises.append(match(*prepared(pair), guess, LIMITS).surprise)
    # 99.9 % of sums of 60 such values lie in this interval: 180 degrees of freedom.
    assert 0.689 < np.mean(surprises) / 3 < 1.384
