"""Images of a campaign as pictures, with or without the results of a run."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError, Problem
from validation.pieces.processes import in_processes
from validation.pieces.processors import processors
from validation.results import Table, TableColumn
from validation.systems import Progress, no_progress
from validation.text_files.csv_tables import Column, read_csv
from validation.text_files.writing import write_files
from vision_gt.campaign.result_files import PLACED
from vision_gt.commands.checks import read_network
from vision_gt.images.files import campaign_images
from vision_gt.images.jobs import BoardJob, Found, Job
from vision_gt.images.kept import detect_new
from vision_gt.looks.boards import OF_BAR, board_looks
from vision_gt.looks.collected import title_of
from vision_gt.looks.look import Known, Look, by_image
from vision_gt.looks.robot import StopView, single_look, stop_looks
from vision_gt.looks.told import FOLDER, name_of, picture_bytes
from vision_gt.optics.camera_files import read_cameras
from vision_gt.patterns.board_views import BoardView
from vision_gt.patterns.dictionaries import Family
from vision_gt.patterns.rejections import Rejection, hull, rejected
from vision_gt.robot.marker_poses import Layout
from vision_gt.robot.robot_pose import Floor
from vision_gt.settings import VisionSettings
from vision_gt.stages.inputs import DRIVE, OF_CHECKS, VisionInputs, made_board, placed

_FEW = 8
"""Pictures below which one process draws them all: others take a second each to start."""
OfBoards = tuple[str, str, Path, str]
"""What an image of boards was taken for, camera, file, moment."""


class Looking:
    """The images of a campaign, and what an earlier run made of them.

    Parameters
    ----------
    campaign : Campaign
        The folder.
    workers : int, optional
        Processes; by default one for each processor.
    progress : callable
        Told what is being done.
    """

    def __init__(
        self, campaign: Campaign, workers: int | None = None, progress: Progress = no_progress
    ) -> None:
        settings = campaign.section("vision", VisionSettings)
        images = campaign_images(campaign.folder / settings.images)
        self.campaign, self.workers, self.progress = campaign, workers, progress
        self.given = VisionInputs(campaign, settings, images)
        self.known = known_before(campaign, settings)
        self.left = _left_before(campaign)
        self.views = _views_before(campaign)

    def looks(
        self,
        stops: Sequence[str],
        cameras: Sequence[str],
        images: Sequence[Path],
        *,
        everything: bool,
    ) -> list[Look]:
        """Those that are wanted: by stops and cameras, or by their files.

        Raises
        ------
        GtvalError
            If there is no such stop, camera or image.
        """
        boards = list(self.given.board_images())
        if images:
            files = [self._relative(path) for path in images]
            looks = [*self._stops((), files), *self._boards(boards, files), *self._others(files)]
            wanted = set(files)
        else:
            self._check(stops, cameras)
            files = [] if stops else [self.given.shown(path) for _, _, path, _ in boards]
            if not everything:
                files = [file for file in files if file in self.left]
            looks = [*self._stops(stops), *self._boards(boards, files)]
            if everything and not stops:
                looks += self._others([self.given.shown(path) for path in self._walk()])
            wanted = {one.image for one in looks}
        of = tuple(f"camera {name}" for name in cameras)
        return [one for one in looks if one.image in wanted and (not of or one.title.endswith(of))]

    def _relative(self, path: Path) -> str:
        """An image by its name relative to the campaign."""
        folder = self.campaign.folder.resolve()
        for one in (path, folder / path):
            if one.is_file() and one.resolve().is_relative_to(folder):
                return str(one.resolve().relative_to(folder))
        raise InputError([Problem(path, "there is no such image in the campaign")])

    def _check(self, stops: Sequence[str], cameras: Sequence[str]) -> None:
        """Raise for names that there are not."""
        known = dict.fromkeys(stop for _, stop in self.given.stop_images())
        for wanted, have, what in (
            (stops, list(known), "stop"),
            (cameras, list(self.given.wanted), "camera"),
        ):
            if strange := [one for one in wanted if one not in have]:
                names = ", ".join(have) or "none"
                raise GtvalError(f"there is no image of {what} {strange[0]}; there are: {names}")

    def _walk(self) -> list[Path]:
        return [path for images in self.given.images.movie.values() for path in images]

    def _found(self, jobs: Sequence[Job], what: str) -> dict[str, Found]:
        """What images show, by their names; files that cannot be read say why."""
        report = f"looking for {what}s"
        kept, tell = self.given.kept, lambda share: self.progress(report, share)
        found = detect_new(jobs, kept, self.workers, tell)
        for one in found:
            if one.fault:
                fault = (self.given.shown(one.path), rejected("image", one.fault))
                self.given.rejections.append(fault)
            else:
                self.given.note(one, f"the {what}")
        return {self.given.shown(one.path): one for one in found}

    def _stops(self, stops: Sequence[str], only: Sequence[str] | None = None) -> Iterator[Look]:
        """Images of the robot, of all stops and files where none is named."""
        images = {
            key: path
            for key, path in self.given.stop_images().items()
            if (not stops or key[1] in stops) and (only is None or self.given.shown(path) in only)
        }
        if not images:
            return
        jobs = [
            self.given.marker_job(path, self.known.cameras.get(camera))
            for (camera, _), path in images.items()
        ]
        found = self._found(jobs, "marker")
        files = {key: self.given.shown(path) for key, path in images.items()}
        seen = {key: found[file].markers for key, file in files.items()}
        yield from stop_looks(seen, files, self.views, self.known, self._said())

    def _said(self) -> dict[str, list[Rejection]]:
        return {file: list(some) for file, some in by_image(self.given.rejections).items()}

    def _boards(self, boards: Sequence[OfBoards], files: Sequence[str]) -> Iterator[Look]:
        """Images of boards; of the bar's also the others of the same moment are looked at."""
        chosen = [one for one in boards if self.given.shown(one[2]) in files]
        moments = {(purpose, moment) for purpose, _, _, moment in chosen if purpose in OF_BAR}
        taken = [one for one in boards if one in chosen or (one[0], one[3]) in moments]
        found = self._found([self.given.board_job(*one) for one in taken], "board")
        said = self._said()
        for purpose in dict.fromkeys(one[0] for one in chosen):
            views: dict[str, list[BoardView]] = {
                self.given.shown(path): list(found[self.given.shown(path)].boards)
                for kind, _, path, _ in taken
                if kind == purpose
            }
            titles = {
                self.given.shown(path): title_of(kind, camera, moment)
                for kind, camera, path, moment in chosen
                if kind == purpose
            }
            for file in titles:
                said.setdefault(file, []).extend(self._left_out(file, views[file]))
                if not views[file] and not said[file]:
                    said[file].append(rejected("image", "the board was not found"))
            yield from board_looks(purpose, views, titles, self.known, said)

    def _left_out(self, file: str, views: Sequence[BoardView]) -> Iterator[Rejection]:
        """Boards of an image that the run did not use."""
        reasons = dict.fromkeys(self.left.get(file, ()))
        for reason in reasons:
            for view in views:
                yield rejected("board", reason, view.part + 1, hull(view.pixels))

    def _others(self, files: Sequence[str]) -> Iterator[Look]:
        """Images of the walk around the robot and of checks, and frames of a drive."""
        below = Path(self.given.settings.images)
        for file in files:
            parts = Path(file).relative_to(below).parts if Path(file).is_relative_to(below) else ()
            if len(parts) != 3 or parts[0] not in {"layout", DRIVE, *OF_CHECKS}:
                continue
            camera = parts[1]
            path = self.campaign.folder / file
            if parts[0] in OF_CHECKS:
                yield from self._of_check(parts[0], camera, path)
                continue
            job = self.given.marker_job(path, self.known.cameras.get(camera))
            found = self._found([job], "marker")[file]
            whole = [one for one in self._said().get(file, ()) if one.kind == "image"]
            yield single_look(file, camera, found.markers, self.known, whole)

    def _of_check(self, purpose: str, camera: str, path: Path) -> Iterator[Look]:
        """An image of a check: the board in it, which no pose depends on."""
        settings, file = self.given.settings, self.given.shown(path)
        boards = {"table": settings.table.board, "survey_check": settings.survey_check.board}
        board = boards.get(purpose, settings.board)
        if board is None:
            return
        parts = [(0, made_board(board))]
        job = BoardJob(path, camera, path.stem, parts, settings.detector)
        views = list(self._found([job], "board")[file].boards)
        said = self._said()
        if not views and file not in said:
            said[file] = [rejected("image", "the board was not found")]
        titles = {file: title_of(purpose, camera, path.stem)}
        yield from board_looks(purpose, {file: views}, titles, self.known, said)


