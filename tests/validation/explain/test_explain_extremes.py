"""Tables that no careful campaign gives: they are explained, or refused in plain words."""

import numpy as np
import pytest

from validation.errors import GtvalError
from validation.explain.analysis import Question, explain
from validation.explain.fitting.noise import ROUNDING, regular
from validation.explain.telling.output import explanation_files
from validation.explain.telling.section import explain_sections, repeatability
from validation.explain.telling.words import findings
from validation.poses.pose_table import PoseTable
from validation.report.svg import inline_svg
from validation.results import Figure
from validation.statistics.conclusions import conclusions
from validation.statistics.error_statistics import bias_test
from validation.statistics.evaluation import evaluate

NOISES = (0.0, 1e-12, 2e-3, 10.0)
FARS = ("none", "position", "heading", "all", "everywhere")
VARIANCES = {"none": None, "plain": 1e-6, "huge": 1e8, "tiny": 1e-16, "mixed": 1.0, "half": 1e-6}


def stops(rng: np.random.Generator, shape: str, n: int) -> np.ndarray:
    poses = np.column_stack([rng.uniform(-3, 3, (n, 2)), rng.uniform(-3, 3, n)])
    if shape == "one place":
        poses[:] = poses[0]
    if shape == "one heading":
        poses[:, 2] = poses[0, 2]
    if shape == "a line":
        poses[:, 1] = 0
    return poses


def covariances(rng: np.random.Generator, kind: str, n: int) -> np.ndarray:
    variance = VARIANCES[kind]
    if variance is None:
        return np.empty(0)
    found = np.tile(variance * np.eye(3), (n, 1, 1))
    if kind == "mixed":
        found *= 10.0 ** rng.integers(-10, 8, (n, 1, 1))
    if kind == "half":
        found[::2] = np.nan
    return found


def table(rng: np.random.Generator, name: str, truth: np.ndarray, noise: float) -> PoseTable:
    n = len(truth)
    poses = truth + noise * rng.normal(size=(n, 3)) * [1, 1, 0.3]
    far = rng.choice(FARS)
    if far == "position":
        poses[0, :2] += rng.choice([1, 100, 9e5])
    if far == "heading":
        poses[0, 2] += 2
    if far == "all":
        poses[:, :2] += rng.choice([1, 1e5])
    if far == "everywhere":
        poses[:, :2] *= 1e5
    ids = tuple(str(number) for number in range(n))
    known = covariances(rng, str(rng.choice(list(VARIANCES))), n)
    whole = PoseTable(name, ids, poses, known)
    kept = n if name == "survey" or rng.random() < 0.7 else int(rng.integers(1, n + 1))
    return whole.select(ids[:kept])


def question(rng: np.random.Generator, truth: np.ndarray, names: list[str]) -> Question:
    stop = str(rng.integers(len(truth)))
    asked = [
        Question(),
        Question(references={names[0]: stop}),
        Question(references={names[0]: "?"}),
        Question(times={str(number): float(number) for number in range(len(truth))}),
        Question(sensors={"camera": tuple(names)}),
        Question(witnesses=[table(rng, "witness", truth, 0.1)]),
    ]
    return asked[int(rng.integers(len(asked)))]


@pytest.mark.parametrize("seed", range(48))
def test_extreme_tables_end_in_an_explanation_or_in_plain_words(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.choice([1, 2, 3, 4, 5, 6, 8, 20]))
    truth = stops(rng, str(rng.choice(["free", "one place", "one heading", "a line"])), n)
    noise = float(rng.choice(NOISES))
    names = [f"rig{number}" for number in range(int(rng.integers(1, 4)))]
    survey = table(rng, "survey", truth, noise)
    systems = [table(rng, name, truth, noise) for name in names]
    asked = question(rng, truth, names)
    try:
        explanation = explain(survey, systems, asked)
    except GtvalError as error:
        assert str(error)  # noqa: PT017  (being refused in words is one of both good ends)
        return
    for one in systems:
        conclusions(evaluate(survey, one))
    assert findings(explanation)
    assert "explain/explanation.json" in explanation_files(explanation)
    sections = explain_sections(explanation, (0.05, 0.05, 0.05), repeatability(explanation))
    if seed % 8 == 0:  # figures take longest
        for section in sections:
            for block in section.blocks:
                if isinstance(block, Figure):
                    assert "<svg" in inline_svg(block, "x")


def test_a_single_pose_far_off_is_told_as_a_disagreement():
    one = PoseTable("survey", ("1",), np.array([[0.572, 5.634, -1.168]]), 3e-6 * np.eye(3)[None])
    far = PoseTable("rig", ("1",), np.array([[1.372, 5.134, -0.668]]), 3e-6 * np.eye(3)[None])
    verdicts = explain(one, [far]).arbitration.verdicts
    assert {(verdict.cell, verdict.blamed) for verdict in verdicts} == {
        ("position", ("survey", "rig")),
        ("heading", ("survey", "rig")),
    }


@pytest.mark.parametrize(("mean", "p_value"), [(0.25, 1.0), (0.05, 1.0), (0.04, 0.0)])
def test_errors_that_are_all_the_same_leave_no_doubt_about_their_bias(mean, p_value):
    test = bias_test(mean, 0.0, 3, limit=0.05)
    assert (test.smallest_limit, test.p_value) == (mean, p_value)


def test_only_nearly_singular_matrices_are_changed_before_they_are_inverted():
    plain = np.array([[4.0, 1.9], [1.9, 1.0]])
    flat = np.array([[4.0, 2.0], [2.0, 1.0]])
    both = regular(np.stack([plain, flat]))
    assert (both[0] == plain).all()
    # The least eigenvalue of the correlations, 0, becomes ROUNDING: each variance grows by it.
    # Correlations are of size 1, so that what rounds is of the size of 2.2e-16.
    assert both[1] - flat == pytest.approx(np.diag([4.0, 1.0]) * ROUNDING, abs=1e-14)
