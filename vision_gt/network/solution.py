"""The camera network of a campaign: links, chain, readings of the boards, joint adjustment."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from scipy.linalg import block_diag
from scipy.spatial.transform import RigidTransform

from validation.errors import GtvalError
from validation.pieces.results import kept_result
from validation.poses.angles import Array
from vision_gt.least_squares.setups import CAMERA_UNKNOWNS, camera_slots
from vision_gt.network.adjustment import Bar, KnownBody, Network, adjust_network
from vision_gt.network.chain import (
    Chain,
    PairLink,
    bar_poses,
    chain_cameras,
    pair_links,
)
from vision_gt.network.exchanged import Exchange, exchanged_snapshots, why_not_linked
from vision_gt.network.reinstated import reinstated
from vision_gt.optics.agreement import strongest_tree
from vision_gt.optics.camera import Camera
from vision_gt.optics.planar_pose import planar_solutions
from vision_gt.optics.transforms import angle_between, composition_jacobians
from vision_gt.patterns.board_views import BoardView, camera_pose_of_board

REFERENCE = "reference"
"""Name of the reference pattern's body."""
_ALONG = float(np.cos(np.pi / 4))
_FAR_FROM_BAR = 0.1, float(np.deg2rad(6))
"""Metres and radians, besides five of the stated sigmas, from which on two boards do not fit the
bar. A judgement: poses of single boards are good to centimetres; wrong readings are a board's
length off."""


class NoFrameError(GtvalError):
    """No camera sees the reference pattern."""


@dataclass(frozen=True)
class NetworkInput:
    """All that the network is computed from.

    Parameters
    ----------
    cameras : tuple of Camera
        With start values of their intrinsic parameters.
    snapshots : tuple of BoardView
        Of the double pattern, and of single boards seen by several cameras.
    both : tuple of BoardView
        Of images that show both boards of the bar.
    reference : tuple of BoardView
        Of the reference pattern, one for each camera that sees it.
    calibration : tuple of BoardView
        Of single boards, each body seen by one camera.
    bar : Bar
        The double pattern as built.
    known_reference : KnownBody or None
        Where the reference pattern lies; without it the frame is that of a camera.
    origin_near : (2,) array, optional
        Pixel near the reference pattern's first corner, in the image where it is largest.
    corners : mapping of str to (1 or 2, 2) array
        By camera, before that: such a pixel of its image, and one farther along the row.
    """

    cameras: tuple[Camera, ...]
    snapshots: tuple[BoardView, ...]
    both: tuple[BoardView, ...]
    reference: tuple[BoardView, ...]
    calibration: tuple[BoardView, ...]
    bar: Bar
    known_reference: KnownBody | None
    origin_near: Array | None = None
    corners: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class NetworkSolution:
    """The network with how it came about.

    Parameters
    ----------
    network : Network
        The result.
    averaged : Network
        The document's way: means of the pairs, chained.
    links : tuple of PairLink
        All pairs.
    chain : Chain
        The tree used.
    reference : str
        The camera that the chain starts from.
    bar_outliers : tuple of str
        Images of both boards that do not fit the bar.
    bar_single : tuple of str
        Images in which only one of them was found.
    unused : tuple of str
        Other images of boards that took no part: no camera saw the same moment, or the board
        gives no pose.
    left_out : tuple of BoardView
        Both boards of the images that do not fit the bar.
    exchanged : tuple of Exchange
        Snapshots that were left out, and agree under other names.
    """

    network: Network
    averaged: Network
    links: tuple[PairLink, ...]
    chain: Chain
    reference: str
    bar_outliers: tuple[str, ...] = field(default=())
    bar_single: tuple[str, ...] = field(default=())
    unused: tuple[str, ...] = field(default=())
    left_out: tuple[BoardView, ...] = field(default=(), repr=False)
    exchanged: tuple[Exchange, ...] = field(default=())


