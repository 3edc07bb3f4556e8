"""Detections kept from one run to the next, by what the image holds and how it is looked at."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any

import numpy as np

from validation.pieces.processors import processors
from validation.pieces.store import FOLDER, KeptPieces, code_of, key_of
from validation.pieces.work import done_once
from vision_gt.images.files import MAX_BYTES
from vision_gt.images.jobs import BROKEN, WORTH_A_POOL, BoardJob, Found, Job, detect_one, one_thread
from vision_gt.images.markers import Detection, MarkerView
from vision_gt.patterns.board_views import BoardView
from vision_gt.patterns.rejections import Rejection, rejected

CODE = ("vision_gt.images", "vision_gt.prints", "vision_gt.patterns", "vision_gt.optics")
"""What finds things in images."""


class KeptDetections(KeptPieces):
    """What earlier runs found in images, and what this one adds; how it is written and read.

    Parameters
    ----------
    path : Path
        The file.
    whole : bool
        Whether what was rejected is kept, too. The poses of a drive need no more than the markers.
    """

    def __init__(self, path: Path, *, whole: bool = True) -> None:
        super().__init__(path, "images")
        self.whole = whole

    def written(self, result: Found, job: Job) -> dict[str, Any] | None:
        """What an image shows, as a line of the file has it; not what may have failed by chance."""
        if result.note.startswith(BROKEN):
            return None
        return _as_json(result, job, whole=self.whole)

    def read(self, told: dict[str, Any], job: Job) -> Found:
        """What a line says of the image of a job."""
        return _from_json(told, job)


def kept_images(folder: Path) -> KeptDetections:
    """Those of the images of a campaign folder that are not of a drive."""
    return KeptDetections(folder / FOLDER / "vision_images.jsonl")


def detect_new(
    jobs: Sequence[Job],
    kept: KeptDetections,
    workers: int | None = None,
    progress: Callable[[float], None] = lambda _share: None,
) -> list[Found]:
    """What images show, in the order of the jobs; what is kept is not looked at again.

    Parameters
    ----------
    jobs : sequence of BoardJob or MarkerJob
        One an image.
    kept : KeptDetections
        What earlier runs found; what is new is added as it is found.
    workers, progress
        As for `detect_all`.
    """
    known = processors(workers) if len(jobs) >= WORTH_A_POOL else 1
    return done_once(detect_one, jobs, _key, kept, kept, known, progress, one_thread)


def _key(job: Job) -> str:
    return image_key(content_of(job.path), settings_key(job))


def settings_key(job: Job) -> str:
    """All that a detection depends on but for the image and the code."""
    if isinstance(job, BoardJob):
        boards = [(part, astuple(board)) for part, board in job.boards]
        told = (job.perhaps,) if job.perhaps else ()
        return repr(("boards", boards, job.detector, *told))
    camera = job.camera
    lens = None if camera is None else (camera.size, np.asarray(camera.parameters).tolist())
    family = (job.family.name, job.family.border)
    return repr((family, sorted(job.wanted), lens, job.fitted))


def image_key(content: bytes, settings: str, frame: int = 0) -> str:
    """Of an image, or of a frame of a video, and of how it is looked at."""
    return key_of(code_of(*CODE), settings.encode(), frame.to_bytes(8, "big"), content)


def content_of(path: Path) -> bytes:
    """The bytes of a file; none where it cannot be read, which detection then says."""
    try:
        with path.open("rb") as stream:
            return stream.read(MAX_BYTES)
    except OSError:
        return b""


def _as_json(found: Found, job: Job, *, whole: bool) -> dict[str, Any]:
    """What an image shows as values that JSON has."""
    line: dict[str, Any] = {"size": list(found.size)}
    line["views"] = [
        [view.number, view.corners.tolist(), view.covariances.tolist()]
        for view in found.markers.views
    ]
    line["fault"], line["note"] = found.fault, found.note
    line["odd"] = [list(found.markers.duplicates), list(found.markers.strangers)]
    if isinstance(job, BoardJob):
        line["boards"] = [
            [view.part, view.ids.tolist(), view.pixels.tolist(), _listed(view.sigmas)]
            for view in found.boards
        ]
    if whole:
        line["remarks"] = list(found.remarks)
        line["rejected"] = [
            [one.kind, one.reason, one.number, one.outline.tolist()] for one in found.rejected
        ]
    return line


def _listed(values: Any) -> Any:
    return None if values is None else np.asarray(values).tolist()


def _from_json(told: dict[str, Any], job: Job) -> Found:
    """What a line says of the image of a job."""
    views = tuple(
        MarkerView(number, np.array(corners, float), np.array(covariances, float))
        for number, corners, covariances in told["views"]
    )
    twice, strangers = (tuple(one) for one in told["odd"])
    width, height = told["size"]
    left = tuple(_rejections(told.get("rejected", ())))
    markers = Detection(views, twice, strangers, left)
    found = Found(
        job.path,
        (width, height),
        fault=str(told["fault"]),
        note=str(told["note"]),
        rejected=left,
        remarks=tuple(told.get("remarks", ())),
    )
    if not isinstance(job, BoardJob):
        return replace(found, markers=markers)
    parts = dict(job.boards)
    boards = tuple(
        BoardView(
            job.camera,
            job.body,
            part,
            parts[part],
            np.array(ids, dtype=np.intp),
            np.array(pixels, float),
            job.path.name,
            None if sigmas is None else np.array(sigmas, float),
        )
        for part, ids, pixels, sigmas in told["boards"]
    )
    return replace(found, boards=boards)


def _rejections(told: Sequence[Any]) -> Iterator[Rejection]:
    for kind, reason, number, outline in told:
        yield rejected(kind, reason, number, np.array(outline, float).reshape(-1, 2))
