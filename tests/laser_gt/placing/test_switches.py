"""Matches that may be wrong, decided by the graph of the others."""

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest

from laser_gt.campaign.findings import hanging_findings
from laser_gt.matching.verdicts import JudgementSettings, Match, with_verdict
from laser_gt.placing.anchors import Surveyed
from laser_gt.placing.engines import Matching
from laser_gt.placing.solution import solve
from laser_gt.placing.switches import WRONG_SHARE, decided
from laser_gt.scans.planar import between
from validation.poses.factored import Factored

SIGMAS = (0.15, 0.1)
FLAWLESS = {
    "explained": 0.8, "violating": 0.0, "hidden": 0.1, "agreement": 0.9, "intruder": 0.0,
    "scale": 1.0, "real_share": 1.0, "eigenvalue_ratio": 0.5, "returned": 1.0,
    "rival": -0.5, "surprise": 1.0,
}  # fmt: skip
DOUBTFUL = {"violating": 0.1}
NAMES = "abcdefghijkl"


def _stops(count):
    return np.random.default_rng(3).uniform(-2, 2, (count, 3))


def _match(poses, first, second, changed=None, off=(0.0, 0.0, 0.0), sigma=0.001):
    """A match right to its sigma, but for what it is off by."""
    rng = np.random.default_rng(NAMES.index(first) * 10 + NAMES.index(second))
    ends = poses[[NAMES.index(first), NAMES.index(second)]]
    pose = between(*ends) + rng.normal(0, sigma, 3) + off
    values = FLAWLESS | (changed or {})
    made = Match(first, second, pose, pose, np.eye(3) * sigma**2, **values)
    return with_verdict(made, JudgementSettings())


def _decided(poses, matches):
    return decided(tuple(NAMES[: len(poses)]), poses, matches, SIGMAS)


@pytest.mark.parametrize(
    "doubt", [{"violating": 0.1}, {"rival": -0.01}, {"surprise": 30.0}, {"intruder": 3.0}]
)
def test_a_doubtful_match_is_confirmed_by_the_graph_if_right_and_refuted_if_wrong(doubt):
    poses = _stops(4)
    rest = [_match(poses, *pair) for pair in list(combinations("abcd", 2))[1:]]
    for off, verdict in ((0.0, "accepted"), (0.2, "refuted")):
        held_up = _match(poses, "a", "b", doubt, (off, 0.0, 0.0))
        assert held_up.verdict == "may be wrong"
        found = _decided(poses, [held_up, *rest])
        assert found[0].verdict == verdict
        assert "graph" in found[0].reasons[-1]
        assert found[1:] == rest


def test_matches_between_two_groups_confirm_each_other_and_not_the_wrong_one():
    poses = _stops(6)
    inside = [_match(poses, *pair) for group in ("abc", "def") for pair in combinations(group, 2)]
    across = [
        _match(poses, "a", "d", DOUBTFUL),
        _match(poses, "b", "e", DOUBTFUL, (0.3, 0.0, 0.0)),
        _match(poses, "c", "f", DOUBTFUL),
    ]
    found = _decided(poses, across + inside)
    assert [one.verdict for one in found[:3]] == ["accepted", "refuted", "accepted"]


def test_loops_of_doubtful_matches_confirm_them():
    poses = _stops(4)
    doubtful = [_match(poses, *pair, DOUBTFUL) for pair in combinations("abcd", 2)]
    assert {one.verdict for one in _decided(poses, doubtful)} == {"accepted"}
    three = [one for one in doubtful if "d" not in (one.reference, one.moving)]
    # one loop may close by chance
    assert {one.verdict for one in _decided(poses[:3], three)} == {"may be wrong"}


def test_what_is_imprecise_is_used_as_it_is():
    poses = _stops(3)
    weak = _match(poses, "a", "b", {"explained": 0.15}, sigma=0.02)
    assert weak.verdict == "imprecise"
    assert weak.used


def _solved(poses, matches, surveyed="a"):
    stops = tuple(NAMES[: len(poses)])
    rows = [NAMES.index(stop) for stop in surveyed]
    known = Surveyed(
        tuple(surveyed), poses[rows], Factored.alone(np.tile(1e-6 * np.eye(3), (len(rows), 1, 1)))
    )
    matching = Matching("scanmatch", _decided(poses, matches), [])
    return solve(stops, np.zeros(3), np.full(3, 1e-6), poses, matching, known, SIGMAS)


def test_stops_behind_a_match_that_nothing_checks_are_placed_and_it_is_named():
    poses = _stops(4)
    chain = [_match(poses, "a", "b"), _match(poses, "b", "c", DOUBTFUL), _match(poses, "c", "d")]
    found = _solved(poses, chain)
    assert found.stops == ("a", "b", "c", "d")
    ((match, behind),) = found.hanging
    assert (match.reference, match.moving, behind) == ("b", "c", ("c", "d"))
    sigma = np.sqrt(np.diagonal(found.placement.joint)).reshape(4, 3)
    # a tenth of the guess's variance, for a tenth of such matches is wrong
    assert sigma[2, 0] == pytest.approx(np.sqrt(WRONG_SHARE) * SIGMAS[0], rel=0.1)
    assert sigma[1, 0] < 0.01