@kept_result()
def solve_network(given: NetworkInput, *, joint: bool = True) -> NetworkSolution:
    """The cameras in the GTV frame.

    Parameters
    ----------
    given : NetworkInput
        Images' contents and what is known.
    joint : bool
        Whether to adjust everything together; otherwise the averaged chain is the result.

    Raises
    ------
    NotLinkedError
        Naming cameras that nothing links to the reference.
    NoFrameError
        If the reference pattern is not seen.
    GtvalError
        If it looks the same turned and nothing says how it lies.

    Notes
    -----
    Without a reference pattern the frame is that of the camera to which most others are linked.
    """
    names = [camera.name for camera in given.cameras]
    reference = [] if given.known_reference is None else _read_reference(given)
    poses = bar_poses(given.snapshots, given.cameras, given.bar.patterns)
    links = pair_links(poses)
    root = reference[0].camera if reference else middle_camera(names, links)
    snapped = (given.snapshots, given.cameras, given.bar.patterns)
    chain = chain_cameras(names, links, root, lambda: why_not_linked(*snapped))
    T_gtv_root = _reference_camera(reference, given)
    T_gtv_camera = {name: T_gtv_root * chain.T_reference_camera[name] for name in names}
    _check_corners(reference, given, T_gtv_camera)
    averaged = _averaged(given, links, chain, T_gtv_camera)
    if not joint:
        return NetworkSolution(averaged, averaged, tuple(links), chain, root)
    both, left, single = _fitting_bar(given)
    rest = [*both, *reference, *given.calibration]
    network = _adjusted(given, links, rest, T_gtv_camera, root)
    fitting = reinstated(given.snapshots, network, links)
    if fitting != links:
        links = fitting
        network = _adjusted(given, links, rest, T_gtv_camera, root)
    unused = _unused(given, network, [name for link in links for name in link.outliers])
    unused = tuple(name for name in unused if name not in {*left, *single})
    misfits = tuple(v for v in given.both if (v.source or v.body) in left)
    mixed = exchanged_snapshots(*snapped, links)
    return NetworkSolution(
        network, averaged, tuple(links), chain, root, left, single, unused, misfits, tuple(mixed)
    )


def _adjusted(
    given: NetworkInput,
    links: Sequence[PairLink],
    rest: Sequence[BoardView],
    T_gtv_camera: Mapping[str, RigidTransform],
    root: str,
) -> Network:
    """The network of the snapshots that agree, and the rest."""
    return adjust_network(
        given.cameras,
        T_gtv_camera,
        [*_as_read(given.snapshots, links), *rest],
        {} if given.known_reference is None else {REFERENCE: given.known_reference},
        given.bar,
        free_intrinsics=bool(given.calibration),
        frame=root if given.known_reference is None else "",
    )


def _unused(given: NetworkInput, network: Network, outliers: Sequence[str]) -> tuple[str, ...]:
    """Images that the adjustment did not use, outliers apart."""
    used = {(view.camera, view.body, view.part) for view in network.views}
    views = [*given.snapshots, *given.both, *given.reference, *given.calibration]
    left = [v for v in views if (v.camera, v.body, v.part) not in used and v.body not in outliers]
    return tuple(dict.fromkeys(view.source or view.body for view in left))


def _read_reference(given: NetworkInput) -> list[BoardView]:
    """The reference views by the right reading, the one with the largest pattern first."""
    if not given.reference:
        raise NoFrameError("no image shows the reference pattern, so the cameras have no frame")
    views = sorted(given.reference, key=lambda view: -float(np.ptp(view.pixels, axis=0).prod()))
    if not views[0].board.looks_the_same_turned:
        return views
    told = dict(given.corners)
    if given.origin_near is not None:
        told.setdefault(views[0].camera, np.asarray(given.origin_near, dtype=float)[None])
    known = [view for view in views if view.camera in told]
    if not known:
        raise GtvalError(
            "the reference pattern looks the same after half a turn; click its first corner in "
            "the image of a camera (`gtval open`, Images; or `gtval vision decide`), give the "
            f"pixel near it in the image of camera {views[0].camera} as "
            "vision.reference.origin_near, or use a board with an odd and an even side"
        )
    return [read_from(view, told[view.camera]) for view in known]


