"""Local lines through scan points: what a surface looks like where it was hit.

The window over which a line is fitted is chosen for each point, by range and by what the points
allow: as long as the surface is straight. Narrow windows fake information: the scatter of their
normals looks like structure, most of all along a corridor, where there is none.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from laser_gt.scans.nearest import NearestGrid
from laser_gt.scans.scan import Flags, Indices, Sweep
from validation.poses.angles import Array

LAGS = (2, 4, 7, 12, 20)
"""Half widths of the windows tried, in beams. A judgement: each some 1.7 times the one before, from
the fewest that fit a line to what a metre of wall near the scanner holds."""

MAX_WINDOW = 1.0
"""Longest window, in metres: beyond it a wall's own waviness counts. A judgement."""

MODEL_SIGMA = 0.0015
"""Standard deviation of a surface about a line, in metres: plaster, quantisation. A
judgement: readings in whole millimetres have 0.3 mm of it, plaster is even to 1 or 2 mm."""


SELECTION = 1.3
"""Factor on the standard deviation of a normal for having picked the best of many windows.

Measured: normals of straight walls scatter by 1.15 to 1.3 times the formula's value.
"""


@dataclass(frozen=True)
class Surface:
    """Points of a sweep with the lines fitted around them.

    Parameters
    ----------
    points : (n, 2) array
        End points of the beams.
    beams : (n, 2) array
        Unit vectors from the sensor to them.
    ranges : (n,) array
        Metres.
    sigmas : (n,) array
        Standard deviation of the ranges.
    centres, normals : (n, 2) arrays
        Centroid and unit normal (towards the sensor) of the line around each point.
    first, last : (n,) int arrays
        Window of points that the line was fitted to, both ends in it.
    normal_sigmas : (n,) array
        Standard deviation of the direction of the normal, in radians.
    flat : (n,) bool array
        True where there is such a line; elsewhere centre and normal mean nothing.
    spacing : (n,) array
        Larger distance to the neighbours before and after in the same run, metres; 0 where
        there is none.
    scatter : (n,) array
        Variance of the points of the window about their line, as measured, square metres; 0
        where there is no line.
    shared : (n,) or (1,) array
        Standard deviation of the ranges that neighbouring beams share, metres.
    shared_beams : float
        Over how many beams that falls to 1 / e; the longest of the sweep's scanners.
    """

    points: Array
    beams: Array
    ranges: Array
    sigmas: Array
    centres: Array
    normals: Array
    first: Indices
    last: Indices
    normal_sigmas: Array
    flat: Flags
    spacing: Array
    scatter: Array
    shared: Array = field(default_factory=lambda: np.zeros(1))
    shared_beams: float = 1.0

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def grid(self) -> NearestGrid:
        """Look-up of the nearest points."""
        return NearestGrid(self.points)

    @cached_property
    def normal_variances(self) -> Array:
        """(n,) variance of each point across its surface, in square metres."""
        cosine = (self.normals * self.beams).sum(-1)
        across = self.sigmas**2 * np.maximum(cosine**2, 0.1) + MODEL_SIGMA**2
        return np.where(self.flat, across, self.sigmas**2 + MODEL_SIGMA**2)

    @cached_property
    def shared_across(self) -> Array:
        """(n,) standard deviation across its surface that each point shares with its neighbours."""
        cosine = (self.normals * self.beams).sum(-1)
        return np.where(self.flat, self.shared * np.abs(cosine), self.shared)

    @cached_property
    def measured_variances(self) -> Array:
        """(n,) the same as it was found around each point, where there is a line."""
        return np.where(self.flat, self.scatter, self.normal_variances)

    @cached_property
    def noise(self) -> float:
        """Median standard deviation of a point across its surface, in metres."""
        return float(np.sqrt(np.median(self.normal_variances)))

    @cached_property
    def window_lengths(self) -> Array:
        """(n,) number of points that each line was fitted to."""
        return (self.last - self.first + 1).astype(float)

    @cached_property
    def lines(self) -> Array:
        """(7, n) what a point is compared with, in one table so that one look-up fetches it.

        Rows: normal x and y (zero where there is no line, so that nothing faces it), distance of
        the line from the origin, its variance, variance of the normal's direction, x and y of
        the point.
        """
        normals = np.where(self.flat, self.normals.T, 0.0)
        offset = (normals * self.centres.T).sum(0)
        variances = self.normal_variances / self.window_lengths
        return np.stack([*normals, offset, variances, self.normal_sigmas**2, *self.points.T])

    @cached_property
    def movable(self) -> Array:
        """(5, m) the points that have a line: x, y, normal x and y, variance across it."""
        packed = np.stack([*self.points.T, *self.normals.T, self.normal_variances])
        return np.ascontiguousarray(packed[:, self.flat])


def surface(sweep: Sweep) -> Surface:
    """The lines around the points of a sweep.

    Parameters
    ----------
    sweep : Sweep
        Points in scan order, view after view.

    Notes
    -----
    For each point, windows of ``LAGS`` beams centred on it, before it and after it are fitted by
    total least squares (moments from running sums, so every window costs the same). A window
    counts if it crosses no gap, is not longer than ``MAX_WINDOW`` and scatters about its line no
    more than the range noise explains (chi-square bound at about 3 sigma). The one whose normal
    is known best wins.
    """
    points, origins = sweep.points, sweep.origins
    away = points - origins
    ranges = np.sqrt((away**2).sum(-1))
    beams = away / np.maximum(ranges, 1e-9)[:, None]
    count = [len(view.scan.points) for view in sweep.views]
    sigmas = np.repeat([view.scan.range_sigma for view in sweep.views], count)
    shared = np.repeat([view.scan.shared_sigma for view in sweep.views], count)
    run = _run_of(sweep, points, ranges, sigmas)
    first, last = _windows(run)
    moments = _window_moments(points, first, last)
    spacing = _spacing(points, run)
    return replace(
        _best_lines(points, beams, ranges, sigmas, first, last, moments, spacing),
        shared=shared,
        shared_beams=max(view.scan.shared_beams for view in sweep.views),
    )