def known_before(campaign: Campaign, settings: VisionSettings) -> Known:
    """Cameras and markers as an earlier run left them; nothing of what there is no result of."""
    markers, floor = settings.markers, settings.floor
    cells = Family(markers.family, markers.border).cells if markers.family else 0
    built = settings.bar.second_on_first
    second = RigidTransform.identity() if built is None else placed(built)
    bar = RigidTransform.concatenate([RigidTransform.identity(), second])
    network, layout = None, None
    with suppress(GtvalError):
        network = read_network(campaign.results)
    with suppress(GtvalError):
        layout = read_layout(campaign.results / "vision_layout.csv")
    cameras = {}
    for path in sorted(campaign.results.glob("vision_camera_*.yaml")):
        with suppress(GtvalError):
            name = path.stem.removeprefix("vision_camera_")
            cameras[name] = read_cameras(path)[0]
    return Known(cameras, network, layout, Floor(floor.height, floor.tilt), cells, bar)


def read_layout(path: Path) -> Layout:
    """Markers on the robot from vision_layout.csv, with their own standard deviations.

    Raises
    ------
    InputError
        If the file is missing or bad.
    """
    names = ("side", *PLACED, *(f"sigma_{name}" for name in PLACED))
    table = read_csv(path, [Column("marker"), *(Column(name, "number") for name in names)])
    table.raise_problems()
    values = np.column_stack([table.numbers[name] for name in names])
    T = RigidTransform.from_components(values[:, 1:4], Rotation.from_rotvec(values[:, 4:7]))
    numbers = tuple(int(name) for name in table.text["marker"])
    return Layout(numbers, values[:, 0], T, np.diag(np.square(values[:, 7:]).ravel()))