def read_from(view: BoardView, places: Array) -> BoardView:
    """The reading of a view whose first corner is nearest to a pixel.

    Parameters
    ----------
    view : BoardView
        Of the reference pattern.
    places : (1 or 2, 2) array
        A pixel near its first inner corner, and another along its rows, towards their end.

    Raises
    ------
    GtvalError
        If the second pixel lies another way: the two are no corner and row of this pattern.

    Notes
    -----
    A row and a column of a print are a quarter turn apart, and seldom less than 45 degrees in an
    image: half of that is the limit.
    """
    chosen = min(view.readings(), key=lambda one: float(np.linalg.norm(one.ends[0] - places[0])))
    if len(places) > 1:
        along, clicked = chosen.ends[1] - chosen.ends[0], places[1] - places[0]
        lengths = np.linalg.norm(along) * np.linalg.norm(clicked)
        if along @ clicked < _ALONG * lengths:
            raise GtvalError(
                f"camera {view.camera}: the two pixels clicked in its image of the reference "
                "pattern are no first corner and row of it (x axis); click them again, or count "
                "the columns and rows of vision.reference.board"
            )
    return chosen


def middle_camera(names: Sequence[str], links: Sequence[PairLink]) -> str:
    """The camera to which most others are linked by chains, over most snapshots."""
    usable = [link for link in links if link.snapshots and not link.ambiguous]

    def reach(name: str) -> tuple[int, int]:
        steps = [(u.first, u.second, u.T_first_second, len(u.snapshots)) for u in usable]
        own = sum(len(u.snapshots) for u in usable if name in {u.first, u.second})
        return len(strongest_tree(name, steps)[0]), own

    return max(names, key=reach)


def _reference_camera(views: Sequence[BoardView], given: NetworkInput) -> RigidTransform:
    """T_gtv_camera of the camera from which the chains begin."""
    if given.known_reference is None:
        return RigidTransform.identity()
    view = views[0]
    camera = next(c for c in given.cameras if c.name == view.camera)
    T = camera_pose_of_board(view, camera)
    if T is None:
        raise NoFrameError(f"camera {view.camera}: the reference pattern gives no pose")
    return given.known_reference.T_gtv_body * T.inv()


def _check_corners(
    reference: Sequence[BoardView],
    given: NetworkInput,
    T_gtv_camera: Mapping[str, RigidTransform],
) -> None:
    """Raise where the corners clicked in the images of two cameras contradict each other."""
    known = given.known_reference
    cameras = {camera.name: camera for camera in given.cameras}
    for view in reference[1:]:
        T = camera_pose_of_board(view, cameras[view.camera])
        if known is None or T is None:
            continue
        turn = known.T_gtv_body.inv() * T_gtv_camera[view.camera] * T
        if turn.rotation.magnitude() > np.pi / 2:  # half a turn, where a right one is none
            raise GtvalError(
                f"the first corner of the reference pattern in the image of camera {view.camera} "
                f"is another one than in that of camera {reference[0].camera}; click both again"
            )


def _as_read(views: Sequence[BoardView], links: Sequence[PairLink]) -> list[BoardView]:
    """Snapshots that agree, by the readings that make them agree."""
    readings: dict[tuple[str, str], int] = {}
    for link in links:
        for snapshot, (one, other) in link.readings.items():
            readings[link.first, snapshot] = one
            readings[link.second, snapshot] = other
    return [
        view.readings()[readings[view.camera, view.body]]
        for view in views
        if (view.camera, view.body) in readings
    ]


