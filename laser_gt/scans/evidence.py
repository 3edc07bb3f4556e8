"""What speaks for and against a pose: points explained, points where there must be nothing.

A sum of residuals cannot tell a right match from a wrong one, for it looks only at points that
found a partner. Here every point of both sweeps is asked: is there a surface where you are, are
you hidden from the other sensor, outside of its view, or in a place that its beams have crossed?
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from laser_gt.scans.planar import inverse, transform
from laser_gt.scans.scan import Flags, Sweep, View, bare, digest_of
from laser_gt.scans.surfaces import FINE_LAGS, Surface, surface
from validation.poses.angles import Array

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

MARGIN = 0.06
"""Distances up to this plus 4 sigma count as explained, in metres. A judgement between skirting
boards or the edges of frames, and furniture that stands out of a wall."""

ROW_GAP = 0.3
"""Points of one row are no further apart than this, in metres. A judgement: more than the points of
a wall seen at a grazing angle in a room, less than the gap between two things."""


@dataclass(frozen=True)
class Prepared:
    """A sweep made ready for matching: everything that depends on it alone.

    Parameters
    ----------
    sweep : Sweep
        The sweep.
    """

    sweep: Sweep

    def __reduce__(self) -> tuple[Callable[[str, Sweep], "Prepared"], tuple[str, Sweep]]:
        """Another process gets the sweep and makes it ready itself, once for all its matches."""
        return _ready, (self.digest, bare(self.sweep))

    @cached_property
    def digest(self) -> str:
        """Hash of all that matches with the sweep depend on, its name apart."""
        return digest_of(self.sweep)

    @property
    def name(self) -> str:
        """Of the stop."""
        return self.sweep.name

    @cached_property
    def surface(self) -> Surface:
        """Its points with their lines."""
        return surface(self.sweep)

    @cached_property
    def fine(self) -> Surface:
        """The same with short lines, too, for the last steps to a pose."""
        return replace(surface(self.sweep, FINE_LAGS), table=self.surface.grid)

    @cached_property
    def tree(self) -> "cKDTree":
        """Its points, for the exact distance to the nearest of them."""
        from scipy.spatial import cKDTree  # noqa: PLC0415  (loaded when a match is judged)

        return cKDTree(self.sweep.points)

    @cached_property
    def tolerance(self) -> float:
        """Largest distance in metres at which a point is explained by a surface."""
        return MARGIN + 4 * self.sweep.range_sigma


_READY: dict[str, Prepared] = {}
"""What this process made ready for others, by digests."""
MOST_READY = 300
"""Sweeps that a process keeps ready. A judgement: with their tables they take some 100 MB."""


def _ready(digest: str, sweep: Sweep) -> Prepared:
    """A sweep that another process sent, made ready at most once."""
    if digest not in _READY or _READY[digest].name != sweep.name:
        if len(_READY) >= MOST_READY:
            _READY.pop(next(iter(_READY)))
        _READY[digest] = Prepared(sweep)
    return _READY[digest]


@dataclass(frozen=True)
class Evidence:
    """Shares of the points of both sweeps, one value for each pose.

    Parameters
    ----------
    explained : (k,) array
        Share of all points that lie on a surface of the other sweep.
    violating : (k,) array
        Share of all points in space that the other sensor's beams have crossed.
    hidden : (k,) array
        Share of all points that the other sensor could not see.
    crossing : ((k, n) bool array, (k, m) bool array)
        Which of the points of the moving sweep and of the reference that were asked are in space
        that the other sensor's beams have crossed.
    """

    explained: Array
    violating: Array
    hidden: Array
    crossing: tuple[Flags, Flags]

    @property
    def overlap(self) -> Array:
        """(k,) share of the points that the other sensor could have seen."""
        return 1 - self.hidden

    @property
    def score(self) -> Array:
        """(k,) what speaks for a pose less what speaks against it; 1 for a perfect match.

        Points that the other sensor could not see speak for nothing and count one half.
        Without that, poses that lay one scan over the other as a whole would win: in a corridor
        the ends of the two views would be taken for ends of the walls.
        """
        return self.explained - self.violating + 0.5 * self.hidden

    @property
    def quality(self) -> Array:
        """(k,) the same of the points alone that the other sensor could have seen."""
        return (self.explained - self.violating) / np.maximum(self.overlap, 1e-9)


def evidence(reference: Prepared, moving: Prepared, pose: Array, stride: int = 1) -> Evidence:
    """How well each pose agrees with all that both sweeps saw.

    Parameters
    ----------
    reference, moving : Prepared
        The two sweeps.
    pose : (k, 3) array
        Moving frame in the reference frame.
    stride : int
        Only every so many points are asked.
    """
    pose = np.atleast_2d(pose)
    tolerance = max(reference.tolerance, moving.tolerance)
    counts = np.zeros((3, len(pose)))
    total = 0
    crossing = []
    for target, source, motion in (
        (reference, moving, pose),
        (moving, reference, inverse(pose)),
    ):
        points = transform(motion, source.sweep.points[::stride])
        explained, violating, hidden = _asked(target, points, tolerance)
        counts += np.stack([explained.sum(-1), violating.sum(-1), hidden.sum(-1)])
        total += points.shape[1]
        crossing.append(violating)
    explained, violating, hidden = counts / total
    return Evidence(explained, violating, hidden, (crossing[0], crossing[1]))


def intruder(reference: Prepared, moving: Prepared, seen: Evidence, row: int) -> float:
    """Length of the longest surface that stands where the other scanner saw free space.

    Scattered points in free space are mixed pixels and grazing beams; a row of them is a thing
    that the other scanner would have seen: it was moved, or the match is wrong.

    Parameters
    ----------
    reference, moving : Prepared
        The two sweeps.
    seen : Evidence
        Of all points of both.
    row : int
        Which of its poses is meant.

    Returns
    -------
    float
        Metres from the first to the last point of the longest unbroken row, in either sweep.
    """
    longest = 0.0
    for source, crossing in zip((moving, reference), seen.crossing, strict=True):
        index = np.flatnonzero(crossing[row])
        if index.size < 2:
            continue
        points = source.sweep.points[index]
        step = np.diff(points, axis=0)
        broken = (np.diff(index) > 1) | ((step**2).sum(-1) > ROW_GAP**2)
        first, last = np.append(True, broken), np.append(broken, True)
        length = np.hypot(*(points[last] - points[first]).T)
        longest = max(longest, float(length.max()))
    return longest


def _asked(target: Prepared, points: Array, tolerance: float) -> tuple[Flags, Flags, Flags]:
    """(k, n) which points are explained, violate free space, are hidden from a sweep."""
    explained = _on_surface(target.surface, points, tolerance)
    seen = np.zeros(explained.shape, dtype=bool)
    crossed = np.zeros(explained.shape, dtype=bool)
    for view in target.sweep.views:
        near, far, there = measured_limits(view, points)
        offset = points - view.mount[:2]
        distance = np.sqrt(np.einsum("...i,...i->...", offset, offset))
        crossed |= there & (distance < near - tolerance)
        seen |= there & (distance < far + tolerance)
    violating = crossed & ~explained
    return explained, violating, ~explained & ~violating & ~seen


def _on_surface(target: Surface, points: Array, tolerance: float) -> Flags:
    """(...) whether points lie on a surface: near a point of it, or on its line between two.

    Far away and at grazing angles the points of a wall are further apart than the tolerance;
    there a point may lie anywhere between them, if it is on the line.
    """
    x, y = points[..., 0], points[..., 1]
    index = target.grid.index(x, y)
    dx, dy = x - target.points[:, 0].take(index), y - target.points[:, 1].take(index)
    squared = dx * dx + dy * dy
    normal_x, normal_y = target.normals[:, 0].take(index), target.normals[:, 1].take(index)
    across = np.abs(normal_x * dx + normal_y * dy)
    along = tolerance + 0.6 * target.spacing.take(index)
    between = target.flat.take(index) & (across < tolerance) & (squared < along**2)
    return np.asarray((squared < tolerance**2) | between)


def measured_limits(view: View, points: Array) -> tuple[Array, Array, Flags]:
    """Least and greatest range that a scanner measured around the direction of each point.

    Parameters
    ----------
    view : View
        Scan and mount.
    points : (..., 2) array
        In the sweep's frame.

    Returns
    -------
    near, far : (...) arrays
        Over three neighbouring beams, metres. ``near`` is 0 where one of them did not return
        (glass, black cloth: nothing is known), ``far`` then is the farthest that did, or 0.
    there : (...) bool array
        Whether the direction is in the field of view.
    """
    scan = view.scan
    offset = points - view.mount[:2]
    azimuth = np.arctan2(offset[..., 1], offset[..., 0]) - view.mount[2]
    turned = scan.angles[0] + np.mod(azimuth - scan.angles[0] + scan.step / 2, 2 * np.pi)
    beam = np.searchsorted(scan.angles, turned, side="right") - 1
    there = (beam >= 0) & (turned < scan.angles[-1] + scan.step)
    near, far = scan.beam_limits
    beam = np.clip(beam, 0, len(scan) - 1)
    return near[beam], far[beam], there
