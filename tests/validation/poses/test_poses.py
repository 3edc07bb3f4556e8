"""Pose tables: what they refuse, and that files give back the same numbers."""

import itertools

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_campaigns import three_stops

from validation.errors import GtvalError, InputError
from validation.poses.covariances import covariance_fault
from validation.poses.pose_table import (
    PLANAR,
    SPATIAL,
    Component,
    PoseTable,
    from_csv,
    in_common,
    pose_difference,
    to_csv,
)
from validation.poses.tum_text import to_tum

names = st.text(st.characters(codec="utf-8"), min_size=1, max_size=8).filter(
    lambda name: name.isprintable() and name == name.strip()
)
lengths = st.floats(-1e6, 1e6)
angles = st.floats(-12.5, 12.5)
sigmas = st.floats(1e-9, 1e3)


@st.composite
def tables(draw) -> PoseTable:
    ids = draw(st.lists(names, min_size=1, max_size=5, unique=True))
    n = len(ids)
    poses = [[draw(lengths), draw(lengths), draw(angles)] for _ in range(n)]
    covariances = np.full((n, 3, 3), np.nan)
    for row in range(n):
        if draw(st.booleans()):
            sigma = np.array([draw(sigmas) for _ in range(3)])
            correlation = np.array([[1, 0.5, -0.25], [0.5, 1, 0.1], [-0.25, 0.1, 1]])
            covariances[row] = correlation * np.outer(sigma, sigma)
    sources = [draw(st.sampled_from(["", "camera 4+1", 'a "b", c;d'])) for _ in range(n)]
    return PoseTable("any", tuple(ids), np.array(poses), covariances, sources=tuple(sources))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(table=tables())
def test_a_file_gives_back_the_same_numbers_to_the_last_bit(tmp_path, table):
    path = tmp_path / "poses_any.csv"
    path.write_text(to_csv(table), encoding="utf-8", newline="")
    back = from_csv(path)
    assert back.system == "any"
    assert back.ids == table.ids
    assert back.sources == table.sources
    assert back.poses.tobytes() == table.poses.tobytes()
    assert np.array_equal(
        back.covariances,
        np.triu(table.covariances) + np.transpose(np.triu(table.covariances, 1), (0, 2, 1)),
        equal_nan=True,
    )


def test_spatial_poses_make_the_round_trip_too(tmp_path):
    poses = np.array([[1.0, 2.0, 3.0, 0.1, 0.2, 0.3]])
    covariances = np.diag([1.0, 2, 3, 4, 5, 6])[None]
    table = PoseTable("rig", ("a",), poses, covariances, components=SPATIAL)
    path = tmp_path / "poses_rig.csv"
    path.write_text(to_csv(table))
    assert path.read_text().startswith("pose,x,y,z,yaw,pitch,roll,xx,xy,xz,xw,xp,xr,yy,")
    assert np.array_equal(from_csv(path, components=SPATIAL).covariances, covariances)


def test_stated_sigmas_fill_in_where_a_row_has_no_covariance(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("pose,x,y,theta,xx,xy,xt,yy,yt,tt\n1,0,0,0,,,,,,\n2,0,0,0,1,0,0,1,0,1\n")
    table = from_csv(path, sigmas=(0.1, 0.2, 0.3))
    assert table.covariances[0] == pytest.approx(np.diag([0.01, 0.04, 0.09]))
    assert table.covariances[1] == pytest.approx(np.eye(3))
    assert from_csv(path).has_covariance.tolist() == [False, True]


@pytest.mark.parametrize(
    ("row", "fault"),
    [
        ("1,0,0,0,1,0,0,1,0,", "missing or not finite"),
        ("1,0,0,0,-1,0,0,1,0,1", "field 'xx': '-1' .*not positive"),
        ("1,0,0,0,1,0,0,0,0,1", "field 'yy': '0' .*not positive"),
        ("1,0,0,0,1,0,0,1,0,-2", "field 'tt': '-2' .*not positive"),
        ("1,0,0,0,1,2,0,1,0,1", "not positive definite"),
        ("1,0,0,0,1,1,0,1,0,1", "not positive definite"),
        ("1,0,0,0,1e-300,1e300,0,1e-300,0,1", "not positive definite"),
        ("1,0,0,90,,,,,,", "field 'theta': '90' — out of range"),
    ],
)
def test_a_bad_row_is_told_with_its_line(tmp_path, row, fault):
    path = tmp_path / "t.csv"
    path.write_text(f"pose,x,y,theta,xx,xy,xt,yy,yt,tt\n{row}\n")
    with pytest.raises(InputError, match=rf"t\.csv, line 2.*{fault}"):
        from_csv(path)


def test_a_table_without_rows_is_an_error(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text("pose,x,y,theta\n")
    with pytest.raises(InputError, match="a header but no pose"):
        from_csv(path)


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"ids": ("1", "2", "1")}, "occur more than once: 1"),
        ({"ids": ("1", "2", "")}, "not a name for a stop"),
        ({"ids": ("1", "2", "3\n")}, "not a name for a stop"),
        ({"ids": ("1", "2")}, r"expected \(2, 3\) numbers"),
        ({"poses": np.full((3, 3), np.nan)}, "pose 1 is not finite"),
        ({"covariances": np.ones((3, 3))}, r"not \(3, 3, 3\)"),
        ({"covariances": np.ones((3, 3, 3))}, "pose 1 is not positive definite"),
        ({"covariances": np.tile([[1, 0.5, 0], [0, 1, 0], [0, 0, 1]], (3, 1, 1))}, "symmetric"),
        ({"sources": ("a", "b")}, "2 sources for 3 poses"),
        ({"joint": np.eye(4)}, r"joint covariance \(4, 4\), not \(9, 9\)"),
    ],
)
def test_a_table_that_would_make_numbers_meaningless_is_refused(changes, fault):
    with pytest.raises(GtvalError, match=fault):
        three_stops("any", **changes)


