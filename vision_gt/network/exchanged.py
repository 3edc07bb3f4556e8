"""Snapshots under wrong names: two cameras' images exchanged, or two moments'; and wrong lenses."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.spatial.transform import RigidTransform

from vision_gt.network.chain import (
    BoardPose,
    PairLink,
    agrees,
    bar_poses,
    best_seen,
    estimates,
    pair_links,
)
from vision_gt.optics.camera import Camera, project
from vision_gt.patterns.board_views import BoardView, camera_pose_of_board

_LEAST_MORE = 3
"""Snapshots that must agree besides those that do as it is. A judgement: three by chance are none
in a million, as one more agrees by chance in a hundred."""
_MOST_SHIFT = 3
"""Numbers by which the files of one camera may run ahead of the other's."""
_WRONG_LENS, _WRONG_PIXELS = 5.0, 0.5
"""Times the other cameras' median misfit of single boards, and pixels, from which on a lens is
taken for wrong. A judgement: cameras alike differ by less than twice."""
_BETTER = 2.0
"""Times that boards have to fit better with lenses exchanged. A judgement: right ones fit to a
tenth of a pixel, and worse than half of that of wrong ones only where these are nearly the same."""
_LENSES = (
    "the lenses of cameras {} and {} are exchanged: their files in vision.camera_files, "
    "or their folders of calibration images"
)
_BOARDS = (
    "the two boards of the bar are exchanged: vision.bar.first and vision.bar.second, or their "
    "first_id"
)
_APART = (
    "the snapshots of cameras {0} and {1} are numbered apart: those of camera {0} are {2} too {3}"
)
_SIZES = 1.03 ** np.arange(-25, 26)
"""Of boards over what is stated: from half to twice. Steps that a network of metres bears."""
_FINE = 1 + 0.005 * np.arange(-3, 4)
_LEAST_CORNERS = 12
"""Of a board whose misfit says something about the lens."""


@dataclass(frozen=True)
class Exchange:
    """Images of the network under each other's names.

    Parameters
    ----------
    cameras : (str, str)
        Of the link that they belong to.
    snapshots : tuple of str
        That were left out, and would agree.
    partners : tuple of (str, str)
        Files that show one moment: of the first camera, and of the second. The two cameras'
        images of one moment, exchanged, are one pair.
    """

    cameras: tuple[str, str]
    snapshots: tuple[str, ...]
    partners: tuple[tuple[str, str], ...]

    @property
    def of_cameras(self) -> bool:
        """Whether the two cameras' images of one moment are exchanged."""
        return len(self.snapshots) == 1


def exchanged_snapshots(
    views: Sequence[BoardView],
    cameras: Sequence[Camera],
    T_bar_patterns: RigidTransform,
    links: Sequence[PairLink],
) -> list[Exchange]:
    """Which of the snapshots that were left out agree under other names.

    Parameters
    ----------
    views : sequence of BoardView
        Of the network's snapshots.
    cameras : sequence of Camera
        With their intrinsic parameters.
    T_bar_patterns : RigidTransform
        Stack of two: where the patterns are on the bar.
    links : sequence of PairLink
        Of the images as they are named.

    Notes
    -----
    Two kinds are told: the two cameras' images of one moment, and images of one camera from
    different moments, also from snapshots with different other cameras. Of two moments of one
    pair of cameras it cannot be told whose images are exchanged: the pairs are the same.
    """
    poses = _by_parts(views, cameras, T_bar_patterns)
    sources = {(view.camera, view.body): view.source or view.body for view in views}
    found: list[Exchange] = []
    told: set[tuple[str, str]] = set()
    for link in links:
        for snapshot in link.outliers:
            if _agrees_exchanged(views, cameras, T_bar_patterns, link, snapshot):
                told |= {(link.first, snapshot), (link.second, snapshot)}
                pair = sources[link.first, snapshot], sources[link.second, snapshot]
                found.append(Exchange((link.first, link.second), (snapshot,), (pair,)))
    odd = {(camera, s) for k in links for s in k.outliers for camera in (k.first, k.second)} - told
    for link in links:
        matched = list(_matched(link, poses, odd))
        if matched:
            names = tuple(sorted({s for pair in matched for s in pair}))
            files = tuple((sources[link.first, a], sources[link.second, b]) for a, b in matched)
            found.append(Exchange((link.first, link.second), names, files))
    return found


