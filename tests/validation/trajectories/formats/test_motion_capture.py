"""Exports of Motive, Vicon and Qualisys, to their public descriptions."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from validation.errors import InputError
from validation.trajectories.formats import is_trajectory, read_trajectory
from validation.trajectories.formats.reading import format_of

N = 40
ANGLE = np.linspace(0, 5, N)
FLOOR = np.column_stack([2 * np.cos(ANGLE), np.sin(ANGLE), 0.3 + 0.001 * np.sin(3 * ANGLE)])
TURNED = Rotation.from_euler("ZYX", np.column_stack([ANGLE, 0.01 * FLOOR[:, :2]]))
QUATERNIONS = TURNED.as_quat()


def csv(*rows, separator=","):
    return "".join(separator.join(map(str, row)) + "\r\n" for row in rows)


def motive(positions, quaternions, *, units="Meters", bodies=("robot",), lost=(), version="1.23"):
    """A take as Motive 2 and 3 export it: rotations before positions, error and markers behind."""
    head = ["Format Version", version, "Take Name", "Take 1", "Capture Frame Rate", "120.000000"]
    head += ["Export Frame Rate", "120.000000", "Capture Start Time", "2024-03-05 04.12.34.567 PM"]
    head += ["Total Exported Frames", len(positions), "Rotation Type", "Quaternion"]
    head += ["Length Units", units, "Coordinate Space", "Global"]
    kinds, names, ids, parts, axes = (
        ["", ""],
        ["", ""],
        ["", ""],
        ["", ""],
        ["Frame", "Time (Seconds)"],
    )
    for body in bodies:
        kinds += ["Rigid Body"] * 8
        names += [body] * 8
        ids += ["AB12"] * 8
        parts += ["Rotation"] * 4 + ["Position"] * 3 + ["Mean Marker Error"]
        axes += [*"XYZWXYZ", ""]
    kinds += ["Rigid Body Marker"] * 3
    names += ["robot:Marker1"] * 3
    ids += ["CD34"] * 3
    parts += ["Position"] * 3
    axes += [*"XYZ"]
    rows = []
    for k, (place, turn) in enumerate(zip(positions, quaternions, strict=True)):
        numbers = [f"{one:.6f}" for one in (*turn, *place)]
        numbers = [""] * 8 if k in lost else [*numbers, "0.000123"]
        rows.append([k, f"{k / 120:.6f}", *(numbers * len(bodies)), "0.1", "0.2", "0.3"])
    return csv(head, [], kinds, names, ids, parts, axes, *rows)


def up_is_y(positions, quaternions):
    """The same motion in a frame with Y up: (x, y, z) there is (x, z, -y) here."""
    change = Rotation.from_euler("x", -90, degrees=True)
    turned = change * Rotation.from_quat(quaternions) * change.inv()
    return change.apply(positions), turned.as_quat()


@pytest.mark.parametrize("y_up", [True, False])
@pytest.mark.parametrize(("units", "scale"), [("Meters", 1), ("Millimeters", 1000)])
def test_a_take_of_motive(written, y_up, units, scale):
    positions, quaternions = up_is_y(FLOOR, QUATERNIONS) if y_up else (FLOOR, QUATERNIONS)
    path = written("Take 1.csv", motive(positions * scale, quaternions, units=units, lost=(3, 4)))
    assert is_trajectory(path)
    assert format_of(path) == "motive"
    found = read_trajectory(path)
    seen = np.delete(np.arange(N), [3, 4])
    np.testing.assert_allclose(found.times, seen / 120, rtol=0, atol=5e-7)
    # Six decimals of a metre, or of a millimetre; of each number of a quaternion.
    np.testing.assert_allclose(found.positions, FLOOR[seen], rtol=0, atol=5.1e-7)
    assert (found.rotations.inv() * TURNED[seen]).magnitude().max() < 4e-6
    assert found.clock.rate == 120
    assert found.child_frame == "robot"
    assert any("line 11 to 12" in note for note in found.provenance["notes"])


def test_an_axis_that_may_be_up_or_not_is_asked_for(written):
    ball = np.random.default_rng(1).normal(0, 1, (N, 3))
    path = written("a.csv", motive(ball, QUATERNIONS))
    with pytest.raises(InputError, match="--up y"):
        read_trajectory(path)
    np.testing.assert_allclose(read_trajectory(path, up="z").positions, ball, atol=5.1e-7)
    turned = read_trajectory(path, up="y").positions
    np.testing.assert_allclose(turned[:, 2], ball[:, 1], atol=5.1e-7)


def test_of_several_bodies_one_is_chosen(written):
    path = written("a.csv", motive(FLOOR, QUATERNIONS, bodies=("robot", "box")))
    with pytest.raises(InputError, match="several bodies: 'robot', 'box'; choose one with --body"):
        read_trajectory(path)
    with pytest.raises(InputError, match="no body 'cat'; there is 'robot', 'box'"):
        read_trajectory(path, body="cat")
    assert read_trajectory(path, body="box").child_frame == "box"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("Rotation Type,Quaternion", "Rotation Type,XYZ", "export as Quaternion"),
        ("Space,Global", "Space,Local", "export in Global coordinates"),
        ("Units,Meters", "Units,Parsecs", "'Parsecs' — not a length"),
        ("Rigid Body,", "Marker,", "no rigid body"),
        ("Frame,Time", "Image,Time", "no line 'Frame, Time"),
        ("0.000123,0.1,0.2,0.3", "0.000123,0.1,0.2", "cells, not 13"),
        ("\r\n5,0.041667", "\r\n5,x", "field 'Time (Seconds)': 'x' — not a number"),
    ],
)
def test_a_damaged_take_is_refused(written, old, new, said):
    text = motive(FLOOR, QUATERNIONS)
    assert old in text
    with pytest.raises(InputError) as caught:
        read_trajectory(written("a.csv", text.replace(old, new)))
    assert said in str(caught.value)


def vicon(rows, titles, units, *, kind="Objects", objects=("robot:robot",), rate=100):
    head = [[kind], [rate], ["", ""], ["Frame", "Sub Frame"], ["", ""]]
    for one in objects:
        head[2] += [one] + [""] * (len(titles) - 1)
        head[3] += titles
        head[4] += units
    body = [[k + 1, 0, *(list(row) * len(objects))] for k, row in enumerate(rows)]
    return csv(*head, *body)


@pytest.mark.parametrize("kind", ["Objects", "Segments"])
@pytest.mark.parametrize("unit", ["rad", "deg", "quaternion"])
def test_objects_of_vicon(written, kind, unit):
    if unit == "quaternion":
        turns, titles, units = QUATERNIONS, ["RX", "RY", "RZ", "RW"], [""] * 4
    else:
        turns = TURNED.as_rotvec() if unit == "rad" else np.degrees(TURNED.as_rotvec())
        titles, units = ["RX", "RY", "RZ"], [unit] * 3
    rows = np.column_stack([turns, FLOOR * 1000])
    path = written(
        "a.csv", vicon(rows, [*titles, "TX", "TY", "TZ"], [*units, *["mm"] * 3], kind=kind)
    )
    assert is_trajectory(path)
    found = read_trajectory(path)
    assert found.provenance["format"] == "vicon"
    np.testing.assert_allclose(found.times, np.arange(N) / 100, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.positions, FLOOR, rtol=1e-12)
    assert (found.rotations.inv() * TURNED).magnitude().max() < 1e-9
    assert found.clock.rate == 100


def test_vicon_lost_frames_other_parts_and_other_objects(written):
    rows = np.column_stack([TURNED.as_rotvec(), FLOOR * 1000]).astype(object)
    rows[5] = ""
    text = vicon(
        rows,
        ["RX", "RY", "RZ", "TX", "TY", "TZ"],
        ["rad"] * 3 + ["mm"] * 3,
        objects=("robot:base", "box:box"),
    )
    text += "\r\nTrajectories\r\n100\r\n,,marker,,\r\nFrame,Sub Frame,X,Y,Z\r\n"
    text += ",,mm,mm,mm\r\n1,0,1,2,3\r\n"
    path = written("a.csv", text)
    with pytest.raises(InputError, match="several bodies: 'robot:base', 'box:box'"):
        read_trajectory(path)
    for body in ("robot:base", "box:box"):
        found = read_trajectory(path, body=body)
        assert len(found) == N - 1
        assert any("line 11" in note for note in found.provenance["notes"])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("Objects\r\n100", "Objects\r\nfast", "line 2, field 'rate': 'fast'"),
        ("Frame,Sub", "Frames,Sub", "expected 'Frame,Sub Frame"),
        ("rad", "turns", "'turns' — expected deg or rad"),
        ("mm", "miles", "'miles' — not a length"),
        ("TZ", "T3", "has no column TZ"),
    ],
)
def test_a_damaged_export_of_vicon_is_refused(written, old, new, said):
    rows = np.column_stack([TURNED.as_rotvec(), FLOOR * 1000])
    text = vicon(rows, ["RX", "RY", "RZ", "TX", "TY", "TZ"], ["rad"] * 3 + ["mm"] * 3)
    assert old in text
    with pytest.raises(InputError) as caught:
        read_trajectory(written("a.csv", text.replace(old, new)))
    assert said in str(caught.value)


ANGLES = Rotation.from_euler("ZYX", np.column_stack([ANGLE, 0.01 * FLOOR[:, :2]])).as_euler("XYZ")
"""Track Manager's own: about X, then about the turned Y, then about the turned Z."""


