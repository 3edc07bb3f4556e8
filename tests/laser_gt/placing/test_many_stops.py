"""Poses of many stops in few numbers are those by matrices of all poses."""

from dataclasses import replace

import numpy as np
import pytest
from laser_halls import hall, table_of
from scipy import stats
from scipy.linalg import block_diag

from laser_gt.campaign.inputs import as_surveyed
from laser_gt.placing.survey_check import LIKELIEST, shape_of, survey_doubt
from laser_gt.scans.planar import compose, compose_jacobians, inverse, wrapped
from validation.poses.joint import LARGEST_WHOLE, with_stored_joint
from validation.poses.pose_files import pose_files
from validation.poses.pose_table import from_csv
from validation.statistics.comparison import compare
from validation.text_files.writing import write_files

MANY = LARGEST_WHOLE // 3 + 1


def by_matrices(solution, survey):
    """The joint covariance by the formula of `place`, all matrices written out."""
    spread, n = solution.graph.spread, len(solution.stops)
    whole = np.linalg.inv(spread.information.toarray())[: 3 * n + 3, : 3 * n + 3]
    whole[: 3 * n, : 3 * n] += block_diag(*spread.noise)
    frame = solution.placement.frames[0]
    shape = compose(inverse(frame), solution.placement.poses)
    turned = block_diag(*compose_jacobians(np.broadcast_to(frame, shape.shape), shape)[1])
    rows = [solution.stops.index(stop) for stop in solution.anchors]
    flat = (3 * np.array(rows)[:, None] + np.arange(3)).ravel()
    gain = solution.placement.by @ solution.placement.of
    left = turned - gain @ turned[flat]
    known = survey.select(solution.anchors).joint_covariance
    return gain @ known @ gain.T + left @ whole[: 3 * n, : 3 * n] @ left.T


def test_the_covariance_is_that_by_matrices():
    place = hall(40, seed=3, share=0.4)
    solution = place.solved()
    expected = by_matrices(solution, place.survey)
    sigmas = np.sqrt(np.diagonal(expected))
    off = (solution.placement.joint - expected) / sigmas[:, None] / sigmas
    # The graph is held to a micrometre at one stop, so the condition of its information is 2e11:
    # by that rounding may change the fifth digit.
    assert np.abs(off).max() < 5e-5


@pytest.fixture(scope="module")
def large():
    place = hall(MANY, seed=5, share=0.5)
    return place, place.solved()


def test_a_large_table_has_a_net_and_no_matrix(large):
    table = table_of(large[1])
    assert table.joint is None
    assert table.net is not None
    # six neighbours a stop, each pair twice, and itself
    assert table.net.information.nnz < 9 * 9 * len(table)
    files = pose_files([table])
    assert {"joint_net_laser_scanmatch.csv", "joint_factor_laser_scanmatch.csv"} <= set(files)
    assert "joint_laser_scanmatch.csv" not in files


def test_a_comparison_with_the_survey_is_that_of_the_whole_matrix(large):
    place, solution = large
    few = table_of(solution)
    whole = replace(few, joint=few.joint_covariance, factor=None, net=None)
    one, other = compare(place.survey, few), compare(place.survey, whole)
    assert one.test.method == other.test.method
    assert one.test.mean == pytest.approx(other.test.mean, rel=1e-6)
    assert one.test.per_pose == other.test.per_pose
    np.testing.assert_allclose(one.mean_sigmas, other.mean_sigmas, rtol=1e-7)


def test_it_comes_back_from_its_files(large, tmp_path):
    table = table_of(large[1])
    write_files(tmp_path, pose_files([table]))
    path = tmp_path / f"poses_{table.system}.csv"
    read = with_stored_joint(from_csv(path), path)
    assert np.array_equal(read.net.information.toarray(), table.net.information.toarray())
    assert np.array_equal(read.factor, table.factor)
    np.testing.assert_allclose(read.net.blocks, table.net.blocks, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seeds", [6, pytest.param(40, marks=pytest.mark.full)])
def test_differences_from_the_survey_and_from_the_truth_are_as_large_as_stated(seeds):
    total, freedom, square, numbers = 0.0, 0, 0.0, 0
    for seed in range(seeds):
        place = hall(MANY, seed=100 + seed, share=0.3)
        table = table_of(place.solved())
        test = compare(place.survey, table).test
        total += test.mean * test.poses
        freedom += round(test.per_pose * test.poses)
        rows = [int(stop) for stop in table.ids]
        off = wrapped(table.poses - place.true[rows]).ravel()
        square += float(off @ np.linalg.solve(table.joint_covariance, off))
        numbers += off.size
    for found, of in ((total, freedom), (square, numbers)):
        low, high = stats.chi2.ppf([5e-4, 1 - 5e-4], of) / of
        assert low < found / of < high


@pytest.mark.parametrize("kind", ["stop", "exchanged"])
def test_one_wrong_stop_of_many_is_named(kind):
    place = hall(2 * LIKELIEST * 2, seed=8)
    poses = place.survey.poses.copy()
    if kind == "stop":
        poses[20, :2] += [0.06, -0.06]
    else:
        poses[[20, 21]] = poses[[21, 20]]
    known = as_surveyed(replace(place.survey, poses=poses))
    solution = place.solved()
    rows = np.array([solution.stops.index(stop) for stop in known.stops])
    doubt = survey_doubt(known.stops, shape_of(solution.graph, rows), known.poses, known.covariance)
    assert doubt.kind == kind
    assert doubt.stops == (("20",) if kind == "stop" else ("20", "21"))
    if kind == "stop":
        assert (np.abs(doubt.size - [0.06, -0.06, 0.0]) < 4 * doubt.sigmas).all()
