"""From rendered images to poses, by the commands; and what becomes of bad input."""

import csv
import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from data_samples.rooms.cameras import MARKER_FAMILY
from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.poses.pose_table import from_csv, pose_difference
from vision_gt.campaign.findings import vision_findings
from vision_gt.campaign.outcome import StopPose
from vision_gt.campaign.pose_tables import pose_tables
from vision_gt.campaign.solve import solve_campaign
from vision_gt.commands.patterns import EXAMPLE
from vision_gt.images.jobs import BoardJob, detect_one
from vision_gt.images.markers import detect_markers
from vision_gt.optics.camera_files import read_cameras
from vision_gt.settings import FloorSettings, VisionSettings
from vision_gt.stages.inputs import load_inputs, made_board
from vision_gt.stages.lacks import Lack
from vision_gt.stages.places import NoLayoutError
from vision_gt.system import SYSTEM, result_of


def errors_of(rendered, table):
    truth = from_csv(rendered / "truth" / "poses.csv", system="truth")
    return pose_difference(truth.select(table.ids).poses, table.poses)


def test_the_images_have_the_documents_names(rendered):
    names = {str(p.relative_to(rendered / "vision")) for p in (rendered / "vision").rglob("*.png")}
    assert {"network/2-1-4.png", "network/1-2-4.png", "reference/2.png"} & names
    assert any(name.startswith("poses/2/pose") for name in names)


def test_poses_are_within_millimetres_and_as_good_as_stated(rendered, outcome):
    poses, _ = pose_tables(outcome)
    errors = errors_of(rendered, poses)
    assert len(errors) >= 5
    assert np.abs(errors[:, :2]).max() < 0.012
    assert np.abs(errors[:, 2]).max() < 0.010
    k = errors.size
    total = errors.ravel() @ np.linalg.solve(poses.joint, errors.ravel())
    # One campaign is one draw of its cameras: the bounds are those of chi-squared at 1 in 10 000.
    from scipy.stats import chi2

    assert chi2.ppf(1e-4, k) < total < chi2.ppf(1 - 1e-4, k)


def test_the_documents_way_is_several_times_worse(rendered, outcome):
    poses, published = pose_tables(outcome)
    theirs = np.abs(errors_of(rendered, published)[:, :2]).mean()
    ours = np.abs(errors_of(rendered, poses)[:, :2]).mean()
    assert theirs > 3 * ours


def test_findings_files_and_figures(rendered, outcome):
    result = result_of(outcome, load_campaign(rendered))
    codes = {finding.code for finding in result.findings}
    assert {"coverage", "bar", "steady"} <= codes
    assert not [f for f in result.findings if f.severity == "error"]
    rows = list(csv.DictReader(result.files["vision_detections.csv"].splitlines()))
    seen = sum(row["89"] == "yes" for row in rows)
    assert seen == sum(89 in d.numbers for d in outcome.detections.values())
    moved = list(csv.DictReader(result.files["vision_steadiness.csv"].splitlines()))
    assert [(row["camera"], row["verdict"]) for row in moved] == [
        (one.camera, one.verdict) for one in outcome.steadiness
    ]
    for section in result.sections:
        for block in section.blocks:
            if hasattr(block, "draw"):
                block.draw().canvas.draw()


def test_a_stop_without_a_pose_has_a_reason(outcome):
    nothing = StopPose("7", {}, None)
    text = {
        finding.code: finding.text
        for finding in vision_findings(
            replace(outcome, stops=(*outcome.stops, nothing)),
            [*(stop.pose for stop in outcome.stops), "7", "99"],
        )
    }["coverage"]
    assert "No marker was found in the images of 7." in text
    assert "No camera has an image of 99" in text


def gtval(seed: int, *arguments: str) -> None:
    """The command in a process of its own, with its own order of sets."""
    environment = {**os.environ, "PYTHONHASHSEED": str(seed)}
    command = [sys.executable, "-c", "from validation.cli import main; main()", *arguments]
    subprocess.run(command, env=environment, check=True, capture_output=True)


