"""Detections outlive a run: one that is killed loses the image that it looks at, no more."""

import subprocess
import sys
import time
from dataclasses import replace

import cv2
import numpy as np
import pytest
from vision_scenes import APRIL, close_up, random_marker

from vision_gt.images.jobs import BoardJob, MarkerJob, detect_one
from vision_gt.images.kept import KeptDetections, detect_new
from vision_gt.patterns.boards import Board
from vision_gt.patterns.dictionaries import Family

JOB = MarkerJob(None, APRIL, (5,))
RUN = """
import sys
from pathlib import Path
from vision_gt.images import kept
from vision_gt.images.jobs import MarkerJob
from vision_gt.images.kept import KeptDetections, detect_new
from vision_gt.patterns.dictionaries import Family

own = kept.detect_one

def said(job):
    print(job.path.name, flush=True)
    return own(job)

kept.detect_one = said
folder = Path(sys.argv[1])
found = [MarkerJob(path, Family("APRILTAG_36H11"), (5,)) for path in sorted(folder.glob("*.png"))]
detect_new(found, KeptDetections(folder / "kept.jsonl"), 1)
"""


@pytest.fixture(scope="module")
def photographs(tmp_path_factory):
    """Files with a marker each."""
    folder = tmp_path_factory.mktemp("photographs")
    rng = np.random.default_rng(11)
    for k in range(8):
        _, image, _ = close_up(rng, random_marker(rng, 3.0), 5)
        cv2.imwrite(str(folder / f"{k}.png"), image)
    return sorted(folder.glob("*.png"))


def same(one, other):
    """Whether two results are the same to the last bit."""
    assert (one.path, one.size, one.note, one.fault) == (
        other.path,
        other.size,
        other.note,
        other.fault,
    )
    for a, b in zip(one.markers.views, other.markers.views, strict=True):
        np.testing.assert_array_equal(a.corners, b.corners)
        np.testing.assert_array_equal(a.covariances, b.covariances)
    for a, b in zip(one.boards, other.boards, strict=True):
        np.testing.assert_array_equal(a.ids, b.ids)
        np.testing.assert_array_equal(a.pixels, b.pixels)
        np.testing.assert_array_equal(a.sigmas, b.sigmas)
        assert (a.camera, a.body, a.part, a.board) == (b.camera, b.body, b.part, b.board)
    for a, b in zip(one.rejected, other.rejected, strict=True):
        assert (a.kind, a.reason, a.number) == (b.kind, b.reason, b.number)
        np.testing.assert_array_equal(a.outline, b.outline)


def test_a_run_killed_at_any_moment_goes_on_where_it_was(photographs, tmp_path, monkeypatch):
    for path in photographs:
        (tmp_path / path.name).write_bytes(path.read_bytes())
    paths = sorted(tmp_path.glob("*.png"))
    killed = subprocess.Popen(
        [sys.executable, "-c", RUN, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    rng = np.random.default_rng()
    begun = [killed.stdout.readline() for _ in range(int(rng.integers(1, 5)))]
    time.sleep(rng.uniform(0, 0.02))
    killed.kill()
    begun += killed.communicate()[0].splitlines()
    kept = KeptDetections(tmp_path / "kept.jsonl")
    assert len(kept) >= len(begun) - 1
    looked = []

    def own(job):
        looked.append(job.path)
        return detect_one(job)

    monkeypatch.setattr("vision_gt.images.kept.detect_one", own)
    before = len(kept)
    found = detect_new([replace(JOB, path=path) for path in paths], kept, 1)
    assert looked == paths[before:]
    for path, one in zip(paths, found, strict=True):
        same(one, detect_one(replace(JOB, path=path)))


def test_boards_and_what_was_rejected_are_kept_to_the_last_bit(tmp_path):
    board = Board(8, 6, 0.05, Family("4X4_100"))
    cells, _ = board.cells()
    shown = np.kron(np.pad(cells, 4, constant_values=1), np.ones((8, 8))) * 160 + 40
    image = cv2.GaussianBlur(shown.astype(np.uint8), (0, 0), 0.8)
    image[150:200, 130:180] = 128
    cv2.imwrite(str(tmp_path / "board.png"), image)
    job = BoardJob(tmp_path / "board.png", "1", "calibration", [(0, board)])
    (first,) = detect_new([job], KeptDetections(tmp_path / "kept.jsonl"))
    (again,) = detect_new([job], KeptDetections(tmp_path / "kept.jsonl"))
    assert first.boards
    same(first, again)
    same(detect_one(job), again)


def test_a_line_that_was_spoilt_is_looked_at_again(photographs, tmp_path):
    path = tmp_path / "kept.jsonl"
    own = [replace(JOB, path=one) for one in photographs[:2]]
    found = detect_new(own, KeptDetections(path))
    text = path.read_text().splitlines()
    path.write_text(text[0].replace("[[", "[x", 1) + "\n" + text[1] + "\n")
    for one, other in zip(found, detect_new(own, KeptDetections(path)), strict=True):
        same(one, other)
    assert len(path.read_text().splitlines()) == 3


def test_where_nothing_can_be_written_the_run_remembers(photographs, tmp_path, monkeypatch):
    (tmp_path / "kept").write_text("a file where a folder should be")
    kept = KeptDetections(tmp_path / "kept" / "images.jsonl")
    own = [replace(JOB, path=photographs[0], camera=None)]
    (found,) = detect_new(own, kept)
    monkeypatch.setattr(
        "vision_gt.images.kept.detect_one", lambda job: pytest.fail(f"{job.path} again")
    )
    same(found, detect_new(own, kept)[0])
