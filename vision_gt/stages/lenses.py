"""Boards in the images of a campaign, and the lenses of its cameras."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError
from validation.systems import Progress, no_progress
from vision_gt.images.files import Image, read_image
from vision_gt.images.jobs import BOARD_IS
from vision_gt.images.other_boards import stated_wrongly
from vision_gt.network.intrinsics import Calibration, calibrate
from vision_gt.network.left_out import left_out_views
from vision_gt.network.solution import NetworkSolution
from vision_gt.optics.camera import Camera
from vision_gt.patterns.board_views import BoardView
from vision_gt.patterns.rejections import Rejection, hull, rejected
from vision_gt.settings import stated
from vision_gt.stages.inputs import VisionInputs, load_inputs
from vision_gt.stages.lacks import Lack, lacking

BoardViews = Mapping[str, Sequence[BoardView]]
"""Views of boards by what their image was taken for."""


@dataclass(frozen=True)
class Begun:
    """What comes before everything else: boards in the images, and the lenses.

    Parameters
    ----------
    given : VisionInputs
        The campaign.
    boards : mapping of str to sequence of BoardView
        By what their image was taken for.
    calibrations : mapping of str to Calibration
        By camera.
    cameras : mapping of str to Camera
        Those whose lens is known.
    lacks : list of Lack
        What could not be solved; grows.
    """

    given: VisionInputs
    boards: BoardViews
    calibrations: Mapping[str, Calibration]
    cameras: Mapping[str, Camera]
    lacks: list[Lack]


def begin(
    campaign: Campaign,
    progress: Progress = no_progress,
    *,
    workers: int | None = None,
    **choices: bool,
) -> Begun:
    """Boards and lenses of a campaign.

    Parameters
    ----------
    campaign : Campaign
        With images below its [vision] folder.
    progress : callable
        Told what is being done.
    workers : int, optional
        Processes; by default one for each processor.
    **choices : bool
        ``as_published``, ``merge_cameras``, ``on_floor``: used instead of the settings.

    Raises
    ------
    GtvalError
        If files are bad, or no camera's lens is known.
    """
    given = load_inputs(campaign, progress, workers, choices)
    files = given.settings.camera_files
    lacks = list(lacking(given.images, given.wanted, files, robot=given.shows_robot))
    boards, sizes = given.board_views()
    calibrations, cameras = _cameras(given, boards, sizes, lacks)
    return Begun(given, boards, calibrations, cameras, lacks)


def _cameras(
    given: VisionInputs,
    boards: BoardViews,
    sizes: Mapping[str, tuple[int, int]],
    lacks: list[Lack],
) -> tuple[dict[str, Calibration], dict[str, Camera]]:
    """Intrinsic parameters of the cameras, from files or from images; what fails is a lack."""
    calibrations: dict[str, Calibration] = {}
    cameras: dict[str, Camera] = {}
    faults = []
    for number, name in enumerate(given.wanted):
        given.progress(f"calibrating camera {name}", 0.45 + 0.1 * number / len(given.wanted))
        try:
            if name in given.settings.camera_files:
                cameras[name] = given.camera_from_file(name, sizes.get(name))
            elif name in given.images.calibration:
                calibrations[name] = _calibrated(given, name, boards, sizes)
                cameras[name] = calibrations[name].camera
        except InputError:
            raise
        except GtvalError as error:
            faults.append(str(error))
            lacks.append(Lack(f"camera {name}", f"{str(error)[0].upper()}{str(error)[1:]}."))
    if not any(name in cameras for name in given.names):
        raise GtvalError("\n".join(faults or [one.text for one in lacks]))
    return calibrations, cameras


def _calibrated(
    given: VisionInputs, name: str, boards: BoardViews, sizes: Mapping[str, tuple[int, int]]
) -> Calibration:
    """One camera from its calibration images."""
    views = [view for view in boards.get("calibration", ()) if view.camera == name]
    if not views:
        raise GtvalError(_no_board(given, name))
    return calibrate(name, sizes[name], views)


def _no_board(given: VisionInputs, name: str) -> str:
    """What is said where no calibration image of a camera shows the stated board."""
    board, paths = stated(given.settings.board), given.images.calibration[name]
    images = {given.shown(path) for path in paths}
    notes = Counter(what for image, what in given.oddities if image in images)
    what, count = next(iter(notes.most_common(1)), ("", 0))
    seen = (
        f"in {count} of them {what}" if what.startswith(BOARD_IS) and stated_wrongly(what) else ""
    )
    count_them = "count the squares (not the inner corners) of yours"
    return (
        f"camera {name}: none of its {len(paths)} calibration images shows a board of "
        f"{board.columns} x {board.rows} squares; {seen or count_them}{':' if seen else ' and'} "
        "correct vision.board"
    )


def examples(begun: Begun) -> dict[str, tuple[Image, BoardView]]:
    """By camera the calibration image with the most tilted board, to show what was found."""
    return {name: _example(begun.given, name, one) for name, one in begun.calibrations.items()}


def _example(given: VisionInputs, name: str, found: Calibration) -> tuple[Image, BoardView]:
    """The calibration image with the most tilted board, to show what was found in it."""
    view = found.views[int(np.argmax(found.coverage.tilts))]
    paths = {path.name: path for path in given.images.calibration[name]}
    return read_image(paths[view.source]), view


def left_out(begun: Begun, solution: NetworkSolution | None) -> Iterator[tuple[str, Rejection]]:
    """Boards that took no part, by their images."""
    for purpose, view, why in left_out_views(begun.boards, begun.calibrations, solution):
        number = None if purpose == "calibration" else view.part + 1
        image = begun.given.image_of(purpose, view)
        yield image, rejected("board", why, number, hull(view.pixels))
