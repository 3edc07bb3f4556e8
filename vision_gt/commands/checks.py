"""The checks by themselves, from images and the results of an earlier run."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from validation.campaign.folder import Campaign
from validation.campaign.stored import stored_tables
from validation.errors import GtvalError, InputError, Problem
from validation.results import VALIDATION_SYSTEM, Finding
from validation.text_files.csv_tables import Column, read_csv
from vision_gt.campaign.checks import Checks, need_facts, one_check
from vision_gt.campaign.result_files import PLACED
from vision_gt.checks.displacement import Displacement, known_displacement
from vision_gt.images.jobs import BoardJob, detect_all
from vision_gt.network.adjustment import Network
from vision_gt.optics.camera import Camera
from vision_gt.optics.camera_files import read_cameras
from vision_gt.patterns.boards import Board
from vision_gt.settings import VisionSettings


def check_of_campaign(
    name: str, campaign: Campaign, workers: int | None = None
) -> tuple[Checks, list[Finding]]:
    """A check ('table', 'survey_check') of a campaign whose results are there.

    The findings are those of the check, and say which results of an earlier run that it rests on
    are out of date.

    Raises
    ------
    GtvalError
        If results or images are missing or bad.
    """
    settings = campaign.section("vision", VisionSettings)
    need_facts(name, campaign, settings)
    network = read_network(campaign.results)
    stored = stored_tables(campaign)
    validation = {one.system: one for one in stored.tables}.get(VALIDATION_SYSTEM)
    late = [one for one in stored.findings if one.subject in {VALIDATION_SYSTEM, "vision"}]
    found = one_check(name, campaign, settings, network, validation, workers)
    return found, [*found.findings, *late]


def read_network(results: Path) -> Network:
    """Cameras and their poses from vision_cameras.csv and vision_camera_NAME.yaml.

    The covariances between cameras are not stored: each camera's own standard deviations are
    all that the result has.

    Raises
    ------
    InputError
        If the files are missing or bad.
    """
    columns = [
        Column("camera"),
        *(Column(name, "number") for name in PLACED),
        *(Column(f"sigma_{name}", "number", low=0) for name in PLACED),
    ]
    table = read_csv(results / "vision_cameras.csv", columns)
    table.flag_duplicates(["camera"])
    table.raise_problems()
    names = table.text["camera"]
    values = np.column_stack([table.numbers[name] for name in PLACED])
    sigmas = np.column_stack([table.numbers[f"sigma_{name}"] for name in PLACED])
    cameras = [read_cameras(results / f"vision_camera_{name}.yaml")[0] for name in names]
    covariance = np.zeros((15 * len(names), 15 * len(names)))
    for i, sigma in enumerate(sigmas):
        rows = np.arange(15 * i, 15 * i + 6)
        covariance[rows, rows] = sigma**2
    return Network(
        tuple(cameras),
        RigidTransform.from_components(values[:, :3], Rotation.from_rotvec(values[:, 3:])),
        covariance,
        RigidTransform.identity(),
        np.zeros((6, 6)),
        0.0,
    )


def displacement_of_images(
    images: tuple[Path, Path], board: Board, camera: Camera, distance: float, sigma: float
) -> Displacement:
    """How far a board moved between two images.

    Raises
    ------
    GtvalError
        If an image is bad or does not show the board.
    """
    jobs = [BoardJob(path, camera.name, path.stem, [(0, board)]) for path in images]
    found = detect_all(jobs)
    w, h = camera.size
    problems = [
        Problem(one.path, one.fault or _fault(one.size, (w, h)))
        for one in found
        if one.fault or one.size != (w, h) or not one.boards
    ]
    if problems:
        raise InputError(problems)
    first, second = (one.boards[0] for one in found)
    moved = known_displacement(first, second, camera, distance, sigma)
    if moved is None:
        raise GtvalError("the board gives no pose in one of the images")
    return moved


def _fault(size: tuple[int, int], expected: tuple[int, int]) -> str:
    """Why an image says nothing."""
    if size != expected:
        return f"{size[0]} x {size[1]} pixels; expected {expected[0]} x {expected[1]}"
    return "the board was not found"
