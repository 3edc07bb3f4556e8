"""What the cameras saw, drawn: outlines are where things are, and nothing left out is missing."""

import csv
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.report.svg import inline_svg
from validation.text_files.writing import write_files
from vision_gt.campaign.result_files import rejected_csv, vision_files
from vision_gt.commands.looking import Looking
from vision_gt.images.files import campaign_images, read_image
from vision_gt.looks.collected import known_of, looks_of
from vision_gt.looks.drawing import picture
from vision_gt.looks.look import Look, Outline
from vision_gt.looks.robot import StopView, single_look, stop_looks, stop_views
from vision_gt.looks.told import looks_section, name_of, picture_bytes, wanted
from vision_gt.patterns.rejections import rejected
from vision_gt.stages.inputs import VisionInputs

MEGABYTE = 1e6


def inputs_of(folder, outcome):
    images = campaign_images(folder / "vision")
    return VisionInputs(load_campaign(folder), outcome.settings, images)


@pytest.fixture
def looks(rendered, outcome):
    return list(looks_of(outcome, inputs_of(rendered, outcome)))


def test_markers_are_where_they_are_expected(looks):
    """Corners are good to a tenth of a pixel, and the pose of a stop fits all of them."""
    used = [one for one in looks if one.verdict.startswith("used: x")]
    assert len(used) >= 5
    offs = [outline.off for look in used for outline in look.outlines if len(outline.found)]
    assert np.nanmedian(offs) < 0.2
    assert np.nanmax(offs) < 1.5


def test_every_stop_and_every_board_that_was_left_out_has_a_look(looks, outcome):
    stops = {tuple(one.title.split(", camera ")) for one in looks if one.title.startswith("stop")}
    assert stops == {(f"stop {stop}", camera) for camera, stop in outcome.detections}
    left = {image for image, one in outcome.rejections if one.kind in {"board", "image"}}
    assert left <= {one.image for one in looks}
    boards = [one for one in looks if not one.title.startswith("stop")]
    assert all(one.flagged for one in boards)


def test_an_image_of_another_stop_is_far_from_where_it_is_expected(rendered, outcome):
    """The same images under each other's names: what is found is where the robot stood."""
    given, known = inputs_of(rendered, outcome), known_of(outcome)
    images = {key: given.shown(path) for key, path in given.stop_images().items()}
    one, other = sorted(key for key in outcome.detections if outcome.detections[key].views)[:2]
    swapped = {one: outcome.detections[other]}
    views = stop_views(outcome.stops)
    (look,) = stop_looks(swapped, images, {one: replace(views[one], used=True)}, known, {})
    far = [outline.off for outline in look.outlines if len(outline.found)]
    assert min(far) > 20


@pytest.mark.parametrize(
    ("changes", "said", "flagged"),
    [
        ({"used": True}, "used: x", False),
        ({"used": True, "p_value": 1e-6}, "fit worse", True),
        ({"used": True, "floor_p": 1e-6}, "does not stand on the floor", True),
        ({}, "another camera knows the pose better", False),
        ({"apart_p": 1e-6, "apart": 0.5}, "500.0 mm apart, which does not fit", True),
        ({"ambiguous": True}, "ambiguous", False),
    ],
)
def test_what_became_of_a_stop_is_said(rendered, outcome, changes, said, flagged):
    given, known = inputs_of(rendered, outcome), known_of(outcome)
    images = {key: given.shown(path) for key, path in given.stop_images().items()}
    key = next(key for key in outcome.detections if outcome.detections[key].views)
    T = stop_views(outcome.stops)[key].T_gtv_robot
    fine = {"p_value": 0.5, "ambiguous": False, "floor_p": 0.5, "used": False}
    own = StopView(T, **{**fine, "apart": 0.001, "apart_p": 0.5, **changes})
    views = {key: own, ("another", key[1]): replace(own, used=True)}
    (look,) = stop_looks({key: outcome.detections[key]}, images, views, known, {})
    assert said in look.verdict
    assert look.flagged == flagged


def test_each_thing_not_used_is_a_row_with_its_place_and_reason():
    quad = np.array([[10.0, 10], [30, 10], [30, 30], [10, 30]])
    listed = [
        ("vision/poses/1/pose2.png", rejected("marker", "no code", None, quad)),
        ("vision/network/1-2-3.png", rejected("board", "left out", 2, quad)),
        ("vision/poses/1/pose3.png", rejected("image", "blank")),
    ]
    rows = list(csv.DictReader(rejected_csv(listed).splitlines()))
    assert [(row["what"], row["number"], row["x"]) for row in rows] == [
        ("marker", "", "20.0"),
        ("board", "2", "20.0"),
        ("image", "", ""),
    ]


