from dataclasses import replace

import numpy as np
import pytest

from validation.errors import GtvalError, InputError
from validation.poses.joint import LARGEST_WHOLE, joint_files, joint_path, with_stored_joint
from validation.poses.pose_files import pose_files
from validation.poses.pose_table import SPATIAL, PoseTable, from_csv, to_csv
from validation.poses.shared_errors import shared_errors
from validation.statistics.comparison import compare
from validation.text_files.writing import write_files


@pytest.fixture
def table():
    rng = np.random.default_rng(4)
    root = rng.standard_normal((6, 8)) * 0.003
    joint = root @ root.T
    blocks = joint.reshape(2, 3, 2, 3)[np.arange(2), :, np.arange(2)]
    return PoseTable("survey", ("7", "8"), rng.standard_normal((2, 3)), blocks, joint=joint)


def with_factor(count, seed=5, shared=4):
    """Poses in space that share the errors of a few unknowns, each with noise of its own."""
    rng = np.random.default_rng(seed)
    factor = rng.standard_normal((6 * count, shared)) * 0.01
    rows = factor.reshape(count, 6, shared)
    covariances = rows @ np.swapaxes(rows, 1, 2) + 1e-4 * np.eye(6)
    ids = tuple(str(number) for number in range(count))
    poses = rng.standard_normal((count, 6)) * 0.1
    return PoseTable("rtk", ids, poses, covariances, SPATIAL, factor=factor)


def whole(table):
    return replace(table, joint=table.joint_covariance, factor=None)


def written(table, folder):
    write_files(folder, pose_files([table]))
    return folder / f"poses_{table.system}.csv"


@pytest.fixture
def path(table, tmp_path):
    return written(table, tmp_path)


LARGE = LARGEST_WHOLE // 6 + 1


@pytest.fixture
def factored(tmp_path):
    return written(with_factor(LARGE), tmp_path)


def test_the_joint_covariance_comes_back_to_the_last_bit(table, path):
    assert np.array_equal(with_stored_joint(from_csv(path), path).joint, table.joint)


def test_without_a_file_beside_it_a_table_has_none(path):
    joint_path(path).unlink()
    assert with_stored_joint(from_csv(path), path).joint is None


def test_a_table_without_joint_covariance_has_no_file():
    assert joint_files(PoseTable("a", ("1",), np.zeros((1, 3)))) == {}


def test_a_file_of_other_poses_is_refused(path):
    text = path.read_text().replace("\n8,", "\n9,")
    path.write_text(text)
    with pytest.raises(InputError, match="not the poses"):
        with_stored_joint(from_csv(path), path)


def test_a_file_that_contradicts_the_covariances_is_refused(path):
    lines = joint_path(path).read_text().splitlines()
    cells = lines[1].split(",")
    cells[1] = repr(float(cells[1]) * 2)
    joint_path(path).write_text("\n".join([lines[0], ",".join(cells), *lines[2:]]) + "\n")
    with pytest.raises(InputError, match="contradicts"):
        with_stored_joint(from_csv(path), path)


def test_a_bad_number_is_named(path):
    broken = joint_path(path)
    broken.write_text(broken.read_text().replace("7.x,", "7.x,oops", 2))
    with pytest.raises(InputError, match="joint_survey"):
        with_stored_joint(from_csv(path), path)


def test_a_blank_cell_is_no_covariance(path):
    broken = joint_path(path)
    lines = broken.read_text().splitlines()
    lines[-1] = lines[-1].rsplit(",", 1)[0] + ","
    broken.write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=r"joint_survey.*empty"):
        with_stored_joint(from_csv(path), path)


def test_a_factor_stands_for_the_whole_matrix():
    table = with_factor(5)
    joint = table.joint_covariance.reshape(5, 6, 5, 6)
    rows = table.factor.reshape(5, 6, 4)
    for i in range(5):
        assert np.array_equal(joint[i, :, i], table.covariances[i])
        for j in set(range(5)) - {i}:
            # Products of at most 0.05 by 0.05, four of them: rounding is below 1e-17.
            np.testing.assert_allclose(joint[i, :, j], rows[i] @ rows[j].T, rtol=0, atol=1e-17)
    chosen = table.select(["3", "0"])
    assert np.array_equal(chosen.factor, table.factor.reshape(5, 6, 4)[[3, 0]].reshape(12, 4))
    dense = whole(table).select(["3", "0"]).joint
    np.testing.assert_allclose(chosen.joint_covariance, dense, rtol=0, atol=1e-17)


