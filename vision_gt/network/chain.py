"""The camera network's start: pairs of cameras linked by boards, chained over the best tree.

This is the way of AD2.3, "Calibration of the camera network": camera_i, pattern_1, bar,
pattern_2, camera_j for each snapshot, the mean over the snapshots, and the chain to the first
camera. It starts the joint adjustment and is what remains where that is not wanted.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.transform import RigidTransform

from validation.errors import GtvalError
from validation.poses.angles import Array
from vision_gt.optics.agreement import (
    chain_to_root,
    distances,
    largest_agreement,
    strongest_tree,
)
from vision_gt.optics.camera import Camera
from vision_gt.optics.transforms import angle_between, mean_transform
from vision_gt.patterns.board_views import BoardView, camera_pose_of_board

_FAR = 0.15, float(np.deg2rad(5.0))
"""Estimates of one camera pair that differ by more (metres, radians) do not agree. Single boards
give a camera's place to centimetres; a wrong board, corner order or file gives something metres
away."""
_LEAST_FOR_SCATTER = 4
"""A judgement: of three snapshots no scatter can be told."""
_STRAY, _STRAY_LENGTH, _STRAY_ANGLE = 6.0, 0.01, np.deg2rad(0.4)
"""A snapshot is left out if it is so many times farther off than the median one, and so far
(metres, radians). A judgement: of normal scatter in six dimensions none is six medians off, and
single boards are good to less than a centimetre and 0.4 degrees."""

_SCATTER = 3.0
"""Times the root mean square scatter of a link within which another estimate is the same."""

_Estimates = list[tuple[RigidTransform, tuple[int, int]]]
"""Of one camera relative to another by one snapshot, with the reading of each board."""


class NotLinkedError(GtvalError):
    """Some cameras have no chain of views to the reference.

    Parameters
    ----------
    text : str
        What is said.
    missing : tuple of str
        The cameras.
    """

    def __init__(self, text: str, missing: Sequence[str] = ()) -> None:
        super().__init__(text)
        self.missing = tuple(missing)


@dataclass(frozen=True)
class BoardPose:
    """A board as one camera saw it in one snapshot.

    Parameters
    ----------
    camera : str
        Who saw it.
    snapshot : str
        Of what moment; views of one snapshot show the same rigid bar.
    T_camera_bar : sequence of RigidTransform
        The bar's frame by each possible reading of the board: two for a print that looks the
        same after half a turn.
    corners : int
        So many were seen.
    """

    camera: str
    snapshot: str
    T_camera_bar: Sequence[RigidTransform]
    corners: int


def bar_poses(
    views: Sequence[BoardView], cameras: Sequence[Camera], T_bar_patterns: RigidTransform
) -> list[BoardPose]:
    """The bar as each view shows it, by all readings of the boards.

    Parameters
    ----------
    views : sequence of BoardView
        Of the network's snapshots.
    cameras : sequence of Camera
        With their intrinsic parameters.
    T_bar_patterns : RigidTransform
        Stack of two: where the patterns are on the bar.
    """
    by_name = {camera.name: camera for camera in cameras}
    poses = []
    for view in views:
        T = camera_pose_of_board(view, by_name[view.camera])
        if T is None:
            continue
        T_pattern_bar = T_bar_patterns[view.part].inv()
        readings = [T * T_pattern_bar]
        if view.board.looks_the_same_turned:
            readings.append(T * view.board.half_turn * T_pattern_bar)
        poses.append(BoardPose(view.camera, view.body, readings, len(view.ids)))
    return poses


@dataclass(frozen=True)
class PairLink:
    """One camera relative to another, from all snapshots that both saw.

    Parameters
    ----------
    first, second : str
        The cameras.
    T_first_second : RigidTransform
        Mean over the snapshots that agree.
    snapshots : tuple of str
        Those that agree.
    outliers : tuple of str
        Those that do not: a wrong file, a board that moved between the two exposures.
    readings : mapping of str to (int, int)
        For each agreeing snapshot which reading of each board it needs.
    spread : (2,) array
        Standard deviations of the agreeing estimates: metres (length), radians (angle).
    ambiguous : bool
        Whether another transform has as many snapshots for it.
    """

    first: str
    second: str
    T_first_second: RigidTransform
    snapshots: tuple[str, ...]
    outliers: tuple[str, ...]
    readings: Mapping[str, tuple[int, int]]
    spread: Array
    ambiguous: bool


def pair_links(poses: Sequence[BoardPose]) -> list[PairLink]:
    """A link for each pair of cameras with common snapshots.

    Parameters
    ----------
    poses : sequence of BoardPose
        All the board views of the network's images. Of several boards in an image the one of
        which most is seen counts: few corners, as of a board that is cut off, give a poor pose.
    """
    seen: dict[tuple[str, str], dict[str, _Estimates]] = {}
    by_snapshot: dict[str, list[BoardPose]] = {}
    for pose in best_seen(poses).values():
        by_snapshot.setdefault(pose.snapshot, []).append(pose)
    for snapshot, views in by_snapshot.items():
        for a, b in product(views, views):
            if a.camera < b.camera:
                seen.setdefault((a.camera, b.camera), {})[snapshot] = estimates(a, b)
    return [_link(pair, some) for pair, some in sorted(seen.items())]


def best_seen(poses: Sequence[BoardPose]) -> dict[tuple[str, str], BoardPose]:
    """By camera and snapshot the board of which most corners were seen."""
    best: dict[tuple[str, str], BoardPose] = {}
    for pose in poses:
        key = pose.camera, pose.snapshot
        if key not in best or pose.corners > best[key].corners:
            best[key] = pose
    return best


def estimates(a: BoardPose, b: BoardPose) -> _Estimates:
    """T_a_b for every reading of the two boards."""
    readings = product(range(len(a.T_camera_bar)), range(len(b.T_camera_bar)))
    return [(a.T_camera_bar[i] * b.T_camera_bar[j].inv(), (i, j)) for i, j in readings]


def _link(pair: tuple[str, str], seen: Mapping[str, _Estimates]) -> PairLink:
    """The transform that most snapshots agree on, and their mean."""
    names = list(seen)
    listed = [(name, T, reading) for name in names for T, reading in seen[name]]
    stack = RigidTransform.concatenate([T for _, T, _ in listed])
    owner = np.array([names.index(name) for name, _, _ in listed])
    rows, rival = largest_agreement(stack, owner, _FAR)
    chosen = _without_strays(stack, rows)
    kept = {listed[row][0]: listed[row][2] for row in chosen}
    members = stack[chosen]
    mean = mean_transform(members)
    return PairLink(
        *pair,
        mean,
        tuple(kept),
        tuple(name for name in names if name not in kept),
        kept,
        _spread(members, mean),
        ambiguous=(2 * rival > len(rows) and len(names) > 1)
        or (len(names) == 1 and len(stack) > 1),
    )


def agrees(T: RigidTransform, link: PairLink) -> bool:
    """Whether an estimate is within the scatter of a link's snapshots."""
    off = T.translation - link.T_first_second.translation
    angle = float(np.ravel(angle_between(T, link.T_first_second))[0])
    length = float(np.linalg.norm(off))
    limits = np.maximum(_SCATTER * link.spread, [_STRAY_LENGTH, _STRAY_ANGLE])
    return bool(length <= limits[0] and angle <= limits[1])


