"""Where the markers are on the robot: from images that show several of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.spatial.transform import RigidTransform

from validation.errors import GtvalError
from validation.pieces.results import kept_result
from validation.poses.angles import Array
from vision_gt.images.markers import MarkerView
from vision_gt.least_squares.adjustment import Knowledge, adjust
from vision_gt.least_squares.setups import CAMERA_UNKNOWNS, Setup, part_slots
from vision_gt.optics.agreement import chain_to_root, largest_agreement, strongest_tree
from vision_gt.optics.camera import Camera
from vision_gt.optics.planar_pose import PlanarSolutions
from vision_gt.optics.transforms import mean_transform
from vision_gt.robot.marker_poses import (
    Layout,
    best_start,
    marker_solutions,
    marker_views,
)

_CLEAR, _CLEAR_PIXELS = 2.0, 0.1
"""A pose counts as sure if the other solution's error is so many times larger. A judgement: a
second candidate that is not needed only costs time, as the images agree on the right one."""
_AGREE = 0.1, float(np.deg2rad(15.0))
"""Estimates of two markers' transform that differ by more (metres, radians) do not agree: the
wrong one of a marker's two poses is tilted by twice the marker's tilt. A judgement: it separates
tilts above some 10 degrees, and smaller ones differ little from the right pose."""


class UnlinkedMarkersError(GtvalError):
    """Some markers were never seen together with the others.

    Parameters
    ----------
    text : str
        What is said.
    missing : tuple of int
        Their ids.
    """

    def __init__(self, text: str, missing: Sequence[int] = ()) -> None:
        super().__init__(text)
        self.missing = tuple(missing)


@dataclass(frozen=True)
class Frame:
    """The markers in one image of the movie.

    Parameters
    ----------
    name : str
        The image.
    views : tuple of MarkerView
        What it shows.
    """

    name: str
    views: tuple[MarkerView, ...]


@dataclass(frozen=True)
class PairEstimate:
    """Two markers seen together.

    Parameters
    ----------
    first, second : int
        Their ids.
    T_first_second : RigidTransform
        Mean over the images.
    images : int
        How many showed both.
    """

    first: int
    second: int
    T_first_second: RigidTransform
    images: int


@dataclass(frozen=True)
class LayoutFit:
    """A layout with how it came about.

    Parameters
    ----------
    layout : Layout
        After the joint refinement.
    chained : RigidTransform
        Stack of T_robot_marker as the chains alone give them, the document's way.
    pairs : tuple of PairEstimate
        The co-visibility graph.
    chains : mapping of int to tuple of int
        Markers from each to the dima-marker.
    left_out : tuple of str
        Images that say nothing of it: they show fewer than two markers, or give no pose.
    """

    layout: Layout
    chained: RigidTransform
    pairs: tuple[PairEstimate, ...]
    chains: Mapping[int, tuple[int, ...]]
    left_out: tuple[str, ...]


@kept_result()
def fit_layout(
    frames: Sequence[Frame],
    camera: Camera,
    sides: Mapping[int, float],
    dima: tuple[int, RigidTransform, Array],
) -> LayoutFit:
    """The layout from a movie around the robot.

    Parameters
    ----------
    frames : sequence of Frame
        Images; those that show a single marker say nothing and are left out.
    camera : Camera
        That took them.
    sides : mapping of int to float
        Sides of the markers, metres.
    dima : (int, RigidTransform, (6, 6) array)
        The marker whose place on the robot was measured, T_robot_marker, and its covariance.

    Raises
    ------
    GtvalError
        Naming the markers of the images that have no side.
    UnlinkedMarkersError
        Naming the markers that no chain of common images links to the dima-marker.

    Notes
    -----
    AD2.3, "Relative position between the markers": pairwise transforms averaged over the
    images, chains with the highest number of views. The joint refinement of all corners in all
    images is this toolkit's.
    """
    unknown = {view.number for frame in frames for view in frame.views} - set(sides)
    if unknown:
        raise GtvalError(f"no side is given for {', '.join(map(str, sorted(unknown)))}")
    useful = [frame for frame in frames if len(frame.views) > 1]
    pairs = _pair_estimates(useful, camera, sides)
    numbers = tuple(sorted(sides))
    chains, T_dima_marker = _chains(numbers, pairs, dima[0])
    T_robot_marker = dima[1] * T_dima_marker
    return _refined(frames, camera, sides, dima, (T_robot_marker, pairs, chains))


def _pair_estimates(
    frames: Sequence[Frame], camera: Camera, sides: Mapping[int, float]
) -> tuple[PairEstimate, ...]:
    """The mean transform of each pair over the images that show both.

    Where a marker has two likely poses, the combinations of all of them are tried and the one
    on which most images agree is taken: the wrong ones differ from image to image.
    """
    candidates: dict[tuple[int, int], list[tuple[int, RigidTransform]]] = {}
    for number, frame in enumerate(frames):
        found = {
            v.number: _likely(marker_solutions(v, sides[v.number], camera)) for v in frame.views
        }
        for a, b in combinations(sorted(found), 2):
            together = [(number, first.inv() * second) for first in found[a] for second in found[b]]
            candidates.setdefault((a, b), []).extend(together)
    estimates = []
    for (a, b), listed in sorted(candidates.items()):
        if listed:
            stack = RigidTransform.concatenate([T for _, T in listed])
            owner = np.array([number for number, _ in listed])
            members, _ = largest_agreement(stack, owner, _AGREE)
            mean = mean_transform(stack[members])
            estimates.append(PairEstimate(a, b, mean, len(members)))
    return tuple(estimates)


def _likely(solutions: PlanarSolutions | None) -> list[RigidTransform]:
    """The pose, or both where the image does not tell them apart."""
    if solutions is None:
        return []
    errors = solutions.errors
    sure = len(errors) == 1 or errors[1] > _CLEAR * errors[0] + _CLEAR_PIXELS
    return [solutions.T_camera_plane[i] for i in range(1 if sure else 2)]


def _chains(
    numbers: Sequence[int], pairs: Sequence[PairEstimate], dima: int
) -> tuple[dict[int, tuple[int, ...]], RigidTransform]:
    """Chains with most views from each marker to the dima-marker, and T_dima_marker of each."""
    T_dima_marker, parents = strongest_tree(
        dima, [(p.first, p.second, p.T_first_second, p.images) for p in pairs]
    )
    missing = [number for number in numbers if number not in T_dima_marker]
    if missing:
        named = ", ".join(map(str, missing))
        raise UnlinkedMarkersError(
            f"no images link marker{'s' if len(missing) > 1 else ''} {named} to the "
            f"dima-marker {dima}: they were never seen together with it, nor with one that was. "
            "Take the movie again so that neighbouring markers are in one image",
            missing,
        )
    chains = {number: chain_to_root(number, parents) for number in T_dima_marker}
    return chains, RigidTransform.concatenate([T_dima_marker[number] for number in numbers])


def _refined(
    frames: Sequence[Frame],
    camera: Camera,
    sides: Mapping[int, float],
    dima: tuple[int, RigidTransform, Array],
    chained: tuple[RigidTransform, tuple[PairEstimate, ...], Mapping[int, tuple[int, ...]]],
) -> LayoutFit:
    """All corners of all images in one adjustment, started from the chains."""
    T_robot_marker, pairs, chains = chained
    numbers = tuple(sorted(sides))
    lengths = np.array([sides[n] for n in numbers])
    start = Layout(numbers, lengths, T_robot_marker, np.zeros((6 * len(numbers),) * 2))
    bodies, kept, left_out = [], [], []
    for frame in frames:
        T = best_start(frame.views, camera, start) if len(frame.views) > 1 else None
        if T is not None:
            bodies.append(T)
            kept.append(frame)
        else:
            left_out.append(frame.name)
    if not kept:
        raise GtvalError("no image of the robot shows two markers; the layout cannot be found")
    setup = Setup.of(
        RigidTransform.concatenate([RigidTransform.identity()]),
        camera.parameters[None],
        RigidTransform.concatenate(bodies),
        T_robot_marker,
    )
    views = marker_views([(0, i, f.views) for i, f in enumerate(kept)], numbers, sides)
    done = adjust(views, setup, _layout_knowledge(setup, camera, numbers, dima), huber=3.0)
    first = CAMERA_UNKNOWNS
    factor = max(done.m0, 1.0) ** 2  # never more certain than the corners state
    covariance = done.covariance[first:, first:] * factor
    layout = Layout(numbers, lengths, done.setup.T_body_part, covariance)
    return LayoutFit(layout, T_robot_marker, pairs, dict(chains), tuple(left_out))


def _layout_knowledge(
    setup: Setup, camera: Camera, numbers: Sequence[int], dima: tuple[int, RigidTransform, Array]
) -> Knowledge:
    """The dima-marker's measured place; the camera's parameters as well as they are known."""
    known = Knowledge.nothing(setup)
    known.free[CAMERA_UNKNOWNS:] = True
    known.add_camera(0, camera.covariance)
    number, _, covariance = dima
    slots = part_slots(setup, numbers.index(number))
    if np.any(covariance):
        known.shared[slots, slots] = np.linalg.inv(covariance)
    else:
        known.free[slots] = False
    return known
