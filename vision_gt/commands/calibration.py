"""Calibration of one camera from a folder of images."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from validation.errors import GtvalError, InputError, Problem
from validation.results import Table
from validation.systems import Progress, no_progress
from vision_gt.images.files import list_images, read_image
from vision_gt.images.jobs import BoardJob, Found, detect_all
from vision_gt.network.intrinsics import Calibration, calibrate
from vision_gt.optics.camera import PARAMETERS
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
    report = partial(progress, "looking for boards")
    found = _looked_through(paths, board, folder.name, None, workers, report)
    views = [view for one in found for view in one.boards]
    if not views:
        raise GtvalError(
            f"none of the {len(paths)} images in {folder} shows a board of {board.columns} x "
            f"{board.rows} squares; count the squares, not the inner corners"
        )
    return calibrate(folder.name, found[0].size, views)


def _looked_through(
    paths: Sequence[Path],
    board: Board,
    camera: str,
    size: tuple[int, int] | None,
    workers: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> list[Found]:
    """What images show of a board; an error for all that are bad, or not of the camera's size."""
    jobs = [BoardJob(path, camera, path.stem, [(0, board)]) for path in paths]
    found = detect_all(jobs, workers, progress)
    width, height = size or next((one.size for one in found if not one.fault), (0, 0))
    problems = [Problem(one.path, one.fault) for one in found if one.fault]
    problems += [
        Problem(one.path, f"{one.size[0]} x {one.size[1]} pixels; expected {width} x {height}")
        for one in found
        if not one.fault and one.size != (width, height)
    ]
    if problems:
        raise InputError(problems)
    return found


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


def calibration_figures(found: Calibration, folder: Path) -> dict[str, bytes]:
    """extrinsics.png, and corners_NAME.png for each image that was used, by their names."""
    from validation.figures.writing import figure_bytes
    from vision_gt.figures.boards import drawn_corners, extrinsics

    files = {"extrinsics.png": extrinsics({found.camera.name: found})}
    for view in found.views:
        image = read_image(folder / view.source)
        shown = {view.source: (image, view, found.camera)}
        files[f"corners_{Path(view.source).stem}.png"] = drawn_corners(shown)
    return {name: figure_bytes(figure, ".png", name) for name, figure in files.items()}
