"""What the last run said of images, read from its tables alone: no image is looked at."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from validation.campaign.folder import Campaign
from validation.errors import GtvalError
from validation.text_files.csv_tables import Column, read_csv

RESULTS = (
    "vision_camera_poses.csv",
    "vision_detections.csv",
    "vision_rejected.csv",
    "vision_steadiness.csv",
    "vision_drive_frames.csv",
)


@dataclass(frozen=True)
class Stored:
    """What a run left.

    Parameters
    ----------
    reasons : mapping of str to list of str
        Why an image, or a board in it, was not used, by its file.
    fates : mapping of (str, str, str) to (str, str)
        State and words, by purpose, camera and name.
    at : float
        When it ran; 0 where it did not.
    """

    reasons: Mapping[str, list[str]]
    fates: Mapping[tuple[str, str, str], tuple[str, str]]
    at: float = 0.0


def stored(campaign: Campaign) -> Stored:
    """What the last run left; nothing of what it did not."""
    results = campaign.results
    reasons: dict[str, list[str]] = {}
    for image, what, reason in _rows(results / "vision_rejected.csv", "image", "what", "reason"):
        if what in {"image", "board"} and reason not in reasons.setdefault(image, []):
            reasons[image].append(reason)
    fates: dict[tuple[str, str, str], tuple[str, str]] = {}
    for camera, pose, count in _rows(results / "vision_detections.csv", *_SEEN):
        fates["poses", camera, pose] = _NONE if count == "0" else ("look", f"{count} markers read")
    for camera, pose, used, ambiguous in _rows(results / "vision_camera_poses.csv", *_POSED):
        other = _AMBIGUOUS if ambiguous == "yes" else _BETTER
        fates["poses", camera, pose] = _USED if used == "yes" else other
    for camera, verdict in _rows(results / "vision_steadiness.csv", "camera", "verdict"):
        for moment in ("before", "after"):
            fates[moment, camera, ""] = "look" if verdict == "moved" else "used", verdict
    at = 0.0
    with suppress(OSError):
        at = (results / "vision_rejected.csv").stat().st_mtime
    return Stored(reasons, fates, at)


_SEEN = ("camera", "pose", "markers")
_POSED = ("camera", "pose", "used", "ambiguous")
_NONE = "not_used", "no marker was read"
_USED = "used", "gives the pose"
_BETTER = "not_used", "another camera knows the pose better"
_AMBIGUOUS = "not_used", "ambiguous: two poses fit alike"


def drive_verdicts(campaign: Campaign) -> dict[tuple[str, float], str]:
    """What became of the frames of a drive, by camera and time in seconds."""
    names = ("camera", "verdict", "time")
    rows = _rows(campaign.results / "vision_drive_frames.csv", *names)
    with suppress(ValueError):
        return {(camera, round(float(time), 6)): verdict for camera, verdict, time in rows}
    return {}


def _rows(path: Path, *names: str) -> list[tuple[str, ...]]:
    """Some columns of a table of the results; no rows where it cannot be read."""
    with suppress(GtvalError):
        table = read_csv(path, [Column(name) for name in names])
        table.raise_problems()
        return list(zip(*(table.text[name] for name in names), strict=True))
    return []
