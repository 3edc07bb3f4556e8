"""The images of a campaign as long as its page is served, and what was decided about them.

What is decided is appended to the campaign's file of decisions, as the command does it, and what
is shown follows from the files: nothing is known here that would be lost with the process.
"""

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

import numpy as np

from validation.campaign.folder import Campaign
from validation.errors import FinalError, GtvalError
from validation.page.desk import Desk, version_of
from validation.page.undoing import TAKEN_BACK, undoing
from validation.text_files.csv_tables import is_cell
from vision_gt.images.decisions import (
    NO_PLACE,
    OF_CORNER,
    Decided,
    ImageDecision,
    append_image_decisions,
    decided,
    faults_of,
    image_decisions,
)
from vision_gt.images.files import ENDINGS, counting
from vision_gt.panel.stored import RESULTS, Stored, stored
from vision_gt.settings import VisionSettings
from vision_gt.stages.decided import decisions_path

PURPOSES = ("reference", "poses", "calibration", "network", "bar", "layout")
CHECKS = ("before", "after", "table", "survey_check", "displacement")
OF_BOARDS = ("calibration", "network", "bar")
DRIVE, OTHER = "drive", "other"
NEEDS = ("corner", "look", "left_out", "not_used", "used", "unknown")
"""What may be said of an image, the most urgent first."""


@dataclass(frozen=True)
class Shown:
    """An image as the list has it.

    Parameters
    ----------
    image : str
        Its file, relative to the campaign folder.
    purpose, camera, name : str
        What it was taken for, by whom, and what tells it from the others.
    state : str
        One of `NEEDS`.
    said : str
        What became of it.
    """

    image: str
    purpose: str
    camera: str
    name: str
    state: str = "unknown"
    said: str = ""


@dataclass(frozen=True)
class Shelf:
    """All images, and what is known of them.

    Parameters
    ----------
    version : str
        Of the files.
    images : mapping of str to Shown
        By their files, those first that need a person.
    frames : mapping of str to Shown
        Frames of drives, by their files.
    history : list of (str, ImageDecision)
        All decisions with their times.
    unnameable : int
        Images whose names no table of decisions can hold: they are not listed.
    """

    version: str
    images: Mapping[str, Shown]
    frames: Mapping[str, Shown]
    history: list[tuple[str, ImageDecision]]
    unnameable: int = 0

    @property
    def decided(self) -> Decided:
        """What counts of it."""
        return decided(self.history)

    @property
    def needing_corner(self) -> list[str]:
        """Images of the reference pattern of which one corner is to be clicked; none if one is."""
        clicked = any(image in self.decided.corners for image in self.images)
        every = [one.image for one in self.images.values() if one.state == "corner"]
        return [] if clicked else every

    def shown(self, image: str) -> Shown:
        """An image by its file.

        Raises
        ------
        GtvalError
            If there is none.
        """
        found = self.images.get(image) or self.frames.get(image)
        if found is None:
            raise FinalError("there is no such image in the campaign")
        return found


