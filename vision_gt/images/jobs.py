"""Detection in many images at once, in as many processes as there are processors."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np

from validation.errors import InputError, Problem
from validation.pieces.processes import as_they_end
from validation.pieces.processors import processors
from vision_gt.images.boards import Detector, FoundBoard, look_for_boards
from vision_gt.images.files import Image, is_blank, read_picture
from vision_gt.images.markers import Detection, detect_markers
from vision_gt.optics.camera import Camera
from vision_gt.patterns.board_views import BoardView
from vision_gt.patterns.boards import Board
from vision_gt.patterns.dictionaries import Family
from vision_gt.patterns.rejections import Rejection

BROKEN = "could not be looked at: "
"""Begins the note on an image in which something went wrong that nobody expected."""
WORTH_A_POOL = 12
"""With fewer images starting processes takes longer than it saves: a judgement, as a process has to
import all modules first."""


@dataclass(frozen=True)
class BoardJob:
    """Look for boards in an image.

    Parameters
    ----------
    path : Path
        The image.
    camera, body : str
        As in `BoardView`.
    boards : sequence of (int, Board)
        What may be there, with its part of the bar.
    detector : {"fitted", "classic", "sector"}
        For plain chessboards.
    perhaps : str
        What other images show where these boards were stated.
    """

    path: Path
    camera: str
    body: str
    boards: Sequence[tuple[int, Board]]
    detector: Detector = "fitted"
    perhaps: str = ""


@dataclass(frozen=True)
class MarkerJob:
    """Look for markers in an image.

    Parameters
    ----------
    path : Path
        The image.
    family : Family
        Of the markers.
    wanted : tuple of int
        Ids that the campaign has.
    camera : Camera or None
        Whose distortion bends the edges.
    fitted : bool
        Whether corners are fitted to the grey levels.
    """

    path: Path
    family: Family
    wanted: tuple[int, ...]
    camera: Camera | None = None
    fitted: bool = True


@dataclass(frozen=True)
class Found:
    """What an image showed.

    Parameters
    ----------
    path : Path
        The image.
    size : (int, int)
        Width and height.
    boards : tuple of BoardView
        Boards found.
    markers : Detection
        Markers found.
    fault : str
        Why nothing could be looked for ('truncated', ...); '' if all is well.
    note : str
        What is odd about the image: 'blank', 'mirrored', what a board is that is not the stated
        one, or what went wrong as the image was looked at.
    rejected : tuple of Rejection
        What was seen and not used, or is rough, and why.
    remarks : tuple of str
        What was done to read the file: which bits, which turn, which alpha.
    """

    path: Path
    size: tuple[int, int] = (0, 0)
    boards: tuple[BoardView, ...] = ()
    markers: Detection = field(default_factory=lambda: Detection(()))
    fault: str = ""
    note: str = ""
    rejected: tuple[Rejection, ...] = ()
    remarks: tuple[str, ...] = ()


Job = BoardJob | MarkerJob
BOARD_IS = "the board is "
"""Begins the note of an image whose board is not as stated."""


def detect_all(
    jobs: Sequence[Job],
    workers: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> list[Found]:
    """What the images show, in the order of the jobs.

    Parameters
    ----------
    jobs : sequence of BoardJob or MarkerJob
        One an image.
    workers : int, optional
        Processes; by default one for each processor.
    progress : callable, optional
        Told the share done.
    """
    found = dict(detect_each(jobs, workers, progress))
    return [found[i] for i in range(len(jobs))]


def detect_each(
    jobs: Sequence[Job],
    workers: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> Iterator[tuple[int, Found]]:
    """What the images show, as they are looked at, each with the number of its job.

    Parameters
    ----------
    jobs, workers, progress
        As for `detect_all`.
    """
    workers = processors(workers)
    if len(jobs) < WORTH_A_POOL:
        workers = 1
    return as_they_end(detect_one, jobs, workers, progress, one_thread)


def one_thread() -> None:
    """One thread of OpenCV in each process."""
    cv2.setNumThreads(1)


def detect_one(job: Job) -> Found:
    """What the image of a file shows; a bad file is a fault, no exception."""
    try:
        picture = read_picture(job.path)
    except InputError as error:
        return Found(job.path, fault="; ".join(problem.expected for problem in error.problems))
    return replace(detect_in(picture.grey, job), remarks=picture.remarks)


def detect_in(image: Image, job: Job) -> Found:
    """What an image that has been read shows; whatever goes wrong is a note, no exception."""
    size = (image.shape[1], image.shape[0])
    try:
        return _looked_at(image, size, job)
    except Exception as error:  # noqa: BLE001  (no image may end a run)
        said = " ".join(str(error).split())[:200] or type(error).__name__
        return Found(job.path, size, note=f"{BROKEN}{said}")


def _looked_at(image: Image, size: tuple[int, int], job: Job) -> Found:
    """What an image shows."""
    if is_blank(image):
        return Found(job.path, size, note="blank")
    if isinstance(job, BoardJob):
        look = look_for_boards(image, [board for _, board in job.boards], job.detector, job.perhaps)
        seen = tuple(
            _view(job, part, board, one)
            for (part, board), one in zip(job.boards, look.found, strict=True)
            if one is not None
        )
        note = f"{BOARD_IS}{look.instead}" if look.instead else ""
        return Found(job.path, size, seen, note=note, rejected=look.rejected)
    return _markers(image, size, job)


def _view(job: BoardJob, part: int, board: Board, found: FoundBoard) -> BoardView:
    """A board as a view for the adjustments."""
    ids, pixels, sigmas = found.ids, found.pixels, found.sigmas
    return BoardView(job.camera, job.body, part, board, ids, pixels, job.path.name, sigmas)


def _markers(image: Image, size: tuple[int, int], job: MarkerJob) -> Found:
    if job.camera is not None and size != job.camera.size:
        expected = (
            f"the image has {size[0]} x {size[1]} pixels, camera {job.camera.name} was "
            f"calibrated with {job.camera.size[0]} x {job.camera.size[1]}"
        )
        return Found(job.path, size, fault=expected)
    detection = detect_markers(image, job.family, job.camera, job.wanted, fitted=job.fitted)
    note = ""
    if not detection.views and not detection.duplicates:
        flipped = detect_markers(
            np.ascontiguousarray(image[:, ::-1]), job.family, None, job.wanted, fitted=False
        )
        note = "mirrored" if flipped.views else ""
    return Found(job.path, size, markers=detection, note=note, rejected=detection.rejected)


def raise_faults(found: Sequence[Found]) -> None:
    """Raise an InputError that names every image that cannot be read."""
    faults = [Problem(one.path, one.fault) for one in found if one.fault]
    if faults:
        raise InputError(faults)


def check_sizes(sizes: Mapping[str, Mapping[tuple[int, int], Path]]) -> None:
    """Raise where one camera's images differ in size."""
    problems = []
    for camera, by_size in sizes.items():
        (usual, example), *others = by_size.items()
        problems += [
            Problem(
                path,
                f"{size[0]} x {size[1]} pixels, but {example.name} of camera {camera} has "
                f"{usual[0]} x {usual[1]}",
            )
            for size, path in others
        ]
    if problems:
        raise InputError(problems)