def test_many_matches_that_nothing_checks_are_one_finding():
    names = "abcdefghijkl"
    poses = _stops(len(names))
    chain = [_match(poses, *pair, DOUBTFUL) for pair in pairwise(names)]
    found = _solved(poses, chain)
    (told,) = hanging_findings(found, "laser_scanmatch")
    assert "11 stops are placed by 11 matches" in told.text
    assert "a - b (11 stops)" in told.text
    assert "and 3 more" in told.text
    assert [size.value for size in told.sizes] == [11, 11]
    assert len(list(hanging_findings(_solved(poses, chain[:3]), "laser_scanmatch"))) == 3


def test_every_group_with_a_surveyed_stop_is_placed_and_a_gap_says_what_would_close_it():
    poses = _stops(7)
    matches = [
        _match(poses, "a", "b"),
        _match(poses, "c", "d"),
        _match(poses, "e", "f"),
        _match(poses, "b", "e", {"violating": 0.3}),
    ]
    found = _solved(poses, matches, "ac")
    assert found.stops == ("a", "b", "c", "d")
    assert np.abs(found.placement.poses - poses[:4]).max() < 0.01
    assert found.parts.tolist() == [0, 0, 1, 1]
    # two groups share nothing but what their surveyed stops share: nothing here
    assert np.abs(found.placement.joint[:6, 6:]).max() < 1e-9
    first, second = found.gaps
    assert first.stops == ("e", "f")
    assert [(one.reference, one.moving) for one in first.matches] == [("b", "e")]
    assert second.stops == ("g",)
    assert second.matches == ()
    assert set(found.lost) == {"e", "f", "g"}


def test_a_group_of_its_own_surveyed_stop_is_not_hung_on_a_doubtful_match():
    poses = _stops(4)
    matches = [
        _match(poses, "a", "b"),
        _match(poses, "c", "d"),
        _match(poses, "b", "c", DOUBTFUL, (1.0, 0.0, 0.0)),
    ]
    found = _solved(poses, matches, "ad")
    assert found.hanging == ()
    assert np.abs(found.placement.poses - poses).max() < 0.01


def test_a_person_has_the_last_word():
    poses = _stops(3)
    wrong = _match(poses, "a", "b", off=(0.2, 0.0, 0.0))
    refused = replace(wrong, verdict="refuted")
    found = _decided(poses, [refused, _match(poses, "b", "c"), _match(poses, "a", "c")])
    assert found[0] is refused


def test_an_imprecise_match_that_contradicts_the_others_is_refuted_and_a_right_one_stays():
    """A corridor whose doors look alike: off by a metre, at a stated 20 mm."""
    poses = _stops(5)
    rest = [_match(poses, *pair) for pair in list(combinations("abcde", 2))[1:]]
    weak = {"explained": 0.15}
    for off, verdict in ((0.0, "imprecise"), (0.06, "imprecise"), (1.0, "refuted")):
        one = _match(poses, "a", "b", weak, (off, 0.0, 0.0), sigma=0.02)
        found = _decided(poses, [one, *rest])
        assert found[0].verdict == verdict
        assert found[1:] == rest
    # a single chain says nothing against it
    chain = [_match(poses, "a", "b", weak, (1.0, 0.0, 0.0), sigma=0.02), _match(poses, "b", "c")]
    assert [one.verdict for one in _decided(poses[:3], chain)] == ["imprecise", "accepted"]


AMBIGUOUS = {"rival": -0.01}


def test_ambiguous_matches_confirm_each_other_not_however_well_they_agree():
    # equal niches a metre apart: all three are wrong by one niche, and agree
    poses = _stops(6)
    inside = [_match(poses, *pair) for group in ("abc", "def") for pair in combinations(group, 2)]
    turned = np.array([1.0, 0.0, 0.0])
    moved = poses.copy()
    moved[3:, :2] += turned[:2]
    across = [_match(moved, first, second, AMBIGUOUS) for first, second in ("ad", "be", "cf")]
    found = _decided(poses, across + inside)
    assert {one.verdict for one in found[:3]} == {"may be wrong"}
    # one that nothing else could be, in agreement with them, decides
    clear = _match(moved, "a", "e", DOUBTFUL)
    assert {one.verdict for one in _decided(poses, [clear, *across, *inside])[:4]} == {"accepted"}


def test_a_stop_behind_an_ambiguous_match_is_where_the_guess_has_it():
    poses = _stops(3)
    chain = [_match(poses, "a", "b"), _match(poses, "b", "c", AMBIGUOUS, (0.3, 0.0, 0.0))]
    chain[1] = replace(chain[1], guess=between(poses[1], poses[2]))
    found = _solved(poses, chain)
    assert np.abs(found.placement.poses[2] - poses[2]).max() < 0.01
    sigma = np.sqrt(np.diagonal(found.placement.joint)).reshape(3, 3)
    assert sigma[2, 0] == pytest.approx(SIGMAS[0], rel=0.1)
