"""The façade costs nothing until it is used, and says what is wrong with what it is given."""

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import gtval
import gtval.plugins
import gtval.testing as samples

HEAVY = {"numpy", "scipy", "cv2", "matplotlib", "click", "rich", "pydantic", "jinja2"}


def python(code, *arguments):
    """What a fresh Python prints."""
    command = [sys.executable, *arguments, *(["-c", code] if code else [])]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


@pytest.mark.parametrize("name", ["gtval", "gtval.plugins"])
def test_importing_loads_nothing_heavy(name):
    code = f"import sys, {name}; print(*(m.partition('.')[0] for m in sys.modules))"
    assert not HEAVY & set(python(code).split())


def test_pytest_starts_without_numpy_for_our_fixtures():
    code = "import sys, gtval.fixtures; print(sorted(sys.modules))"
    loaded = ast.literal_eval(python(code))
    assert "pytest" in loaded
    assert not HEAVY & set(loaded)


def test_no_run_loads_the_distributions_of_scipy():
    """They take half a second, and `scipy.special` has what is asked of them."""
    names = [f"{name}.system" for name in ("survey", "vision_gt", "laser_gt", "rtk_gt")]
    names += ["vision_gt.campaign.solve", "laser_gt.campaign.solve", "rtk_gt.campaign.solve"]
    code = f"import sys, validation.whole_run, {', '.join(names)}"
    done = python(f"{code}; print('scipy.stats' in sys.modules)")
    assert done == "False\n"


def test_importing_takes_a_fraction_of_starting_python():
    clock = "import time; start = time.process_time(); import gtval; "
    clock += "print(start, time.process_time() - start)"
    starting, importing = np.array([python(clock).split() for _ in range(5)], dtype=float).min(0)
    assert importing < starting / 2


def test_the_module_is_the_command():
    told = python("", "-m", "gtval", "--help")
    assert told.startswith("Usage: gtval")
    assert told == python("", "-m", "validation", "--help")


@pytest.mark.parametrize("module", [gtval, gtval.plugins])
def test_type_checkers_see_the_names_that_are_loaded(module):
    tree = ast.parse(Path(module.__file__).read_text(encoding="utf-8"))
    checked = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {
        (alias.name, node.module)
        for node in checked.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert {name for name, _ in seen} == set(module.__all__) == set(dir(module))
    for name, home in seen:
        assert getattr(module, name) is getattr(sys.modules[home], name)


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'gtval' has no attribute 'solve'"):
        gtval.solve  # noqa: B018


def test_poses_in_space_are_told_by_their_six_numbers():
    table = gtval.pose_table("rtk", np.zeros((2, 6)))
    assert [component.name for component in table.components][2:4] == ["z", "yaw"]


def test_a_pose_table_of_a_wrong_shape_is_refused():
    with pytest.raises(gtval.GtvalError, match=r"expected \(2, 3\) numbers, got \(2, 4\)"):
        gtval.pose_table("rig", np.zeros((2, 4)))


def test_an_image_file_gives_the_same_markers(tmp_path):
    import cv2

    sample = samples.make_images(seed=3)
    cv2.imwrite(str(tmp_path / "one.png"), sample.images[0])
    one, other = (
        gtval.locate_markers(image, sample.camera, sample.sides, sample.family)
        for image in (tmp_path / "one.png", sample.images[0])
    )
    assert len(one) >= 2
    assert all((a.corners == b.corners).all() for a, b in zip(one, other, strict=True))


def test_a_file_of_fixes_of_an_unknown_form_is_refused(tmp_path):
    (tmp_path / "rear.dat").write_text("what is this?")
    with pytest.raises(gtval.GtvalError, match="set format to one of nmea, rtklib"):
        gtval.read_fixes(tmp_path / "rear.dat")


def test_the_path_is_where_the_vehicle_was(tmp_path):
    # The records of a file and of memory; sigma of a fix is 6.4 mm, and three antennas are
    # averaged: 5 sigma of one antenna bound the median.
    drive = samples.make_drive(tmp_path, seed=4)
    records = [gtval.read_fixes(tmp_path / "rtk" / f"{one.receiver}.nmea") for one in drive.records]
    path = gtval.find_path(records, gtval.find_offsets(records), drive.heights)
    steps = np.linalg.norm(np.diff(path.poses[:, :3], axis=0), axis=1)
    known = dict(zip(drive.truth.ids, drive.truth.poses, strict=True))
    true = np.array([known[name] for name in gtval.path_table(path).ids])
    true_steps = np.linalg.norm(np.diff(true[:, :3], axis=0), axis=1)
    assert np.median(np.abs(steps - true_steps)) < 5 * 0.0064


@pytest.mark.parametrize(
    ("system", "poses", "more", "expected"),
    [
        ("rig", [[0, 0, "a"]], {}, "poses: expected numbers in rows of equal length"),
        ("rig", [[0, 0, 1], [0, 0]], {}, "poses: expected numbers in rows of equal length"),
        ("rig", None, {}, "poses: expected one row of numbers a pose, got None"),
        ("rig", [0, 0, 1], {}, "poses: expected one row of numbers a pose"),
        ("rig", {"a": 1}, {}, "poses: expected numbers in rows of equal length"),
        ("rig", [[0, 0, float("nan")]], {}, "pose 1 is not finite"),
        ("rig", [[0, 0, 1]], {"sigmas": 0.1}, "sigmas: expected a number above 0 a component"),
        ("rig", [[0, 0, 1]], {"sigmas": [0.1, 0.1]}, "sigmas: expected a number above 0"),
        ("rig", [[0, 0, 1]], {"sigmas": [0.1, 0.1, -1]}, "sigmas: expected a number above 0"),
        ("rig", [[0, 0, 1]], {"sigmas": ["a", 0, 0]}, "sigmas: expected numbers"),
        ("rig", [[0, 0, 1]], {"covariances": "x"}, "covariances: expected numbers"),
        ("rig", [[0, 0, 1]], {"covariances": np.eye(3)}, r"covariances \(3, 3\), not \(1, 3, 3\)"),
        ("rig", [[0, 0, 1]], {"ids": 5}, "a list of ids, not 'rig' and 5"),
        ("rig", [[0, 0, 1]], {"ids": "1"}, "a list of ids, not 'rig' and '1'"),
        ("rig", [[0, 0, 1]], {"ids": ["a", "b"]}, r"expected \(2, 3\) numbers, got \(1, 3\)"),
        (None, [[0, 0, 1]], {}, "a name and a list of ids, not None"),
    ],
)
def test_a_pose_table_of_bad_numbers_says_what_was_expected(system, poses, more, expected):
    with pytest.raises(gtval.GtvalError, match=expected):
        gtval.pose_table(system, poses, **more)