def _agrees_exchanged(
    views: Sequence[BoardView],
    cameras: Sequence[Camera],
    T_bar_patterns: RigidTransform,
    link: PairLink,
    snapshot: str,
) -> bool:
    """Whether a snapshot agrees once each image is the other camera's."""
    other = {link.first: link.second, link.second: link.first}
    own = [view for view in views if view.body == snapshot and view.camera in other]
    parts = {view.camera: view.part for view in own}
    # Boards that look alike are told apart by the camera alone; others by their ids.
    turned = [
        replace(
            view,
            camera=other[view.camera],
            part=parts[other[view.camera]] if view.board.family is None else view.part,
        )
        for view in own
    ]
    found = best_seen(bar_poses(turned, cameras, T_bar_patterns))
    one, two = (found.get((camera, snapshot)) for camera in (link.first, link.second))
    if one is None or two is None:
        return False
    return any(agrees(T, link) for T, _ in estimates(one, two))


Poses = Mapping[tuple[str, str], BoardPose]
"""By camera and snapshot."""


def _by_parts(
    views: Sequence[BoardView], cameras: Sequence[Camera], T_bar_patterns: RigidTransform
) -> list[tuple[Poses, Poses]]:
    """The bar as the first and as the second camera of a pair may see it.

    Boards that look alike may be either of the bar's: then one is the first, the other the second.
    """
    if all(view.board.family is not None for view in views):
        poses = best_seen(bar_poses(views, cameras, T_bar_patterns))
        return [(poses, poses)]
    first, second = (
        best_seen(bar_poses([replace(v, part=p) for v in views], cameras, T_bar_patterns))
        for p in (0, 1)
    )
    return [(first, second), (second, first)]


def _matched(
    link: PairLink, readings: Sequence[tuple[Poses, Poses]], odd: set[tuple[str, str]]
) -> Iterator[tuple[str, str]]:
    """Snapshots whose images by the first and by the second camera agree, though named apart."""
    free = {s for camera, s in odd if camera == link.second}
    for snapshot in sorted(s for camera, s in odd if camera == link.first):
        for other in sorted(free - {snapshot}):
            if not {snapshot, other} & set(link.outliers):
                continue
            pairs = [
                (one[link.first, snapshot], two[link.second, other])
                for one, two in readings
                if (link.first, snapshot) in one and (link.second, other) in two
            ]
            if any(agrees(T, link) for pair in pairs for T, _ in estimates(*pair)):
                free.discard(other)
                yield snapshot, other
                break


def why_not_linked(
    views: Sequence[BoardView],
    cameras: Sequence[Camera],
    T_bar_patterns: RigidTransform,
) -> str:
    """What would link the cameras, as a sentence; '' if nothing that is thought of does.

    Parameters
    ----------
    views : sequence of BoardView
        Of the network's snapshots.
    cameras : sequence of Camera
        With their intrinsic parameters.
    T_bar_patterns : RigidTransform
        Stack of two: where the patterns are on the bar.
    """
    poses = bar_poses(views, cameras, T_bar_patterns)
    as_is = _agreeing(poses)
    tried = [
        (_agreeing(bar_poses(views, turned, T_bar_patterns)), _LENSES.format(one, other))
        for one, other, turned in _lenses_exchanged(cameras)
    ]
    tried += [
        (as_is + more, _APART.format(first, second, abs(shift), "low" if shift > 0 else "high"))
        for first, second, shift, more in _shifted(poses)
    ]
    swapped = [replace(view, part=1 - view.part) for view in views]
    tried.append((_agreeing(bar_poses(swapped, cameras, T_bar_patterns)), _BOARDS))
    count, said = max(tried, key=lambda one: one[0])
    if count < as_is + _LEAST_MORE:
        lens = _lenses_that_fit(views, cameras) or _worst_lens(views, cameras)
        if lens:
            return lens
        count, said = _other_size(views, cameras, T_bar_patterns)
    if count < as_is + _LEAST_MORE:
        return ""
    return f"{said}: {count} snapshots agree then, {as_is} as it is"


def _other_size(
    views: Sequence[BoardView], cameras: Sequence[Camera], T_bar_patterns: RigidTransform
) -> tuple[int, str]:
    """How many snapshots agree with boards of the size at which most do, and a sentence.

    Boards of s times the stated size put everything s times as far away: the same as a bar that is
    1/s times as long. Snapshots do not tell the one from the other.
    """

    def at(size: float) -> tuple[int, float]:
        """Snapshots that agree, and minus their scatter."""
        patterns = RigidTransform.from_components(
            T_bar_patterns.translation / size, T_bar_patterns.rotation
        )
        links = [k for k in pair_links(bar_poses(views, cameras, patterns)) if len(k.snapshots) > 1]
        return sum(len(k.snapshots) for k in links), -sum(float(k.spread[0]) for k in links) * size

    coarse = max(_SIZES, key=at)
    size = max(coarse * _FINE, key=at)
    squares, bar = (f"{100 * abs(one - 1):.0f} %" for one in (size, 1 / size))
    words, other = ("smaller", "longer") if size < 1 else ("larger", "shorter")
    return at(size)[0], (
        f"the squares of the bar's boards are some {squares} {words} than stated, or the bar is "
        f"some {bar} {other} (measure both)"
    )


