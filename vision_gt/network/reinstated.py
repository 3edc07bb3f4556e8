"""Snapshots that were left out for poor poses of their boards, and fit the network all the same."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.spatial.transform import RigidTransform

from vision_gt.least_squares.adjustment import Knowledge, NotDeterminedError, adjust
from vision_gt.least_squares.setups import Setup, as_views
from vision_gt.network.adjustment import Network
from vision_gt.network.chain import PairLink
from vision_gt.optics.camera import stacked_parameters
from vision_gt.patterns.board_views import BoardView, camera_pose_of_board

_ALIKE = 2.0
"""Times the worst of the snapshots that agree, within which one that was left out fits, too. A
judgement: corners of one pair of cameras are alike, and wrong images are off by a hundred times."""


def reinstated(
    views: Sequence[BoardView], network: Network, links: Sequence[PairLink]
) -> list[PairLink]:
    """The links with those snapshots taken back whose corners fit the network.

    Parameters
    ----------
    views : sequence of BoardView
        Of all snapshots.
    network : Network
        By those that agree.
    links : sequence of PairLink
        As they are.

    Notes
    -----
    Snapshots are sorted out by what single boards give. A board of which a corner of the print is
    seen, or that is seen flat, gives a poor pose, though its corners are good.
    """
    by_body: dict[str, list[BoardView]] = {}
    for view in views:
        by_body.setdefault(view.body, []).append(view)
    patterns = RigidTransform.concatenate([RigidTransform.identity(), network.bar])
    done = []
    for link in links:
        if not link.outliers or len(link.snapshots) < 2:
            done.append(link)
            continue
        limit = _ALIKE * max(
            _misfits(by_body[name], link, network, patterns)[link.readings[name]]
            for name in link.snapshots
        )
        back = {}
        for snapshot in link.outliers:
            tried = _misfits(by_body[snapshot], link, network, patterns)
            best = min(tried, key=lambda reading: tried[reading], default=None)
            if best is not None and tried[best] < limit:
                back[snapshot] = best
        done.append(_with(link, back))
    return done


def _with(link: PairLink, back: Mapping[str, tuple[int, int]]) -> PairLink:
    """The link with some snapshots taken back."""
    return replace(
        link,
        snapshots=(*link.snapshots, *back),
        outliers=tuple(name for name in link.outliers if name not in back),
        readings={**link.readings, **back},
    )


def _misfits(
    views: Sequence[BoardView], link: PairLink, network: Network, patterns: RigidTransform
) -> dict[tuple[int, int], float]:
    """By the reading of either camera's boards: unit-variance residuals, the bar placed anew."""
    first = [view.readings() for view in views if view.camera == link.first]
    second = [view.readings() for view in views if view.camera == link.second]
    found = {}
    for i, j in product(*(range(min(map(len, some), default=0)) for some in (first, second))):
        read = [*(view[i] for view in first), *(view[j] for view in second)]
        found[i, j] = _misfit(read, network, patterns)
    return found


def _misfit(views: Sequence[BoardView], network: Network, patterns: RigidTransform) -> float:
    """Residuals in units of what was stated, with cameras and bar as they are."""
    largest = max(views, key=lambda view: len(view.ids))
    camera = network.cameras[network.index(largest.camera)]
    T = camera_pose_of_board(largest, camera)
    if T is None:
        return float("inf")
    T_gtv_body = network.T_gtv_camera[network.index(largest.camera)] * T
    start = T_gtv_body * patterns[largest.part].inv()
    setup = Setup.of(
        network.T_gtv_camera,
        stacked_parameters(network.cameras),
        RigidTransform.concatenate([start]),
        patterns,
    )
    seen = as_views(views, network.names, [views[0].body])
    try:
        done = adjust(seen, setup, Knowledge.nothing(setup))
    except NotDeterminedError:
        return float("inf")
    return float(np.sqrt((done.residuals**2).mean()))