def test_a_picture_shows_the_part_that_holds_what_was_found_larger():
    """A marker of 20 pixels is drawn at several times its size, inside of the picture."""
    image = np.full((960, 1280), 90, dtype=np.uint8)
    quad = np.array([[1250.0, 900], [1270, 900], [1270, 920], [1250, 920]])
    look = Look("vision/poses/1/pose1.png", "stop 1, camera 1", "used", (Outline("6", quad, quad),))
    whole, part = picture(look, image).axes
    wide = np.ptp(part.get_xlim())
    assert wide < 1280 / 4
    assert max(part.get_xlim()) <= 1280
    assert np.ptp(whole.get_xlim()) == 1280


def test_what_is_expected_nowhere_is_not_drawn():
    image = np.full((480, 640), 90, dtype=np.uint8)
    quad = np.array([[100.0, 100], [140, 100], [140, 140], [100, 140]])
    nowhere = np.full((4, 2), np.nan)
    outlines = (Outline("6", quad, nowhere), Outline("7", nowhere[:0], nowhere, axes=nowhere))
    look = Look("vision/poses/1/pose1.png", "stop 1, camera 1", "used", outlines)
    assert len(picture(look, image).axes) == 2  # what was found is there, enlarged


def test_thumbnails_of_many_images_stay_small(looks, rendered):
    many = [replace(one, flagged=True) for one in looks] * 12
    section = looks_section(many, rendered)
    figures = [block for block in section.blocks if hasattr(block, "draw")]
    assert len(wanted(many)) == 24
    assert len(figures) == 4
    assert 4 * len(inline_svg(figures[0], "one")) < MEGABYTE


def test_results_give_the_same_looks_as_the_run(campaign, outcome, looks):
    write_files(campaign / "results", vision_files(outcome))
    looking = Looking(load_campaign(campaign), 1)
    again = looking.looks((), (), (), everything=False)
    assert {(one.image, one.verdict) for one in again} == {
        (one.image, one.verdict) for one in looks
    }
    offs = {(one.image, o.name): o.off for one in looks for o in one.outlines}
    for one in again:
        for outline in one.outlines:
            if one.title.startswith("stop"):
                before = offs[one.image, outline.name]
                assert outline.off == pytest.approx(before, abs=1e-3, nan_ok=True)
    frame = next((campaign / "vision" / "layout").rglob("*.png"))
    (walk,) = looking.looks((), (), [frame], everything=False)
    # The walk's own pose fits its markers: each was one of those that made the layout.
    assert max(outline.off for outline in walk.outlines if len(outline.found)) < 1.5


def test_without_results_what_was_found_is_drawn(campaign):
    done = CliRunner().invoke(
        main, ["vision", "look", str(campaign), "--stop", "1", "--workers", "1"]
    )
    assert done.exit_code == 0, done.output
    assert "only what was found is drawn" in done.output
    (drawn,) = {path.suffix for path in (campaign / "results" / "vision").iterdir()}
    assert drawn == ".jpg"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--stop", "none"], "there is no image of stop none"),
        (["--camera", "9"], "there is no image of camera 9"),
        (["--image", "other.png"], "no such image in the campaign"),
    ],
)
def test_what_there_is_not_is_said(rendered, options, said):
    done = CliRunner().invoke(main, ["vision", "look", str(rendered), *options])
    assert done.exit_code == 2
    assert said in " ".join(done.output.split())


def test_a_look_is_a_file_that_can_be_read(looks, rendered, tmp_path):
    one = looks[0]
    path = tmp_path / name_of(one)
    path.write_bytes(picture_bytes((one, rendered)))
    assert read_image(path).shape[1] == 1000
    assert cv2.imread(str(path)) is not None


def test_a_frame_by_itself_needs_no_network(outcome):
    known = replace(known_of(outcome), network=None)
    key = next(key for key in outcome.detections if len(outcome.detections[key].views) > 1)
    look = single_look("vision/drive/1/2.png", key[0], outcome.detections[key], known)
    assert max(o.off for o in look.outlines if len(o.found)) < 1.5
    assert Path(name_of(look)).name == "drive_1_2.jpg"


def test_an_image_of_a_check_shows_its_board_where_its_pose_has_it(campaign, outcome):
    write_files(campaign / "results", vision_files(outcome))
    path = campaign / "vision/displacement/1/first.png"
    [look] = Looking(load_campaign(campaign), 1).looks((), (), [path], everything=False)
    assert look.outlines[0].off < 0.5
    cv2.imwrite(str(path), np.random.default_rng(1).integers(90, 110, (960, 1280)).astype(np.uint8))
    [look] = Looking(load_campaign(campaign), 1).looks((), (), [path], everything=False)
    assert look.flagged
    assert not look.outlines