class Shelves:
    """The shelf of one campaign, looked through anew whenever a file has changed."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._changing = threading.Lock()
        self._known: Shelf | None = None
        self._folders: list[Path] = []

    def version(self) -> str:
        """Changes with the folders of images, the decisions and the results of runs."""
        try:
            campaign = self._desk.campaign()
            settings = campaign.section("vision", VisionSettings)
        except GtvalError as error:
            return str(error)
        names = [campaign.results / name for name in RESULTS]
        files = [campaign.toml, decisions_path(campaign, settings), *names]
        folders = version_of([campaign.folder / settings.images, *self._folders])
        return f"{version_of(files)}/{hash(folders)}"

    def shelf(self) -> Shelf:
        """What there is now.

        Raises
        ------
        GtvalError
            If campaign.toml or the file of decisions is bad.
        """
        with self._changing:
            if self._known is None or self._known.version != self.version():
                campaign = self._desk.campaign()
                settings = campaign.section("vision", VisionSettings)
                root = campaign.folder / settings.images
                self._folders = sorted(path for path in root.rglob("*") if path.is_dir())
                version = self.version()
                history = image_decisions(decisions_path(campaign, settings))
                self._known = _filled(campaign, settings, version, history)
            return self._known

    def file_of(self, image: str) -> Path:
        """The file of an image that the campaign has.

        Raises
        ------
        GtvalError
            If there is none, or a link leads out of the campaign folder.
        """
        self.shelf().shown(image)
        path = self._desk.inside(image)
        if not path.is_file():
            raise FinalError("that image is gone")
        return path

    def decide(self, made: Sequence[ImageDecision]) -> int:
        """Record decisions; those that count already are not recorded twice. How many were.

        Raises
        ------
        GtvalError
            If the campaign has no such image, or the file cannot be written.
        """
        for one in made:
            self.file_of(one.image)
            for name, expected in faults_of(one):
                raise FinalError(f"{name}: {expected}")
        with self._changing:
            campaign = self._desk.campaign()
            path = decisions_path(campaign, campaign.section("vision", VisionSettings))
            last = {one.about: one for _, one in image_decisions(path)}
            new = [one for one in made if not _same(last.get(one.about), one)]
            if new:
                now = datetime.now().astimezone().isoformat(timespec="milliseconds")
                append_image_decisions(path, new, now)
        return len(new)

    def undo(self, by: str) -> list[ImageDecision]:
        """Take back what a person decided last, and has not taken back; what was recorded.

        Raises
        ------
        GtvalError
            If there is nothing of theirs.
        """

        def restored(before: ImageDecision | None, back: ImageDecision) -> ImageDecision:
            kind = "no-corner" if back.kind in OF_CORNER else "use"
            one = before or replace(back, kind=kind, places=NO_PLACE)
            return replace(one, by=by, note=TAKEN_BACK)

        restoring = undoing(self.shelf().history, by, lambda one: one.about, restored)
        if not restoring:
            raise FinalError("there is no decision of yours to take back")
        self.decide(restoring)
        return restoring


def _same(last: ImageDecision | None, one: ImageDecision) -> bool:
    """Whether a decision says what counts already, so that it came twice."""
    if last is None:
        return one.kind in {"use", "no-corner"}
    alike = (last.kind, last.by, last.note) == (one.kind, one.by, one.note)
    places = last.places.shape == one.places.shape
    return alike and places and bool(np.allclose(last.places, one.places, rtol=0, atol=0.006))


def _filled(
    campaign: Campaign,
    settings: VisionSettings,
    version: str,
    history: list[tuple[str, ImageDecision]],
) -> Shelf:
    """The shelf of a campaign."""
    root, known = campaign.folder / settings.images, stored(campaign)
    found, counts, unnameable = [], decided(history), 0
    for path in root.rglob("*"):
        if path.suffix.lower() in ENDINGS and path.is_file():
            name = path.relative_to(campaign.folder).as_posix()
            if is_cell(name):
                found.append(_placed(name, path.relative_to(root).parts, path.stem))
            else:
                unnameable += 1
    told = [_told(one, known, counts, campaign.folder) for one in found]
    frames = [one for one in told if one.purpose == DRIVE]
    images = _with_corners([one for one in told if one.purpose != DRIVE], settings, counts)
    order = {name: place for place, name in enumerate((*PURPOSES, *CHECKS, OTHER))}

    def need(one: Shown) -> tuple[int, int, object, object]:
        # The pattern comes first, clicked or not: what is decided moves nothing away.
        first = NEEDS.index("corner" if one.purpose == "reference" else one.state)
        rank = min(first, NEEDS.index("left_out"))
        return rank, order[one.purpose], counting(one.name), counting(one.camera)

    return Shelf(
        version,
        {one.image: one for one in sorted(images, key=need)},
        {one.image: one for one in sorted(frames, key=lambda one: counting(one.image))},
        history,
        unnameable,
    )


def _placed(image: str, parts: Sequence[str], stem: str) -> Shown:
    """What an image was taken for, by the folders that it lies in."""
    kind = parts[0] if len(parts) > 1 else OTHER
    if kind == "steadiness" and len(parts) == 3 and parts[1] in CHECKS:
        return Shown(image, parts[1], stem, "")
    if kind == "reference" and len(parts) == 2:
        return Shown(image, kind, stem, "")
    if kind in {"network", "bar"} and len(parts) == 2:
        return Shown(image, kind, stem.partition("-")[0], stem)
    if len(parts) == 3 and kind in {*PURPOSES, *CHECKS, DRIVE}:
        name = stem.removeprefix("pose") if kind in {"poses", "table"} else stem
        return Shown(image, kind, parts[1], name)
    return Shown(image, OTHER, "", "/".join(parts))


def _told(one: Shown, known: Stored, counts: Decided, folder: Path) -> Shown:
    """An image with what the last run, and a person, said of it."""
    if one.image in counts.left_out:
        return replace(one, state="left_out", said=counts.left_out[one.image].told)
    if one.image in known.reasons:
        return replace(one, state="look", said="; ".join(known.reasons[one.image]))
    if one.purpose in OF_BOARDS and _written(folder / one.image) < known.at:
        return replace(one, state="used")  # a run says of all others why not
    state, said = known.fates.get((one.purpose, one.camera, one.name), ("unknown", ""))
    return replace(one, state=state, said=said)


def _written(path: Path) -> float:
    """When a file was written; never, where it has just gone."""
    try:
        return path.stat().st_mtime
    except OSError:
        return float("inf")


def _with_corners(
    images: Sequence[Shown], settings: VisionSettings, counts: Decided
) -> list[Shown]:
    """The images, those of the reference pattern with whether a corner is to be clicked."""
    board = settings.reference.board
    twofold = board is not None and not board.family and (board.columns + board.rows) % 2 == 0
    stated = settings.reference.origin_near is not None
    told = []
    for one in images:
        corner = counts.corners.get(one.image)
        if one.purpose == "reference" and one.state != "left_out" and corner is not None:
            x, y = corner.places[0]
            said = f"first corner at {x:.0f}, {y:.0f} {corner.told}".rstrip()
            told.append(replace(one, state="used", said=said))
        elif one.purpose == "reference" and twofold and not stated and one.state != "left_out":
            told.append(replace(one, state="corner"))
        else:
            told.append(one)
    return told