def _without_strays(stack: RigidTransform, chosen: list[int]) -> list[int]:
    """Rows without those far from the others' scatter.

    Cameras that face each other look nearly alike with their images exchanged: only the scatter
    of the good snapshots, which is much smaller than a first look must allow, tells.
    """
    if len(chosen) < _LEAST_FOR_SCATTER:
        return chosen
    members = stack[chosen]
    middle = members[int(np.argmin(distances(members, _FAR).sum(1)))]
    lengths = np.linalg.norm(members.translation - middle.translation, axis=1)
    angles = angle_between(members, middle)
    good = (lengths <= max(_STRAY * float(np.median(lengths)), _STRAY_LENGTH)) & (
        angles <= max(_STRAY * float(np.median(angles)), _STRAY_ANGLE)
    )
    return [row for row, fine in zip(chosen, good, strict=True) if fine]


def _spread(members: RigidTransform, mean: RigidTransform) -> Array:
    """Standard deviations of length and angle about the mean."""
    lengths = np.linalg.norm(members.translation - mean.translation, axis=1)
    return np.sqrt([np.mean(lengths**2), np.mean(angle_between(members, mean) ** 2)])


@dataclass(frozen=True)
class Chain:
    """Cameras in the frame of the reference camera.

    Parameters
    ----------
    T_reference_camera : mapping of str to RigidTransform
        Of each camera.
    parents : mapping of str to str
        The camera through which each is chained; the reference has none.
    """

    T_reference_camera: Mapping[str, RigidTransform]
    parents: Mapping[str, str]

    def path(self, camera: str) -> tuple[str, ...]:
        """Cameras from one to the reference."""
        return chain_to_root(camera, self.parents)


def chain_cameras(
    cameras: Sequence[str],
    links: Sequence[PairLink],
    reference: str,
    why: Callable[[], str] = lambda: "",
) -> Chain:
    """All cameras chained to the reference over the tree of the strongest links.

    Parameters
    ----------
    cameras : sequence of str
        All that must be linked.
    links : sequence of PairLink
        Weighted by their agreeing snapshots.
    reference : str
        The camera that sees the reference pattern.
    why : callable
        Asked what is probably wrong, as a sentence, where some camera is not linked.

    Raises
    ------
    NotLinkedError
        Naming every camera without a chain to the reference.
    """
    usable = [link for link in links if link.snapshots and not link.ambiguous]
    found, parents = strongest_tree(
        reference, [(u.first, u.second, u.T_first_second, len(u.snapshots)) for u in usable]
    )
    missing = [camera for camera in cameras if camera not in found]
    if missing:
        raise NotLinkedError(_missing_sentence(missing, links, reference, why()), missing)
    return Chain({camera: found[camera] for camera in cameras}, parents)


def _missing_sentence(
    missing: Sequence[str], links: Sequence[PairLink], reference: str, why: str
) -> str:
    """Which cameras are not linked, and why where something was seen."""
    said = (
        f"no chain of views links camera{'s' if len(missing) > 1 else ''} {', '.join(missing)} to "
        f"camera {reference}, which sees the reference pattern"
    )
    if why:
        return f"{said}. Probably {why}"
    doubtful = [link for link in links if link.ambiguous]
    if doubtful:
        pairs = ", ".join(f"{link.first}-{link.second}" for link in doubtful)
        said += (
            f"; the snapshots of {pairs} do not decide between two positions (take more, with "
            "the bar in different directions, or use boards that do not look the same turned)"
        )
    return said + ". Take snapshots of the double pattern with a neighbouring camera"
