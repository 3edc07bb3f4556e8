"""Detections kept from one run to the next, by what the image holds and how it is looked at."""

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import astuple, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from vision_gt.images.files import MAX_BYTES
from vision_gt.images.jobs import BoardJob, Found, Job, detect_each
from vision_gt.images.markers import Detection, MarkerView
from vision_gt.patterns.board_views import BoardView
from vision_gt.patterns.rejections import Rejection, rejected

FOLDER = "kept"
"""Below the campaign; may be deleted at any time."""
_BEGIN = b'{"key":"'
_DIGITS = 64
"""Of a key in base 16."""
_READING = 0.05
"""Of the work, that it takes to read files and to see whether they are known: a millisecond beside
twenty and more."""
_LOOKING = 3
"""Goes up where the code finds other things in the same image: 2 since tone curves are fitted, 3
since covariances count what a fit leaves side by side."""


class KeptDetections:
    """What earlier runs found in images, and what this one adds.

    Each image is one line, written as soon as it was looked at: a run that is killed goes on where
    it was. Only where the lines are is in memory. Where nothing can be written all is looked at
    again by the next run.

    Parameters
    ----------
    path : Path
        The file.
    whole : bool
        Whether what was rejected is kept, too. The poses of a drive need no more than the markers.
    """

    def __init__(self, path: Path, *, whole: bool = True) -> None:
        self.path, self.whole = path, whole
        self._place: dict[str, int] = {}
        self._unwritten: dict[str, bytes] = {}
        self._cut = False
        with suppress(OSError), path.open("rb") as stream:
            start = 0
            for line in stream:
                if line.startswith(_BEGIN) and line.endswith(b"}\n"):
                    key = line[len(_BEGIN) : len(_BEGIN) + _DIGITS].decode("ascii", "replace")
                    self._place[key] = start
                start += len(line)
                self._cut = not line.endswith(b"\n")

    def __len__(self) -> int:
        return len(self._place) + len(self._unwritten)

    def get(self, key: str, job: Job) -> Found | None:
        """What a job found in an image; None where that is not known, or cannot be read."""
        try:
            told = json.loads(self._line(key))
            if told["key"] != key:
                return None
            return _from_json(told, job)
        except (OSError, ValueError, KeyError, TypeError, IndexError):
            return None

    def _line(self, key: str) -> bytes:
        if key in self._unwritten:
            return self._unwritten[key]
        with self.path.open("rb") as stream:
            stream.seek(self._place[key])
            return stream.readline()

    def add(self, key: str, found: Found, job: Job) -> None:
        """Keep what was found."""
        told = _as_json(key, found, job, whole=self.whole)
        line = json.dumps(told, separators=(",", ":")).encode() + b"\n"
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with self.path.open("ab") as stream:
                if self._cut:
                    stream.write(b"\n")
                    self._cut = False
                start = stream.tell()
                stream.write(line)
        except OSError:
            self._unwritten[key] = line
            return
        self._place[key] = start


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
    keys = []
    for number, job in enumerate(jobs):
        keys.append(key_of(content_of(job.path), settings_key(job)))
        progress(_READING * number / len(jobs))
    found: list[Found | None] = [kept.get(key, job) for key, job in zip(keys, jobs, strict=True)]
    new = [i for i, one in enumerate(found) if one is None]

    def looked(share: float) -> None:
        progress(_READING + (1 - _READING) * share)

    for at, one in detect_each([jobs[i] for i in new], workers, looked):
        found[new[at]] = one
        kept.add(keys[new[at]], one, jobs[new[at]])
    return [one for one in found if one is not None]


def settings_key(job: Job) -> str:
    """All that a detection depends on but for the image, this program's version included."""
    if isinstance(job, BoardJob):
        boards = [(part, astuple(board)) for part, board in job.boards]
        told = (job.perhaps,) if job.perhaps else ()
        return repr((_program(), _LOOKING, "boards", boards, job.detector, *told))
    camera = job.camera
    lens = None if camera is None else (camera.size, np.asarray(camera.parameters).tolist())
    family = (job.family.name, job.family.border)
    return repr((_program(), _LOOKING, family, sorted(job.wanted), lens, job.fitted))


@cache
def _program() -> str:
    """The version of this program, which takes a millisecond to find out."""
    return version("gtval")


def key_of(content: bytes, settings: str, frame: int = 0) -> str:
    """SHA-256 of an image, or of a frame of a video, and of how it is looked at."""
    digest = hashlib.sha256(settings.encode())
    digest.update(frame.to_bytes(8, "big"))
    digest.update(content)
    return digest.hexdigest()


def content_of(path: Path) -> bytes:
    """The bytes of a file; none where it cannot be read, which detection then says."""
    try:
        with path.open("rb") as stream:
            return stream.read(MAX_BYTES)
    except OSError:
        return b""


def _as_json(key: str, found: Found, job: Job, *, whole: bool) -> dict[str, Any]:
    """A line of the file."""
    line: dict[str, Any] = {"key": key, "size": list(found.size)}
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