@pytest.mark.full
def test_the_command_and_a_run_write_the_same_bytes_in_two_processes(rendered, tmp_path):
    alone, run = tmp_path / "alone", tmp_path / "run"
    for folder in (alone, run):
        shutil.copytree(rendered, folder)
        shutil.rmtree(folder / "kept", ignore_errors=True)
    gtval(1, "vision", str(alone), "--workers", "1")
    gtval(2, "run", str(run))
    record = json.loads((run / "results" / "run.json").read_text())
    written = set(record["steps"]["vision"]["outputs"])
    tables = {"poses_vision.csv", "poses_vision.tum", "joint_vision.csv", "vision_cameras.csv"}
    assert tables <= written
    assert written == {path.name for path in (alone / "results").iterdir()} - {"run.json"}
    for name in written:
        assert (alone / "results" / name).read_bytes() == (run / "results" / name).read_bytes()


def test_hardware_that_nobody_stated_is_asked_for_all_at_once(campaign):
    toml = campaign / "campaign.toml"
    kept, left = [], False
    for line in toml.read_text().splitlines():
        if line.startswith("["):
            left = line.split("]")[0].removeprefix("[").startswith("vision.")
        if not left:
            kept.append(line)
    toml.write_text("\n".join(kept))
    keys = ["board", "bar.first", "bar.second", "bar.second_on_first", "reference.board"]
    keys += ["reference.position", "markers.family", "markers.sides", "markers.dima"]
    keys += ["markers.dima_on_robot"]
    examples = ["in [vision.markers] a line such as: dima = 14", "position = [0.2, 0.0]"]
    expect_error(campaign, *(f"field 'vision.{key}'" for key in keys), *examples)
    # What the error says to write is enough.
    board, others = EXAMPLE.removeprefix("[vision]\n").split("\n", 1)
    toml.write_text(toml.read_text().replace("[vision]", f"[vision]\n{board}") + "\n" + others)
    load_inputs(load_campaign(campaign))


def test_standard_deviations_that_nobody_stated_are_told(outcome):
    stated = vision_findings(outcome)
    assert "assumed_sigmas" not in {finding.code for finding in stated}
    settings = outcome.settings.model_copy(update={"floor": FloorSettings()})
    (found,) = set(vision_findings(replace(outcome, settings=settings))) - set(stated)
    assert (found.severity, found.code) == ("note", "assumed_sigmas")
    assert "vision.floor.height = 0.003; vision.floor.tilt = 0.005" in found.text


