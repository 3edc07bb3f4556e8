"""Which explanation is chosen, how often, and how sure its numbers are."""

import numpy as np
import pytest
from explain_campaigns import FRAME, MOUNT, SCALE, random_stops, simulate
from scipy import stats

from validation.explain.analysis import Question, explain
from validation.explain.fitting.models import candidates
from validation.explain.fitting.pairs import make_pairs
from validation.explain.fitting.selection import select
from validation.explain.fitting.settled import settle
from validation.explain.sources.reference import infer_reference
from validation.explain.telling.words import findings

TRUE = {
    "none": (np.zeros(0), "none"),
    "tied": (np.zeros(0), "none"),
    "frame": (FRAME, "frame"),
    "mount": (MOUNT, "mount"),
    "reference_mount": (MOUNT, "reference_mount"),
    "frame_mount": (np.concatenate([FRAME, MOUNT]), "frame_mount"),
    "scale": (np.array([SCALE]), "scale"),
}
REFERENCES = {"tied": "6", "reference_mount": "6"}


def chosen_and_nees(kind, seed, stated, **campaign):
    survey, rig = simulate(kind, seed, stated=stated, **campaign)
    pairs = make_pairs(survey, rig, REFERENCES.get(kind, ""))
    selection = select(pairs)
    true, name = TRUE[kind]
    nees = np.nan
    if len(true):
        everything = np.ones((len(pairs), 2), dtype=bool)
        settled = settle(pairs, selection.candidate(name).fit, everything)
        error = settled.values - true
        nees = float(error @ np.linalg.solve(settled.covariance, error))
    return selection.chosen.name == name, nees, len(true)


def check_rate_and_nees(kind, stated, seeds):
    found = [chosen_and_nees(kind, seed, stated) for seed in range(seeds)]
    right = sum(ok for ok, _, _ in found)
    # At least 95 % must be right; so few only where that would happen once in a thousand.
    assert right >= stats.binom.ppf(0.001, seeds, 0.95)
    k = found[0][2]
    if k:
        mean = np.mean([nees for _, nees, _ in found])
        # With the noise estimated (73 degrees of freedom left) NEES is k F(k, 73), mean k 73/71.
        expected = k * (1.0 if stated else 73 / 71)
        low, high = stats.chi2.ppf([0.0005, 0.9995], k * seeds) / seeds
        assert low < mean * k / expected < high


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("kind", TRUE)
def test_the_cause_is_found_and_its_covariance_is_right(kind, stated):
    check_rate_and_nees(kind, stated, 12)


@pytest.mark.full
@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("kind", TRUE)
def test_the_cause_is_found_and_its_covariance_is_right_over_many_seeds(kind, stated):
    check_rate_and_nees(kind, stated, 300)


def test_the_order_of_nesting():
    models = {m.name: m for m in candidates(reference=True, moving=False)}
    assert models["none"].nested_in(models["frame"])
    assert models["reference_mount"].nested_in(models["frame_mount"])
    assert not models["frame"].nested_in(models["mount"])


def test_schwarz_weights_add_up():
    survey, rig = simulate("frame", 1)
    weights = select(make_pairs(survey, rig)).weights
    assert sum(weights.values()) == pytest.approx(1)
    assert weights["frame"] > 0.5


# The reference inferred ------------------------------------------------------------------------


def inferred(kind, seed):
    survey, rig = simulate(kind, seed)
    if kind == "reference_mount":  # its own pair would give the reference away
        keep = [name for name in rig.ids if name != "6"]
        rig = rig.select(keep)
    pairs = make_pairs(survey, rig)
    candidate = select(pairs).candidate("frame_mount")
    settled = settle(pairs, candidate.fit, np.ones((len(pairs), 2), dtype=bool))
    return infer_reference(settled, survey)


def test_the_reference_is_among_those_not_ruled_out():
    evidence = [inferred("reference_mount", seed) for seed in range(40)]
    held = sum("6" in one.possible for one in evidence)
    # Ruled out wrongly in 5 %: 38 of 40 expected.
    assert stats.binom.ppf(0.001, 40, 0.95) <= held
    assert np.median([len(one.possible) for one in evidence]) < 8
    assert np.median([one.odds for one in evidence]) > 1


