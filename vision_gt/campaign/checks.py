"""Checks of the cameras, and of the survey by a camera, that a campaign has images of.

Images lie in table/CAMERA/poseX, survey_check/CAMERA/PLACE and displacement/CAMERA/first and
second, below the folder of the images. One that shows nothing costs itself, not the others.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError, Problem
from validation.poses.pose_table import PoseTable
from validation.results import Finding, Size
from vision_gt.checks.displacement import Displacement, known_displacement
from vision_gt.checks.known_places import (
    KnownPlace,
    PlaceReading,
    placed_on,
    read_board,
    read_marker,
)
from vision_gt.images.files import images_of_poses, list_images
from vision_gt.images.jobs import BoardJob, Found, Job, MarkerJob
from vision_gt.images.kept import detect_new, kept_images
from vision_gt.network.adjustment import Network
from vision_gt.patterns.dictionaries import Family
from vision_gt.settings import BoardSettings, VisionSettings, stated
from vision_gt.stages.decided import decided_about
from vision_gt.stages.facts import missing_facts
from vision_gt.stages.inputs import OF_CHECKS, made_board

Taken = Sequence[tuple[str, str, Path]]
"""Camera, name of the place, image."""

TABLE, SURVEY, DISPLACEMENT = OF_CHECKS
_WHAT = {
    TABLE: "the images of a table",
    SURVEY: "the images of a board that checks the survey",
    DISPLACEMENT: "the images of a board that was moved",
}


@dataclass(frozen=True)
class Checks:
    """What the checks gave.

    Parameters
    ----------
    table, survey : tuple of PlaceReading
        Boards and markers on the table; boards at known places on the floor.
    displacement : tuple of Displacement
        One for each camera that saw a board in two places.
    findings : tuple of Finding
        Verdicts, and what could not be checked.
    """

    table: tuple[PlaceReading, ...] = ()
    survey: tuple[PlaceReading, ...] = ()
    displacement: tuple[Displacement, ...] = ()
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True)
class _Given:
    """What all checks start from."""

    campaign: Campaign
    settings: VisionSettings
    network: Network
    validation: PoseTable | None
    workers: int | None

    def folder(self, name: str) -> Path:
        return self.campaign.folder / self.settings.images / name

    @cached_property
    def left_out(self) -> frozenset[Path]:
        return decided_about(self.campaign, self.settings).paths(self.campaign.folder)


def campaign_checks(
    campaign: Campaign,
    settings: VisionSettings,
    network: Network,
    validation: PoseTable | None,
    workers: int | None = None,
) -> Checks:
    """All checks that there are images of; what keeps one from being made is a finding."""
    given = _Given(campaign, settings, network, validation, workers)
    table, survey, moved = Checks(), Checks(), Checks()
    findings: list[Finding] = []
    for name, check in ((TABLE, _table), (SURVEY, _survey), (DISPLACEMENT, _displacement)):
        if not given.folder(name).is_dir():
            continue
        try:
            found = check(given)
        except GtvalError as error:
            text = f"{_WHAT[name].capitalize()} are not made use of: {error}"
            findings.append(Finding("warning", text, "vision", "not_checked"))
            continue
        findings += found.findings
        table, survey, moved = (
            found if name == kind else old
            for kind, old in zip(OF_CHECKS, (table, survey, moved), strict=True)
        )
    return Checks(table.table, survey.survey, moved.displacement, tuple(findings))


def one_check(
    name: str,
    campaign: Campaign,
    settings: VisionSettings,
    network: Network,
    validation: PoseTable | None,
    workers: int | None = None,
) -> Checks:
    """One of the checks ('table', 'survey_check', 'displacement').

    Raises
    ------
    GtvalError
        If images, facts of the hardware or validation poses are missing or bad.
    """
    check = {TABLE: _table, SURVEY: _survey, DISPLACEMENT: _displacement}[name]
    return check(_Given(campaign, settings, network, validation, workers))


def need_facts(name: str, campaign: Campaign, settings: VisionSettings) -> None:
    """Raise where campaign.toml does not state what the images of a check show.

    Raises
    ------
    InputError
        Naming each key that is missing, and what to write.
    """
    table = settings.table
    keys = {SURVEY: ["survey_check"], DISPLACEMENT: ["displacement", "board"]}.get(name, [])
    if name == TABLE:
        keys = ["table.height"]
        if table.board is not None or table.marker is None:
            keys += ["table.board", "table.corner"]
        if table.marker is not None:
            keys += ["table.marker_side", "table.marker_middle", "markers.family"]
    needed = {f"vision.{key}": _WHAT[name] for key in keys}
    if problems := list(missing_facts(campaign.toml, settings, needed)):
        raise InputError(problems)


def _need(given: _Given, name: str) -> None:
    need_facts(name, given.campaign, given.settings)


def _known_cameras(given: _Given, names: Sequence[str], folder: Path) -> None:
    """Raise for images of cameras that the network does not have."""
    if unknown := sorted(set(names) - set(given.network.names)):
        raise GtvalError(f"{folder}: the results have no camera {', '.join(unknown)}")


def _over_stop(
    given: _Given, stop: str, place: Sequence[float], sigmas: Sequence[float], name: str = ""
) -> KnownPlace:
    """A place (x, y, height, heading) in the robot frame of a surveyed stop.

    Raises
    ------
    GtvalError
        If the stop was not surveyed.
    """
    table = given.validation
    if table is None:
        said = "there are no validation poses; `gtval run` makes results/poses_survey.csv"
        raise GtvalError(said)
    if stop not in table.ids:
        raise GtvalError(f"there is no validation pose '{stop}'")
    row = table.ids.index(stop)
    return placed_on(name or stop, table.poses[row], table.covariances[row], place, sigmas)


def _table(given: _Given) -> Checks:
    """Boards and markers on a table over surveyed stops."""
    table, folder = given.settings.table, given.folder(TABLE)
    _need(given, TABLE)
    images = images_of_poses(folder, given.left_out)
    if not images:
        raise InputError([Problem(folder, "no images (CAMERA/poseX.png) of a board on a table")])
    _known_cameras(given, list(images), folder)
    taken = [(name, pose, path) for name, poses in images.items() for pose, path in poses.items()]
    readings: list[PlaceReading] = []
    missed: list[str] = []
    height = stated(table.height)
    if table.board is not None:
        at = (*stated(table.corner), height, table.heading)
        known = [_over_stop(given, pose, at, table.sigmas) for _, pose, _ in taken]
        _board_readings(given, taken, known, table.board, readings, missed)
    if table.marker is not None:
        at = (*stated(table.marker_middle), height, table.marker_heading)
        known = [_over_stop(given, pose, at, table.sigmas) for _, pose, _ in taken]
        _marker_readings(given, taken, known, readings, missed)
    if not readings:
        raise InputError([Problem(folder, f"nothing was found in it: {'; '.join(missed)}")])
    findings = (*_missed(missed), *table_verdicts(readings))
    return Checks(table=tuple(readings), findings=findings)


def _survey(given: _Given) -> Checks:
    """A board at known places on the floor, seen by cameras."""
    check, folder = given.settings.survey_check, given.folder(SURVEY)
    _need(given, SURVEY)
    cameras = sorted(path.name for path in folder.glob("*") if path.is_dir())
    taken = [
        (name, path.stem, path)
        for name in cameras
        for path in list_images(folder / name, given.left_out)
    ]
    if not taken:
        raise InputError([Problem(folder, "no images (CAMERA/PLACE.png) of a board")])
    _known_cameras(given, cameras, folder)
    if problems := [
        Problem(path, f"vision.survey_check.places has no place '{place}'")
        for _, place, path in taken
        if place not in check.places
    ]:
        raise InputError(problems)
    known = []
    for _, name, _ in taken:
        place = check.places[name]
        at = (*place.corner, check.height, place.heading)
        if place.stop:
            known.append(_over_stop(given, place.stop, at, check.sigmas, name))
        else:
            known.append(placed_on(name, np.zeros(3), np.zeros((3, 3)), at, check.sigmas))
    readings: list[PlaceReading] = []
    missed: list[str] = []
    _board_readings(given, taken, known, stated(check.board), readings, missed)
    if not readings:
        raise InputError([Problem(folder, f"nothing was found in it: {'; '.join(missed)}")])
    findings = (*_missed(missed), *survey_verdicts(readings))
    return Checks(survey=tuple(readings), findings=findings)


def _displacement(given: _Given) -> Checks:
    """The calibration board before and after it was moved by a known distance."""
    settings, folder = given.settings, given.folder(DISPLACEMENT)
    _need(given, DISPLACEMENT)
    cameras = sorted(path.name for path in folder.iterdir() if path.is_dir())
    _known_cameras(given, cameras, folder)
    pairs: list[tuple[str, Path]] = []
    for name in cameras:
        if any(path.parent == folder / name for path in given.left_out):
            continue  # half a pair tells nothing
        by_stem = {path.stem: path for path in list_images(folder / name)}
        if set(by_stem) != {"first", "second"}:
            said = "expected two images, first and second, of the board in its two places"
            raise InputError([Problem(folder / name, said)])
        pairs += [(name, by_stem["first"]), (name, by_stem["second"])]
    board = made_board(stated(settings.board))
    jobs = [BoardJob(path, c, path.stem, [(0, board)], settings.detector) for c, path in pairs]
    found = _looked(given, jobs)
    moved, missed = [], []
    expected, sigma = stated(settings.displacement.distance), settings.displacement.sigma
    for first, second in zip(found[::2], found[1::2], strict=True):
        missed += [_shown(given, one.path, "board") for one in (first, second) if not one.boards]
        if first.boards and second.boards:
            camera = given.network.cameras[given.network.index(first.boards[0].camera)]
            one = known_displacement(first.boards[0], second.boards[0], camera, expected, sigma)
            moved += [] if one is None else [one]
    verdicts = [displacement_verdict(one) for one in moved]
    return Checks(displacement=tuple(moved), findings=(*_missed(missed), *verdicts))


def _looked(given: _Given, jobs: Sequence[Job]) -> list[Found]:
    """What images show; an error for all that are bad or not of their camera's size."""
    found = detect_new(jobs, kept_images(given.campaign.folder), given.workers)
    sizes = {camera.name: camera.size for camera in given.network.cameras}
    problems = [Problem(one.path, one.fault) for one in found if one.fault]
    problems += [
        Problem(one.path, f"{one.size[0]} x {one.size[1]} pixels; expected {w} x {h}")
        for one in found
        for w, h in [sizes[one.path.parent.name]]
        if not one.fault and one.size != (w, h)
    ]
    if problems:
        raise InputError(problems)
    return found