def test_what_no_step_looks_at_is_told(campaign):
    vision = campaign / "vision"
    image = next((vision / "reference").iterdir())
    strays = ["poses/7/pose1.png", "layout/1/1.png", "calibration/loose.png", "pose/1/pose1.png"]
    strays += ["poses/1/pose9.webp"]
    for name in [*strays, "table/1/pose1.png"]:
        (vision / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(image, vision / name)
    (vision / "steadiness" / "after" / "1.png").unlink()
    toml = campaign / "campaign.toml"
    files = 'camera_files = { "8" = "eight.yaml" }'
    toml.write_text(toml.read_text().replace("[vision]\n", f"[vision]\n{files}\n"))
    told = {name for name, _ in load_inputs(load_campaign(campaign)).oddities}
    strays += ["steadiness/before/1.png"]
    assert told == {*(f"vision/{name}" for name in strays), "eight.yaml"}


def test_a_marker_that_the_campaign_does_not_have_is_told(campaign):
    toml = campaign / "campaign.toml"
    lines = toml.read_text().replace('"89" = 0.156, ', "").splitlines()
    toml.write_text("\n".join(line for line in lines if not line.startswith('"89"')))
    given = load_inputs(load_campaign(campaign), workers=1)
    cameras = {
        name: read_cameras(campaign / "truth" / f"camera_{name}.yaml")[0] for name in given.wanted
    }
    given.marker_views(cameras)
    said = {what for _, what in given.oddities}
    assert "marker 89 is not in vision.markers.sides; it is not used" in said


def expect_error(campaign, *words):
    runner = CliRunner()
    done = runner.invoke(main, ["vision", "solve", str(campaign), "--workers", "1"])
    assert done.exit_code == 2, done.output
    said = " ".join((done.output + done.stderr).split())
    for word in words:
        assert word in said
    assert not (campaign / "results" / "poses_vision.csv").exists()


def test_a_wrong_board_size_is_an_error(campaign):
    vision = campaign / "vision"
    for folder in ("network", "bar", "steadiness"):
        shutil.rmtree(vision / folder)
    for camera in (vision / "calibration").iterdir():
        for path in sorted(camera.iterdir())[1:]:
            path.unlink()
    toml = campaign / "campaign.toml"
    text = toml.read_text()
    board = text.index("[vision.board]")
    toml.write_text(text[:board] + text[board:].replace("columns = 10", "columns = 9", 1))
    expect_error(campaign, "none of its 1 calibration images shows a board of 9 x 6 squares")


def test_a_truncated_image_is_an_error_that_names_it(campaign):
    path = next((campaign / "vision" / "network").glob("2-1-1.png"))
    path.write_bytes(path.read_bytes()[:200_000])
    expect_error(campaign, "2-1-1.png", "truncated")


def test_an_image_of_another_size_is_an_error(campaign):
    path = campaign / "vision" / "calibration" / "2" / "03.png"
    cv2.imwrite(str(path), np.zeros((480, 640), dtype=np.uint8) + 90)
    expect_error(campaign, "03.png", "640 x 480")


def test_a_camera_file_of_another_resolution_is_an_error(campaign):
    text = (campaign / "truth" / "camera_2.yaml").read_text()
    (campaign / "two.yaml").write_text(text.replace("image_width: 1280", "image_width: 640"))
    toml = campaign / "campaign.toml"
    toml.write_text(
        toml.read_text().replace("[vision]\n", '[vision]\ncamera_files = { "2" = "two.yaml" }\n')
    )
    expect_error(campaign, "two.yaml", "made for 640 x 960 pixels")


def test_an_image_name_that_says_nothing_is_an_error(campaign):
    path = next((campaign / "vision" / "network").glob("2-1-1.png"))
    path.rename(path.with_name("first.png"))
    expect_error(campaign, "first.png", "expected a name such as 2-1-4")


@pytest.mark.parametrize(
    ("content", "said"),
    [(b"", "truncated or damaged"), (b"no picture", "not an image"), (None, "the same camera as")],
    ids=["empty", "text", "twice"],
)
def test_bad_reference_files_are_errors_that_name_them(campaign, content, said):
    path = next((campaign / "vision" / "reference").iterdir())
    if content is None:
        shutil.copy(path, path.with_suffix(".bmp"))
    else:
        # Nothing else to look at: what is asked is that the bad file is named.
        for folder in ("calibration", "network", "bar", "steadiness"):
            for image in (campaign / "vision" / folder).rglob("*.png"):
                image.unlink()
        for name in ("1", "2"):
            camera = (campaign / "truth" / f"camera_{name}.yaml").read_text()
            (campaign / f"{name}.yaml").write_text(camera)
        toml = campaign / "campaign.toml"
        files = 'camera_files = { "1" = "1.yaml", "2" = "2.yaml", "hand" = "2.yaml" }'
        toml.write_text(toml.read_text().replace("[vision]\n", f"[vision]\n{files}\n"))
        path.write_bytes(content)
    expect_error(campaign, path.stem, said)


def test_a_missing_reference_is_an_error(campaign):
    shutil.rmtree(campaign / "vision" / "reference")
    expect_error(campaign, "no image of the reference pattern")


def test_blank_and_mirrored_images_and_swapped_pairs_are_findings(campaign):
    poses = campaign / "vision" / "poses" / "2"
    blank, mirrored, doubled = sorted(poses.iterdir())[:3]
    noise = np.random.default_rng(0).normal(60, 2, (960, 1280))
    cv2.imwrite(str(blank), noise.astype(np.uint8))
    cv2.imwrite(str(mirrored), cv2.imread(str(mirrored), 0)[:, ::-1])
    number = show_a_marker_twice(doubled)
    network = campaign / "vision" / "network"
    one, other = network / "2-1-2.png", network / "1-2-2.png"
    spare = network / "spare.tmp"
    one.rename(spare)
    other.rename(one)
    spare.rename(other)
    loaded = load_campaign(campaign)
    outcome = solve_campaign(loaded, workers=1, as_published=False)
    found = result_of(outcome, loaded).findings
    said = {finding.code: finding.text for finding in found}
    images = " ".join(f.text for f in found if f.code == "image")
    assert blank.name in images
    assert "blank" in images
    assert mirrored.name in images
    assert "mirror" in images
    assert doubled.name in images
    assert f"marker {number} is seen twice" in images
    assert "1-2-2.png and 2-1-2.png" in said["snapshots_exchanged"]
    assert "snapshot_outliers" not in said


def test_a_mirrored_board_is_told_from_one_that_is_not_there(rendered, tmp_path):
    settings = load_campaign(rendered).section("vision", VisionSettings).bar
    boards = [(0, made_board(settings.first)), (1, made_board(settings.second))]
    whole = cv2.imread(str(next((rendered / "vision" / "bar").glob("*.png"))), 0)
    notes = {}
    for name, image in {"as_is": whole, "mirrored": whole[:, ::-1], "none": whole[:200]}.items():
        path = tmp_path / f"{name}.png"
        cv2.imwrite(str(path), image)
        found = detect_one(BoardJob(path, "2", name, boards))
        notes[name] = found.note, bool(found.boards)
    assert notes == {
        "as_is": ("", True),
        "mirrored": ("the board is mirrored", False),
        "none": ("", False),
    }


def test_a_wrong_family_of_markers_is_named_with_the_one_that_is_there(campaign):
    toml = campaign / "campaign.toml"
    stated = '[vision.markers]\nfamily = "ARTOOLKITPLUS_SIMPLE"'
    assert stated in toml.read_text()
    toml.write_text(toml.read_text().replace(stated, '[vision.markers]\nfamily = "4X4_250"'))
    with pytest.raises(NoLayoutError, match=r"4X4_250.* but of ARTOOLKITPLUS_SIMPLE, ids 3, 6"):
        solve_campaign(load_campaign(campaign), workers=1, as_published=False)


def test_a_board_stated_wrongly_is_an_error_where_it_costs_poses(outcome):
    name = "the board is 4X4_100 where 5X5_100 was stated"
    odd = tuple((f"vision/network/1-2-{i}.png", name) for i in (1, 2))
    lost = Lack("camera 2", "No chain of views links camera 2.")
    for lacks, severity in (((), "warning"), ((lost,), "error")):
        found = vision_findings(replace(outcome, oddities=odd, lacks=lacks))
        told = [one for one in found if name in one.text]
        assert [one.severity for one in told] == [severity]
        assert told == found[:1]


def show_a_marker_twice(path) -> int:
    """Copy one of the markers into a corner of its image; its id."""
    image = cv2.imread(str(path), 0)
    view = detect_markers(image, MARKER_FAMILY).views[0]
    low = np.floor(view.corners.min(0)).astype(int) - 12
    high = np.ceil(view.corners.max(0)).astype(int) + 12
    part = image[max(low[1], 0) : high[1], max(low[0], 0) : high[0]]
    image[10 : 10 + part.shape[0], 10 : 10 + part.shape[1]] = part
    cv2.imwrite(str(path), image)
    return view.number


def test_a_campaign_without_images_has_no_vision(tmp_path):
    (tmp_path / "campaign.toml").write_text('name = "empty"\n')
    assert not SYSTEM.has_data(load_campaign(tmp_path))