def test_the_heading_of_the_reference_is_found():
    survey, _ = simulate("reference_mount", 3)
    evidence = inferred("reference_mount", 3)
    off = np.angle(np.exp(1j * (evidence.heading - survey.poses[5, 2])))
    assert abs(off) < 3 * evidence.heading_sigma


def test_a_frame_of_its_own_is_not_taken_for_a_reference():
    evidence = [inferred("frame_mount", seed) for seed in range(20)]
    assert sum(one.accepted for one in evidence) <= 4


# What cannot be told ---------------------------------------------------------------------------


def texts(explanation):
    return {finding.code: finding.text for finding in findings(explanation)}


def test_two_sources_cannot_tell_who_is_wrong():
    survey, rig = simulate("none", 3)
    poses = rig.poses.copy()
    poses[7, :2] += 0.3
    told = texts(explain(survey, [type(rig)("rig", rig.ids, poses, rig.covariances)]))
    assert "nothing tells which" in told["two_sources"]
    assert "no other source tells which of them is wrong" in told["disputed_pose"]


def test_five_poses_say_what_they_do_not_show():
    # A mount error over five stops: whatever is said, the poses are too few for much.
    survey, rig = simulate("none", 3, n=5, stated=False)
    explanation = explain(survey, [rig])
    assert explanation.systems[0].name == "none"
    told = texts(explanation)
    assert "no_three_cornered_hat" in told


def test_three_poses_are_too_few():
    survey, rig = simulate("none", 3, n=3)
    explanation = explain(survey, [rig])
    assert explanation.systems[0].name == "unknown"
    assert "too few poses" in texts(explanation)["too_few_poses"]


def one_heading(seed):
    stops = random_stops(np.random.default_rng(seed), 26)
    stops[:, 2] = 0.4
    return stops


def test_at_one_heading_a_wrong_mount_cannot_be_told_from_a_wrong_frame():
    survey, rig = simulate("none", 3, stops=one_heading(3))
    # A mount without a turn: a turn of the frame would show, as it moves far stops more.
    poses = rig.poses + np.array([0.06, -0.04, 0.0])
    rig = type(rig)("rig", rig.ids, poses, rig.covariances)
    explanation = explain(survey, [rig])
    told = texts(explanation)
    [one] = explanation.systems
    names = {one.name, *(rival.name for rival in one.selection.rivals)}
    assert {"frame", "mount"} <= names
    assert "cannot tell them apart" in told["rivals"]
    assert "frame_mount" in told["not_observable"]


def test_a_straight_path_at_one_heading_says_so():
    stops = np.column_stack([np.linspace(0, 5, 20), np.full(20, 1.0), np.zeros(20)])
    survey, rig = simulate("none", 3, n=20, stops=stops)
    assert "not_observable" in texts(explain(survey, [rig]))


# Systems of one sensor -------------------------------------------------------------------------


def test_systems_of_one_sensor_agree_on_the_same_mount():
    agreed = 0
    for seed in range(20):
        survey, first = simulate("mount", seed, stated=False)
        rng = np.random.default_rng(1000 + seed)
        poses = first.poses + rng.normal(size=first.poses.shape) * 0.005
        second = type(first)("other", first.ids, poses)
        question = Question(sensors={"laser": ("rig", "other")})
        [one] = explain(survey, [first, second], question).agreements
        agreed += one.p_value > 0.05
        assert one.joint == pytest.approx(MOUNT, abs=0.02)
    assert agreed >= stats.binom.ppf(0.001, 20, 0.95)


def test_different_mounts_are_told_apart():
    survey, first = simulate("mount", 1)
    _, second = simulate("none", 1)
    second = type(first)("other", second.ids, second.poses, second.covariances)
    question = Question(sensors={"laser": ("rig", "other")})
    explanation = explain(survey, [first, second], question)
    assert explanation.agreements[0].p_value < 1e-6
    assert "different_mounts" in texts(explanation)
