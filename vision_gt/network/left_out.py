"""Views of boards that took no part in calibrations and network, each with its reason."""

from collections.abc import Iterator, Mapping, Sequence

from vision_gt.network.intrinsics import Calibration
from vision_gt.network.solution import NetworkSolution
from vision_gt.patterns.board_views import BoardView

_OUTLIER = "left out of the calibration: its corners fit worse than those of the other images"
_APART = "left out: it does not agree with the other snapshots of cameras {} and {}"
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
        apart = [
            link
            for link in solution.links
            if view.camera in {link.first, link.second} and view.body in link.outliers
        ]
        if apart:
            yield "network", view, _APART.format(apart[0].first, apart[0].second)
        elif view.source in solution.unused:
            yield "network", view, _ALONE
    for view in boards.get("bar", ()):
        reasons = ((solution.bar_outliers, _BAR), (solution.bar_single, _SINGLE))
        for names, reason in reasons:
            if view.source in names:
                yield "bar", view, reason
