"""The table check of a campaign: images and earlier results to readings, and their tables."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from validation.campaign.folder import Campaign
from validation.campaign.stored import stored_tables
from validation.errors import GtvalError, InputError, Problem
from validation.results import VALIDATION_SYSTEM, Finding, Table
from validation.text_files.csv_tables import Column, read_csv
from vision_gt.campaign.inputs import made_board, missing_facts
from vision_gt.campaign.result_files import PLACED
from vision_gt.images.files import images_of_poses
from vision_gt.images.jobs import BoardJob, detect_all
from vision_gt.network.adjustment import Network
from vision_gt.network.table_check import TableReading, check_table
from vision_gt.optics.camera_files import read_cameras
from vision_gt.settings import VisionSettings, stated

MM = 1e3


def table_readings(
    campaign: Campaign, workers: int | None = None
) -> tuple[list[TableReading], list[Finding]]:
    """Boards on the table, found in the images of vision/table, beside the validation poses.

    The findings say that results of an earlier run which this rests on are out of date.

    Raises
    ------
    GtvalError
        If results or images are missing or bad.
    """
    settings = campaign.section("vision", VisionSettings)
    needed = {"vision.table": "the images of a board on a table"}
    if problems := list(missing_facts(campaign.toml, settings, needed)):
        raise InputError(problems)
    network = read_network(campaign.results)
    stored = stored_tables(campaign)
    validation = {one.system: one for one in stored.tables}.get(VALIDATION_SYSTEM)
    if validation is None:
        raise GtvalError(f"{campaign.results}: no poses_survey.csv; `gtval run` makes it")
    late = [one for one in stored.findings if one.subject in {VALIDATION_SYSTEM, "vision"}]
    folder = campaign.folder / settings.images / "table"
    images = images_of_poses(folder)
    board = made_board(settings.table.board)
    jobs = [
        (pose, BoardJob(path, camera, pose, [(0, board)], settings.detector))
        for camera, paths in images.items()
        for pose, path in paths.items()
    ]
    if not jobs:
        raise InputError([Problem(folder, "no images (CAMERA/poseX.png) of a board on a table")])
    unknown = sorted(set(images) - set(network.names))
    if unknown:
        raise GtvalError(f"{folder}: the results have no camera {', '.join(unknown)}")
    found = detect_all([job for _, job in jobs], workers)
    problems = [
        Problem(one.path, one.fault or "the board was not found")
        for one in found
        if one.fault or not one.boards
    ]
    if problems:
        raise InputError(problems)
    views = [(pose, one.boards[0]) for (pose, _), one in zip(jobs, found, strict=True)]
    table = settings.table
    place = (*stated(table.corner), table.heading, stated(table.height))
    return check_table(views, network, validation, place), late


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


def reading_table(readings: Sequence[TableReading]) -> Table:
    """The document's table: each pose with its differences, validation minus board."""
    rows = []
    for one in readings:
        cells = [
            value
            for k in range(3)
            for value in (one.validation[k], one.board[k], one.difference[k])
        ]
        rows.append((one.pose, one.camera, *cells, float(one.difference[3])))
    columns = [
        f"{name} {what} [m]" for name in "xyz" for what in ("validation", "board", "difference")
    ]
    return Table(
        "Chessboard on the table",
        ("pose", "camera", *columns, "heading difference [rad]"),
        rows,
        ("", "", *((".4f", ".4f", "+.4f") * 3), "+.4f"),
        note="Difference: validation minus board.",
    )


def statistics_table(readings: Sequence[TableReading]) -> Table:
    """Mean, standard deviation and largest absolute value of the differences."""
    off = np.array([one.difference for one in readings])
    rows = []
    for k, name in enumerate(("x [mm]", "y [mm]", "z [mm]", "heading [mrad]")):
        column = MM * off[:, k]
        spread = float(column.std(ddof=1)) if len(column) > 1 else None
        rows.append((name, len(column), float(column.mean()), spread, float(np.abs(column).max())))
    return Table(
        "Differences of the chessboard on the table",
        ("component", "n", "average", "standard deviation", "largest absolute value"),
        rows,
        ("", "", "+.2f", ".2f", ".2f"),
        note="The document reports averages of 2.9 mm and -0.1 mm in x and y.",
    )
