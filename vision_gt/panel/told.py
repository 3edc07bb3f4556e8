"""Images as the scripts and templates of the page take them: plain values."""

from collections.abc import Mapping
from typing import Any

from validation.campaign.folder import Campaign
from validation.page.panels import Waiting
from validation.page.undoing import TAKEN_BACK
from vision_gt.images.decisions import ImageDecision
from vision_gt.panel.shelf import Shelf, Shown
from vision_gt.panel.stored import drive_verdicts

MOST_ROWS = 2_000
"""Images that the list holds. A judgement: a screen holds twenty."""
MOST_FRAMES = 5_000
"""Of a camera on the time line. A judgement: eight minutes at 10 Hz, and five a pixel."""
Words = Mapping[str, str]


def title_of(one: Shown, words: Words) -> str:
    """What an image is called: 'stop 7, camera 2'."""
    title = words[f"title_{one.purpose}"]
    return title.replace("{name}", one.name).replace("{camera}", one.camera)


def list_told(shelf: Shelf, words: Words) -> dict[str, Any]:
    """The list of all images but frames of a drive, those that need a person first."""
    rows = [
        {
            "image": one.image,
            "title": title_of(one, words),
            "purpose": one.purpose,
            "camera": one.camera,
            "state": one.state,
            "said": one.said,
        }
        for one in shelf.images.values()
    ]
    counts: dict[str, int] = {}
    for one in shelf.images.values():
        for group in (one.purpose, f"state_{one.state}"):
            counts[group] = counts.get(group, 0) + 1
    more = max(len(rows) - MOST_ROWS, 0)
    told = {"rows": rows[:MOST_ROWS], "more": more, "counts": counts, "frames": len(shelf.frames)}
    return {**told, "waiting": len(shelf.needing_corner), "unnameable": shelf.unnameable}


def decision_told(shelf: Shelf, image: str, words: Words) -> dict[str, Any]:
    """What was decided about an image."""
    one, counts = shelf.shown(image), shelf.decided
    left, corner = counts.left_out.get(image), counts.corners.get(image)
    return {
        "image": image,
        "title": title_of(one, words),
        "purpose": one.purpose,
        "camera": one.camera,
        "state": one.state,
        "said": one.said,
        "left_out": None if left is None else {"by": left.by, "note": _note(left)},
        "corner": None
        if corner is None
        else {"by": corner.by, "note": _note(corner), "places": corner.places.tolist()},
    }


def _note(one: ImageDecision) -> str:
    """Why it was decided; that something else was taken back is no reason."""
    return "" if one.note == TAKEN_BACK else one.note


def times_told(shelf: Shelf, campaign: Campaign) -> dict[str, Any]:
    """The frames of a drive by camera: seconds since the first, files, and what became of them.

    Of a camera with very many frames some, evenly spread.
    """
    verdicts = drive_verdicts(campaign)
    cameras: dict[str, list[tuple[float, str, str]]] = {}
    for one in shelf.frames.values():
        try:
            time = float(one.name)
        except ValueError:
            continue
        verdict = verdicts.get((one.camera, round(time, 6)), "")
        verdict = "left out" if one.state == "left_out" else verdict
        cameras.setdefault(one.camera, []).append((time, one.image, verdict))
    cameras = {
        name: sorted(frames)[:: -(-len(frames) // MOST_FRAMES)] for name, frames in cameras.items()
    }
    first = min((time for frames in cameras.values() for time, _, _ in frames), default=0.0)
    return {
        "cameras": [
            {
                "camera": camera,
                "times": [round(time - first, 6) for time, _, _ in frames],
                "images": [image for _, image, _ in frames],
                "verdicts": [verdict for _, _, verdict in frames],
            }
            for camera, frames in sorted(cameras.items())
        ]
    }


def waiting_told(shelf: Shelf, words: Words) -> list[Waiting]:
    """Whether the corner of the reference pattern is to be clicked; nothing where there is none."""
    count = len(shelf.needing_corner)
    if count:
        return [Waiting(words["waiting"].replace("{count}", str(count)), count=count)]
    if any(image in shelf.images for image in shelf.decided.corners):
        return [Waiting(words["none_waits"], done=True)]
    return []