def _views_before(campaign: Campaign) -> dict[tuple[str, str], StopView]:
    """Poses of the stops by all cameras, from vision_camera_poses.csv; none where there is none."""
    words = ("pose", "camera", "ambiguous", "used")
    needed = ("x", "y", "z", "theta", "pitch", "roll", "p_value", "floor_p_value")
    columns = [Column(name) for name in words] + [Column(name, "number") for name in needed]
    columns += [Column(name, "number", blank=True) for name in ("apart", "apart_p_value")]
    with suppress(GtvalError):
        table = read_csv(campaign.results / "vision_camera_poses.csv", columns)
        table.raise_problems()
        number = table.numbers
        turns = np.column_stack([number[name] for name in ("theta", "pitch", "roll")])
        T = RigidTransform.from_components(
            np.column_stack([number[name] for name in "xyz"]),
            Rotation.from_euler("ZYX", turns),
        )
        return {
            (camera, pose): StopView(
                T[row],
                float(number["p_value"][row]),
                table.text["ambiguous"][row] == "yes",
                float(number["floor_p_value"][row]),
                table.text["used"][row] == "yes",
                float(number["apart"][row]),
                float(number["apart_p_value"][row]),
            )
            for row, (pose, camera) in enumerate(
                zip(table.text["pose"], table.text["camera"], strict=True)
            )
        }
    return {}


def _left_before(campaign: Campaign) -> Mapping[str, Sequence[str]]:
    """Reasons for which a run did not use boards, or whole images, by image."""
    columns = [Column("image"), Column("what"), Column("reason")]
    left: dict[str, list[str]] = {}
    with suppress(GtvalError):
        table = read_csv(campaign.results / "vision_rejected.csv", columns)
        rows = zip(*(table.text[one.name] for one in columns), strict=True)
        for image, what, reason in rows:
            if what == "board":
                left.setdefault(image, []).append(reason)
            elif what == "image":
                left.setdefault(image, [])
    return left


@dataclass(frozen=True)
class Drawn:
    """Pictures that were written.

    Parameters
    ----------
    looks : tuple of Look
        What they show.
    folder : Path
        Where they are.
    remarks : tuple of str
        What a reader should know of all of them.
    """

    looks: tuple[Look, ...]
    folder: Path
    remarks: tuple[str, ...]

    @property
    def table(self) -> Table:
        """What became of the images, and their pictures."""
        columns: list[TableColumn] = [
            ("picture", "", [name_of(one) for one in self.looks]),
            ("shows", "", [one.title for one in self.looks]),
            ("what became of it", "", [one.became for one in self.looks]),
        ]
        return Table.of_columns("Pictures", columns)

    @property
    def facts(self) -> dict[str, object]:
        """For scripts."""
        return {
            "folder": str(self.folder),
            "remarks": list(self.remarks),
            "pictures": [
                {
                    "picture": name_of(one),
                    "image": one.image,
                    "shows": one.title,
                    "became": one.became,
                    "flagged": one.flagged,
                    "off": {o.name: None if np.isnan(o.off) else o.off for o in one.outlines},
                    "rejected": [
                        {"what": r.kind, "number": r.number, "reason": r.reason}
                        for r in one.rejections
                    ],
                }
                for one in self.looks
            ],
        }


def looks_drawn(
    campaign: Campaign,
    output: Path | None = None,
    workers: int | None = None,
    progress: Progress = no_progress,
    **choice: Any,
) -> Drawn:
    """Draw images of a campaign, and write them.

    Parameters
    ----------
    campaign : Campaign
        The folder.
    output : Path, optional
        Folder for the pictures; by default results/vision.
    workers : int, optional
        Processes; by default one for each processor.
    progress : callable
        Told what is being done.
    **choice
        As for `Looking.looks`.

    Raises
    ------
    GtvalError
        If there is nothing of what is wanted.
    """
    looking = Looking(campaign, workers, progress)
    looks = looking.looks(**choice)
    if not looks:
        raise GtvalError("there is no image to draw; `--all` draws boards that were used, too")
    folder = output or campaign.results / FOLDER
    drawn = [(one, campaign.folder) for one in looks]
    count = 1 if len(looks) < _FEW else processors(workers)
    parts = in_processes(picture_bytes, drawn, count, lambda share: progress("drawing", share))
    write_files(folder, dict(zip(map(name_of, looks), parts, strict=True)))
    remarks = []
    if looking.known.network is None or looking.known.layout is None:
        remarks.append("There are no results of a run: only what was found is drawn.")
    return Drawn(tuple(looks), folder, tuple(remarks))
