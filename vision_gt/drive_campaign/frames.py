"""Frames of a drive: one folder of images a camera, named by time, or a video with its times."""

import filecmp
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array
from validation.text_files.csv_tables import Column, read_csv
from validation.trajectories.formats.stamps import exact_times, unit_of
from vision_gt.images.files import LeftOut, drive_cameras, list_images
from vision_gt.images.pictures import VIDEOS

NAME = "expected a name that is the time of the frame, such as 1700000000.100.png"


@dataclass(frozen=True)
class CameraFrames:
    """The n frames of one camera.

    Parameters
    ----------
    camera : str
        Its name.
    times : (n,) array
        Seconds since ``epoch``, increasing.
    epoch : int
        Whole seconds.
    paths : tuple of Path
        One image a frame, in the order of time; empty for a video.
    video : Path, optional
        All frames, in the order of time.
    repeated : int
        Images left out as copies of earlier ones, see `each_once`.
    """

    camera: str
    times: Array
    epoch: int
    paths: tuple[Path, ...] = ()
    video: Path | None = None
    repeated: int = 0

    def __len__(self) -> int:
        return len(self.times)


def drive_frames(
    folder: Path, unit: str | None = None, left_out: LeftOut = frozenset()
) -> list[CameraFrames]:
    """The frames of all cameras of a drive.

    Parameters
    ----------
    folder : Path
        Holds CAMERA/TIME.png and so on; or CAMERA.mp4 beside CAMERA.csv, whose column 'time' has a
        row for each frame.
    unit : {"s", "ms", "us", "ns"}, optional
        Of the times, where they do not tell it.
    left_out : set of Path
        Images that a person decided not to use.

    Raises
    ------
    InputError
        Naming every image whose name is no time, times that repeat or go back, and a video without
        its times.
    """
    found: list[CameraFrames] = []
    problems: list[Problem] = []
    for camera in drive_cameras(folder, left_out):
        videos = [folder / f"{camera}{ending}" for ending in sorted(VIDEOS)]
        videos = [one for one in videos if one.is_file()]
        try:
            if videos:
                found.append(_of_video(camera, videos[0], unit))
            else:
                found.append(_of_images(camera, folder / camera, unit, left_out))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    return found


def each_once(frames: CameraFrames) -> CameraFrames:
    """The frames without copies, byte for byte, of the one of the same size before.

    A sensor never gives the same noise twice: a copy is the same exposure, written again by a
    driver whose next frame was late. It counts once, at the first of its times.
    """
    last: dict[int, Path] = {}
    kept = []
    for row, path in enumerate(frames.paths):
        size = path.stat().st_size
        before = last.setdefault(size, path)
        if before is path or not filecmp.cmp(before, path, shallow=False):
            kept.append(row)
            last[size] = path
    if len(kept) == len(frames.paths):
        return frames
    paths = tuple(frames.paths[row] for row in kept)
    repeated = len(frames.paths) - len(kept)
    return replace(frames, times=frames.times[kept], paths=paths, repeated=repeated)


def _of_images(camera: str, folder: Path, unit: str | None, left_out: LeftOut) -> CameraFrames:
    """Frames in files, sorted by the times that their names are."""
    paths = list_images(folder, left_out)
    wrong = [Problem(path, NAME) for path in paths if not _is_number(path.stem)]
    if wrong:
        raise InputError(wrong)
    epoch, times = _times(folder, [path.stem for path in paths], unit)
    order = np.argsort(times, kind="stable")
    again = [order[i + 1] for i in np.flatnonzero(np.diff(times[order]) == 0)]
    if again:
        raise InputError([Problem(paths[i], "another image has the same time") for i in again])
    return CameraFrames(camera, times[order], epoch, tuple(paths[i] for i in order))


def _of_video(camera: str, video: Path, unit: str | None) -> CameraFrames:
    """Frames of a video, whose times are in a table of their own."""
    path = video.with_suffix(".csv")
    if not path.is_file():
        said = f"the times of the frames of {video.name}: a column 'time' with a row for each frame"
        raise InputError([Problem(path, f"missing; write here {said}")])
    table = read_csv(path, [Column("time", unit="s")])
    table.raise_problems()
    if not len(table):
        raise InputError([Problem(path, "no times")])
    epoch, times = _times(path, table.raw["time"], unit)
    for row in np.flatnonzero(np.diff(times) <= 0):
        line = table.lines[row + 1]
        raise InputError([Problem(path, "not later than the frame before", line, "time")])
    return CameraFrames(camera, times, epoch, (), video)


def _times(path: Path, stamps: list[str], unit: str | None) -> tuple[int, Array]:
    """Exact times, in the unit that is stated or that they tell."""
    try:
        return exact_times(stamps, unit or unit_of(np.array(stamps, dtype=float)))
    except GtvalError as error:
        said = str(error).replace("--unit s, ms, us or ns", '[vision.drive] unit = "s" or the like')
        if _are_numbers_in_a_row(stamps):
            said = (
                f"{stamps[0]}, {stamps[1]} and so on look like numbers of frames, not like times; "
                "name each frame by its time, or give a video and a table of times"
            )
        raise InputError([Problem(path, said)]) from None


def _are_numbers_in_a_row(stamps: list[str]) -> bool:
    """Whether stamps count frames: whole, and mostly each one more than the one before."""
    if len(stamps) < 3 or not all(one.isdigit() for one in stamps):
        return False
    return bool(np.median(np.diff(np.array(stamps, dtype=float))) == 1)


def _is_number(text: str) -> bool:
    return text.replace(".", "", 1).isdigit()
