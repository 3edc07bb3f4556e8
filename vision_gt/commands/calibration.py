"""Calibration of one camera from a folder, and the check with two boards."""

from pathlib import Path

import numpy as np

from validation.errors import GtvalError, InputError, Problem
from validation.results import Table
from validation.systems import Progress, no_progress
from vision_gt.images.files import list_images
from vision_gt.images.jobs import BoardJob, detect_all
from vision_gt.network.intrinsics import Calibration, calibrate, known_displacement
from vision_gt.optics.camera import PARAMETERS, Camera
from vision_gt.patterns.boards import Board


def calibration_of_folder(
    folder: Path, board: Board, workers: int | None = None, progress: Progress = no_progress
) -> Calibration:
    """The calibration that the images of a folder give.

    Raises
    ------
    GtvalError
        If files are bad, sizes differ, or the board is not found often enough.
    """
    paths = list_images(folder)
    if not paths:
        raise InputError([Problem(folder, "there are no images here")])
    jobs = [BoardJob(path, folder.name, path.stem, [(0, board)]) for path in paths]
    found = detect_all(jobs, workers, lambda share: progress("looking for boards", share))
    problems = [Problem(one.path, one.fault) for one in found if one.fault]
    size = next((one.size for one in found if not one.fault), (0, 0))
    usual = f"{size[0]} x {size[1]}"
    problems += [
        Problem(one.path, f"{one.size[0]} x {one.size[1]} pixels, the first has {usual}")
        for one in found
        if not one.fault and one.size != size
    ]
    if problems:
        raise InputError(problems)
    views = [view for one in found for view in one.boards]
    if not views:
        raise GtvalError(
            f"none of the {len(paths)} images in {folder} shows a board of {board.columns} x "
            f"{board.rows} squares; count the squares, not the inner corners"
        )
    return calibrate(folder.name, size, views)


def calibration_facts(found: Calibration) -> dict[str, object]:
    """Numbers for scripts."""
    return {
        "camera": found.camera.name,
        "size": list(found.camera.size),
        "parameters": dict(zip(PARAMETERS, found.camera.parameters.tolist(), strict=True)),
        "sigmas": dict(zip(PARAMETERS, found.camera.sigmas.tolist(), strict=True)),
        "rms": found.rms,
        "images": {
            view.source: float(rms) for view, rms in zip(found.views, found.image_rms, strict=True)
        },
        "outliers": list(found.outliers),
        "coverage": found.coverage.share,
    }


def parameters_table(found: Calibration) -> Table:
    """The parameters with their standard deviations."""
    camera = found.camera
    return Table.of_columns(
        f"Camera {camera.name}, {camera.size[0]} x {camera.size[1]} pixels",
        [
            ("parameter", "", PARAMETERS),
            ("value", ".6g", camera.parameters),
            ("sigma", ".2g", camera.sigmas),
        ],
        f"rms {found.rms:.3f} px; {100 * found.coverage.share:.0f} % of the image covered.",
    )


def image_table(found: Calibration) -> Table:
    """Each image with its residuals, distance and tilt."""
    coverage, nothing = found.coverage, [None] * len(found.outliers)
    left = [f"{name} (left out)" for name in found.outliers]
    return Table.of_columns(
        "Images",
        [
            ("image", "", [*(view.source for view in found.views), *left]),
            ("rms [px]", ".3f", [*found.image_rms, *nothing]),
            ("distance [m]", ".2f", [*coverage.distances, *nothing]),
            ("tilt [deg]", ".0f", [*np.rad2deg(coverage.tilts), *nothing]),
        ],
    )


def displacement_of_images(
    first: Path, second: Path, board: Board, camera: Camera
) -> tuple[float, float]:
    """How far a board moved between two images, and how far it turned: metres and radians.

    Raises
    ------
    GtvalError
        If an image is bad or does not show the board.
    """
    views = []
    for path in (first, second):
        found = detect_all([BoardJob(path, camera.name, path.stem, [(0, board)])])[0]
        if found.fault:
            raise InputError([Problem(path, found.fault)])
        if found.size != camera.size:
            raise InputError(
                [Problem(path, f"{found.size} pixels; the camera file is for {camera.size}")]
            )
        if not found.boards:
            raise InputError([Problem(path, "the board was not found")])
        views.append(found.boards[0])
    moved = known_displacement(views[0], views[1], camera)
    if moved is None:
        raise GtvalError("the board gives no pose in one of the images")
    return moved
