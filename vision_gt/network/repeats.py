"""Images of a calibration that are one picture given again."""

from collections.abc import Sequence

import numpy as np

from vision_gt.patterns.board_views import BoardView

_SAME = 0.45
"""Of the corners' standard deviation, that the corners of one picture are apart where it is given
again: 0.1 to 0.35 in a video with each frame twice, which its codec changes a little. Two pictures
of a board at rest are apart by 1.4 times the noise, which was 0.55 and more of what is stated."""


def repeated(views: Sequence[BoardView]) -> dict[str, str]:
    """Images that are an earlier one again, and which: a video has each frame twice, a file a copy.

    As they say nothing new, to count them makes a lens look better known than it is.

    Parameters
    ----------
    views : sequence of BoardView
        Of one camera.
    """
    same: dict[str, str] = {}
    first: list[BoardView] = []
    for view in views:
        known = next((one for one in first if _is_same(one, view)), None)
        if known is None:
            first.append(view)
        else:
            same[view.source] = known.source
    return same


def _is_same(one: BoardView, two: BoardView) -> bool:
    if one.board != two.board or not np.array_equal(one.ids, two.ids):
        return False
    limit = _SAME * float(np.median(one.stated_sigmas))
    return bool(np.sqrt(np.mean((one.pixels - two.pixels) ** 2)) < limit)
