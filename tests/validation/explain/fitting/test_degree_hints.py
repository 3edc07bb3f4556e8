"""Headings that look like degrees: a warning, and an error only where chance cannot do so."""

import numpy as np
import pytest

from validation.errors import GtvalError
from validation.explain.analysis import Question, explain
from validation.explain.fitting.pairs import CERTAIN, degrees_hint
from validation.explain.telling.words import findings
from validation.poses.pose_table import PoseTable


def table(system, headings):
    n = len(headings)
    places = np.column_stack([np.arange(n), np.arange(n) % 3])
    return PoseTable(system, tuple(map(str, range(n))), np.column_stack([places, headings]))


def test_three_noisy_poses_in_radians_are_explained_with_a_warning():
    # The headings 0.3, 0.6 and 0.9 with errors as large as themselves.
    survey = table("survey", [0.3, 0.6, 0.9, 1.2, 1.5, 1.8])
    rig = table("rig", [0.4, 0.4, 1.2])
    told = findings(explain(survey, [rig], Question()))
    (hint,) = [one for one in told if one.code == "perhaps_degrees"]
    assert hint.severity == "warning"
    assert hint.text.startswith("Perhaps the angles of 'survey' look like degrees")


def test_many_headings_in_degrees_are_refused():
    rng = np.random.default_rng(0)
    headings = rng.uniform(0.0, 2.0, 26)
    with pytest.raises(GtvalError, match="'rig' look like degrees"):
        degrees_hint(
            table("survey", headings),
            table("rig", np.degrees(headings + rng.normal(0, 0.01, 26))),
        )


def test_unrelated_headings_are_never_refused():
    # Each table is refused with a chance below 1e-6: none of 3000 is, whatever their number.
    rng = np.random.default_rng(1)
    for n in (3, 4, 5, 8, 12):
        for _ in range(600):
            a, b = rng.uniform(-np.pi, np.pi, (2, n))
            degrees_hint(table("a", a), table("b", b))


def test_few_headings_in_degrees_are_a_warning():
    # Half of six within 0.02 rad: 2 6 C(5, 2) (2 0.02 / pi)^2 = 0.02, no certainty.
    headings = np.array([0.1, 0.5, 0.9, 1.3, 1.7, 2.1])
    errors = np.array([0.05, -0.02, 0.02, -0.05, 0.02, -0.03])
    hint = degrees_hint(table("a", headings), table("b", np.degrees(headings + errors)))
    assert CERTAIN < 0.02
    assert "'b' look like degrees" in hint