def qualisys(bodies=("robot",), *, matrix=True, lost=(), names=True):
    head = [["NO_OF_FRAMES", N], ["NO_OF_CAMERAS", 8], ["NO_OF_BODIES", len(bodies)]]
    head += [["FREQUENCY", 100], ["NO_OF_ANALOG", 0], ["ANALOG_FREQUENCY", 0]]
    head += [["DESCRIPTION", "--"], ["TIME_STAMP", "2024-01-22, 17:47:17", "22107.99179716"]]
    head += [["DATA_INCLUDED", "6D"], ["BODY_NAMES", *bodies]]
    titles = ["Frame", "Time"]
    for body in bodies:
        columns = ["X", "Y", "Z", "Roll", "Pitch", "Yaw", "Residual"]
        columns += [f"Rot[{k}]" for k in range(9)] if matrix else []
        titles += [f"{body} {columns[0]}" if names else columns[0], *columns[1:]]
    rows = []
    for k in range(N):
        row = [*(FLOOR[k] * 1000), *np.degrees(ANGLES[k]), 0.5]
        row += [*TURNED[k].as_matrix().T.ravel()] if matrix else []
        row = [0.0] * len(row) if k in lost else row
        rows.append([k + 1, f"{k / 100:.5f}", *([f"{one:.5f}" for one in row] * len(bodies))])
    return csv(*head, titles, *rows, separator="\t")


