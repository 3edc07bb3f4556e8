"""Images of the robot at its stops, with what became of them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import RigidTransform

from vision_gt.campaign.findings import POOR_FIT, POOR_FLOOR, fate
from vision_gt.campaign.outcome import StopPose
from vision_gt.images.files import counting
from vision_gt.images.markers import Detection
from vision_gt.looks.look import Known, Look, marker_outlines
from vision_gt.patterns.rejections import Rejection
from vision_gt.robot.alone import pose_in_camera

MM = 1e3


@dataclass(frozen=True)
class StopView:
    """The pose of a stop by one camera, and what became of it.

    Parameters
    ----------
    T_gtv_robot : RigidTransform
        By this camera's image.
    p_value : float
        How likely so bad a fit of the corners is by chance.
    ambiguous : bool
        Whether another pose cannot be ruled out.
    floor_p : float
        How likely a robot on the floor looks so high or tilted by chance.
    used : bool
        Whether the stop's pose is this one, or comes of it and others.
    apart : float
        Metres from the stop's pose; NaN where the stop has none.
    apart_p : float
        How likely it fits and is so far away by chance; NaN where the stop has none.
    """

    T_gtv_robot: RigidTransform
    p_value: float
    ambiguous: bool
    floor_p: float
    used: bool
    apart: float
    apart_p: float


StopViews = Mapping[tuple[str, str], StopView]
"""By camera and stop."""


def stop_views(stops: Sequence[StopPose]) -> dict[tuple[str, str], StopView]:
    """The poses of all stops by all cameras."""
    views = {}
    for stop in stops:
        for camera, pose in stop.by_camera.items():
            used, apart, chance = fate(stop, camera)
            views[camera, stop.pose] = StopView(
                pose.T_gtv_robot, pose.p_value, pose.ambiguous, pose.floor_p, used, apart, chance
            )
    return views


def stop_looks(
    detections: Mapping[tuple[str, str], Detection],
    images: Mapping[tuple[str, str], str],
    views: StopViews,
    known: Known,
    odd: Mapping[str, Sequence[Rejection]],
) -> Iterator[Look]:
    """One image of the robot after the other, stop by stop.

    Parameters
    ----------
    detections : mapping of (str, str) to Detection
        By camera and stop.
    images : mapping of (str, str) to str
        Files, by the same.
    views : mapping of (str, str) to StopView
        Poses, by the same.
    known : Known
        Cameras and markers.
    odd : mapping of str to sequence of Rejection
        By the file: what is said of whole images.
    """
    chosen = {stop: view for (_, stop), view in views.items() if view.used}
    for camera, stop in sorted(detections, key=lambda key: (counting(key[1]), counting(key[0]))):
        found, own = detections[camera, stop], views.get((camera, stop))
        file, place = images[camera, stop], known.place(camera)
        whole = [one for one in odd.get(file, ()) if one.kind == "image"]
        shown = own if own is not None and own.used else chosen.get(stop, own)
        T = None if shown is None or place is None else place.inv() * shown.T_gtv_robot
        outlines = marker_outlines(
            found.views, known.cameras.get(camera), known.layout, T, known.cells
        )
        verdict, flagged = stop_verdict(own, found, sure=stop in chosen, solved=bool(views))
        yield Look(
            file,
            f"stop {stop}, camera {camera}",
            verdict,
            outlines,
            (*whole, *found.rejected),
            flagged or bool(whole),
        )


def stop_verdict(
    own: StopView | None, found: Detection, *, sure: bool, solved: bool
) -> tuple[str, bool]:
    """What became of an image of the robot, and whether it is to be looked at.

    Parameters
    ----------
    own : StopView or None
        The pose by this image.
    found : Detection
        Markers in it.
    sure : bool
        Whether the stop has a pose.
    solved : bool
        Whether any stop has.
    """
    if not found.views:
        return "no marker was read", not sure
    if not solved:
        return f"{len(found.views)} markers were read", False
    if own is None:
        return "its markers give no pose", True
    if own.used:
        return _used(own)
    if own.ambiguous or not sure:
        why = "ambiguous: two poses fit alike, so this one is not used"
        return (why if own.ambiguous else "no sure pose"), not sure
    said = "not used: another camera knows the pose better. The two are"
    said += f" {MM * own.apart:.1f} mm apart"
    if own.p_value < POOR_FIT:
        said += "; its corners fit worse than they should"
    elif own.apart_p < POOR_FIT:
        said += ", which does not fit (outlines are expected by the pose that is used)"
    return said, own.apart_p < POOR_FIT


def _used(own: StopView) -> tuple[str, bool]:
    """What is said of the pose that is used, and whether it is to be looked at."""
    x, y, _ = own.T_gtv_robot.translation
    turn = np.rad2deg(own.T_gtv_robot.rotation.as_euler("ZYX")[0])
    poor, off = own.p_value < POOR_FIT, own.floor_p < POOR_FLOOR
    said = [f"used: x {x:.3f} m, y {y:.3f} m, heading {turn:.1f} degrees"]
    said += ["the corners fit worse than they should"] * poor
    said += ["the robot does not stand on the floor as it should"] * off
    return "; ".join(said), poor or off


def single_look(
    file: str, camera: str, found: Detection, known: Known, whole: Sequence[Rejection] = ()
) -> Look:
    """An image of the robot by itself: a frame of a drive, or one of the walk around it.

    Parameters
    ----------
    file : str
        The image.
    camera : str
        That took it.
    found : Detection
        Markers in it.
    known : Known
        Cameras and markers.
    whole : sequence of Rejection
        What is said of the whole image.
    """
    taken_by = known.cameras.get(camera)
    both = None if taken_by is None or known.layout is None else (taken_by, known.layout)
    pose = None if both is None else pose_in_camera(both[0], found.views, both[1])
    T = None if pose is None else pose.T_gtv_robot
    outlines = marker_outlines(found.views, taken_by, known.layout, T, known.cells)
    verdict = f"{len(found.views)} markers read"
    if pose is not None and pose.ambiguous:
        verdict += "; two poses fit alike, the better one is drawn"
    return Look(file, f"camera {camera}", verdict, outlines, (*whole, *found.rejected), bool(whole))
