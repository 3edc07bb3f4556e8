"""Tables with named columns, in the spellings of people and programs."""

import numpy as np
import pytest

from validation.errors import InputError
from validation.trajectories.formats import is_trajectory, read_trajectory

TIMES = 1_403_636_579.25 + 0.1 * np.arange(5)
X, Y, YAW = np.arange(5) / 4, -np.arange(5) / 8, np.array([0, 0.5, 3, -3, 1.25])


def table(header, *columns, separator=","):
    rows = [separator.join(map(str, row)) for row in zip(*columns, strict=True)]
    return "\n".join([header, *rows]) + "\n"


def ns(times=TIMES):
    return [round(t * 1000) * 1_000_000 for t in times]


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        ("time,x,y,theta", (TIMES, X, Y, YAW)),
        ("t,px,py,yaw", (TIMES, X, Y, YAW)),
        ("Timestamp,pos_x,pos_y,heading", (TIMES, X, Y, YAW)),
        ("#timestamp [ns],x [m],y [m],yaw [rad]", (ns(), X, Y, YAW)),
        ("stamp (ms),x (mm),y (mm),yaw (deg)", (TIMES * 1e3, X * 1e3, Y * 1e3, np.degrees(YAW))),
        ("timestamp_us,x_m,y_m,yaw_deg", (TIMES * 1e6, X, Y, np.degrees(YAW))),
        ("sec,nsec,tx,ty,theta", (TIMES.astype(int), np.array(ns()) % 10**9, X, Y, YAW)),
        (
            "header.stamp.sec,header.stamp.nanosec,pose.x,pose.y,pose.theta_rad",
            (TIMES.astype(int), np.array(ns()) % 10**9, X, Y, YAW),
        ),
        (
            "%time,field.header.stamp,field.pose.position.x,field.pose.position.y,theta",
            (ns(TIMES + 3), ns(), X, Y, YAW),
        ),
        ("theta,seq,y,x,time", (YAW, range(5), Y, X, TIMES)),
        ("Time (s),X (m),Y (m),Yaw (rad)", (TIMES, X, Y, YAW)),
        ("time [s],position_x,position_y,psi", (TIMES, X, Y, YAW)),
        ("time,x [cm],y [cm],theta", (TIMES, X * 100, Y * 100, YAW)),
    ],
)
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_the_same_poses_in_many_spellings(written, header, columns, separator):
    path = written("a.csv", table(header.replace(",", separator), *columns, separator=separator))
    assert is_trajectory(path)
    found = read_trajectory(path)
    assert found.kind == "plane"
    # A double holds today's seconds to 2.4e-7, and microseconds of them to 1/4.
    np.testing.assert_allclose(found.times_since(0), TIMES, rtol=0, atol=5e-7)
    np.testing.assert_allclose(found.poses, np.column_stack([X, Y, YAW]), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "names", ["qx,qy,qz,qw", "orientation_x,orientation_y,orientation_z,quat_w"]
)
@pytest.mark.parametrize("z", [True, False])
def test_quaternions(written, names, z):
    q = np.column_stack([np.zeros((5, 2)), np.sin(YAW / 2), np.cos(YAW / 2)])
    header, heights = ("time,x,y,z," if z else "time,x,y,"), ([np.arange(5)] if z else [])
    found = read_trajectory(written("a.csv", table(header + names, TIMES, X, Y, *heights, *q.T)))
    assert found.kind == ("space" if z else "plane")
    np.testing.assert_allclose(found.headings, YAW, atol=1e-12)


def test_roll_pitch_yaw(written):
    header = "time,x,y,z,roll_deg,pitch_deg,yaw_deg"
    zero = np.zeros(5)
    text = table(header, TIMES, X, Y, X, zero + 90, zero, np.degrees(YAW))
    found = read_trajectory(written("a.csv", text))
    np.testing.assert_allclose(found.headings, YAW, atol=1e-12)
    # Rolled by 90 degrees, the robot's Y axis points up.
    np.testing.assert_allclose(found.rotations.apply([0, 1, 0])[:, 2], 1, atol=1e-12)


def test_a_decimal_comma_between_semicolons(written):
    rows = [f"{t:.3f};{x};{y}".replace(".", ",") for t, x, y in zip(TIMES, X, Y, strict=True)]
    found = read_trajectory(written("a.csv", "time;x;y\n" + "\n".join(rows)))
    np.testing.assert_array_equal(found.poses, np.column_stack([X, Y]))
    np.testing.assert_allclose(found.times, TIMES - found.epoch, rtol=0, atol=2.5e-7)