@pytest.mark.parametrize("matrix", [True, False])
@pytest.mark.parametrize("bodies", [("robot",), ("robot", "arm")])
def test_bodies_of_qualisys(written, matrix, bodies):
    path = written("a_6D.tsv", qualisys(bodies, matrix=matrix))
    assert is_trajectory(path)
    found = read_trajectory(path, body=bodies[-1])
    assert found.provenance["format"] == "qualisys"
    np.testing.assert_allclose(found.times, np.arange(N) / 100, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.positions, FLOOR, rtol=0, atol=5.1e-9)
    assert (found.rotations.inv() * TURNED).magnitude().max() < 2e-5
    assert found.clock.rate == 100


def test_the_matrix_of_a_published_file(written):
    """A line of a ship's motion in a basin: roll -0.65630, pitch 0.09391, yaw 0.05772 degrees."""
    text = qualisys().splitlines()[:11]
    row = "1\t0.00000\t-194.91974\t2.24150\t0.99661\t-0.65630\t0.09391\t0.05772\t4.98536\t1.00000\t"
    row += "0.00099\t-0.00165\t-0.00101\t0.99993\t-0.01145\t0.00164\t0.01145\t0.99993"
    found = read_trajectory(written("a.tsv", "\r\n".join([*text, row]) + "\r\n"))
    by_angles = Rotation.from_euler("XYZ", [-0.65630, 0.09391, 0.05772], degrees=True)
    assert (found.rotations[0].inv() * by_angles).magnitude() < 3e-5


def test_qualisys_without_columns_for_frame_and_time(written):
    lines = qualisys().split("\r\n")
    short = [line.split("\t", 2)[-1] if k >= 10 else line for k, line in enumerate(lines)]
    found = read_trajectory(written("a.tsv", "\r\n".join(short)))
    np.testing.assert_allclose(found.times, np.arange(N) / 100, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.positions, FLOOR, rtol=0, atol=5.1e-9)


def test_frames_in_which_qualisys_did_not_see_the_body(written):
    found = read_trajectory(written("a.tsv", qualisys(lost=(7, 8))))
    assert len(found) == N - 2
    assert any("line 19 to 20" in note for note in found.provenance["notes"])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("FREQUENCY\t100\r\nNO_OF", "FREQUENCY\t0\r\nNO_OF", "field 'FREQUENCY': '0'"),
        ("BODY_NAMES\trobot", "BODY_NAMES", "no rigid body"),
        ("Frame\tTime\trobot X\tY\t", "Picture\tTime\trobot A\tB\t", "no line 'X, Y, Z"),
        ("\r\n2\t0.01000\t", "\r\n2\t0.01000\tx", "field 'robot X'"),
        ("Rot[8]", "Rot[9]", None),
    ],
)
def test_a_damaged_export_of_qualisys_is_refused(written, old, new, said):
    text = qualisys()
    assert old in text
    path = written("a.tsv", text.replace(old, new, 1))
    if said is None:
        assert "no rotation matrix" in " ".join(read_trajectory(path).provenance["notes"])
        return
    with pytest.raises(InputError) as caught:
        read_trajectory(path)
    assert said in str(caught.value)
