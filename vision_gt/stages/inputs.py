"""From the files of a campaign to data: what the lab states, and what the images show."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from validation.campaign.folder import Campaign
from validation.errors import InputError, Problem
from validation.poses.angles import Array
from validation.systems import Progress, no_progress
from vision_gt.images.decisions import Decided
from vision_gt.images.files import CampaignImages, drive_cameras, images_below
from vision_gt.images.jobs import (
    BoardJob,
    Found,
    Job,
    MarkerJob,
    check_sizes,
    raise_faults,
)
from vision_gt.images.kept import KeptDetections, detect_new, kept_images
from vision_gt.images.markers import Detection
from vision_gt.images.wrong_boards import boards_in
from vision_gt.network.adjustment import KnownBody
from vision_gt.optics.camera import Camera
from vision_gt.optics.camera_files import read_cameras
from vision_gt.patterns.board_views import BoardView
from vision_gt.patterns.boards import Board
from vision_gt.patterns.dictionaries import Family
from vision_gt.patterns.rejections import Rejection, rejected
from vision_gt.robot.layout import Frame
from vision_gt.settings import BoardSettings, Placement, VisionSettings, stated
from vision_gt.stages.decided import decided_about, images_in_use, strange_decisions
from vision_gt.stages.facts import missing_facts

DRIVE = "drive"
"""Folder of the frames of a robot that drives."""
OF_CHECKS = ("table", "survey_check", "displacement")
"""Folders of images that poses do not depend on."""


def made_board(settings: BoardSettings | None) -> Board:
    """The board that settings describe."""
    board = stated(settings)
    family = Family(board.family) if board.family else None
    return Board(
        board.columns,
        board.rows,
        board.square,
        family,
        board.first_id,
        board.marker or 0.0,
        board.inverted,
        board.legacy,
    )


def placed(settings: Placement | None) -> RigidTransform:
    """The transform that settings describe."""
    place = stated(settings)
    rotation = Rotation.from_matrix(np.array(place.rotation))
    return RigidTransform.from_components(np.array(place.translation), rotation)


def sides_of(settings: VisionSettings) -> dict[int, float]:
    """Sides of the markers by their ids, metres."""
    return {int(number): side for number, side in settings.markers.sides.items()}


def known_reference(settings: VisionSettings) -> KnownBody:
    """Where the reference pattern lies, face up, and how well that is known."""
    reference = settings.reference
    lying = Rotation.from_rotvec([0, 0, reference.heading]) * Rotation.from_rotvec([np.pi, 0, 0])
    place = [*stated(reference.position), reference.height]
    covariance = np.diag(np.square(reference.sigmas))
    return KnownBody(RigidTransform.from_components(place, lying), covariance)


@dataclass(frozen=True)
class VisionInputs:
    """What a campaign holds for the vision system.

    Parameters
    ----------
    campaign : Campaign
        The folder.
    settings : VisionSettings
        With what was chosen at the command line.
    images : CampaignImages
        By what they were taken for.
    progress : callable
        Told what is being done.
    workers : int, optional
        Processes; by default one for each processor.
    oddities : list of (str, str)
        Images and what is odd about them; grows while images are looked at.
    rejections : list of (str, Rejection)
        Images and what was seen in them and not used; grows while images are looked at.
    noted : set of (Path, str)
        Images of which all that is odd has been told, for boards or for markers.
    """

    campaign: Campaign
    settings: VisionSettings
    images: CampaignImages
    progress: Progress = no_progress
    workers: int | None = None
    oddities: list[tuple[str, str]] = field(default_factory=list)
    rejections: list[tuple[str, Rejection]] = field(default_factory=list)
    noted: set[tuple[Path, str]] = field(default_factory=set)

    @cached_property
    def kept(self) -> KeptDetections:
        """What is known of images from earlier, in this run or another."""
        return kept_images(self.campaign.folder)

    @cached_property
    def decided(self) -> Decided:
        """What people decided about images."""
        return decided_about(self.campaign, self.settings)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The cameras of the network: those named, or that see the robot, or that took anything."""
        images = self.images
        seeing = dict.fromkeys([*images.poses, *self._filmed])
        if not seeing:
            taken = [camera for one in images.network for camera in one.images]
            of_bar = [camera for camera, _ in images.bar]
            own = [name for name in images.calibration if name not in images.movie]
            seeing = dict.fromkeys([*own, *sorted({*taken, *of_bar}), *images.reference])
        return tuple(self.settings.cameras) or tuple(seeing)

    @property
    def _filmed(self) -> list[str]:
        folder = self.campaign.folder
        return drive_cameras(folder / self.settings.images / DRIVE, self.decided.paths(folder))

    @property
    def shows_robot(self) -> bool:
        """Whether there are images of the robot at its stops, or on the move."""
        return bool(self.images.poses or self._filmed)

    @property
    def wanted(self) -> tuple[str, ...]:
        """Those of the network, of the walk around the robot, and all others with a calibration."""
        return tuple(dict.fromkeys([*self.names, *self.images.movie, *self.images.calibration]))

    def board_views(self) -> tuple[dict[str, list[BoardView]], dict[str, tuple[int, int]]]:
        """Views of all boards by what the image was taken for, and each camera's image size.

        Raises
        ------
        InputError
            For every bad image, and for images of one camera that differ in size.
        """
        taken = list(self.board_images())
        found = boards_in(
            [self.board_job(*one) for one in taken],
            self.kept,
            self.workers,
            lambda share: self.progress("looking for boards", 0.45 * share),
        )
        raise_faults(found)
        views: dict[str, list[BoardView]] = {}
        sizes: dict[str, dict[tuple[int, int], Path]] = {}
        for (purpose, camera, _, _), one in zip(taken, found, strict=True):
            self.note(one, "the board")
            sizes.setdefault(camera, {}).setdefault(one.size, one.path)
            views.setdefault(purpose, []).extend(one.boards)
            if not one.boards and not one.note:
                self._odd(one.path, "the board was not found")
        check_sizes(sizes)
        return views, {camera: next(iter(by_size)) for camera, by_size in sizes.items()}

    def board_images(self) -> Iterator[tuple[str, str, Path, str]]:
        """Images of boards: what they were taken for, camera, file, and a name for the moment."""
        images = self.images
        for camera in self.wanted:
            for path in images.calibration.get(camera, ()):
                if camera not in self.settings.camera_files:
                    yield "calibration", camera, path, f"calibration/{camera}/{path.stem}"
        bars = [
            *(("network", c, path, s.name) for s in images.network for c, path in s.images.items()),
            *(("bar", camera, path, f"bar/{path.stem}") for camera, path in images.bar),
        ]
        yield from (image for image in bars if image[1] in self.names)
        for camera, path in images.reference.items():
            yield "reference", camera, path, "reference"
        for camera in self.watched:
            yield "before", camera, images.before[camera], "before"
            yield "after", camera, images.after[camera], "after"

    def image_of(self, purpose: str, view: BoardView) -> str:
        """The image of a view, by its name relative to the campaign."""
        below = {
            "calibration": Path("calibration", view.camera),
            "before": Path("steadiness", "before"),
            "after": Path("steadiness", "after"),
        }.get(purpose, Path(purpose))
        return str(Path(self.settings.images) / below / view.source)

    @property
    def corners(self) -> dict[str, Array]:
        """Where the reference pattern begins, by camera: what was clicked in its image."""
        found = {camera: self.shown(path) for camera, path in self.images.reference.items()}
        corners = self.decided.corners
        return {one: corners[file].places for one, file in found.items() if file in corners}

    @property
    def watched(self) -> tuple[str, ...]:
        """Cameras with an image of before and one of after."""
        images = self.images
        return tuple(n for n in self.names if n in images.before and n in images.after)

    def board_job(self, purpose: str, camera: str, path: Path, moment: str) -> BoardJob:
        """How to look for boards in an image, by what `board_images` tells of it."""
        boards = self._boards_in(purpose, camera, moment)
        return BoardJob(path, camera, moment, boards, self.settings.detector)

    def _boards_in(self, purpose: str, camera: str, moment: str) -> list[tuple[int, Board]]:
        """Which boards an image may show, with their parts of the bar."""
        settings = self.settings
        if purpose == "network" and settings.bar.second is None:
            return [(0, made_board(settings.bar.first or settings.board))]
        if purpose == "reference":
            return [(0, made_board(settings.reference.board))]
        if purpose not in {"network", "bar"}:
            return [(0, made_board(settings.board))]
        boards = [(0, made_board(settings.bar.first)), (1, made_board(settings.bar.second))]
        if purpose == "bar" or all(board.family is not None for _, board in boards):
            return boards
        # Boards that look alike: a camera sees its own one.
        pair = moment.split("-")[:2]
        first = next((n for n in self.names if n in pair), None)
        first = next((one for one, two in settings.bar.pairs if {one, two} == set(pair)), first)
        return [boards[0 if camera == first else 1]]

    def camera_from_file(self, name: str, size: tuple[int, int] | None) -> Camera:
        """A camera as its file has it.

        Raises
        ------
        InputError
            If the file is bad, has no such camera, or is made for images of another size.
        """
        path = self.campaign.folder / self.settings.camera_files[name]
        found = read_cameras(path)
        chosen = next((c for c in found if c.name == name), found[0] if len(found) == 1 else None)
        if chosen is None:
            names = ", ".join(c.name for c in found)
            raise InputError([Problem(path, f"it has no camera '{name}' (it has {names})")])
        if size is not None and size != chosen.size:
            said = (
                f"made for {chosen.size[0]} x {chosen.size[1]} pixels, but the images of camera "
                f"{name} have {size[0]} x {size[1]}"
            )
            raise InputError([Problem(path, said)])
        return replace(chosen, name=name)

    @property
    def movie_camera(self) -> str:
        """The camera that took most of the walk around the robot."""
        return max(self.images.movie, key=lambda name: len(self.images.movie[name]))

    @property
    def walk(self) -> Sequence[Path]:
        """Its images."""
        return self.images.movie[self.movie_camera]

    def marker_views(
        self, cameras: Mapping[str, Camera]
    ) -> tuple[list[Frame], dict[tuple[str, str], Detection]]:
        """Markers in the walk around the robot, and in the images of the stops.

        Parameters
        ----------
        cameras : mapping of str to Camera
            Whose distortion bends the edges of the markers.

        Returns
        -------
        frames : list of Frame
            Of the movie camera.
        detections : dict of (str, str) to Detection
            By camera and stop.
        """
        walk = self.walk if self.images.movie and self.movie_camera in cameras else ()
        stops = {key: path for key, path in self.stop_images().items() if key[0] in cameras}
        jobs = [self.marker_job(path, cameras[self.movie_camera]) for path in walk]
        jobs += [self.marker_job(path, cameras[name]) for (name, _), path in stops.items()]
        found = detect_new(
            jobs,
            self.kept,
            self.workers,
            lambda share: self.progress("looking for markers", 0.65 + 0.2 * share),
        )
        raise_faults(found)
        for one in found:
            if (one.path, "the marker") in self.noted:
                continue
            self.note(one, "the marker")
            for number in one.markers.duplicates:
                self.oddities.append(
                    (self.shown(one.path), f"marker {number} is seen twice; neither is used")
                )
            for number in one.markers.strangers:
                said = f"marker {number} is not in vision.markers.sides; it is not used"
                self.oddities.append((self.shown(one.path), said))
        frames = [Frame(one.path.stem, one.markers.views) for one in found[: len(walk)]]
        return frames, dict(zip(stops, (one.markers for one in found[len(walk) :]), strict=True))

    def published_views(self, cameras: Mapping[str, Camera]) -> dict[tuple[str, str], Detection]:
        """Markers in the images of the stops with corners as OpenCV finds them."""
        stops = self.stop_images()
        jobs = [
            self.marker_job(path, cameras[name], fitted=False) for (name, _), path in stops.items()
        ]
        found = detect_new(jobs, self.kept, self.workers)
        return dict(zip(stops, (one.markers for one in found), strict=True))

    def stop_images(self) -> dict[tuple[str, str], Path]:
        """Images of the robot by camera and stop."""
        poses = self.images.poses
        return {(n, pose): path for n in self.names for pose, path in poses.get(n, {}).items()}

    def marker_job(self, path: Path, camera: Camera | None, *, fitted: bool = True) -> Job:
        """How to look for markers in an image."""
        markers = self.settings.markers
        family = Family(markers.family, markers.border)
        return MarkerJob(path, family, tuple(sides_of(self.settings)), camera, fitted)

    def note(self, found: Found, what: str) -> None:
        """Remember what is odd about an image, once."""
        if (found.path, what) in self.noted:
            return
        self.noted.add((found.path, what))
        said = {
            "blank": "blank: nothing but noise (a covered lens, no light?)",
            "mirrored": f"{what} is only found in the mirror image: the print, or the image, is "
            "mirrored",
        }
        if found.note:
            what = said.get(found.note, found.note)
            self.oddities.append((self.shown(found.path), what))
            self.rejections.append((self.shown(found.path), rejected("image", what)))
        for remark in found.remarks:
            self.oddities.append((self.shown(found.path), remark))
        self.rejections.extend((self.shown(found.path), one) for one in found.rejected)

    def _odd(self, path: Path, what: str) -> None:
        """Remember that an image is not used, and why."""
        self.oddities.append((self.shown(path), what))
        self.rejections.append((self.shown(path), rejected("image", what)))

    def shown(self, path: Path) -> str:
        """A file by its name relative to the campaign."""
        return str(path.relative_to(self.campaign.folder))