def test_an_empty_table_is_a_table():
    table = PoseTable("any", (), np.empty((0, 3)))
    assert len(table) == 0
    assert table.has_covariance.shape == (0,)


def test_selecting_takes_the_joint_covariance_along():
    joint = np.diag(np.arange(1.0, 10.0))
    chosen = three_stops("any", joint=joint).select(["3", "1"])
    assert chosen.ids == ("3", "1")
    assert chosen.joint is not None
    assert np.diagonal(chosen.joint).tolist() == [7, 8, 9, 1, 2, 3]
    with pytest.raises(GtvalError, match="has no pose 9"):
        three_stops("any").select(["9"])


def test_a_covariance_that_is_not_stated_has_no_fault():
    assert covariance_fault(np.full((3, 3), np.nan)) is None
    assert covariance_fault(np.diag([1e-12, 1e12, 1.0])) is None


def test_differences_of_angles_are_wrapped_and_of_lengths_are_not():
    difference = pose_difference(np.array([4.0, 0, 3.1]), np.array([-4.0, 0, -3.1]), PLANAR)
    assert difference == pytest.approx([8, 0, 6.2 - 2 * np.pi])


def test_components_have_units():
    assert [component.unit for component in PLANAR] == ["m", "m", "rad"]


def test_common_stops_are_in_the_order_of_the_first():
    a, b = three_stops("a"), three_stops("b").select(["3", "2"])
    assert in_common([a, b]) == ["2", "3"]


def test_tum_lines_hold_time_position_and_quaternion():
    lines = to_tum(three_stops("any")).splitlines()
    numbers = np.array([[float(cell) for cell in line.split()] for line in lines])
    assert numbers[:, 0].tolist() == [1, 2, 3]
    assert numbers[:, 3:6] == pytest.approx(np.zeros((3, 3)))
    heading = 2 * np.arctan2(numbers[:, 6], numbers[:, 7])
    assert heading == pytest.approx([0.1, 1.6, -3.1])


def test_tum_lines_are_in_order_of_time():
    table = three_stops("any")
    shuffled = to_tum(table, {"1": 30.0, "2": 10.0, "3": 20.0}).splitlines()
    times = [float(line.split()[0]) for line in shuffled]
    assert times == [10, 20, 30]


def test_tum_quaternions_of_spatial_poses_turn_yaw_pitch_roll():
    poses = np.array([[0, 0, 0, 0.3, -0.2, 0.1]])
    line = to_tum(PoseTable("rig", ("1",), poses, components=SPATIAL))
    x, y, z, w = (float(cell) for cell in line.split()[4:])
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    pitch = np.arcsin(2 * (w * y - z * x))
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    assert (yaw, pitch, roll) == pytest.approx((0.3, -0.2, 0.1))


@pytest.mark.parametrize("ids", [("1", "2", "b"), ("1", "2", "nan"), ("1", "2", "inf")])
def test_stops_without_numbers_need_times(ids):
    table = three_stops("any", ids=ids)
    with pytest.raises(GtvalError, match="not numbered; give their times"):
        to_tum(table)
    with pytest.raises(GtvalError, match="not numbered; give their times"):
        to_tum(table, {"1": 0.0})
    assert to_tum(table, dict(zip(ids, itertools.count(1.0), strict=False))).count("\n") == 3


def test_other_components_have_no_tum():
    table = PoseTable("depth", ("1",), [[1.0]], components=(Component("z", "length", "z"),))
    with pytest.raises(GtvalError, match="cannot hold"):
        to_tum(table)