def _spacing(points: Array, run: Indices) -> Array:
    """(n,) larger distance to the neighbours in the same run."""
    chord = np.sqrt((np.diff(points, axis=0) ** 2).sum(-1)) * (run[1:] == run[:-1])
    return np.asarray(np.maximum(np.append(chord, 0.0), np.append(0.0, chord)))


def _run_of(sweep: Sweep, points: Array, ranges: Array, sigmas: Array) -> Indices:
    """(n,) number of the unbroken run of points that each point belongs to."""
    steps, gaps = [], []
    for view in sweep.views:
        angles = view.scan.angles[view.scan.returned]
        gaps.append(np.diff(angles, prepend=-10.0))
        steps.append(np.full(len(angles), view.scan.step))
    step = np.concatenate(steps)
    chord = np.sqrt((np.diff(points, axis=0, prepend=points[:1]) ** 2).sum(-1))
    # Judgements: a run ends at a jump (ten times the arc is a wall within 6 degrees of the beam,
    # 0.1 m the depth of a door frame) and where three beams are missing.
    allowed = np.maximum(10 * ranges * step, 0.1) + 5 * sigmas
    broken = (chord > allowed) | (np.concatenate(gaps) > 3.5 * step)
    return np.cumsum(broken)


def _windows(run: Indices) -> tuple[Indices, Indices]:
    """(w, n) first and last point of every window tried; last < first where it leaves its run."""
    index = np.arange(len(run))
    lags = np.array(LAGS)[:, None]
    first = np.concatenate([index - lags, index - 2 * lags, index + 0 * lags])
    last = np.concatenate([index + lags, index + 0 * lags, index + 2 * lags])
    low, high = np.maximum(first, 0), np.minimum(last, len(run) - 1)
    whole = (low == first) & (high == last) & (run[low] == run[high])
    return np.where(whole, low, 1), np.where(whole, high, 0)


def _window_moments(points: Array, first: Indices, last: Indices) -> tuple[Array, ...]:
    """Count, means, and centred second moments of every window, (w, n) each."""
    shift = points.mean(0)
    x, y = (points - shift).T
    sums = np.zeros((5, len(points) + 1))
    np.cumsum(np.stack([x, y, x * x, x * y, y * y]), axis=1, out=sums[:, 1:])
    count = np.maximum(last - first + 1, 1).astype(float)
    total_x, total_y, xx, xy, yy = (row[last + 1] - row[first] for row in sums)
    mean_x, mean_y = total_x / count, total_y / count
    return (
        count,
        mean_x + shift[0],
        mean_y + shift[1],
        xx - total_x * mean_x,
        xy - total_x * mean_y,
        yy - total_y * mean_y,
    )


def _best_lines(
    points: Array,
    beams: Array,
    ranges: Array,
    sigmas: Array,
    first: Indices,
    last: Indices,
    moments: tuple[Array, ...],
    spacing: Array,
) -> Surface:
    """The surface with the best acceptable window of each point."""
    count, mean_x, mean_y, xx, xy, yy = moments
    half_difference, half_sum = (xx - yy) / 2, (xx + yy) / 2
    root = np.sqrt(half_difference**2 + xy**2)
    spread, scatter = half_sum + root, np.maximum(half_sum - root, 0.0)
    cosine = _incidence(half_difference, xy, root, beams)
    variance = sigmas**2 * np.maximum(cosine**2, 0.1) + MODEL_SIGMA**2
    freedom = np.maximum(count - 2, 1.0)
    bound = variance * (freedom + 3 * np.sqrt(2 * freedom))
    good = (last > first) & (scatter <= bound) & (spread <= count * MAX_WINDOW**2 / 12)
    known = np.where(good, spread / variance, 0.0)
    best = known.argmax(0)
    column = np.arange(len(points))
    pick = (best, column)
    flat = known[pick] > 0
    direction = 0.5 * np.arctan2(xy[pick], half_difference[pick])
    normals = np.stack([-np.sin(direction), np.cos(direction)], axis=-1)
    towards = (normals * beams).sum(-1) > 0
    normals[towards] *= -1
    return Surface(
        points=points,
        beams=beams,
        ranges=ranges,
        sigmas=sigmas,
        centres=np.stack([mean_x[pick], mean_y[pick]], axis=-1),
        normals=normals,
        first=np.where(flat, first[pick], column),
        last=np.where(flat, last[pick], column),
        normal_sigmas=SELECTION / np.sqrt(np.where(flat, known[pick], 1.0)),
        flat=flat,
        spacing=spacing,
        scatter=np.where(flat, (scatter / freedom)[pick], 0.0),
    )


def _incidence(half_difference: Array, xy: Array, root: Array, beams: Array) -> Array:
    """Cosine between each beam and the normal of the principal axis, without trigonometry.

    The axis at angle a has cos 2a = (xx - yy) / (2 root), sin 2a = xy / root; the squared cosine
    of a beam (u, v) with its normal is (1 - (u^2 - v^2) cos 2a - 2 u v sin 2a) / 2.
    """
    safe = np.maximum(root, 1e-12)
    u, v = beams[:, 0], beams[:, 1]
    squared = 0.5 * (1 - ((u * u - v * v) * half_difference + 2 * u * v * xy) / safe)
    return np.sqrt(np.clip(squared, 0.0, 1.0))
