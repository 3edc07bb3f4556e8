"""Detections kept from one run to the next, by what the image holds and how it is looked at."""

import hashlib
import json
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from vision_gt.images.jobs import Found, MarkerJob
from vision_gt.images.markers import Detection, MarkerView

FOLDER = "kept"
"""Below the campaign; may be deleted at any time."""


class KeptDetections:
    """What earlier runs found in the frames of a camera, and what this one adds.

    Each frame is one line, written as soon as it was looked at: a run that is killed goes on where
    it was.

    Parameters
    ----------
    path : Path
        The file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.found = dict(_lines(path))
        self._cut = path.is_file() and not path.read_bytes().endswith(b"\n")

    def add(self, key: str, found: Found) -> None:
        """Keep what was found."""
        self.found[key] = found
        self.path.parent.mkdir(parents=True, exist_ok=True)
        line = json.dumps(_as_json(key, found), separators=(",", ":"))
        with self.path.open("a", encoding="utf-8") as stream:
            stream.write(f"\n{line}\n" if self._cut else f"{line}\n")
        self._cut = False


def settings_key(job: MarkerJob) -> str:
    """All that a detection depends on but for the image, this program's version included."""
    camera = job.camera
    lens = None if camera is None else (camera.size, np.asarray(camera.parameters).tolist())
    family = (job.family.name, job.family.border)
    return repr((version("gtval"), family, sorted(job.wanted), lens, job.fitted))


def key_of(content: bytes, settings: str, frame: int = 0) -> str:
    """SHA-256 of an image, or of a frame of a video, and of how it is looked at."""
    digest = hashlib.sha256(settings.encode())
    digest.update(frame.to_bytes(8, "big"))
    digest.update(content)
    return digest.hexdigest()


def _as_json(key: str, found: Found) -> dict[str, Any]:
    """A line of the file: no more than the poses of a drive need."""
    views = [
        [view.number, view.corners.tolist(), view.covariances.tolist()]
        for view in found.markers.views
    ]
    line: dict[str, Any] = {"key": key, "size": list(found.size), "views": views}
    line["fault"], line["note"] = found.fault, found.note
    line["odd"] = [list(found.markers.duplicates), list(found.markers.strangers)]
    return line


def _lines(path: Path) -> Iterator[tuple[str, Found]]:
    """What the lines of a file say; those that are cut short or of another form are left out."""
    if not path.is_file():
        return
    with path.open(encoding="utf-8", errors="replace") as stream:
        for line in stream:
            try:
                told = json.loads(line)
                views = tuple(
                    MarkerView(number, np.array(corners, float), np.array(covariances, float))
                    for number, corners, covariances in told["views"]
                )
                twice, strangers = (tuple(one) for one in told["odd"])
                width, height = told["size"]
                markers = Detection(views, twice, strangers)
                fault, note = str(told["fault"]), str(told["note"])
                found = Found(path, (width, height), markers=markers, fault=fault, note=note)
                yield str(told["key"]), found
            except (ValueError, KeyError, TypeError):
                continue