def load_inputs(
    campaign: Campaign,
    progress: Progress = no_progress,
    workers: int | None = None,
    choices: Mapping[str, object] | None = None,
) -> VisionInputs:
    """What a campaign holds for the vision system, checked but for the contents of the images.

    Parameters
    ----------
    campaign : Campaign
        The folder.
    progress : callable
        Told what is being done.
    workers : int, optional
        Processes; by default one for each processor.
    choices : mapping of str to object, optional
        Settings that are used instead of the campaign's.

    Raises
    ------
    InputError
        Naming every image that has a name that says nothing, and every fact of the lab's hardware
        that campaign.toml has to state for these images.
    """
    stated = campaign.section("vision", VisionSettings)
    settings = VisionSettings.model_validate(
        {**stated.model_dump(exclude_unset=True), **(choices or {})}
    )
    images = images_in_use(campaign, settings)
    given = VisionInputs(campaign, settings, images, progress, workers)
    problems = [*_strangers(given), *missing_facts(campaign.toml, settings, _needed(given))]
    if problems:
        raise InputError(problems)
    given.oddities.extend(_not_used(given))
    return given


def _needed(given: VisionInputs) -> dict[str, str]:
    """Facts of the hardware that these images ask for, and what for."""
    images, bar = given.images, given.settings.bar
    needed = {}
    if images.reference:
        needed["vision.reference"] = "the image of the reference pattern"
    if given.shows_robot or images.movie:
        needed["vision.markers"] = "the images of the robot"
    if given.watched:
        needed["vision.board"] = "the images of steadiness"
    if any(purpose == "calibration" for purpose, _, _, _ in given.board_images()):
        needed["vision.board"] = "the calibration images"
    alone = bar.second is None and bar.second_on_first is None
    single = alone and not images.bar and (bar.first or given.settings.board) is not None
    if (images.network or images.bar) and not single:
        needed["vision.bar"] = "the images of the double pattern"
    return needed


def _strangers(given: VisionInputs) -> Iterator[Problem]:
    """Images of the reference pattern by cameras that there are not."""
    names = given.names
    for name, path in given.images.reference.items():
        if name not in names:
            yield Problem(path, f"there is no camera '{name}' ({', '.join(names)})")


def _not_used(given: VisionInputs) -> Iterator[tuple[str, str]]:
    """Images that no step looks at, and why; and camera files of cameras that there are not."""
    folder = given.campaign.folder
    yield from strange_decisions(folder, given.decided)
    used = {path for _, _, path, _ in given.board_images()} | given.decided.paths(folder)
    walk = given.walk if given.images.movie else ()
    used |= {*walk, *given.stop_images().values()}
    root = folder / given.settings.images
    for path in images_below(root):
        if path not in used and path.relative_to(root).parts[0] not in {*OF_CHECKS, DRIVE}:
            what = "not used: no step looks at an image of this place, camera or kind"
            yield str(path.relative_to(folder)), what
    for name, file in given.settings.camera_files.items():
        if name not in given.wanted:
            yield file, f"not used: there are no images of camera {name} (vision.camera_files)"