def _board_readings(
    given: _Given,
    taken: Taken,
    known: Sequence[KnownPlace],
    board: BoardSettings,
    readings: list[PlaceReading],
    missed: list[str],
) -> None:
    """Add readings of a board at known places, and the images that do not show it."""
    jobs = [
        BoardJob(path, camera, place, [(0, made_board(board))], given.settings.detector)
        for camera, place, path in taken
    ]
    for at, one in zip(known, _looked(given, jobs), strict=True):
        found = read_board(one.boards[0], given.network, at) if one.boards else None
        if found is None:
            missed.append(_shown(given, one.path, "board"))
        else:
            readings.append(found)


def _marker_readings(
    given: _Given,
    taken: Taken,
    known: Sequence[KnownPlace],
    readings: list[PlaceReading],
    missed: list[str],
) -> None:
    """Add readings of the marker on the table, and the images that do not show it."""
    table, markers = given.settings.table, given.settings.markers
    family, number = Family(markers.family, markers.border), stated(table.marker)
    cameras = {camera.name: camera for camera in given.network.cameras}
    jobs = [MarkerJob(path, family, (number,), cameras[name]) for name, _, path in taken]
    for (name, _, path), at, one in zip(taken, known, _looked(given, jobs), strict=True):
        side = stated(table.marker_side)
        views = [read_marker(v, side, name, given.network, at) for v in one.markers.views]
        if not views or views[0] is None:
            missed.append(_shown(given, path, f"marker {number}"))
        else:
            readings.append(views[0])


