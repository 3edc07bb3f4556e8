"""Covariances by sparse inverses are those by matrices of all poses."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from validation.errors import FaultyResultError, InputError
from validation.poses.common_origin import apart, joint_of, placed_by
from validation.poses.factored import Factored
from validation.poses.joint import LARGEST_WHOLE, joint_files, net_path, with_stored_joint
from validation.poses.nets import Net
from validation.poses.pose_files import pose_files
from validation.poses.pose_table import PoseTable, from_csv
from validation.poses.shared_errors import shared_errors
from validation.statistics.comparison import compare
from validation.statistics.consistency import joint_square, square_of_factored, whitened
from validation.text_files.writing import write_files

N, K = 30, 3


def information_of(rng, size):
    seen = sparse.random_array((2 * size, size), density=3 / size, rng=rng)
    return (50 * seen.T @ seen + 2 * sparse.eye_array(size)).tocsc()


def errors_of(rng, count=N):
    """In a net, shared by a factor of which a column is taken away, and alone; and the matrix."""
    information = information_of(rng, count * K)
    factor = rng.normal(0, 0.3, (count, K, 4))
    factor[..., 3] *= 0.1
    signs = np.array([1.0, 1.0, 1.0, -1.0])
    own = np.tile(np.diag([0.1, 0.2, 0.05]), (count, 1, 1))
    flat = factor.reshape(count * K, 4)
    whole = np.linalg.inv(information.toarray()) + (flat * signs) @ flat.T
    whole += np.kron(np.eye(count), own[0])
    return Factored(own, factor, signs, Net.of(information, K)), whole


@pytest.fixture
def both():
    return errors_of(np.random.default_rng(1))


# The condition of these matrices is below 1e4: rounding changes the twelfth digit.
CLOSE = {"rtol": 1e-9, "atol": 1e-11}


def test_it_is_the_matrix_and_its_inverse(both):
    few, whole = both
    values = np.random.default_rng(2).normal(size=(N, K, 3))
    flat = values.reshape(N * K, 3)
    np.testing.assert_allclose(few.matrix(), whole, **CLOSE)
    np.testing.assert_allclose(
        few.solve(values).reshape(N * K, 3), np.linalg.solve(whole, flat), **CLOSE
    )
    white = whitened(values, few)
    np.testing.assert_allclose(white.T @ white, flat.T @ np.linalg.solve(whole, flat), **CLOSE)
    square, freedom = square_of_factored(values[..., 0], few, values[..., 1:])
    expected = joint_square(flat[:, 0], whole, flat[:, 1:])
    assert (square, freedom) == (pytest.approx(expected[0], rel=1e-9), expected[1])


def test_parts_products_and_what_is_taken_over(both):
    few, whole = both
    rng = np.random.default_rng(3)
    rows = np.array([3, 7, 1])
    flat = (3 * rows[:, None] + np.arange(3)).ravel()
    np.testing.assert_allclose(few.select(rows).matrix(), whole[np.ix_(flat, flat)], **CLOSE)
    gain = rng.normal(size=(2, N, K))
    seen = gain.reshape(2, -1)
    np.testing.assert_allclose(few.products(gain), seen @ whole @ seen.T, **CLOSE)
    by, of, used = rng.normal(size=(N * K, 2)) * 0.1, rng.normal(size=(2, 12)), np.arange(12)
    left = np.eye(N * K)
    left[:, used] -= by @ of
    kept = (left @ whole @ left.T)[:30, :30]
    np.testing.assert_allclose(few.without(by[:30], of, used, 10).matrix(), kept, **CLOSE)
    turns = rng.normal(size=(N, K, K))
    turned = np.zeros((N * K, N * K))
    for at, turn in enumerate(turns):
        turned[3 * at : 3 * at + 3, 3 * at : 3 * at + 3] = turn
    np.testing.assert_allclose(few.turned(turns).matrix(), turned @ whole @ turned.T, **CLOSE)


def test_the_sum_of_two_and_another_process(both):
    few, whole = both
    more, other = errors_of(np.random.default_rng(4))
    together = few.beside(more)
    np.testing.assert_allclose(together.matrix(), whole + other, **CLOSE)
    values = np.random.default_rng(5).normal(size=(N, K, 1))
    expected = np.linalg.solve(whole + other, values.reshape(N * K, 1))
    np.testing.assert_allclose(together.solve(values).reshape(N * K, 1), expected, **CLOSE)
    sent = pickle.loads(pickle.dumps(few.net))
    assert np.array_equal(sent.times(values), few.net.times(values))


def test_any_matrix_becomes_few_numbers_as_many_as_it_has(both):
    whole = both[1]
    np.testing.assert_allclose(Factored.of_matrix(whole, K).matrix(), whole, **CLOSE)


def tables_of(count, seed=6):
    """A table in a net and the same by a matrix."""
    rng = np.random.default_rng(seed)
    large = errors_of(rng, count)[0]
    net = replace(large.net, information=large.net.information * 1e4, blocks=large.net.blocks / 1e4)
    few = Factored(large.own / 1e4, large.factor / 1e2, np.ones(4), net)
    poses = np.column_stack([rng.uniform(-5, 5, (count, 2)), rng.uniform(-3, 3, count)])
    ids = tuple(str(number) for number in range(count))
    flat = few.factor.reshape(count * K, 4)
    small = PoseTable("cart", ids, poses, few.blocks, factor=flat, net=few.net)
    return small, PoseTable("cart", ids, poses, few.blocks, joint=few.matrix())


LARGE = LARGEST_WHOLE // K + 4


def survey_of(table, seed=7):
    rng = np.random.default_rng(seed)
    off = rng.normal(0, 0.01, table.poses.shape)
    return PoseTable(
        "survey", table.ids, table.poses + off, np.tile(1e-4 * np.eye(3), (len(table), 1, 1))
    )


def test_tables_choose_compare_and_share_as_those_with_a_matrix():
    few, whole = tables_of(12)
    names = ["7", "2", "5"]
    np.testing.assert_allclose(
        few.select(names).joint_covariance, whole.select(names).joint, **CLOSE
    )
    plane = few.components[:2]
    np.testing.assert_allclose(few.only(plane).joint_covariance, whole.only(plane).joint, **CLOSE)
    gain = np.random.default_rng(8).normal(size=(2, 12, 3))
    seen = [shared_errors([one]).seen_by(gain) for one in (few, whole)]
    np.testing.assert_allclose(*seen, **CLOSE)
    parts = [shared_errors([one]).select(np.array([4, 1])).only(np.array([2])).matrix()
             for one in (few, whole)]  # fmt: skip
    np.testing.assert_allclose(*parts, **CLOSE)
    one, other = (compare(survey_of(few), table) for table in (few, whole))
    assert one.test.mean == pytest.approx(other.test.mean, rel=1e-9)
    np.testing.assert_allclose(one.mean_sigmas, other.mean_sigmas, **CLOSE)


def test_a_frame_fitted_to_a_survey_is_taken_over_as_with_a_matrix():
    few, whole = tables_of(LARGE)
    survey = survey_of(few)
    stops = few.ids[:20]
    placed = [placed_by(one, survey, stops, mount=True) for one in (few, whole)]
    assert placed[0].net is not None
    np.testing.assert_allclose(joint_of(placed[0]), joint_of(placed[1]), rtol=1e-6, atol=1e-10)
    left = [apart(survey, one).gt for one in placed]
    np.testing.assert_allclose(joint_of(left[0]), joint_of(left[1]), rtol=1e-6, atol=1e-10)


def written(table, folder):
    write_files(folder, pose_files([table]))
    return folder / f"poses_{table.system}.csv"


def test_a_part_of_a_net_comes_back_with_the_numbers_that_hold_it(tmp_path):
    few = tables_of(LARGE + 10)[0]
    part = few.select(few.ids[5 : LARGE + 5])
    path = written(part, tmp_path)
    assert "other_1," in net_path(path).read_text()
    read = with_stored_joint(from_csv(path), path)
    np.testing.assert_allclose(read.joint_covariance, part.joint_covariance, rtol=1e-9, atol=1e-15)


def test_a_small_net_is_written_as_the_matrix(tmp_path):
    few = tables_of(LARGEST_WHOLE // K)[0]
    path = written(few, tmp_path)
    read = with_stored_joint(from_csv(path), path)
    assert read.net is None
    assert np.array_equal(read.joint, few.joint_covariance)


def smaller(line):
    ends, _, value = line.rpartition(",")
    return f"{ends},{float(value) / 100!r}"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda lines: [*lines, lines[1]], "the same as line 2"),
        (lambda lines: [lines[0], "x.y,x.y,1.0", *lines[1:]], "not those of the poses"),
        (lambda lines: [line for line in lines if not line.startswith("3.x,3.x,")], "definite"),
        (lambda lines: [lines[0], *map(smaller, lines[1:])], "contradicts"),
        (lambda lines: [lines[0], lines[1].rsplit(",", 1)[0] + ",oops", *lines[2:]], "oops"),
    ],
)
def test_a_spoilt_file_is_refused_by_its_name(tmp_path, change, said):
    path = written(tables_of(LARGE)[0], tmp_path)
    file = net_path(path)
    lines = file.read_text().splitlines()
    lines = change(lines)
    file.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=rf"joint_net_cart\.csv(.|\n)*({said})"):
        with_stored_joint(from_csv(path), path)


def test_a_net_of_other_poses_or_beside_a_matrix_is_refused():
    few, whole = tables_of(5)
    with pytest.raises(FaultyResultError, match="not both"):
        replace(few, joint=whole.joint, factor=None)
    with pytest.raises(FaultyResultError, match="a net of 12 numbers, not 15"):
        replace(few, net=few.select(few.ids[:4]).net)


def test_sums_of_nets_are_not_written(tmp_path):
    few = tables_of(LARGE)[0]
    twice = replace(few, net=few.net.beside(few.net), covariances=2 * few.covariances)
    with pytest.raises(FaultyResultError, match="cannot be written"):
        write_files(tmp_path, joint_files(twice))
