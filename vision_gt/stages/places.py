"""Where the cameras are, and the markers on the robot, as far as the images tell."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import RigidTransform

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.results import listed_ids
from vision_gt.images.markers import Detection
from vision_gt.network.adjustment import Bar, KnownBody
from vision_gt.network.chain import NotLinkedError
from vision_gt.network.solution import NetworkInput, NetworkSolution, solve_network
from vision_gt.optics.camera import Camera
from vision_gt.patterns.board_views import BoardView
from vision_gt.patterns.dictionaries import Family
from vision_gt.patterns.rejections import rejected
from vision_gt.robot.layout import Frame, LayoutFit, UnlinkedMarkersError, fit_layout
from vision_gt.robot.marker_poses import Layout
from vision_gt.settings import BarSettings, stated
from vision_gt.stages.inputs import VisionInputs, placed, sides_of
from vision_gt.stages.lacks import Lack
from vision_gt.stages.lenses import Begun
from vision_gt.stages.other_markers import family_instead


class NoLayoutError(GtvalError):
    """The images do not tell where the markers are on the robot."""


def network_of(begun: Begun, known: KnownBody | None) -> NetworkSolution:
    """The network; calibration images take part in its adjustment.

    Parameters
    ----------
    begun : Begun
        Boards and lenses. Cameras that nothing links become lacks.
    known : KnownBody or None
        Where the reference pattern lies; without it the frame is a camera's.

    Raises
    ------
    NoFrameError
        If no camera sees the reference pattern.
    """
    settings, boards, calibrations = begun.given.settings, begun.boards, begun.calibrations
    names = [name for name in begun.given.names if name in begun.cameras]
    origin = settings.reference.origin_near

    def views(purpose: str) -> tuple[BoardView, ...]:
        return tuple(view for view in boards.get(purpose, ()) if view.camera in names)

    while True:
        chosen = [v for name in names if name in calibrations for v in calibrations[name].views]
        network = NetworkInput(
            cameras=tuple(begun.cameras[name] for name in names),
            snapshots=views("network"),
            both=views("bar"),
            reference=views("reference") if known is not None else (),
            calibration=tuple(chosen) if all(name in calibrations for name in names) else (),
            bar=bar_of(settings.bar),
            known_reference=known,
            origin_near=None if origin is None else np.array(origin),
            corners=begun.given.corners,
        )
        try:
            return solve_network(network, joint=not settings.averaged_network)
        except NotLinkedError as error:
            lost = [name for name in error.missing if name in names]
            if not lost or len(lost) == len(names):
                raise
            said = str(error)
            text = f"{said[0].upper()}{said[1:]}. What {_whom(lost)} saw is left out."
            begun.lacks.append(Lack(_whom(lost), text))
            names = [name for name in names if name not in lost]


def bar_of(settings: BarSettings) -> Bar:
    """The double pattern as built; one without extent where no image shows it."""
    second = settings.second_on_first
    T = RigidTransform.identity() if second is None else placed(second)
    return Bar(T, np.array(settings.sigmas))


def _whom(cameras: Sequence[str]) -> str:
    return f"camera{'s' if len(cameras) > 1 else ''} {', '.join(cameras)}"


def layout_of(
    given: VisionInputs,
    frames: Sequence[Frame],
    detections: Mapping[tuple[str, str], Detection],
    cameras: Mapping[str, Camera],
    lacks: list[Lack],
) -> tuple[LayoutFit, Camera]:
    """The layout from the walk around the robot, or from the stops; and the camera it comes from.

    Raises
    ------
    NoLayoutError
        If neither tells where the markers are.
    """
    sides = sides_of(given.settings)
    try:
        if frames:
            walker = cameras[given.movie_camera]
            return fit_layout(frames, walker, sides, dima_of(given)), walker
        several: dict[str, list[Frame]] = {}
        for (camera, stop), found in detections.items():
            if len(found.views) > 1:
                several.setdefault(camera, []).append(Frame(f"stop {stop}", found.views))
        if not several:
            raise NoLayoutError("no image of the robot shows two of its markers")
        walker = cameras[max(several, key=lambda name: len(several[name]))]
        chosen = several[walker.name]
        try:
            return fit_layout(chosen, walker, sides, dima_of(given)), walker
        except UnlinkedMarkersError as error:
            known = {number: side for number, side in sides.items() if number not in error.missing}
            names = ", ".join(map(str, error.missing))
            lacks.append(Lack("markers", f"Of marker {names} the place on the robot is not known."))
            linked = [
                Frame(one.name, tuple(v for v in one.views if v.number in known)) for one in chosen
            ]
            return fit_layout(linked, walker, known, dima_of(given)), walker
    except GtvalError as error:
        raise NoLayoutError(_other_family(given) or str(error)) from error


def _other_family(given: VisionInputs) -> str:
    """What is said where the images show markers of another family; '' where they do not."""
    markers = given.settings.markers
    paths = [*(given.walk if given.images.movie else ()), *given.stop_images().values()]
    found = family_instead(paths, Family(markers.family, markers.border))
    if found is None:
        return ""
    name, border, ids = found
    wide = f" with a border of {border} cells" if border != markers.border else ""
    return (
        f"the images of the robot do not show markers of {markers.family}, as vision.markers "
        f"states, but of {name}{wide}, ids {listed_ids([str(one) for one in ids])}: correct "
        "vision.markers.family" + (" and border" if wide else "")
    )


def of_layout(
    given: VisionInputs, detections: Mapping[tuple[str, str], Detection], layout: Layout
) -> dict[tuple[str, str], Detection]:
    """Detections with those markers alone whose place is known; the others are rejected."""
    found = {}
    images = given.stop_images()
    for key, one in detections.items():
        known = tuple(view for view in one.views if view.number in layout.numbers)
        others = tuple(
            rejected("marker", "its place on the robot is not known", view.number, view.corners)
            for view in one.views
            if view.number not in layout.numbers
        )
        given.rejections.extend((given.shown(images[key]), other) for other in others)
        found[key] = replace(one, views=known, rejected=(*one.rejected, *others))
    return found


def dima_of(given: VisionInputs) -> tuple[int, RigidTransform, Array]:
    """The marker whose place on the robot was measured."""
    markers = given.settings.markers
    covariance = np.diag(np.square(markers.dima_sigmas))
    return stated(markers.dima), placed(markers.dima_on_robot), covariance
