"""Formats told by content and name, and that nothing but a known error comes of any bytes."""

import gzip
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from validation.errors import GtvalError, InputError
from validation.poses.trajectory import Trajectory
from validation.trajectories.formats import (
    is_trajectory,
    read_trajectory,
    trajectory_text,
    write_trajectory,
)
from validation.trajectories.formats.reading import READERS, format_of

HERE = {
    "csv": "time,x,y,theta\n0.0,1,2,0.1\n0.1,1,2,0.2\n0.2,1,3,0.2\n",
    "tum": "# made by hand\n1e9 1 2 3 0 0 0 1\n1000000000.5 1 2 4 0 0.6 0 0.8\n",
    "tum_covariance": "1000000000.1 1 2 3 0 0 0 1 1e-4 0 0 1e-4 0 1e-4 1e-2 0 0 1e-2 0 1e-2\n",
    "kitti": "1 0 0 1 0 1 0 2 0 0 1 3\n",
    "rawseeds": "1235561676.015850, -0.028146, 0.015461, 1.564037\n",
    "euroc": "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m]\n1403636579763555527,1,2,3\n",
    "motive": "Format Version,1.23,Take Name,a,Rotation Type,Quaternion,Length Units,Meters\n\n"
    ",,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body\n"
    ",,a,a,a,a,a,a,a\n,,1,1,1,1,1,1,1\n"
    ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position\n"
    "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z\n0,0.0,0,0,0,1,1,2,3\n1,0.01,0,0,0,1,2,2,4\n",
    "vicon": "Objects\n100\n,,a,,,,,\nFrame,Sub Frame,RX,RY,RZ,TX,TY,TZ\n,,rad,rad,rad,mm,mm,mm\n"
    "1,0,0,0,0.1,1,2,3\n2,0,0,0,0.2,1,2,4\n",
    "qualisys": "NO_OF_FRAMES\t1\nFREQUENCY\t100\nBODY_NAMES\ta\nFrame\tTime\ta X\tY\tZ\tRoll"
    "\tPitch\tYaw\tResidual\n1\t0.0\t1\t2\t3\t0\t0\t9\t1\n2\t0.01\t1\t2\t3\t0\t0\t9\t1\n",
    "gsi": "110001+00000001 18....+23201500 19....+11142213 81..10+00001000 82..10+00002000\n",
    "landxml": '<LandXML><CgPoints><CgPoint timeStamp="2023-11-14T22:13:20">1 2 3</CgPoint>'
    "</CgPoints></LandXML>",
}
"""The smallest file of each format of text."""


@pytest.mark.parametrize("form", HERE)
@pytest.mark.parametrize("name", ["a", "a.csv", "a.txt", "a.gz"])
def test_the_content_tells_the_format_whatever_the_name(written, form, name):
    data = HERE[form].encode()
    path = written(name, gzip.compress(data) if name.endswith("gz") else data)
    assert format_of(path) == form
    assert is_trajectory(path)


@pytest.mark.parametrize("form", HERE)
@pytest.mark.parametrize("change", ["\r\n", "\r", "bom"])
def test_ends_of_lines_and_a_byte_order_mark_change_nothing(written, form, change):
    times = written("times.txt", "1.5\n")
    options = {"times": times} if form == "kitti" else {}
    options |= {"up": "y"} if form == "motive" else {}
    before = read_trajectory(written("a", HERE[form]), **options)
    text = "\ufeff" + HERE[form] if change == "bom" else HERE[form].replace("\n", change)
    after = read_trajectory(written("a", text), **options)
    np.testing.assert_array_equal(after.poses, before.poses)
    np.testing.assert_array_equal(after.times, before.times)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "the file is empty"),
        (b" \n \n", "the file is empty"),
        ("time,x,y\n0,1,2\n".encode("utf-16"), "UTF-16"),
        (b"\x7fELF\0\0\0\0", "a binary file, not text"),
        (b"\x1f\x8b\x08\0garbage", "damaged or cut off"),
        (b"hello world\n", "euroc, rawseeds: no column for a time, x, y among 'hello', 'world'"),
        (b"1 2 3\n", "tum: 3 columns, not 8"),
        (b'{"a": 1}\n', "no format of a trajectory fits"),
        (b"pose,x,y,theta\n1,0,0,0\n", "a table of named stops"),
        (b"1403636579763555527,1,2,3\n", "rawseeds: stamps of more than 12 digits"),
    ],
)
def test_what_is_no_trajectory_is_told_with_the_formats_tried(written, content, said):
    path = written("a.csv", content)
    with pytest.raises(InputError) as caught:
        read_trajectory(path)
    assert said in str(caught.value)
    assert not is_trajectory(path)


def test_every_format_says_why_it_does_not_fit(written):
    with pytest.raises(InputError) as caught:
        read_trajectory(written("a.csv", "1 2 3\n"))
    assert all(f"{form}: " in str(caught.value) for form in READERS)


@pytest.mark.parametrize("form", READERS)
def test_a_wrong_format_that_is_asked_for_is_an_error(written, form):
    with pytest.raises(InputError):
        read_trajectory(written("a", "hello world\n"), format=form)


