"""Calibration of one camera from a folder of images."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from validation.errors import GtvalError, InputError, Problem
from validation.results import Table
from validation.systems import Progress, no_progress
from vision_gt.images.files import list_images, read_image
from vision_gt.images.jobs import BoardJob, Found, detect_all, detect_in
from vision_gt.images.pictures import VIDEOS, video_frames
from vision_gt.network.intrinsics import Calibration, calibrate, lens_words
from vision_gt.network.repeats import repeated
from vision_gt.network.verdict import calibration_verdict
from vision_gt.patterns.board_views import camera_pose_of_board
from vision_gt.patterns.boards import Board

AGAIN = "an earlier image again; it counts once"
MOST_FRAMES = 80
"""Of a video: more show the board in the same places again. A judgement."""


def calibration_of_images(
    source: Path, board: Board, workers: int | None = None, progress: Progress = no_progress
) -> tuple[Calibration, list[Found]]:
    """The calibration that the images of a folder, or the frames of a video, give.

    Parameters
    ----------
    source : Path
        The folder, or the video.
    board : Board
        What the images show.
    workers : int, optional
        Processes; by default one for each processor.
    progress : callable
        Told what is being done.

    Returns
    -------
    Calibration
        Of the camera.
    list of Found
        What each image shows, and what in it was not used and why.

    Raises
    ------
    GtvalError
        If files are bad, sizes differ, or the board is not found often enough.
    """
    report = partial(progress, "looking for boards")
    if source.is_file() and source.suffix.lower() in VIDEOS:
        found = _in_video(source, board)
    else:
        paths = list_images(source)
        if not paths:
            raise InputError([Problem(source, "there are no images here")])
        found = _looked_through(paths, board, source.name, None, workers, report)
    views = [view for one in found for view in one.boards]
    if not views:
        instead = sorted({one.note for one in found if one.note})
        why = f" ({'; '.join(instead)})" if instead else ""
        raise GtvalError(
            f"none of the {len(found)} images in {source} shows a board of {board.columns} x "
            f"{board.rows} squares{why}; count the squares, not the inner corners"
        )
    same = repeated(views)
    found = [replace(one, note=AGAIN) if one.path.name in same else one for one in found]
    views = [view for view in views if view.source not in same]
    return calibrate(source.stem, found[0].size, views), found


def _in_video(source: Path, board: Board) -> list[Found]:
    """What the frames of a video show."""
    return [
        detect_in(image, BoardJob(source.with_name(name), source.stem, name, [(0, board)]))
        for name, image in video_frames(source, MOST_FRAMES)
    ]


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


def remark_lines(looks: Sequence[Found]) -> list[str]:
    """What is odd about the images: one line a kind, with the first image that has it."""
    said: dict[str, list[str]] = {}
    for one in looks:
        for what in (*([one.note] if one.note else []), *one.remarks):
            said.setdefault(what, []).append(one.path.name)
    for one in looks:
        for left in one.rejected:
            number = "" if left.number is None else f" {left.number}"
            said.setdefault(f"{left.kind}{number}: {left.reason}", []).append(one.path.name)
    return [
        f"{names[0]}{f' and {len(names) - 1} more' if len(names) > 1 else ''}: {what}"
        for what, names in said.items()
    ]


def calibration_facts(found: Calibration, looks: Sequence[Found] = ()) -> dict[str, object]:
    """Numbers for scripts."""
    verdict = calibration_verdict(found)
    return {
        "camera": found.camera.name,
        "size": list(found.camera.size),
        "lens": found.camera.lens,
        "held_out_rms": dict(found.held_out),
        "parameters": dict(found.camera.named),
        "sigmas": {
            name: sigma
            for name, sigma in zip(found.camera.names, found.camera.sigmas.tolist(), strict=True)
            if name
        },
        "rms": found.rms,
        "images": {
            view.source: float(rms) for view, rms in zip(found.views, found.image_rms, strict=True)
        },
        "outliers": list(found.outliers),
        "coverage": found.coverage.share,
        "verdict": {
            "word": verdict.word,
            "text": verdict.text,
            "pixels": verdict.pixels,
            "focal": verdict.focal,
            "lacks": [one.kind for one in verdict.shortcomings],
        },
        "remarks": {
            one.path.name: [*([one.note] if one.note else []), *one.remarks]
            for one in looks
            if one.note or one.remarks
        },
        "rejected": [
            {
                "image": one.path.name,
                "what": what.kind,
                "number": what.number,
                "place": None if np.isnan(what.place).any() else what.place.tolist(),
                "reason": what.reason,
            }
            for one in looks
            for what in one.rejected
        ],
    }


def parameters_table(found: Calibration) -> Table:
    """The parameters with their standard deviations."""
    camera = found.camera
    sigmas = camera.sigmas[camera.estimated].tolist()
    return Table.of_columns(
        f"Camera {camera.name}, {camera.size[0]} x {camera.size[1]} pixels",
        [
            ("parameter", "", list(camera.named)),
            ("value", ".6g", list(camera.named.values())),
            ("sigma", ".2g", [*sigmas, *(len(camera.named) - len(sigmas)) * [None]]),
        ],
        f"{lens_words(found)} rms {found.rms:.3f} px; {100 * found.coverage.share:.0f} % of the "
        "image covered.",
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


def calibration_figures(found: Calibration, looks: Sequence[Found]) -> dict[str, bytes]:
    """extrinsics.png, and corners_NAME.png for each image, by their names.

    Images of a video are not drawn: they are no files.
    """
    from validation.figures.writing import figure_bytes
    from vision_gt.figures.boards import extrinsics
    from vision_gt.looks.boards import outline_at
    from vision_gt.looks.drawing import DOTS_PER_INCH, picture
    from vision_gt.looks.look import Look

    shown = extrinsics({found.camera.name: found})
    files = {"extrinsics.png": figure_bytes(shown, ".png", "extrinsics.png")}
    views = {view.source: view for view in found.views}
    rms = dict(zip(views, found.image_rms, strict=True))
    for one in looks:
        if not one.path.is_file() or not (one.path.name in views or one.rejected):
            continue
        name, said, outlines = one.path.name, one.note or "not used", []
        view = views.get(name)
        T = None if view is None else camera_pose_of_board(view, found.camera)
        if view is not None and T is not None:
            outlines = [outline_at(view, "board", found.camera, T)]
            said = f"{len(view.ids)} corners, rms {rms[name]:.3f} px"
        look = Look(name, f"camera {found.camera.name}", said, tuple(outlines), one.rejected)
        drawn, target = picture(look, read_image(one.path)), f"corners_{one.path.stem}.png"
        files[target] = figure_bytes(drawn, ".png", target, DOTS_PER_INCH)
    return files