def _shown(given: _Given, path: Path, what: str) -> str:
    """What was not found where."""
    return f"{what} in {path.relative_to(given.campaign.folder)}"


def _missed(missed: Sequence[str]) -> Iterator[Finding]:
    """A warning that names what was not found."""
    if missed:
        text = (
            f"Not found, and left out: {', '.join(missed)}. Is it whole in the image, sharp and "
            "well lit? Are the squares counted right?"
        )
        yield Finding("warning", text, "vision", "check_not_found")


def _worst(readings: Sequence[PlaceReading]) -> str:
    """The readings that do not agree, in words."""
    return "; ".join(
        f"{one.kind} at {one.pose}, camera {one.camera}: "
        + ", ".join(
            f"{name} {1e3 * v:+.1f}" for name, v in zip("xyz", one.difference, strict=False)
        )
        + f" mm, heading {1e3 * one.difference[3]:+.1f} mrad, p = {one.p_value:.1g}"
        for one in readings
        if not one.agrees
    )


def _largest(readings: Sequence[PlaceReading]) -> tuple[Size, ...]:
    """The largest difference of a place."""
    most = max(float(np.linalg.norm(one.difference[:2])) for one in readings)
    return (Size("largest difference in the plane", most, "m"),)


def table_verdicts(readings: Sequence[PlaceReading]) -> Iterator[Finding]:
    """Whether each camera sees things on the table where they are."""
    for name in dict.fromkeys(one.camera for one in readings):
        own = [one for one in readings if one.camera == name]
        if all(one.agrees for one in own):
            text = f"Camera {name} sees all {len(own)} things on the table where they should be."
            yield Finding("good", text, f"camera {name}", "table_agrees", _largest(own))
        else:
            text = (
                f"Camera {name} does not see things on the table where they should be (should be "
                f"minus seen): {_worst(own)}. Was the table at the right stop, the board turned "
                "right, its place on the table right? Else the camera has moved."
            )
            yield Finding("error", text, f"camera {name}", "table_differs", _largest(own))