def test_degrees_that_are_not_told_are_asked_for(written):
    path = written("a.csv", table("time,x,y,yaw", TIMES, X, Y, np.degrees(YAW)))
    with pytest.raises(InputError, match=r"--degrees.*--radians"):
        read_trajectory(path)
    np.testing.assert_allclose(read_trajectory(path, degrees=True).headings, YAW, atol=1e-12)
    unwrapped = read_trajectory(path, degrees=False)
    np.testing.assert_array_equal(unwrapped.poses[:, 2], np.degrees(YAW))


def test_covariances_of_any_spelling(written):
    ones = np.ones(5)
    matrix = [4e-4, 1e-5, 2e-5, 9e-4, -1e-5, 1e-4]
    for header in (
        "xx,xy,xt,yy,yt,tt",
        "cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt",
        "var_x,cov_xy,cov_x_theta,var_y,cov_y_yaw,var_theta",
    ):
        columns = [ones * one for one in matrix]
        found = read_trajectory(
            written("a.csv", table(f"time,x,y,theta,{header}", TIMES, X, Y, YAW, *columns))
        )
        upper = found.covariances[2][np.triu_indices(3)]
        np.testing.assert_allclose(upper, matrix, rtol=1e-12)
    text = table("time,x,y,theta,sigma_x,sigma_y,sigma_theta_deg", TIMES, X, Y, YAW, *[ones] * 3)
    found = read_trajectory(written("a.csv", text))
    sigmas = np.sqrt(np.diagonal(found.covariances[0]))
    np.testing.assert_allclose(sigmas, [1, 1, np.pi / 180], rtol=1e-12)


def test_frames_without_a_position_are_left_out_and_told(written):
    text = "time,x,y\n0.0,1,2\n0.1,,\n0.2,3,4\n"
    found = read_trajectory(written("a.csv", text))
    np.testing.assert_array_equal(found.times, [0.0, 0.2])
    assert any("line 3" in note for note in found.provenance["notes"])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,x,z\n0,1,2\n", "no column for y"),
        ("x,y\n0,1\n", "no column for a time"),
        ("time,x,y,px_m,pos_y,position_y\n0,1,2,3,4,5\n", None),
        ("time,pos_x,px,y\n0,1,2,3\n0.1,1,2,3\n", "two columns could be this"),
        ("time,x,y\n0,1,a\n0.1,b,2\n", "line 2, field 'y': 'a' — not a number"),
        ("time,x,y\n0,1,a\n0.1,b,2\n", "line 3, field 'x': 'b' — not a number"),
        ("time,x,y\n0,1,\n", "field 'y': '' — the cell is empty"),
        ("time,x,y\n0,1,nan\n", "'nan' — not a number"),
        ("time,x,y\n0,inf,1\n", "'inf' — not a number"),
        ("time,x,y\n0,1_0,1\n", "'1_0' — not a number"),
        ("time,x,y\n0,1e999,1\n", "'1e999' — not a number"),
        ("time,x,y\n0,٣,1\n", "'٣' — not a number"),
        ("time,x,y\n0,1,2\n0.1,1\n", "line 3: '0.1,1' — 2 cells, not 3 (is the file cut off?)"),
        ("time,x,y\n0,1,2,3\n0.1,1,2\n", "line 2: '0,1,2,3' — 4 cells, not 3"),
        ("time,x,y\n", "no row of numbers"),
        ("time,x [kg],y\n0,1,2\n", "the unit 'kg' is no length"),
        ("time,x,y,qx,qy,qz\n0,1,2,0,0,0\n", "a quaternion needs four columns; qw is missing"),
        ("time,x,y,qx,qy,qz,qw\n0,1,2,0,0,0,0.5\n0.1,1,2,0,0,0,1\n", "length 0.5, not 1"),
        ("time,x,y,z,yaw_deg,pitch,roll\n0,1,2,3,0,0,0\n", "some angles are in degrees"),
        ("time,x,y\n0,1e10,2\n0.1,0,0\n", "farther than 1e+09 m"),
        ("time,x,y\n0.2,0,0\n0.1,0,0\n0.3,0,0\n", "the stamps do not increase"),
        ("time,x,y\n0.1,0,0\n0.1,0,0\n0.3,0,0\n", "repeated the stamp"),
        (
            "time,x,y,theta,xx,xy,xt,yy,yt,tt\n0,0,0,0,1,2,0,1,0,1\n0.1,0,0,0,1,0,0,1,0,1\n",
            "line 2, field 'covariance': the covariance is not positive definite",
        ),
        ("time,x,y\n0,1,2\n1,1,2\n2,1,2\n", "--unit s, ms, us or ns"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(written, text, said):
    path = written("a.csv", text)
    if said is None:
        return
    with pytest.raises(InputError) as caught:
        read_trajectory(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_table_of_named_stops_is_no_trajectory(written):
    path = written("a.csv", "pose,time,x,y,theta\n1,0,0,0,0\n2,1,0,0,0\n")
    assert not is_trajectory(path)
    with pytest.raises(InputError, match="a table of named stops"):
        read_trajectory(path)
