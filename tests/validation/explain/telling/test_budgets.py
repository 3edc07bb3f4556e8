"""Budgets that tell frame and mount apart."""

import numpy as np
import pytest

from validation.explain.analysis import explain
from validation.explain.telling.budgets import system_budgets
from validation.poses.pose_table import PoseTable


def campaign(n, seed, headings=None):
    rng = np.random.default_rng(seed)
    turned = rng.uniform(-np.pi, np.pi, n) if headings is None else headings
    poses = np.column_stack([rng.uniform(-4, 4, (n, 2)), turned])
    ids = tuple(map(str, range(n)))
    noise = rng.normal(size=(n, 3)) * [0.01, 0.01, 0.004]
    return PoseTable("survey", ids, poses), PoseTable("rig", ids, poses + noise)


def test_what_frame_and_mount_contribute_is_how_well_they_are_known():
    n = 24
    survey, rig = campaign(n, 1)
    [one] = explain(survey, [rig]).systems
    x, _, theta = system_budgets(one)
    lines = {line.name: line.uncertainty for line in x.contributions}
    # A position is shifted by two numbers of the frame and, turned about, two of the mount.
    shared = np.hypot(lines["frame"], lines["mount"])
    assert 0.01 * np.sqrt(2 / n) < 1.4 * shared
    assert shared < 2 * 0.01 * np.sqrt(3 / n)
    assert lines["noise of system and survey"] == pytest.approx(0.01, rel=0.5)
    assert x.expanded > 1.96 * x.combined
    assert theta.unit == "rad"


def test_many_budgets_say_how_far_frame_and_mount_are_off():
    # The fitted chain applied to poses that are right moves them by what the budget says.
    moved, said = [], []
    for seed in range(25):
        survey, rig = campaign(16, seed)
        [one] = explain(survey, [rig]).systems
        if not (found := system_budgets(one)):
            continue  # neighbours that are alike by chance
        fit = one.selection.candidate("frame_mount").fit
        errors = fit.corrected.poses[0] - one.selection.pairs.gt
        moved.append(np.mean(errors[:, 0] ** 2))
        lines = {line.name: line.uncertainty for line in found[0].contributions}
        said.append(lines["frame"] ** 2 + lines["mount"] ** 2)
    # Mean squares of about 3 numbers each: the ratio of 20 is known to 20 %.
    assert len(said) >= 18
    assert np.mean(moved) / np.mean(said) == pytest.approx(1, abs=0.5)


def test_at_one_heading_there_is_no_such_budget():
    survey, rig = campaign(12, 2, headings=np.zeros(12))
    [one] = explain(survey, [rig]).systems
    assert system_budgets(one) == ()
