"""Decisions about images: kept in order, read strictly, and obeyed by every step."""

import numpy as np
import pytest

from validation.errors import GtvalError, InputError
from vision_gt.images.decisions import (
    NO_PLACE,
    ImageDecision,
    append_image_decisions,
    decided,
    image_decisions,
)
from vision_gt.images.files import campaign_images, drive_cameras, images_of_poses

ONE = "vision/poses/1/pose1.png"


def made(kind="leave-out", image=ONE, places=NO_PLACE, by="ann", note=""):
    return ImageDecision(image, kind, np.asarray(places, dtype=float).reshape(-1, 2), by, note)


def test_the_last_decision_of_each_kind_counts(tmp_path):
    path = tmp_path / "decisions.csv"
    append_image_decisions(path, [made(note="=1+1"), made("corner", places=[[3.25, 4]])], "t1")
    append_image_decisions(path, [made("use"), made("corner", places=[[1, 2], [9, 2]])], "t2")
    append_image_decisions(path, [made(image="vision/poses/2/pose1.png")], "t3")
    history = image_decisions(path)
    assert [at for at, _ in history] == ["t1", "t1", "t2", "t2", "t3"]
    assert history[0][1].note == "=1+1"
    counts = decided(history)
    assert set(counts.left_out) == {"vision/poses/2/pose1.png"}
    assert counts.corners[ONE].places.tolist() == [[1, 2], [9, 2]]
    append_image_decisions(path, [made("no-corner")], "t4")
    assert decided(image_decisions(path)).corners == {}


@pytest.mark.parametrize(
    "bad",
    [
        made("keep"),
        made(image="/etc/passwd"),
        made(image="vision/../../x.png"),
        made(image="vision//x.png"),
        made("corner"),
        made("corner", places=[[np.nan, 1]]),
        made("corner", places=[[1e9, 1]]),
        made("corner", places=[[5, 5], [5, 5]]),
        made(places=[[1, 2]]),
    ],
)
def test_what_is_no_decision_is_not_written(tmp_path, bad):
    path = tmp_path / "decisions.csv"
    with pytest.raises(InputError):
        append_image_decisions(path, [made(), bad], "now")
    assert not path.exists()


def test_every_bad_place_of_the_file_is_named(tmp_path):
    path = tmp_path / "decisions.csv"
    path.write_text(
        "image,decision,x,y\nvision/a.png,keep,,\n../b.png,use,,\nvision/c.png,corner,1,\n"
    )
    with pytest.raises(InputError) as error:
        image_decisions(path)
    assert [one.line for one in error.value.problems] == [2, 3, 4]


def test_rows_are_added_in_the_order_of_the_columns_that_the_file_has(tmp_path):
    path = tmp_path / "decisions.csv"
    own = "image,decision,note,by,time,axis_y,axis_x,y,x"
    path.write_text(f"{own}\nvision/a.png,use,,,,,,,")  # and no end of line
    append_image_decisions(path, [made("corner", places=[[1, 2], [3, 4]], note="n")], "t")
    [(_, first), (at, last)] = image_decisions(path)
    assert (first.image, last.image, at, last.note) == ("vision/a.png", ONE, "t", "n")
    assert last.places.tolist() == [[1, 2], [3, 4]]
    path.write_text("image,decision\n")
    with pytest.raises(GtvalError, match="no column 'time'"):
        append_image_decisions(path, [made()], "t")
    assert path.read_text() == "image,decision\n"


def test_an_image_that_is_left_out_is_as_if_it_were_not_there(tmp_path):
    for name in ("poses/1/pose1.png", "poses/1/strange.png", "drive/1/1.png", "reference/1.png"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    with pytest.raises(InputError, match="strange"):
        campaign_images(tmp_path)
    left = {tmp_path / "poses/1/strange.png", tmp_path / "drive/1/1.png"}
    images = campaign_images(tmp_path, left)
    assert images.poses == {"1": {"1": tmp_path / "poses/1/pose1.png"}}
    assert images_of_poses(tmp_path / "poses", left) == images.poses
    assert drive_cameras(tmp_path / "drive", left) == []
    assert drive_cameras(tmp_path / "drive") == ["1"]
