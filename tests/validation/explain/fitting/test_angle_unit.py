"""Headings in degrees are refused where that is certain, and only asked about where it is not."""

import numpy as np
import pytest
from explain_campaigns import simulate, table

from validation.errors import GtvalError
from validation.explain.analysis import explain
from validation.explain.fitting.angle_unit import CERTAIN, angle_unit_doubt, chance_of_agreement
from validation.explain.telling.words import findings

THREE = np.array([[1, 1, 0.3], [2, 2, 0.6], [3, 0, 0.9], [4, 1, 1.2], [5, 2, 1.5], [6, 0, 1.8]])
NOISY = np.array([[1.3, 1, 0.4], [1.6, 2.2, 0.4], [3.1, -0.5, 1.2]])


def test_three_noisy_poses_in_radians_are_explained_and_not_asked_about():
    # Two of three headings agree as well by accident in 4 % of tables.
    explanation = explain(table("survey", THREE), [table("rig", NOISY)])
    assert "perhaps_degrees" not in {one.code for one in findings(explanation)}


def test_three_headings_beyond_a_turn_that_agree_as_degrees_are_asked_about():
    degrees = THREE[:3] * [1, 1, 100.0]
    noisy = np.radians(degrees[:, 2]) + np.array([0.05, -0.04, 0.02])
    survey = table("survey", np.column_stack([THREE[:3, :2], noisy]))
    (warning,) = [
        one
        for one in findings(explain(survey, [table("rig", degrees)]))
        if one.code == "perhaps_degrees"
    ]
    assert warning.severity == "warning"
    assert warning.text.startswith("The angles of 'rig' look like degrees")
    assert warning.text.endswith("if they are degrees, write radians.")


def test_a_good_table_is_not_asked_about():
    assert angle_unit_doubt(*simulate("none", 1)) == ""


@pytest.mark.parametrize("seed", range(20))
def test_no_table_in_radians_is_refused_however_noisy(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 30))
    # Headings beyond a turn, as of a robot that counts its turns, and no relation at all.
    a, b = (np.column_stack([np.zeros((n, 2)), rng.uniform(-9, 9, n)]) for _ in range(2))
    angle_unit_doubt(table("survey", a), table("rig", b))


def test_degrees_that_are_small_are_only_asked_about():
    survey, rig = simulate("none", 1)
    small = survey.poses * [1, 1, 0.1]  # headings of at most 18 degrees, all below a turn
    degrees = np.column_stack([rig.poses[:, :2], 0.1 * np.degrees(survey.poses[:, 2])])
    degrees[:, 2] = np.clip(degrees[:, 2], -6, 6)
    assert "look like degrees" in angle_unit_doubt(table("survey", small), table("rig", degrees))


def test_degrees_of_a_campaign_are_certain():
    survey, rig = simulate("none", 1)
    degrees = rig.poses * [1, 1, np.degrees(1.0)]
    with pytest.raises(GtvalError, match=r"Write radians: degrees times 0\.0174533"):
        angle_unit_doubt(survey, table("rig", degrees))


@pytest.mark.parametrize("n", [3, 5, 8, 13])
@pytest.mark.parametrize("spread", [0.05, 0.2, 0.5])
def test_the_chance_is_an_upper_bound(n, spread):
    rng = np.random.default_rng(n)
    trials = 20_000
    headings = rng.uniform(-np.pi, np.pi, (trials, n))
    turned = np.exp(1j * headings)
    middle = np.median(turned.real, 1) + 1j * np.median(turned.imag, 1)
    found = np.median(np.abs(np.angle(turned / middle[:, None])), axis=1)
    share = float((found <= spread).mean())
    bound = chance_of_agreement(n, spread)
    # The bound is twice that of one table; four standard deviations of the counted share.
    assert share <= bound / 2 + 4 * np.sqrt(bound / trials)


def test_more_poses_make_it_more_certain_and_three_never_are():
    chances = [chance_of_agreement(n, 0.02) for n in (3, 9, 15, 27)]
    assert chances == sorted(chances, reverse=True)
    assert chances[0] > 0.01
    assert chances[-1] < CERTAIN


def test_degrees_in_both_tables_are_asked_about():
    survey, rig = simulate("none", 1)
    turned = [1, 1, np.degrees(1.0)]
    doubt = angle_unit_doubt(
        table("survey", survey.poses * turned), table("rig", rig.poses * turned)
    )
    assert "both look like degrees" in doubt
