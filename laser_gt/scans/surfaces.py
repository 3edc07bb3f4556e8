"""Local lines through scan points: what a surface looks like where it was hit.

The window over which a line is fitted is chosen for each point, by range and by what the points
allow: as long as the surface is straight. Narrow windows fake information: the scatter of their
normals looks like structure, most of all along a corridor, where there is none.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from laser_gt.scans.nearest import NearestGrid
from laser_gt.scans.scan import MIN_RETURNS, Flags, Indices, Sweep
from validation.poses.angles import Array

LAGS = (2, 4, 7, 12, 20)
"""Half widths of the windows tried, in beams. A judgement: each some 1.7 times the one before, from
the fewest that fit a line to what a metre of wall near the scanner holds.
"""

FINE_LAGS = (1, 3, 9, 20)
"""The same for the last steps to a pose: pieces of furniture with three beams on them have a line
then, and the choice is from fewer windows.

Measured: errors in 300 furnished rooms are 1.19 and 1.09 times the Cramer-Rao bound (full turn,
half turn) instead of 1.24 and 1.15; those on pairs of a real building are the same to what chance
does. From further away such lines mislead: starts that are disturbed by 12 cm come back less often,
and of 136 pairs of that building 60 would be accepted instead of 74."""

MAX_WINDOW = 1.0
"""Longest window, in metres: beyond it a wall's own waviness counts. A judgement."""

MODEL_SIGMA = 0.0015
"""Standard deviation of a surface about a line, in metres: plaster, quantisation. A
judgement: readings in whole millimetres have 0.3 mm of it, plaster is even to 1 or 2 mm."""


SELECTION = 1.3
"""Factor on the standard deviation of a normal for having picked the best of many windows.

Measured: normals of straight walls scatter by 1.15 to 1.3 times the formula's value.
"""


WITHIN_BEAM = 1 / np.sqrt(12)
"""Standard deviation of where within its step a beam is answered, in steps: anywhere. Measured on
scans of a SICK LMS of half degrees: across walls at 60 to 75 degrees from the beam points scatter
by what 2.6 to 3.7 mrad make beyond their range noise, 0.30 to 0.42 of a step."""


def variance_across(sigmas: Array, widths: Array, cosine: Array) -> Array:
    """Variance of points across their surfaces, square metres.

    Parameters
    ----------
    sigmas : array
        Standard deviation of the ranges, metres.
    widths : array
        Standard deviation of where across its beam the point was met, metres.
    cosine : array
        Of the incidence.
    """
    squared = cosine**2
    beam = widths**2 * (1 - squared)
    return np.asarray(sigmas**2 * np.maximum(squared, 0.1) + beam + MODEL_SIGMA**2)


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
    widths : (n,) or (1,) array
        Standard deviation of where across its beam each point was met, metres.
    table : NearestGrid, optional
        Look-up of the nearest of the points, where another surface has made it already.
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
    widths: Array = field(default_factory=lambda: np.zeros(1))
    table: NearestGrid | None = None

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def grid(self) -> NearestGrid:
        """Look-up of the nearest points."""
        return self.table or NearestGrid(self.points)

    @cached_property
    def normal_variances(self) -> Array:
        """(n,) variance of each point across its surface, in square metres."""
        cosine = (self.normals * self.beams).sum(-1)
        across = variance_across(self.sigmas, self.widths, cosine)
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

        Rows: normal x and y (zero where there is no line, so that nothing faces it), x and y of
        the point, distance of the line from the origin, its variance, variance of the normal's
        direction.
        """
        normals = np.where(self.flat, self.normals.T, 0.0)
        offset = (normals * self.centres.T).sum(0)
        variances = self.normal_variances / self.window_lengths
        return np.stack([*normals, *self.points.T, offset, variances, self.normal_sigmas**2])

    @cached_property
    def movable(self) -> Array:
        """(5, m) the points that have a line: x, y, normal x and y, variance across it."""
        packed = np.stack([*self.points.T, *self.normals.T, self.normal_variances])
        return np.ascontiguousarray(packed[:, self.flat])


def surface(sweep: Sweep, lags: Sequence[int] = LAGS) -> Surface:
    """The lines around the points of a sweep.

    Parameters
    ----------
    sweep : Sweep
        Points in scan order, view after view.
    lags : sequence of int
        Half widths of the windows tried, in beams.

    Notes
    -----
    For each point, windows of so many beams centred on it, before it and after it are fitted by
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
    steps = np.repeat([view.scan.step for view in sweep.views], count)
    widths = WITHIN_BEAM * steps * ranges
    run = _run_of(sweep, points, ranges, sigmas)
    first, last = _windows(run, lags)
    windows = (first, last, _window_moments(points, first, last), _spacing(points, run))
    found = _best_lines(points, beams, ranges, sigmas, 0.0 * widths, *windows)
    share = _beam_share(found, widths)
    if share > 0:
        found = _best_lines(points, beams, ranges, sigmas, widths * np.sqrt(share), *windows)
    shared_beams = max(view.scan.shared_beams for view in sweep.views)
    return replace(found, shared=shared, shared_beams=shared_beams)


FAKED, SHOWN = 0.1, 0.3
"""Factors on the variance within the beam: up to the first the choice of windows fakes it, from the
second on it is there. Measured where lines were chosen as if beams had no width: scans of such
beams show 0.06 in the median and 0.2 in one of four, those of two buildings by a SICK LMS 0.8 in
the median and 0.3 or more in three of four."""


def _beam_share(found: Surface, widths: Array) -> float:
    """How much of `WITHIN_BEAM` the scatter about the lines shows, 0 to 1, as a variance.

    Least squares in two numbers: factors on the variance that the ranges make, and on that within
    the beam.
    """
    flat = found.flat
    if flat.sum() < MIN_RETURNS:
        return 0.0
    cosine = (found.normals * found.beams).sum(-1)[flat]
    by_range = variance_across(found.sigmas[flat], 0.0 * widths[flat], cosine)
    by_beam = variance_across(found.sigmas[flat], widths[flat], cosine) - by_range
    weight = (found.window_lengths[flat] - 2) / (by_range + by_beam) ** 2
    design = np.stack([by_range, by_beam])
    normal = (design * weight) @ design.T
    right = (design * weight) @ found.scatter[flat]
    determinant = normal[0, 0] * normal[1, 1] - normal[0, 1] ** 2
    if determinant <= 1e-9 * normal[0, 0] * normal[1, 1]:
        return 0.0
    share = (normal[0, 0] * right[1] - normal[0, 1] * right[0]) / determinant
    ranges = (normal[1, 1] * right[0] - normal[0, 1] * right[1]) / determinant
    share /= max(ranges, 1.0)  # what is faked grows with all noise
    return float(np.clip((share - FAKED) / (SHOWN - FAKED), 0.0, 1.0))


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


def _windows(run: Indices, halves: Sequence[int]) -> tuple[Indices, Indices]:
    """(w, n) first and last point of every window tried; last < first where it leaves its run."""
    index = np.arange(len(run))
    lags = np.array(halves)[:, None]
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
    widths: Array,
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
    variance = variance_across(sigmas, widths, cosine)
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
        widths=widths,
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
