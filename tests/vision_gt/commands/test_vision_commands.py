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


def test_images_of_a_board_in_one_place_show_no_displacement(rendered):
    image = next((rendered / "vision" / "steadiness" / "before").iterdir())
    camera = rendered / "truth" / f"camera_{image.stem}.yaml"
    facts = json.loads(run("check-displacement", camera, image, image, 0.3, *BOARD, "--json"))
    assert facts["expected"] == 0.3
    assert facts["measured"] == 0.0


def test_patterns_come_with_the_lines_that_describe_them(tmp_path):
    said = run("print-patterns", tmp_path, "--svg")
    assert "[vision.markers]" in said
    assert (tmp_path / "marker_14.svg").exists()
    written = json.loads(run("print-patterns", tmp_path, "--svg", "--json"))["written"]
    assert len(written) == len(list(tmp_path.iterdir()))
