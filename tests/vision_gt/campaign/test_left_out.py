"""What a person decided about images is obeyed by every step, by page and by command alike."""

import csv

import numpy as np
import pytest
from click.testing import CliRunner

from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.page.desk import Desk
from validation.page.runner import Runner
from vision_gt.campaign.checks import campaign_checks
from vision_gt.drive_campaign.frames import drive_frames
from vision_gt.images.decisions import NO_PLACE, ImageDecision
from vision_gt.panel.shelf import Shelves
from vision_gt.settings import VisionSettings
from vision_gt.stages.decided import left_out_findings
from vision_gt.stages.inputs import load_inputs
from vision_gt.system import SYSTEM


@pytest.fixture
def left(outcome):
    """Images of a stop, of a calibration, and half a pair of a moved board."""
    camera, stop = next(iter(outcome.detections))
    return (
        f"vision/poses/{camera}/pose{stop}.png",
        "vision/calibration/2/01.png",
        "vision/displacement/1/first.png",
    )


def decide(folder, *said):
    return CliRunner().invoke(main, ["vision", "decide", str(folder), *said, "--by", "ann"])


def rows(folder):
    """The decisions but for their times."""
    with (folder / "vision/decisions.csv").open() as stream:
        return [{**row, "time": ""} for row in csv.DictReader(stream)]


def test_no_step_uses_an_image_that_is_left_out_and_the_report_says_so(campaign, outcome, left):
    for image in left:
        assert decide(campaign, image, "leave-out", "--note", "blurred").exit_code == 0
    loaded = load_campaign(campaign)
    given = load_inputs(loaded)
    used = {given.shown(path) for _, _, path, _ in given.board_images()}
    used |= {given.shown(path) for path in given.stop_images().values()}
    assert used
    assert used.isdisjoint(left)
    [said] = left_out_findings(loaded, given.settings)
    assert (said.severity, said.sizes[0].value) == ("note", 3)
    assert all(f"{image} (by ann: blurred)" in said.text for image in left)
    assert not [what for image, what in given.oddities if image in left]
    assert campaign / "vision/decisions.csv" in SYSTEM.inputs(loaded)
    settings = loaded.section("vision", VisionSettings)
    checks = campaign_checks(loaded, settings, outcome.network.network, None, 1)
    assert [one.camera for one in checks.displacement] == ["2"]
    for image in left:
        assert decide(campaign, image, "use").exit_code == 0
    again = load_inputs(loaded)
    assert set(again.stop_images()) == set(outcome.detections)


def test_page_and_command_write_the_same(campaign, left):
    image = campaign / left[0]
    assert decide(campaign, str(image), "leave-out", "--note", "dark").exit_code == 0
    [reference] = (campaign / "vision/reference").iterdir()
    name = f"vision/reference/{reference.name}"
    assert decide(campaign, name, "corner", "10.5", "20", "90", "21").exit_code == 0
    by_command = rows(campaign)
    (campaign / "vision/decisions.csv").unlink()
    shelves = Shelves(Desk(campaign, Runner(campaign)))
    shelves.decide([ImageDecision(left[0], "leave-out", NO_PLACE, "ann", "dark")])
    corner = np.array([[10.5, 20], [90, 21]])
    shelves.decide([ImageDecision(name, "corner", corner, "ann")])
    assert rows(campaign) == by_command


@pytest.mark.parametrize(
    "said",
    [
        ("vision/poses/1/pose99.png", "leave-out"),
        ("campaign.toml", "leave-out"),
        ("../campaign/vision/nothing.png", "use"),
        ("vision/calibration/2/01.png", "corner"),
        ("vision/calibration/2/01.png", "corner", "1"),
        ("vision/calibration/2/01.png", "use", "1", "2"),
    ],
)
def test_a_command_that_says_no_decision_writes_nothing(campaign, said):
    answer = decide(campaign, *said)
    assert answer.exit_code == 2, answer.output
    assert not (campaign / "vision/decisions.csv").exists()


def test_a_decision_about_an_image_that_went_away_is_told(campaign, left):
    image = campaign / left[0]
    assert decide(campaign, str(image), "leave-out").exit_code == 0
    image.unlink()
    said = dict(load_inputs(load_campaign(campaign)).oddities)
    assert "no such image" in said[left[0]]


def test_frames_that_are_left_out_are_not_filmed(tmp_path):
    for name in ("1/1700000000.1.png", "1/1700000000.2.png", "2/nonsense.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    left = {tmp_path / "1/1700000000.1.png", tmp_path / "2/nonsense.png"}
    [frames] = drive_frames(tmp_path, None, left)
    assert [path.name for path in frames.paths] == ["1700000000.2.png"]