def survey_verdicts(readings: Sequence[PlaceReading]) -> Iterator[Finding]:
    """Whether the cameras and the survey agree on where the board is."""
    if all(one.agrees for one in readings):
        most = max(float(np.linalg.norm(one.difference[:2])) for one in readings)
        text = (
            f"Survey and camera agree: {len(readings)} readings of a board at known places differ "
            f"by at most {1e3 * most:.1f} mm, no more than by chance."
        )
        yield Finding("good", text, "survey", "survey_check_agrees", _largest(readings))
    else:
        text = (
            "Survey and camera do not agree (known place minus camera): "
            f"{_worst(readings)}. Lay the board again; if it stays, one of the two has a bias: "
            "compare the marks of the Vframe, and the place of the reference pattern."
        )
        yield Finding("error", text, "survey", "survey_check_differs", _largest(readings))


def displacement_verdict(one: Displacement) -> Finding:
    """Whether a camera measures a known distance right."""
    said = (
        f"Camera {one.camera} sees a board moved by {one.measured:.4f} m, expected "
        f"{one.expected:.4f} m: off by {1e3 * one.off:+.1f} mm, sigma {1e3 * one.off_sigma:.1f} mm "
        f"(p = {one.p_value:.2g})."
    )
    subject = f"camera {one.camera}"
    size = (Size.normal("moved by less expected", one.off, one.off_sigma, "m"),)
    if one.agrees:
        return Finding("good", f"{said} That is chance.", subject, "displacement_agrees", size)
    text = (
        f"{said} That is no chance. Measure the distance again, and the square of the board; else "
        "calibrate the camera again."
    )
    return Finding("error", text, subject, "displacement_differs", size)