def _fitting_bar(
    given: NetworkInput,
) -> tuple[list[BoardView], tuple[str, ...], tuple[str, ...]]:
    """Views of both boards, by the readings that fit the bar as built.

    Then the images whose boards do not fit it, and those that show only one of them.
    """
    by_image: dict[str, list[BoardView]] = {}
    for view in given.both:
        by_image.setdefault(view.body, []).append(view)
    cameras = {camera.name: camera for camera in given.cameras}
    kept: list[BoardView] = []
    left, single = [], []
    for body, views in by_image.items():
        name = views[0].source or body
        if len({view.part for view in views}) < 2:
            single.append(name)
            continue
        chosen = _fitting_pair(views, cameras, given.bar)
        if chosen is None:
            left.append(name)
        else:
            kept += chosen
    return kept, tuple(left), tuple(single)


def _fitting_pair(
    views: Sequence[BoardView], cameras: Mapping[str, Camera], bar: Bar
) -> list[BoardView] | None:
    """The two views of one image, read so that they fit the bar; None if they cannot."""
    first = [reading for view in views if view.part == 0 for reading in view.readings()]
    second = [reading for view in views if view.part == 1 for reading in view.readings()]
    best, least = None, 1.0
    for one, other in product(first, second):
        off = _bar_misfit(one, other, cameras, bar)
        if off < least:
            best, least = [one, other], off
    return best


def _bar_misfit(one: BoardView, other: BoardView, cameras: Mapping[str, Camera], bar: Bar) -> float:
    """How far two boards are from their places on the bar, 1 being too far."""
    least = np.inf
    solutions = [
        planar_solutions(view.points, view.pixels, cameras[view.camera].parameters)
        for view in (one, other)
    ]
    if solutions[0] is None or solutions[1] is None:
        return least
    T = solutions[0].best.inv() * solutions[1].best
    length = np.linalg.norm(T.translation - bar.T_first_second.translation)
    angle = angle_between(T, bar.T_first_second)
    sigmas = bar.sigmas
    return float(
        max(
            length / (_FAR_FROM_BAR[0] + 5 * sigmas[:3].max()),
            angle / (_FAR_FROM_BAR[1] + 5 * sigmas[3:].max()),
        )
    )


def _averaged(
    given: NetworkInput,
    links: Sequence[PairLink],
    chain: Chain,
    T_gtv_camera: Mapping[str, RigidTransform],
) -> Network:
    """The chained means as a network, with the covariance that the spreads give.

    Each link's mean has the spread of its snapshots over the root of their number; what the
    bar's own error adds is common to all of them and enters in full.
    """
    names = [camera.name for camera in given.cameras]
    covariance = np.zeros((CAMERA_UNKNOWNS * len(names),) * 2)
    known = given.known_reference
    own = {chain.path(names[0])[-1]: np.zeros((6, 6)) if known is None else known.covariance}
    by_pair = {(link.first, link.second): link for link in links}
    for name in sorted(names, key=lambda n: len(chain.path(n))):
        parent = chain.parents.get(name)
        if parent is None:
            continue
        link = by_pair.get((parent, name)) or by_pair[name, parent]
        step = T_gtv_camera[parent].inv() * T_gtv_camera[name]
        by_parent, by_step = composition_jacobians(T_gtv_camera[parent], step)
        spread = np.repeat(np.square(link.spread) / 3, 3) / len(link.snapshots)
        spread = spread + np.square(given.bar.sigmas) + 1e-10
        own[name] = by_parent @ own[parent] @ by_parent.T + by_step @ np.diag(spread) @ by_step.T
    for i, camera in enumerate(given.cameras):
        slots = camera_slots(i)
        covariance[slots, slots] = block_diag(own[camera.name], camera.covariance)
    return Network(
        tuple(given.cameras),
        RigidTransform.concatenate([T_gtv_camera[name] for name in names]),
        covariance,
        given.bar.T_first_second,
        np.diag(np.square(given.bar.sigmas)),
        0.0,
    )