def _lenses_exchanged(cameras: Sequence[Camera]) -> Iterator[tuple[str, str, list[Camera]]]:
    """Pairs of cameras with images of one size, and all cameras with their lenses exchanged."""
    for one, other in combinations(cameras, 2):
        if one.size == other.size:
            lenses = {one.name: other, other.name: one}
            yield (
                one.name,
                other.name,
                [replace(lenses.get(camera.name, camera), name=camera.name) for camera in cameras],
            )


def _agreeing(poses: Sequence[BoardPose]) -> int:
    """Snapshots that agree, over all pairs of cameras; a single one agrees with nothing."""
    return sum(len(link.snapshots) for link in pair_links(poses) if len(link.snapshots) > 1)


def _shifted(poses: Sequence[BoardPose]) -> Iterator[tuple[str, str, int, int]]:
    """Pairs of cameras, what is added to the first one's numbers, and how many more agree then."""
    by_pair: dict[tuple[str, str], dict[tuple[str, int], BoardPose]] = {}
    for (camera, snapshot), pose in best_seen(poses).items():
        one, other, number = snapshot.rsplit("-", 2) if snapshot.count("-") == 2 else ("", "", "")
        if number.isdigit():
            by_pair.setdefault((one, other), {})[camera, int(number)] = pose
    for (first, second), some in by_pair.items():
        as_is = _agreeing(list(some.values()))
        for shift in (s for s in range(-_MOST_SHIFT, _MOST_SHIFT + 1) if s):
            moved = [
                replace(pose, snapshot=f"{number + shift * (camera == first)}")
                for (camera, number), pose in some.items()
            ]
            yield first, second, shift, _agreeing(moved) - as_is


def _misfits(views: Sequence[BoardView], cameras: Sequence[Camera]) -> dict[str, float]:
    """By camera the median pixels between single boards and their own best poses."""
    misfits = {}
    for camera in cameras:
        own = [v for v in views if v.camera == camera.name and len(v.ids) >= _LEAST_CORNERS]
        found = [off for v in own if (off := board_misfit(v, camera)) is not None]
        if found:
            misfits[camera.name] = float(np.median(found))
    return misfits


def _lenses_that_fit(views: Sequence[BoardView], cameras: Sequence[Camera]) -> str:
    """Two cameras whose single boards fit with each other's lenses, and not with their own."""
    own = _misfits(views, cameras)
    for one, other, turned in _lenses_exchanged(cameras):
        pair = [camera for camera in turned if camera.name in {one, other}]
        fits = _misfits(views, pair)
        if len(fits) == 2 and max(fits.values()) < min(own[one], own[other]) / _BETTER:
            better = f"boards fit by {max(fits.values()):.2f} px then"
            return f"{_LENSES.format(one, other)}: {better}, by {own[one]:.2f} px as it is"
    return ""


def _worst_lens(views: Sequence[BoardView], cameras: Sequence[Camera]) -> str:
    """The camera whose lens does not fit single boards, where the others' do; '' if none."""
    misfits = _misfits(views, cameras)
    if len(misfits) < 2:
        return ""
    name = max(misfits, key=lambda one: misfits[one])
    rest = float(np.median([off for one, off in misfits.items() if one != name]))
    if misfits[name] < max(_WRONG_LENS * rest, _WRONG_PIXELS):
        return ""
    return (
        f"the lens of camera {name} is not the one that took its images: boards fit by "
        f"{misfits[name]:.2f} px, with the other cameras by {rest:.2f} px. Look at its file in "
        "vision.camera_files, or calibrate it again"
    )


def board_misfit(view: BoardView, camera: Camera) -> float | None:
    """Root mean square pixels between a board and its own best pose; None if it has no pose."""
    T = camera_pose_of_board(view, camera)
    if T is None:
        return None
    miss = project(T.apply(view.points), camera.parameters) - view.pixels
    return float(np.sqrt(np.nanmean((miss**2).sum(-1))))