def test_files_that_are_missing_and_formats_that_are_none(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        read_trajectory(tmp_path / "a.csv")
    assert not is_trajectory(tmp_path / "a.csv")
    with pytest.raises(GtvalError, match="'word' is no format; there are csv"):
        read_trajectory(tmp_path / "a.csv", format="word")
    with pytest.raises(GtvalError, match="no axis that points up"):
        read_trajectory(tmp_path / "a.csv", up="x")


@pytest.mark.parametrize("form", HERE)
def test_a_file_that_is_cut_off_anywhere_gives_a_known_error_or_fewer_poses(written, form):
    times = written("times.txt", "1.5\n")
    options = {"times": times} if form == "kitti" else {}
    whole = read_trajectory(written("a", HERE[form]), up="y", **options)
    for end in range(len(HERE[form])):
        try:
            found = read_trajectory(written("a", HERE[form][:end]), up="y", **options)
        except GtvalError:
            continue
        assert len(found) <= len(whole)


def known(path, **options):
    """Reading ends in a trajectory of finite numbers, or a known error."""
    told = is_trajectory(path)
    try:
        found = read_trajectory(path, **options)
    except GtvalError:
        return
    assert told or options
    assert np.isfinite(found.poses).all()
    assert (np.diff(found.times) > 0).all()
    with np.errstate(all="ignore"):
        stated = found.covariances[found.has_covariance]
    assert np.isfinite(stated).all()


FIXTURES = {"suppress_health_check": [HealthCheck.function_scoped_fixture]}


@settings(max_examples=150, **FIXTURES)
@given(data=st.binary(max_size=200), form=st.sampled_from([None, *READERS]))
def test_any_bytes(written, data, form):
    known(written("a", data), **({} if form is None else {"format": form}))


cells = st.one_of(
    st.sampled_from(
        ["", "nan", "inf", "-0", "1e400", "1e-400", "0x1", "1_0", "½", "9" * 400, "\0"]
    ),
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.integers(-(10**20), 10**20).map(str),
    st.text(max_size=4),
)


@settings(max_examples=25, **FIXTURES)
@pytest.mark.parametrize("form", HERE)
@given(data=st.data())
def test_a_good_file_with_a_few_cells_changed(written, form, data):
    """Cells, separators and lines of a good file are replaced, doubled and taken out."""
    import re

    parts = re.split(r"([,\s<>]+)", HERE[form])
    for _ in range(data.draw(st.integers(1, 3))):
        where = data.draw(st.integers(0, len(parts) - 1))
        what = data.draw(st.sampled_from(["replace", "double", "remove"]))
        if what == "replace":
            parts[where] = data.draw(cells)
        else:
            parts[where : where + 1] = [parts[where]] * 2 if what == "double" else []
        parts = parts or [""]
    times = written("times.txt", "1.5\n")
    data_ = "".join(parts).encode(errors="surrogatepass")
    options = data.draw(st.sampled_from([{}, {"format": form, "times": times, "up": "y"}]))
    known(written("a", data_), **options)


@settings(max_examples=60, **FIXTURES)
@given(rows=st.lists(st.lists(cells, min_size=4, max_size=4), min_size=1, max_size=4))
def test_any_cells_under_good_names(written, rows):
    text = "time,x,y,yaw\n" + "".join(",".join(row) + "\n" for row in rows)
    known(written("a.csv", text.encode(errors="surrogatepass")))


def many(n, kind="space") -> Trajectory:
    rng = np.random.default_rng(1)
    turned = rng.uniform(1, 2, (n, 4)) if kind == "space" else rng.uniform(-3, 3, (n, 1))
    turned /= np.linalg.norm(turned, axis=1, keepdims=True) if kind == "space" else 1
    places = rng.normal(0, 10, (n, 3 if kind == "space" else 2))
    poses = np.column_stack([places, turned])
    times = np.arange(n) * 0.01 + 0.123456789
    covariances = np.tile(np.diag([1e-4] * (6 if kind == "space" else 3)), (n, 1, 1))
    return Trajectory("a", times, poses, kind, covariances, epoch=1_400_000_000)


@pytest.mark.parametrize("form", ["tum", "euroc", "csv"])
def test_a_hundred_thousand_poses_are_read_in_less_than_a_second(tmp_path, form):
    # Twice the time that is asked for, as other tests may run beside this one.
    kind = "plane" if form == "csv" else "space"
    path = tmp_path / "a.csv"
    path.write_text(trajectory_text(many(100_000, kind), form))
    began = time.process_time()
    found = read_trajectory(path)
    assert time.process_time() - began < 2
    assert len(found) == 100_000
    began = time.process_time()
    assert is_trajectory(path)
    assert time.process_time() - began < 0.1


def test_nothing_is_written_where_a_format_cannot_hold_it(tmp_path, drive):
    with pytest.raises(GtvalError, match="without orientation"):
        write_trajectory(drive("points_space"), tmp_path / "a.tum")
    with pytest.raises(GtvalError, match="does not tell the format"):
        write_trajectory(drive(), tmp_path / "a.txt")
    with pytest.raises(GtvalError, match="cannot be written; there are csv"):
        write_trajectory(drive(), tmp_path / "a.csv", "motive")
    assert list(tmp_path.iterdir()) == []
