import numpy as np
import pytest

from validation.errors import InputError
from validation.poses.joint import joint_path, joint_to_csv, with_stored_joint
from validation.poses.pose_table import PoseTable, from_csv, to_csv


@pytest.fixture
def table():
    rng = np.random.default_rng(4)
    root = rng.standard_normal((6, 8)) * 0.003
    joint = root @ root.T
    blocks = joint.reshape(2, 3, 2, 3)[np.arange(2), :, np.arange(2)]
    return PoseTable("survey", ("7", "8"), rng.standard_normal((2, 3)), blocks, joint=joint)


@pytest.fixture
def path(table, tmp_path):
    where = tmp_path / "poses_survey.csv"
    where.write_text(to_csv(table))
    joint_path(where).write_text(joint_to_csv(table))
    return where


def test_the_joint_covariance_comes_back_to_the_last_bit(table, path):
    assert np.array_equal(with_stored_joint(from_csv(path), path).joint, table.joint)


def test_without_a_file_beside_it_a_table_has_none(path):
    joint_path(path).unlink()
    assert with_stored_joint(from_csv(path), path).joint is None


def test_a_table_without_joint_covariance_has_no_file():
    with pytest.raises(ValueError, match="no joint"):
        joint_to_csv(PoseTable("a", ("1",), np.zeros((1, 3))))


def test_a_file_of_other_poses_is_refused(path):
    text = path.read_text().replace("\n8,", "\n9,")
    path.write_text(text)
    with pytest.raises(InputError, match="not the poses"):
        with_stored_joint(from_csv(path), path)


def test_a_file_that_contradicts_the_covariances_is_refused(table, path):
    lines = joint_to_csv(table).splitlines()
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
