"""Frames of a drive in files: times by names, videos, what is kept, what is refused."""

import json
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest
from vision_scenes import APRIL, camera, marker_image, random_marker

from validation.errors import InputError
from vision_gt.drive_campaign.detecting import frames_seen
from vision_gt.drive_campaign.frames import drive_frames, each_once
from vision_gt.drive_campaign.solve import other_count
from vision_gt.images import kept as images_kept
from vision_gt.images.files import drive_cameras
from vision_gt.images.jobs import MarkerJob
from vision_gt.images.kept import KeptDetections, detect_new

JOB = MarkerJob(None, APRIL, (5,), camera(), fitted=False)


def images(folder, names, seed=0):
    """Photographs of marker 5 under some names."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        rng = np.random.default_rng(seed)
        image, _ = marker_image(rng, random_marker(rng, 2.0), 5)
        cv2.imwrite(str(folder / name), image)
        seed += 1


def test_names_are_times_to_the_microsecond(tmp_path):
    names = ["1700000000.100000.png", "1700000000.000001.png", "1700000001.png"]
    (tmp_path / "2").mkdir()
    for name in names:
        (tmp_path / "2" / name).touch()
    (frames,) = drive_frames(tmp_path)
    assert frames.camera == "2"
    assert frames.epoch == 1_700_000_000
    np.testing.assert_allclose(frames.times, [1e-6, 0.1, 1.0], atol=1e-9)
    assert [path.name for path in frames.paths] == [names[1], names[0], names[2]]


def test_nanoseconds_are_told_by_their_size(tmp_path):
    (tmp_path / "1").mkdir()
    for k in range(3):
        (tmp_path / "1" / f"{1_700_000_000_000_000_000 + k * 100_000_000}.png").touch()
    (frames,) = drive_frames(tmp_path)
    np.testing.assert_allclose(frames.times, [0.0, 0.1, 0.2], atol=1e-9)


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["pose1.png"], "the time of the frame"),
        (["1700000000.1.png", "1700000000.10.png"], "another image has the same time"),
        (["000000.png", "000001.png", "000002.png"], "look like numbers of frames"),
    ],
)
def test_names_that_are_no_times_are_refused(tmp_path, names, said):
    (tmp_path / "1").mkdir()
    for name in names:
        (tmp_path / "1" / name).touch()
    with pytest.raises(InputError, match=said):
        drive_frames(tmp_path)


def video(path, times, seed=0):
    """A video of marker 5 and the times of its frames."""
    made = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10, (1280, 960))
    for k in range(len(times)):
        rng = np.random.default_rng(seed + k)
        image, _ = marker_image(rng, random_marker(rng, 2.0), 5)
        made.write(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    made.release()
    path.with_suffix(".csv").write_text("time\n" + "".join(f"{t}\n" for t in times))


def test_a_video_has_its_times_in_a_table(tmp_path):
    video(tmp_path / "4.avi", [1700000000.0, 1700000000.1, 1700000000.2])
    assert drive_cameras(tmp_path) == ["4"]
    (frames,) = drive_frames(tmp_path)
    kept = KeptDetections(tmp_path / "kept.jsonl")
    found = frames_seen(frames, JOB, kept)
    assert [one.markers.numbers for one in found] == [(5,)] * 3
    again = frames_seen(frames, JOB, KeptDetections(tmp_path / "kept.jsonl"))
    for one, other in zip(found, again, strict=True):
        np.testing.assert_array_equal(one.markers.views[0].corners, other.markers.views[0].corners)


def test_a_frame_that_was_written_twice_counts_once_at_its_first_time(tmp_path):
    first, again, other = (f"170000000{k}.0.png" for k in range(3))
    images(tmp_path / "1", [first])
    shutil.copy(tmp_path / "1" / first, tmp_path / "1" / again)
    images(tmp_path / "1", [other], seed=3)
    # An image of the same size on disk, with other bytes, is another frame.
    changed = bytearray((tmp_path / "1" / first).read_bytes())
    changed[-1] ^= 1
    (tmp_path / "1" / "1700000003.0.png").write_bytes(changed)
    (frames,) = drive_frames(tmp_path)
    once = each_once(frames)
    assert len(frames) == 4
    assert [path.name for path in once.paths] == [first, other, "1700000003.0.png"]
    np.testing.assert_array_equal(once.times, [0.0, 2.0, 3.0])
    assert once.repeated == 1
    assert each_once(once) is once


def test_a_video_with_other_frames_than_times_is_told_with_both_numbers(tmp_path):
    video(tmp_path / "4.avi", [1700000000.0, 1700000000.1, 1700000000.2])
    (tmp_path / "4.csv").write_text("time\n1700000000.0\n1700000000.1\n")
    (frames,) = drive_frames(tmp_path)
    told = other_count(frames)
    assert told.file.name == "4.csv"
    assert told.expected.startswith("2 times, but 4.avi has 3 frames")


def test_a_video_without_times_is_refused(tmp_path):
    video(tmp_path / "4.avi", [0.0])
    (tmp_path / "4.csv").unlink()
    with pytest.raises(InputError, match="column 'time' with a row for each frame"):
        drive_frames(tmp_path)


def test_times_that_go_back_are_refused_by_line(tmp_path):
    video(tmp_path / "4.avi", [1700000000.0, 1700000000.2, 1700000000.1])
    with pytest.raises(InputError) as caught:
        drive_frames(tmp_path)
    assert caught.value.problems[0].line == 4


def test_a_run_that_was_stopped_goes_on_where_it_was(tmp_path, monkeypatch):
    names = [f"170000000{k}.0.png" for k in range(4)]
    images(tmp_path / "1", names)
    (frames,) = drive_frames(tmp_path)
    looked = []
    own = images_kept.detect_one

    def stopping(job):
        if len(looked) == 2:
            raise KeyboardInterrupt
        looked.append(job.path.name)
        return own(job)

    path = tmp_path / "kept.jsonl"
    monkeypatch.setattr(images_kept, "detect_one", stopping)
    with pytest.raises(KeyboardInterrupt):
        frames_seen(frames, JOB, KeptDetections(path), workers=1)
    assert len(path.read_text().splitlines()) == 2
    path.write_text(path.read_text() + '{"key": "cut sho')  # killed while it wrote
    looked.clear()
    monkeypatch.setattr(
        images_kept, "detect_one", lambda job: (looked.append(job.path.name), own(job))[1]
    )
    found = frames_seen(frames, JOB, KeptDetections(path), workers=1)
    assert looked == names[2:]
    assert [one.markers.numbers for one in found] == [(5,)] * 4
    looked.clear()
    frames_seen(frames, JOB, KeptDetections(path), workers=1)
    assert not looked
    for line in path.read_text().splitlines():
        if not line.startswith('{"key": "cut'):
            json.loads(line)


def test_other_settings_or_another_image_are_looked_at_anew(tmp_path):
    images(tmp_path / "1", ["1700000000.0.png", "1700000001.0.png"])
    (frames,) = drive_frames(tmp_path)
    path = tmp_path / "kept.jsonl"
    frames_seen(frames, JOB, KeptDetections(path))
    kept = KeptDetections(path)
    first = frames.paths[0]
    detect_new([replace(JOB, path=first)], kept)
    assert len(kept) == 2
    detect_new([replace(JOB, path=first, wanted=(5, 6))], kept)
    assert len(kept) == 3
    images(tmp_path / "2", ["1700000000.0.png"], seed=9)
    (tmp_path / "2" / "1700000000.0.png").replace(tmp_path / "1" / "1700000000.0.png")
    frames_seen(frames, JOB, KeptDetections(path))
    assert len(KeptDetections(path)) == 4