def test_comparison_and_explanation_are_those_of_the_whole_matrix():
    table = with_factor(12)
    zero = np.zeros((12, 6))
    surveyed = PoseTable("survey", table.ids, zero, table.covariances / 100, SPATIAL)
    alone, both = compare(surveyed, table), compare(surveyed, whole(table))
    assert "joint" in alone.test.method
    # The condition of the matrix is some 1e3: rounding changes the 13th digit.
    assert alone.test.mean == pytest.approx(both.test.mean, rel=1e-11)
    assert alone.test.p_value == pytest.approx(both.test.p_value, rel=1e-9)
    parts = shared_errors([table]).matrix(), shared_errors([whole(table)]).matrix()
    assert np.array_equal(*parts)


def test_a_large_factor_is_written_instead_of_the_matrix_and_comes_back(factored):
    names = {file.name for file in factored.parent.iterdir()}
    assert names == {"poses_rtk.csv", "poses_rtk.tum", "joint_factor_rtk.csv"}
    read = with_stored_joint(from_csv(factored, components=SPATIAL), factored)
    assert np.array_equal(read.factor, with_factor(LARGE).factor)
    assert np.array_equal(read.joint_covariance, with_factor(LARGE).joint_covariance)


def test_a_small_factor_is_written_as_the_matrix(tmp_path):
    path = written(with_factor(LARGE - 1), tmp_path)
    read = with_stored_joint(from_csv(path, components=SPATIAL), path)
    assert read.factor is None
    assert np.array_equal(read.joint, with_factor(LARGE - 1).joint_covariance)


def damaged(text, kind):
    lines = text.splitlines()
    cells = lines[3].split(",")
    changes = {
        "a row is lost": lambda: lines.pop(3),
        "rows are exchanged": lambda: lines.insert(3, lines.pop(4)),
        "a cell is lost": lambda: lines.__setitem__(3, ",".join([*cells[:-1], ""])),
        "no number": lambda: lines.__setitem__(3, ",".join([*cells[:-1], "oops"])),
        "too large": lambda: lines.__setitem__(3, ",".join([*cells[:-1], "0.3"])),
        "no columns": lambda: lines.__setitem__(
            slice(None), [line.split(",")[0] for line in lines]
        ),
        "nothing": lines.clear,
    }
    changes[kind]()
    return "".join(line + "\n" for line in lines)


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("a row is lost", "not the poses"),
        ("rows are exchanged", "not the poses"),
        ("a cell is lost", "empty"),
        ("no number", "not a number"),
        ("too large", "contradicts"),
        ("no columns", "not the poses"),
        ("nothing", "empty"),
    ],
)
def test_a_damaged_factor_is_refused_by_name(factored, kind, said):
    file = factored.with_name("joint_factor_rtk.csv")
    file.write_text(damaged(file.read_text(), kind))
    with pytest.raises(InputError, match=f"joint_factor_rtk.csv.*{said}"):
        with_stored_joint(from_csv(factored, components=SPATIAL), factored)


def test_two_files_of_one_covariance_are_refused(factored):
    joint_path(factored).write_text("number\n")
    with pytest.raises(InputError, match=r"joint_factor_rtk.csv.*joint_rtk.csv states the same"):
        with_stored_joint(from_csv(factored, components=SPATIAL), factored)


def test_a_table_has_a_matrix_or_its_factor():
    table = with_factor(2)
    with pytest.raises(GtvalError, match="not both"):
        replace(table, joint=table.joint_covariance)
    with pytest.raises(GtvalError, match="12 rows"):
        replace(table, factor=np.ones((11, 2)))
    assert "joint" not in to_csv(table)
