"""Fits: exact where there is no noise, unmoved by gross errors, and honest about what is lost."""

import numpy as np
import pytest
from explain_campaigns import FRAME, GT_NOISE, MOUNT, SCALE, random_stops, simulate, spoiled, table

from validation.errors import GtvalError
from validation.explain.fitting.fit import fit
from validation.explain.fitting.leave_one_out import leave_one_out
from validation.explain.fitting.models import candidates
from validation.explain.fitting.noise import precision, weigh
from validation.explain.fitting.observability import observability
from validation.explain.fitting.pairs import make_pairs
from validation.explain.fitting.settled import settle

TRUE = {
    "frame": FRAME,
    "mount": MOUNT,
    "reference_mount": MOUNT,
    "frame_mount": np.concatenate([FRAME, MOUNT]),
    "scale": np.array([SCALE]),
}
NAMES = {"reference_mount": "6"}


def model_named(name, pairs):
    models = candidates(reference=pairs.reference_pose is not None, moving=pairs.motion is not None)
    return next(model for model in models if model.name == name)


def fitted(name, survey, rig, **options):
    pairs = make_pairs(survey, rig, NAMES.get(name, ""))
    return pairs, fit(pairs, model_named(name, pairs), **options)


@pytest.mark.parametrize("name", TRUE)
def test_without_noise_the_fault_is_found_exactly(name):
    stops = random_stops(np.random.default_rng(3), 15)
    survey, rig = table("survey", stops), table("rig", spoiled(name, stops, stops))
    _, found = fitted(name, survey, rig)
    k = len(TRUE[name])
    assert found.parameters[0, :k] == pytest.approx(TRUE[name], abs=1e-9)
    assert np.abs(found.residuals).max() < 1e-8


@pytest.mark.parametrize("stated", [True, False])
def test_gross_errors_do_not_move_the_fit(stated):
    survey, rig = simulate("frame_mount", 5, stated=stated)
    pairs, clean = fitted("frame_mount", survey, rig)
    cells = np.ones((len(pairs), 2), dtype=bool)
    cells[[2, 9, 20, 25], 0] = cells[[4, 11], 1] = False
    without = settle(pairs, clean, cells)
    poses = rig.poses.copy()
    poses[[2, 9, 20, 25], :2] += [[0.5, 0], [0.3, -2], [-0.4, 0.4], [1, 1]]
    poses[[4, 11], 2] += [0.6, -2.0]
    _, spoilt = fitted("frame_mount", survey, table("rig", poses, GT_NOISE if stated else None))
    sigma = np.sqrt(np.diagonal(clean.covariance[0]))
    # The same as without these cells, but for the weights of the others' tails: less than sigma.
    assert np.all(np.abs(spoilt.parameters - without.fit.parameters)[0] < sigma)
    assert spoilt.weights[0, [2, 9, 20, 25], 0].max() < 0.05
    assert spoilt.weights[0, [4, 11], 1].max() < 0.05


def test_the_density_is_a_density():
    # Integrated over a grid fine at the middle and wide enough for the widest part.
    grid = np.sinh(np.linspace(-9, 9, 121))
    x, y, t = np.meshgrid(grid, grid, grid, indexing="ij")
    points = np.stack([x, y, t], -1)
    covariance = np.array([[1.0, 0.3, 0.4], [0.3, 1.5, 0.2], [0.4, 0.2, 0.8]])
    density = np.exp(weigh(points, precision(covariance)).log_density)
    width = np.gradient(grid)
    volume = width[:, None, None] * width[:, None] * width
    assert (density * volume).sum() == pytest.approx(1.0, abs=0.02)


def test_precision_is_the_inverse():
    rng = np.random.default_rng(0)
    factor = rng.normal(size=(7, 3, 3))
    covariance = factor @ np.swapaxes(factor, -1, -2) + 0.1 * np.eye(3)
    known = precision(covariance)
    assert np.allclose(known.joint @ covariance, np.eye(3))
    assert np.allclose(known.position @ covariance[:, :2, :2], np.eye(2))
    assert np.allclose(known.log_joint, np.linalg.slogdet(covariance)[1])


def test_one_step_leave_one_out_is_refitting():
    survey, rig = simulate("frame", 8)
    pairs, found = fitted("frame", survey, rig)
    include = ~np.eye(len(pairs), dtype=bool)
    again = fit(pairs, found.model, include=include)
    refitted = again.residuals[np.arange(len(pairs)), np.arange(len(pairs))]
    # Weights are kept in the one step and follow the data in the refit: a small part of sigma.
    assert np.abs(leave_one_out(found).residuals - refitted).max() < 0.05 * 0.01


