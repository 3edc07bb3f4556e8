"""Two tables of which one took its frame from the other: what their differences tell."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from validation.errors import InputError
from validation.poses import common_origin, joint
from validation.poses.common_origin import (
    apart,
    follows_files,
    joint_of,
    own_part,
    placed_by,
    with_stored_follows,
)
from validation.poses.pose_table import PLANAR, PoseTable, from_csv, to_csv
from validation.statistics.comparison import compare
from validation.text_files.writing import pieces_of

SURVEY, OWN = np.array([0.003, 0.003, 0.003]), np.array([0.002, 0.002, 0.001])


def _truth(rng, n=12):
    return np.column_stack([rng.uniform(-3, 3, (n, 2)), rng.uniform(-3, 3, n)])


def _campaign(seed, stops=12, common=0.004, *, mount=True):
    """A survey whose poses share an error, and a system laid onto some of its stops."""
    rng = np.random.default_rng(seed)
    truth = _truth(rng)
    n = len(truth)
    ids = tuple(str(one) for one in range(n))
    shift = np.tile([1.0, 1.0, 0.0], n)
    joint = np.kron(np.eye(n), np.diag(SURVEY**2)) + common**2 * np.outer(shift, shift)
    blocks = joint.reshape(n, 3, n, 3)[range(n), :, range(n)]
    errors = rng.normal(0, 1, (n, 3)) * SURVEY + common * rng.normal() * shift[:3]
    survey = PoseTable("survey", ids, truth + errors, blocks, joint=joint)
    own = truth + rng.normal(0, 1, (n, 3)) * OWN
    start = PoseTable("cart", ids, own, np.tile(np.diag(OWN**2), (n, 1, 1)))
    table = placed_by(start, survey, ids[:stops], mount=mount)
    # The system's poses themselves, moved as that says: to first order L = raw + G (S - raw).
    used = (survey.poses[:stops] - own[:stops]).ravel()
    moved = own + (table.follows.gain @ used).reshape(n, 3)
    return survey, PoseTable(
        "cart", ids, moved, table.covariances, joint=table.joint, follows=table.follows
    )


@pytest.mark.parametrize(("stops", "fitted"), [(12, 6), (5, 6), (2, 5), (1, 3)])
def test_differences_of_a_system_placed_by_surveyed_stops_are_as_large_as_stated(stops, fitted):
    total, dof, levels = 0.0, 0, []
    for seed in range(40):
        test = compare(*_campaign(seed, stops, mount=stops > 1)).test
        total += test.mean * test.poses
        dof += round(test.per_pose * test.poses)
        levels.append(test.p_value)
    expected = 36 - fitted
    assert dof == 40 * expected
    low, high = stats.chi2.ppf([0.0005, 0.9995], dof)
    assert low < total < high
    # One of 20 right tables is outside its 95 % interval: 99.9 % of 40 tables have at most 8.
    assert sum(level < 0.05 for level in levels) <= 8


def test_taken_as_independent_the_same_differences_look_far_too_small():
    ratios = []
    for seed in range(20):
        survey, table = _campaign(seed, common=0.02)
        alone = PoseTable("cart", table.ids, table.poses, table.covariances, joint=table.joint)
        ratios.append(compare(survey, alone).test.mean / 3)
        assert compare(survey, table).test.verdict in {"below", "inside", "above"}
    assert np.mean(ratios) < 0.85


def test_the_covariance_of_differences_is_what_many_campaigns_scatter_by():
    squares = []
    for seed in range(40):
        survey, table = _campaign(seed, stops=4)
        found = compare(survey, table)
        squares.append((found.errors[:, :2].mean(0) / found.mean_sigmas[:2]) ** 2)
    # 80 squares of a standard normal: 99.9 % of right ones
    low, high = stats.chi2.ppf([0.0005, 0.9995], 80)
    assert low < np.sum(squares) < high


def test_means_are_zero_by_construction_where_every_stop_placed_the_frame_and_not_with_half():
    every = compare(*_campaign(3, 12, mount=False))
    # A frame alone turns by positions and headings together: the mean heading stays free.
    assert every.constructed_means == ("x", "y")
    assert np.abs(every.errors[:, :2].mean(0)).max() < 1e-4
    assert compare(*_campaign(3, 6, mount=False)).constructed_means == ()
    one = compare(*_campaign(3, 1, mount=False))
    assert one.constructed == ("0",)
    assert np.isnan(one.nees[0])
    assert one.constructed_means == ()


def test_what_was_taken_over_is_read_back_to_the_last_bit(tmp_path):
    _, table = _campaign(1)
    path = tmp_path / "poses_cart.csv"
    path.write_text(to_csv(table))
    ((name, text),) = follows_files(table).items()
    (tmp_path / name).write_text(text)
    read = with_stored_follows(from_csv(path), path)
    assert read.follows.ids == table.follows.ids
    assert read.follows.what == "frame and mount"
    assert (read.follows.by == table.follows.by).all()
    assert (read.follows.of == table.follows.of).all()
    (tmp_path / name).write_text(text.replace("cart,0.x", "cart,99.x", 1))
    with pytest.raises(InputError, match="rows are not the poses"):
        with_stored_follows(from_csv(path), path)


def test_positions_alone_can_be_placed_too():
    rng = np.random.default_rng(0)
    ids = tuple("abcdef")
    truth = rng.uniform(-3, 3, (6, 2))
    cov = np.tile(np.eye(2) * 1e-6, (6, 1, 1))
    survey = PoseTable("survey", ids, truth, cov, PLANAR[:2])
    prism = placed_by(PoseTable("prism", ids, truth, cov, PLANAR[:2]), survey, ids)
    test = compare(survey, prism).test
    assert round(test.per_pose * test.poses) == 12 - 3


def _by_factor(seed, stops=12, *, mount=True, chance=0.0):
    """The same with a survey that states its joint covariance by a factor, in few numbers."""
    survey, table = _campaign(seed, stops, mount=mount)
    shift = np.tile([0.004, 0.004, 0.0], len(survey))[:, None]
    survey = replace(survey, joint=None, factor=shift)
    rng = np.random.default_rng(seed + 1)
    skew = rng.normal(0, 0.3, (len(survey), 3, 3)) * chance + np.eye(3)
    own = skew @ np.diag(OWN**2) @ np.swapaxes(skew, 1, 2)
    start = PoseTable("cart", survey.ids, table.poses, own)
    return survey, start, survey.ids[:stops]


@pytest.mark.parametrize("mount", [True, False])
@pytest.mark.parametrize("stops", [12, 7, 1])
@pytest.mark.parametrize("kept", [slice(None), slice(2, 11), slice(None, None, -2)])
def test_in_few_numbers_all_is_as_with_a_matrix_of_all_poses(monkeypatch, mount, stops, kept):
    survey, start, used = _by_factor(stops, stops, mount=mount and stops > 1, chance=1.0)
    found = []
    for largest in (10_000, 0):
        monkeypatch.setattr(common_origin, "LARGEST_WHOLE", largest)
        table = placed_by(start, survey, used, mount=mount and stops > 1)
        some = table.select(table.ids[kept])
        parts = apart(survey, some)
        found.append((table, compare(survey, some), parts, own_part(survey, some)))
    whole, few = found
    assert few[0].joint is None
    for which in (0, 3):
        scale = np.sqrt(np.diagonal(joint_of(whole[0].select(whole[which].ids))))
        off = (joint_of(few[which]) - joint_of(whole[which])) / scale / scale[:, None]
        assert np.abs(off).max() < 1e-7
    for name in ("validation", "gt"):
        one, other = (joint_of(getattr(some[2], name)) for some in found)
        scale = np.sqrt(np.diagonal(joint_of(survey)).max())
        assert np.abs(one - other).max() < 1e-7 * scale**2
    assert few[2].constructed == whole[2].constructed
    assert few[2].mean_share == pytest.approx(whole[2].mean_share, abs=1e-9)
    first, second = whole[1].test, few[1].test
    assert round(first.per_pose * first.poses) == round(second.per_pose * second.poses)
    assert second.mean == pytest.approx(first.mean, rel=1e-4)
    assert few[1].mean_sigmas == pytest.approx(whole[1].mean_sigmas, abs=1e-8)


def test_a_factor_of_which_a_part_is_taken_away_is_read_back(tmp_path, monkeypatch):
    monkeypatch.setattr(common_origin, "LARGEST_WHOLE", 0)
    monkeypatch.setattr(joint, "LARGEST_WHOLE", 0)
    survey, start, used = _by_factor(3, 6)
    table = placed_by(start, survey, used, mount=True)
    assert set(table.signs) == {-1.0, 1.0}
    path = tmp_path / "poses_cart.csv"
    path.write_text(to_csv(table))
    ((name, content),) = joint.joint_files(table).items()
    (tmp_path / name).write_text("".join(one.decode() for one in pieces_of(content)))
    read = joint.with_stored_joint(from_csv(path), path)
    assert (read.factor == table.factor).all()
    assert (read.signs == table.signs).all()
    assert read.select(read.ids[2:5]).signs is not None


def test_ten_thousand_poses_placed_by_a_survey_need_no_matrix_of_all():
    rng = np.random.default_rng(5)
    n = 10_000
    ids = tuple(map(str, range(n)))
    truth = np.column_stack([rng.uniform(-50, 50, (n, 2)), rng.uniform(-3, 3, n)])
    blocks = np.tile(np.diag(SURVEY**2), (n, 1, 1))
    shift = np.tile([0.004, 0.004, 0.0], n)[:, None]
    covariances = blocks + np.outer(*[[0.004, 0.004, 0.0]] * 2)
    errors = rng.normal(0, 1, (n, 3)) * SURVEY + shift[:3, 0] * rng.normal()
    survey = PoseTable("survey", ids, truth + errors, covariances, factor=shift)
    own = truth + rng.normal(0, 1, (n, 3)) * OWN
    start = PoseTable("cart", ids, own, np.tile(np.diag(OWN**2), (n, 1, 1)))
    tracemalloc.start()
    table = placed_by(start, survey, ids[::4])
    moved = own + (
        table.follows.by @ (table.follows.of @ (survey.poses[::4] - own[::4]).ravel())
    ).reshape(n, 3)
    test = compare(survey, replace(table, poses=moved)).test
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 200e6
    assert test.verdict == "inside" or test.p_value > 0.001
    assert round(test.per_pose * n) == 3 * n - 3  # what the frame could take away is none
