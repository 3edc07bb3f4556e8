"""Images of boards, with what became of them."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.spatial.transform import RigidTransform

from vision_gt.figures.boards import rim_of
from vision_gt.looks.look import NOWHERE, Known, Look, Outline, closed, median_off
from vision_gt.optics.camera import Camera, project
from vision_gt.patterns.board_views import BoardView, camera_pose_of_board
from vision_gt.patterns.rejections import Rejection

OF_BAR = ("network", "bar")
"""What images of the bar's two boards are taken for."""
_AXIS = 2.0
"""Squares that an axis is drawn long."""
_TIPS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, -1]])
"""z points into the board, so that its axis is drawn the other way, towards the viewer."""
_PARTS = ("first board", "second board")


def board_looks(
    purpose: str,
    views: Mapping[str, Sequence[BoardView]],
    titles: Mapping[str, str],
    known: Known,
    rejections: Mapping[str, Sequence[Rejection]],
) -> Iterator[Look]:
    """Images of boards.

    Parameters
    ----------
    purpose : str
        What they were taken for: 'network', 'calibration', ...
    views : mapping of str to sequence of BoardView
        By image, relative to the campaign: what was found in it.
    titles : mapping of str to str
        Of those images that are wanted.
    known : Known
        The cameras.
    rejections : mapping of str to sequence of Rejection
        By image.
    """
    by_body: dict[str, list[BoardView]] = {}
    for view in (one for some in views.values() for one in some):
        by_body.setdefault(view.body, []).append(view)
    for image, title in titles.items():
        own, left = views.get(image, ()), tuple(rejections.get(image, ()))
        outlines = []
        for view in own:
            others = by_body[view.body] if purpose in OF_BAR else ()
            name = _PARTS[view.part] if purpose in OF_BAR else "board"
            outlines.append(board_outline(view, name, others, known))
        reasons = [one.reason for one in left if one.kind in {"board", "image"}]
        corners = sum(len(view.ids) for view in own)
        said = "; ".join(dict.fromkeys(reasons)) or f"used, {corners} corners"
        yield Look(image, title, said, tuple(outlines), left, bool(reasons))


def board_outline(view: BoardView, name: str, others: Sequence[BoardView], known: Known) -> Outline:
    """A board as it was found, and its rim where it should be.

    Parameters
    ----------
    view : BoardView
        As detected.
    name : str
        Of the board.
    others : sequence of BoardView
        Of the same bar at the same moment: by them it is expected; where there are none, by its
        own pose.
    known : Known
        The cameras.
    """
    camera = known.cameras.get(view.camera)
    if camera is None:
        return Outline(name, NOWHERE, NOWHERE, view.pixels)
    tried = [
        outline_at(reading, name, camera, T)
        for T in _expected(view, others, known)
        for reading in view.readings()
    ]
    seen = [one for one in tried if len(one.expected)]
    return min(seen, key=lambda one: one.off, default=Outline(name, NOWHERE, NOWHERE, view.pixels))


def outline_at(
    view: BoardView, name: str, camera: Camera, T_camera_board: RigidTransform
) -> Outline:
    """A board as it was found, and its rim where a pose has it; no rim behind the camera."""
    with np.errstate(invalid="ignore"):
        rim = T_camera_board.apply(closed(rim_of(view.board)[:-1]))
        outline = project(rim, camera.parameters)
        seen = project(T_camera_board.apply(view.points), camera.parameters)
        tips = T_camera_board.apply(_AXIS * view.board.square * _TIPS)
        axes = project(tips, camera.parameters)
    off = median_off(view.pixels, seen)
    if not np.isfinite(outline).all() or not np.isfinite(axes).all():
        return Outline(name, NOWHERE, NOWHERE, view.pixels, off)
    return Outline(name, NOWHERE, outline, view.pixels, off, axes)


def _expected(
    view: BoardView, others: Sequence[BoardView], known: Known
) -> Iterator[RigidTransform]:
    """T_camera_board by all readings of the other views, or else by the view's own pose."""
    place, found = known.place(view.camera), False
    for other in others:
        there, camera = known.place(other.camera), known.cameras.get(other.camera)
        same = (other.camera, other.part) == (view.camera, view.part)
        if same or place is None or there is None or camera is None:
            continue
        for reading in other.readings():
            T = camera_pose_of_board(reading, camera)
            if T is not None:
                found = True
                T_gtv_bar = there * T * known.bar[other.part].inv()
                yield place.inv() * T_gtv_bar * known.bar[view.part]
    camera = known.cameras.get(view.camera)
    own = None if camera is None or found else camera_pose_of_board(view, camera)
    if own is not None:
        yield own