def test_a_settled_fit_counts_its_freedom():
    survey, rig = simulate("frame", 8, stated=False)
    pairs, found = fitted("frame", survey, rig)
    settled = settle(pairs, found, np.ones((len(pairs), 2), dtype=bool))
    assert settled.used_freedom.sum() == pytest.approx(3)
    assert settled.dof.sum() == pytest.approx(3 * 26 - 3)
    position = settled.fit.residuals[0, :, :2]
    expected = np.sqrt((position**2).sum() / settled.dof[0])
    assert settled.fit.scale[0, 0] == pytest.approx(expected)


def test_before_and_after_are_both_told():
    survey, rig = simulate("mount", 2)
    pairs, found = fitted("mount", survey, rig)
    settled = settle(pairs, found, np.ones((len(pairs), 2), dtype=bool))
    assert np.array_equal(settled.before, pairs.errors)
    assert settled.spread(settled.after)[0] < settled.spread(settled.before)[0]


# What cannot be seen ---------------------------------------------------------------------------


def seen(name, stops):
    survey, rig = simulate("none", 4, n=len(stops), stops=stops)
    _, found = fitted(name, survey, rig)
    return observability(found)


def test_at_one_heading_frame_and_mount_are_not_told_apart():
    stops = random_stops(np.random.default_rng(1), 26)
    stops[:, 2] = 0.7
    lost = seen("frame_mount", stops)
    assert {"frame_x", "frame_y", "mount_x", "mount_y"} <= set(lost.undetermined)
    assert seen("frame", stops).complete
    assert seen("mount", stops).complete


def test_all_stops_at_one_place_show_no_scale():
    stops = random_stops(np.random.default_rng(1), 26)
    stops[:, :2] = [1.0, 2.0]
    assert "scale" in seen("frame_scale", stops).undetermined


def test_many_headings_show_frame_and_mount():
    assert seen("frame_mount", random_stops(np.random.default_rng(1), 26)).complete


# Bad input --------------------------------------------------------------------------------------


def test_disjoint_ids_are_an_error():
    survey, rig = simulate("none", 1, n=5)
    other = type(rig)("rig", tuple("abcde"), rig.poses)
    with pytest.raises(GtvalError, match="no pose id in common"):
        make_pairs(survey, other)


@pytest.mark.parametrize("which", [0, 1])
def test_degrees_are_noticed(which):
    tables = list(simulate("none", 1))
    poses = tables[which].poses.copy()
    poses[:, 2] = np.degrees(poses[:, 2]) / 100 * 100
    tables[which] = table(tables[which].system, poses)
    with pytest.raises(GtvalError, match=f"'{tables[which].system}' look like degrees"):
        make_pairs(*tables)


def test_a_large_turn_of_the_frame_is_not_taken_for_degrees():
    survey, rig = simulate("none", 1)
    poses = rig.poses.copy()
    poses[:, 2] += 2.0
    make_pairs(survey, table("rig", poses))


def test_an_unknown_reference_is_an_error():
    survey, rig = simulate("none", 1)
    with pytest.raises(GtvalError, match="reference pose 99 has no validation pose"):
        make_pairs(survey, rig, "99")


def test_a_reference_known_by_construction_does_not_count():
    survey, rig = simulate("reference_mount", 1)
    pairs = make_pairs(survey, rig, "6")
    assert pairs.constructed == ("6",)
    assert len(pairs) == 25


def test_times_are_needed_for_every_pose_and_must_differ():
    survey, rig = simulate("none", 1, n=5)
    with pytest.raises(GtvalError, match="no time is given for pose 5"):
        make_pairs(survey, rig, times={str(i): float(i) for i in range(1, 5)})
    with pytest.raises(GtvalError, match="different times"):
        make_pairs(survey, rig, times=dict.fromkeys(("1", "2", "3", "4", "5"), 1.0))


def test_a_time_offset_is_recovered():
    rng = np.random.default_rng(2)
    t = np.linspace(0, 20, 60)
    path = np.column_stack([2 * np.cos(0.3 * t), 2 * np.sin(0.6 * t), 0.4 * t])
    late = t - 0.05
    gt = np.column_stack([2 * np.cos(0.3 * late), 2 * np.sin(0.6 * late), 0.4 * late])
    noise = rng.normal(size=(2, 60, 3)) * 0.002
    times = {str(i + 1): value for i, value in enumerate(t)}
    pairs = make_pairs(table("survey", path + noise[0]), table("rig", gt + noise[1]), times=times)
    found = fit(pairs, model_named("time", pairs))
    sigma = float(np.sqrt(found.covariance[0, 0, 0]))
    assert found.parameters[0, 0] == pytest.approx(0.05, abs=4 * sigma)
    assert sigma < 0.002
