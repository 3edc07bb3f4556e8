"""The camera network's start: pairs of cameras linked by boards, chained over the best tree.

This is the way of AD2.3, "Calibration of the camera network": camera_i, pattern_1, bar,
pattern_2, camera_j for each snapshot, the mean over the snapshots, and the chain to the first
camera. It starts the joint adjustment and is what remains where that is not wanted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.transform import RigidTransform

from validation.errors import GtvalError
from validation.poses.angles import Array
from vision_gt.optics.camera import Camera
from vision_gt.optics.transforms import angle_between, mean_transform
from vision_gt.patterns.board_views import BoardView, camera_pose_of_board

_FAR_LENGTH = 0.15
_FAR_ANGLE = np.deg2rad(5.0)
"""Estimates of one camera pair that differ by more do not agree. Single boards give a camera's
place to centimetres; a wrong board, corner order or file gives something metres away."""


_LEAST_FOR_SCATTER = 4
_STRAY, _STRAY_LENGTH, _STRAY_ANGLE = 6.0, 0.01, np.deg2rad(0.4)
"""A snapshot is left out if it is so many times farther off than the median one, and so far."""


class NotLinkedError(GtvalError):
    """Some cameras have no chain of views to the reference."""


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
    """

    camera: str
    snapshot: str
    T_camera_bar: Sequence[RigidTransform]


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
        poses.append(BoardPose(view.camera, view.body, readings))
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
        All the board views of the network's images.
    """
    seen: dict[tuple[str, str], dict[str, list[tuple[RigidTransform, tuple[int, int]]]]] = {}
    by_snapshot: dict[str, list[BoardPose]] = {}
    for pose in poses:
        by_snapshot.setdefault(pose.snapshot, []).append(pose)
    for snapshot, views in by_snapshot.items():
        for a, b in product(views, views):
            if a.camera < b.camera:
                seen.setdefault((a.camera, b.camera), {})[snapshot] = _estimates(a, b)
    return [_link(pair, estimates) for pair, estimates in sorted(seen.items())]


def _estimates(a: BoardPose, b: BoardPose) -> list[tuple[RigidTransform, tuple[int, int]]]:
    """T_a_b for every reading of the two boards."""
    readings = product(range(len(a.T_camera_bar)), range(len(b.T_camera_bar)))
    return [(a.T_camera_bar[i] * b.T_camera_bar[j].inv(), (i, j)) for i, j in readings]


def _link(
    pair: tuple[str, str],
    estimates: Mapping[str, Sequence[tuple[RigidTransform, tuple[int, int]]]],
) -> PairLink:
    """The transform that most snapshots agree on, and their mean."""
    snapshots = list(estimates)
    stack = RigidTransform.concatenate([T for s in snapshots for T, _ in estimates[s]])
    owner = np.concatenate([np.full(len(estimates[s]), k) for k, s in enumerate(snapshots)])
    apart = _apart(stack)
    # For each candidate: how far is the nearest reading of every snapshot, one at most.
    nearest = np.stack(
        [np.minimum(apart[:, owner == k].min(1), 1.0) for k in range(len(snapshots))], axis=1
    )
    misfit = nearest.sum(1)
    best = int(np.argmin(misfit))
    chosen, kept, outliers = [], {}, []
    for k, snapshot in enumerate(snapshots):
        rows = np.flatnonzero(owner == k)
        row = rows[np.argmin(apart[best, rows])]
        if apart[best, row] < 1:
            chosen.append(int(row))
            kept[snapshot] = estimates[snapshot][int(row - rows[0])][1]
        else:
            outliers.append(snapshot)
    chosen, kept, stray = _without_strays(stack, chosen, kept)
    outliers += stray
    support = (nearest < 1).sum(1)
    others = apart[best] > 1
    rival = int(support[others].max(initial=0))
    members = stack[chosen]
    mean = mean_transform(members)
    return PairLink(
        *pair,
        mean,
        tuple(kept),
        tuple(outliers),
        kept,
        _spread(members, mean),
        ambiguous=(2 * rival > support[best] and len(snapshots) > 1)
        or (len(snapshots) == 1 and len(stack) > 1),
    )


def _without_strays(
    stack: RigidTransform, chosen: list[int], kept: dict[str, tuple[int, int]]
) -> tuple[list[int], dict[str, tuple[int, int]], list[str]]:
    """Members without those far from the others' scatter, and the snapshots left out.

    Cameras that face each other look nearly alike with their images exchanged: only the scatter
    of the good snapshots, which is much smaller than a first look must allow, tells.
    """
    if len(chosen) < _LEAST_FOR_SCATTER:
        return chosen, kept, []
    members = stack[chosen]
    middle = members[int(np.argmin(_apart(members).sum(1)))]
    lengths = np.linalg.norm(members.translation - middle.translation, axis=1)
    angles = angle_between(members, middle)
    good = (lengths <= max(_STRAY * float(np.median(lengths)), _STRAY_LENGTH)) & (
        angles <= max(_STRAY * float(np.median(angles)), _STRAY_ANGLE)
    )
    names = list(kept)
    return (
        [row for row, fine in zip(chosen, good, strict=True) if fine],
        {name: kept[name] for name, fine in zip(names, good, strict=True) if fine},
        [name for name, fine in zip(names, good, strict=True) if not fine],
    )


def _apart(stack: RigidTransform) -> Array:
    """(n, n) distances of transforms, 1 where they no longer agree."""
    t, R = stack.translation, stack.rotation.as_matrix()
    lengths = np.linalg.norm(t[:, None] - t, axis=-1) / _FAR_LENGTH
    traces = np.einsum("aij,bij->ab", R, R)
    angles = np.arccos(np.clip((traces - 1) / 2, -1, 1)) / _FAR_ANGLE
    return np.asarray(np.maximum(lengths, angles))


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
        path = [camera]
        while path[-1] in self.parents:
            path.append(self.parents[path[-1]])
        return tuple(path)


def chain_cameras(cameras: Sequence[str], links: Sequence[PairLink], reference: str) -> Chain:
    """All cameras chained to the reference over the tree of the strongest links.

    Parameters
    ----------
    cameras : sequence of str
        All that must be linked.
    links : sequence of PairLink
        Weighted by their agreeing snapshots.
    reference : str
        The camera that sees the reference pattern.

    Raises
    ------
    NotLinkedError
        Naming every camera without a chain to the reference.
    """
    found = {reference: RigidTransform.identity()}
    parents: dict[str, str] = {}
    usable = [link for link in links if link.snapshots and not link.ambiguous]
    while True:
        # Prim's tree: the strongest link that reaches a new camera.
        reach = [link for link in usable if (link.first in found) != (link.second in found)]
        if not reach:
            break
        link = max(reach, key=lambda one: len(one.snapshots))
        if link.first in found:
            known, new, T = link.first, link.second, link.T_first_second
        else:
            known, new, T = link.second, link.first, link.T_first_second.inv()
        found[new] = found[known] * T
        parents[new] = known
    missing = [camera for camera in cameras if camera not in found]
    if missing:
        raise NotLinkedError(_missing_sentence(missing, links, reference))
    return Chain({camera: found[camera] for camera in cameras}, parents)


def _missing_sentence(missing: Sequence[str], links: Sequence[PairLink], reference: str) -> str:
    """Which cameras are not linked, and why where something was seen."""
    said = (
        f"no chain of views links camera{'s' if len(missing) > 1 else ''} {', '.join(missing)} to "
        f"camera {reference}, which sees the reference pattern"
    )
    doubtful = [link for link in links if link.ambiguous]
    if doubtful:
        pairs = ", ".join(f"{link.first}-{link.second}" for link in doubtful)
        said += (
            f"; the snapshots of {pairs} do not decide between two positions (take more, with "
            "the bar in different directions, or use boards that do not look the same turned)"
        )
    return said + ". Take snapshots of the double pattern with a neighbouring camera"
