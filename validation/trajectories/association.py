"""Two trajectories at common times."""

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.trajectory import Kind, Trajectory
from validation.trajectories.interpolation import interpolate

At = Literal["sparser", "reference", "source"]
"""Whose times are kept: those of the source with the longer intervals, or of one of the two."""


@dataclass(frozen=True)
class Coverage:
    """What part of the times has a pair.

    Parameters
    ----------
    at : {"reference", "source"}
        Whose times were asked for.
    asked, paired : int
        Poses there, and those with support in the other.
    span_s, covered_s : float
        Seconds from the first to the last pose of the reference, and those of them in stretches
        of pairs without a gap.
    holes : (h, 2) array
        First and last time of the stretches without a pair, within the reference's span, seconds
        since its epoch; the longest first.
    """

    at: Literal["reference", "source"]
    asked: int
    paired: int
    span_s: float
    covered_s: float
    holes: Array

    @property
    def share(self) -> float:
        """Of the reference's span that is covered."""
        return self.covered_s / self.span_s if self.span_s > 0 else float(self.paired > 0)


@dataclass(frozen=True)
class Pairs:
    """Two trajectories of the same kind at the same n times.

    Parameters
    ----------
    reference, source : Trajectory
        Both with the reference's epoch.
    coverage : Coverage
        What has no pair.
    shared : str
        What the two were reduced to, in words; empty where they are of one kind.
    """

    reference: Trajectory
    source: Trajectory
    coverage: Coverage
    shared: str = ""

    @property
    def times(self) -> Array:
        """(n,) seconds since the reference's epoch."""
        return self.reference.times

    @property
    def starts_anew(self) -> npt.NDArray[np.bool_]:
        """(n,) True where a pair comes after a gap; the first does."""
        limit = max(self.reference.gap, self.source.gap)
        return np.concatenate([[True], np.diff(self.times) > limit])[: len(self.times)]


def associate(reference: Trajectory, source: Trajectory, at: At = "sparser") -> Pairs:
    """Both trajectories at the times of one of them; the other is interpolated.

    Parameters
    ----------
    reference, source : Trajectory
        Of any kinds; they are compared in what they share.
    at : {"sparser", "reference", "source"}
        Whose times.

    Raises
    ------
    GtvalError
        If no time has support in both.
    """
    if at not in get_args(At):
        raise GtvalError(f"'{at}' is none of {', '.join(get_args(At))}")
    for one in (reference, source):
        if not len(one):
            raise GtvalError(f"'{one.system}' has no pose")
    ours, theirs, shared = in_what_they_share(reference, source)
    theirs = replace(theirs, times=theirs.times_since(ours.epoch), epoch=ours.epoch)
    if at == "sparser":
        at = "source" if _interval(theirs) > _interval(ours) else "reference"
    asked, other = (ours, theirs) if at == "reference" else (theirs, ours)
    between = interpolate(other, asked.times)
    kept = asked if between.supported.all() else asked.select(between.supported)
    if not len(kept):
        raise GtvalError(
            f"'{source.system}' and '{reference.system}' have no time in common: "
            f"{_when(theirs)} and {_when(ours)} seconds. Do their clocks count from the same "
            "moment? Whole hours or 18, 19 or 37 s apart are other time scales"
        )
    pair = (kept, between.trajectory)
    found = Pairs(*(pair if at == "reference" else pair[::-1]), _NOTHING, shared)
    return replace(found, coverage=_coverage(found, ours, at, len(asked)))


_NOTHING = Coverage("reference", 0, 0, 0.0, 0.0, np.empty((0, 2)))


def in_what_they_share(
    reference: Trajectory, source: Trajectory
) -> tuple[Trajectory, Trajectory, str]:
    """Both reduced to what both have, and that in words.

    In the plane if one is; positions if one has no orientation.
    """
    said = []
    if reference.dimensions != source.dimensions:
        spatial = reference if reference.dimensions == 3 else source
        said.append(f"'{spatial.system}' is seen from above")
        reference, source = reference.planar(), source.planar()
    if reference.has_orientation != source.has_orientation:
        bare = source if reference.has_orientation else reference
        said.append(f"'{bare.system}' has positions only, which alone are compared")
        reference, source = _positions_only(reference), _positions_only(source)
    return reference, source, "; ".join(said)


def _positions_only(one: Trajectory) -> Trajectory:
    if not one.has_orientation:
        return one
    d = one.dimensions
    kind: Kind = "points_plane" if d == 2 else "points_space"
    return replace(
        one, poses=one.positions, kind=kind, covariances=np.asarray(one.covariances)[:, :d, :d]
    )


def _interval(one: Trajectory) -> float:
    return float(np.median(np.diff(one.times))) if len(one) > 1 else np.inf


def _when(one: Trajectory) -> str:
    return f"{one.times[0] + one.epoch:.3f} to {one.times[-1] + one.epoch:.3f}"


def _coverage(
    pairs: Pairs, reference: Trajectory, at: Literal["reference", "source"], asked: int
) -> Coverage:
    """What of the reference's span has pairs."""
    times = pairs.times
    first, last = float(reference.times[0]), float(reference.times[-1])
    starts = np.flatnonzero(pairs.starts_anew)
    ends = np.concatenate([starts[1:] - 1, [len(times) - 1]])
    covered = float((times[ends] - times[starts]).sum())
    holes = np.column_stack(
        [np.concatenate([[first], times[ends]]), np.concatenate([times[starts], [last]])]
    )
    limit = max(pairs.reference.gap, pairs.source.gap)
    holes = holes[np.diff(holes, axis=1)[:, 0] > limit]
    longest = np.argsort(-np.diff(holes, axis=1)[:, 0], kind="stable")
    return Coverage(at, asked, len(times), last - first, covered, holes[longest])
