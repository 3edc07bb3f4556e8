"""The smaller commands below ``gtval vision``: boards are stated, and all print objects."""

import json

import pytest
from click.testing import CliRunner

from validation.cli import main
from vision_gt.optics.camera_files import read_cameras

BOARD = ["--columns", "10", "--rows", "6", "--square", "0.1"]


def run(*arguments, status: int = 0) -> str:
    done = CliRunner().invoke(main, ["vision", *map(str, arguments)])
    assert done.exit_code == status, done.output
    return done.stdout if status == 0 else done.output


def test_a_camera_is_calibrated_from_a_folder_and_its_file_converted(rendered, tmp_path):
    images = rendered / "vision" / "calibration" / "1"
    target = tmp_path / "one.yaml"
    facts = json.loads(
        run("calibrate", images, *BOARD, "--workers", 1, "--write", target, "--json")
    )
    truth = read_cameras(rendered / "truth" / "camera_1.yaml")[0].parameters
    sigma = facts["sigmas"]["fx"]
    # One draw: five standard deviations, of a calibration by five images.
    assert facts["parameters"]["fx"] == pytest.approx(truth[0], abs=5 * sigma)
    other = tmp_path / "one.mat"
    said = json.loads(run("convert-camera", target, other, "--format", "bouguet", "--json"))
    assert said["written"] == [str(other)]
    assert read_cameras(other)[0].parameters[0] == facts["parameters"]["fx"]


@pytest.mark.parametrize("command", [["calibrate", "."], ["check-displacement", "a", "b", "c", 1]])
def test_no_board_is_taken_for_granted(command):
    assert "--columns 10 --rows 6 --square 0.1" in run(*command, status=2)


def test_a_board_that_moved_is_judged_by_its_sigmas(rendered):
    """Moved by 0.6 m to 1 mm: 0.6 agrees, 9.9 mm more does not, and --strict ends with 3."""
    camera = rendered / "truth" / "camera_1.yaml"
    images = [rendered / "vision" / "displacement" / "1" / f"{n}.png" for n in ("first", "second")]
    facts = json.loads(run("check-displacement", camera, *images, 0.6, *BOARD, "--json"))
    assert facts["agrees"]
    assert abs(facts["measured"] - 0.6) < 4 * (facts["sigma"] ** 2 + 0.001**2) ** 0.5
    assert facts["sigma"] < 0.001
    assert facts["angle"] < 0.005
    wrong = ("check-displacement", camera, *images, 0.6099, *BOARD)
    told = run(*wrong, "--strict", status=3)
    assert "That is no chance" in told
    assert f"off by {1e3 * (facts['measured'] - 0.6099):+.1f} mm" in told
    run(*wrong)  # without --strict the finding alone says it


def test_calibration_pictures_are_written(rendered, tmp_path):
    run("calibrate", rendered / "vision/calibration/1", *BOARD, "--workers", 1,
        "--figures", tmp_path)  # fmt: skip
    names = {path.name for path in tmp_path.iterdir()}
    assert {"extrinsics.png", "corners_01.png"} <= names


def test_patterns_come_with_the_lines_that_describe_them(tmp_path):
    said = run("print-patterns", tmp_path, "--svg")
    assert "[vision.markers]" in said
    assert (tmp_path / "marker_14.svg").exists()
    written = json.loads(run("print-patterns", tmp_path, "--svg", "--json"))["written"]
    assert len(written) == len(list(tmp_path.iterdir()))
