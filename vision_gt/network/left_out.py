"""Views of boards that took no part in calibrations and network, each with its reason."""

from collections.abc import Iterator, Mapping, Sequence

from vision_gt.network.exchanged import Exchange
from vision_gt.network.intrinsics import Calibration
from vision_gt.network.solution import NetworkSolution
from vision_gt.patterns.board_views import BoardView

_OUTLIER = "left out of the calibration: its corners fit worse than those of the other images"
_APART = "left out: it does not agree with the other snapshots of cameras {} and {}"
_MIXED = "left out: under a wrong name; {}"
_BAR = "left out: its two boards do not fit the bar"
_SINGLE = "only one of the bar's two boards was found: it says nothing about the bar"
_ALONE = "not used: the other camera does not show the bar at the same moment, or there is no pose"


def left_out_views(
    boards: Mapping[str, Sequence[BoardView]],
    calibrations: Mapping[str, Calibration],
    solution: NetworkSolution | None,
) -> Iterator[tuple[str, BoardView, str]]:
    """What each view was taken for, the view, and why it was not used.

    Parameters
    ----------
    boards : mapping of str to sequence of BoardView
        All views, by what their image was taken for.
    calibrations : mapping of str to Calibration
        By camera.
    solution : NetworkSolution or None
        The network.
    """
    for view in boards.get("calibration", ()):
        if view.camera in calibrations and view.source in calibrations[view.camera].outliers:
            yield "calibration", view, _OUTLIER
    if solution is None:
        return
    for view in boards.get("network", ()):
        why = _why_apart(view, solution)
        if why:
            yield "network", view, why
    for view in boards.get("bar", ()):
        reasons = ((solution.bar_outliers, _BAR), (solution.bar_single, _SINGLE))
        for names, reason in reasons:
            if view.source in names:
                yield "bar", view, reason


def _why_apart(view: BoardView, solution: NetworkSolution) -> str:
    """Why a view of a snapshot is not used; '' where it is."""
    for mixed in solution.exchanged:
        if view.camera in mixed.cameras and view.body in mixed.snapshots:
            return _MIXED.format(_pairs(mixed))
    for link in solution.links:
        if view.camera in {link.first, link.second} and view.body in link.outliers:
            return _APART.format(link.first, link.second)
    return _ALONE if view.source in solution.unused else ""


def _pairs(one: Exchange) -> str:
    """What an exchange is, in words."""
    if one.of_cameras:
        return f"each of {' and '.join(one.partners[0])} is the other camera's"
    return "; ".join(f"{a} and {b} show the same moment" for a, b in one.partners)
