"""What a whole drive shows of offsets and errors: distances of the antennas, and how they lean.

A vehicle leans forward as its road does. A receiver whose height is wrong tilts the plane through
the antennas for as long as it is, while the way stays as steep as it was. Springs, humps and slow
errors make them differ, too, which the drive itself shows.
"""

from dataclasses import dataclass

import numpy as np

from rtk_gt.lasting.contrasts import antenna_planes
from rtk_gt.offsets.estimate import Offsets
from rtk_gt.offsets.noise import pair_incidence
from rtk_gt.offsets.robust import autocorrelation_time
from rtk_gt.offsets.slow_errors import ErrorModel, summed_covariance
from rtk_gt.receivers.fixes import Bools
from rtk_gt.receivers.steps import pair_differences
from validation.poses.angles import Array

SIDE = 1.0
"""Seconds to both sides over which a way is as steep as it is: at a metre a second noise of a
centimetre is then half a degree."""
SLOWEST = 1.0
"""Metres a second below which a way has no slope."""
FEWEST = 100
"""Epochs with such a slope, at least."""
FALSE, PLAIN = 10.0, 0.1
"""Standard deviations, or metres, to which a residual counts: false fixes of metres are others."""


@dataclass(frozen=True)
class _WaySlopes:
    """Slopes of the antennas' plane along the way minus those of the way, at n epochs.

    Parameters
    ----------
    values : (n,) array
        Metres a metre; 0 where there are none.
    moving : (n,) bool array
        Where there are some.
    by_height : (n, r) array
        What a metre of each antenna's height adds, 1/m.
    ahead : (n, 2) array
        The way's direction along and across the first baseline: what a constant lean adds.
    """

    values: Array
    moving: Bools
    by_height: Array
    ahead: Array


def _way_slopes(times: Array, positions: Array) -> _WaySlopes | None:
    """Of positions (n, r, 3), metres, at times (n,); None of two antennas or too few epochs."""
    n, r = positions.shape[:2]
    every = float(np.median(np.diff(times)))
    side = max(round(SIDE / every), 1)
    if r < 3 or n < FEWEST:
        return None
    centre = positions.mean(1)
    way, took = np.zeros((n, 3)), np.full(n, np.inf)
    way[side:-side] = centre[2 * side :] - centre[: -2 * side]
    took[side:-side] = times[2 * side :] - times[: -2 * side]
    length = np.hypot(way[:, 0], way[:, 1])
    # Over a pause the way may go up and down.
    moving = (took < 3 * side * every) & (length > SLOWEST * took)
    if moving.sum() < FEWEST:
        return None
    course = way[:, :2] / np.maximum(length, 1e-3)[:, None]
    inverse, arms, slopes = antenna_planes(positions)
    along = (slopes * course).sum(1)
    values = np.where(moving, along - way[:, 2] / np.maximum(length, 1e-3), 0.0)
    by_height = np.einsum("ni,nij,nrj->nr", course, inverse, arms) * moving[:, None]
    first = positions[:, 1, :2] - positions[:, 0, :2]
    first = first / np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-3)
    ahead = np.column_stack(
        [(course * first).sum(1), first[:, 0] * course[:, 1] - first[:, 1] * course[:, 0]]
    )
    return _WaySlopes(values, moving, by_height, ahead * moving[:, None])


@dataclass(frozen=True)
class WholeDrive:
    """Residuals of n epochs and q kinds, and how they change with offsets and errors.

    Parameters
    ----------
    rods : (n, p, 3) array
        Between the antennas of each pair, metres.
    residuals : (n, q) array
        Of the p distances, metres, and of the slope along the way where there is one.
    own : (n, q, k) array
        What errors of the offsets, of the distances and of the lean add.
    by_height : (n, r) array
        What heights of the antennas add to the slope; empty without slopes.
    moving : (n,) bool array
        Where there is a slope.
    every : float
        Seconds between epochs.
    whole : (n, q) array
        Residuals as they are; in ``residuals`` none counts beyond what noise and small errors make.
    """

    rods: Array
    residuals: Array
    own: Array
    by_height: Array
    moving: Bools
    every: float
    whole: Array

    @classmethod
    def of(cls, times: Array, positions: Array, offsets: Offsets) -> "WholeDrive":
        """From positions (n, r, 3) with offsets added, metres, and what is known of these."""
        n, r = positions.shape[:2]
        rods = pair_differences(positions)
        lengths = np.linalg.norm(rods, axis=-1, keepdims=True)
        along = rods / lengths
        p = along.shape[1]
        whole = lengths[..., 0] - offsets.distances
        residuals = _clipped(whole, PLAIN)
        by_offset = pair_incidence(r)[None, :, 1:, None] * along[:, :, None, :]
        own = np.concatenate(
            [by_offset.reshape(n, p, -1), np.broadcast_to(-np.eye(p), (n, p, p))], axis=2
        )
        every = float(np.median(np.diff(times)))
        slopes = _way_slopes(times, positions)
        if slopes is None:
            none = np.zeros((n, 0)), np.zeros(n, dtype=bool)
            return cls(rods, residuals, own, *none, every, whole)
        lean = np.linalg.lstsq(slopes.ahead, slopes.values, rcond=None)[0]
        leans = np.where(slopes.moving, slopes.values - slopes.ahead @ lean, 0.0)[:, None]
        values = np.zeros((n, 1))
        values[slopes.moving] = _clipped(leans[slopes.moving])
        row = np.zeros((n, 1, own.shape[2] + 2))
        row[:, 0, 2 : 3 * (r - 1) : 3] = slopes.by_height[:, 1:]
        row[:, 0, -2:] = slopes.ahead
        own = np.concatenate([np.pad(own, ((0, 0), (0, 0), (0, 2))), row], axis=1)
        residuals = np.concatenate([residuals, values], axis=1)
        whole = np.concatenate([whole, leans], axis=1)
        return cls(rods, residuals, own, slopes.by_height, slopes.moving, every, whole)

    @property
    def receivers(self) -> int:
        """How many there are."""
        p = self.rods.shape[1]
        return next(r for r in range(2, p + 2) if r * (r - 1) // 2 == p)

    def as_seen(self, first: int, last: int) -> Array:
        """(n, q) residuals, those of an error in the epochs [first, last) whole.

        Offsets may be those with an error that stays: then the distances before it are as far off,
        which is usual there.
        """
        at = np.arange(len(self.whole))
        rest, p = (at < first) | (at >= last), self.rods.shape[1]
        found = np.where(rest[:, None], self.residuals, self.whole)
        if rest.any():
            found[rest, :p] = _clipped(self.whole[rest, :p], PLAIN)
        return found

    def error(self, who: int, size: Array) -> Array:
        """(n, q, 4) design of an error of a receiver, about a size (3,).

        The last column is what the distances change by beyond it, as they are no straight lines.
        """
        sign = pair_incidence(self.receivers)[:, who, None]
        right = self.rods - sign * size
        length = np.linalg.norm(right, axis=-1, keepdims=True)
        design = sign * right / length
        whole = np.linalg.norm(self.rods, axis=-1) - length[..., 0]
        found = np.concatenate([design, (whole - design @ size)[..., None]], axis=-1)
        if self.by_height.shape[1] == 0:
            return found
        lean = np.zeros((len(found), 1, 4))
        lean[:, 0, 2] = self.by_height[:, who]
        return np.concatenate([found, lean], axis=1)

    def score_spread(self, times: Array, scored: Array, model: ErrorModel, eta: float) -> Array:
        """(k, k) what sums of ``scored`` (n, k, q) times the residuals vary by, by a model.

        The receivers' errors are white and slow; the lean varies by springs and humps besides.
        """
        n, r = len(self.rods), self.receivers
        errors = np.stack([self.error(who, np.zeros(3))[..., :3] for who in range(r)], axis=2)
        errors = (errors * [1.0, 1.0, eta]).reshape(n, -1, 3 * r)
        scores = scored @ errors
        found = model.white**2 * np.einsum("tkc,tlc->kl", scores, scores)
        found += summed_covariance(times, scores, model)
        p = self.rods.shape[1]
        for lean in range(p, scored.shape[2]):
            varies = 1 / self.weight(self.residuals)[0][lean, lean]
            found += varies * scored[:, :, lean].T @ scored[:, :, lean]
        return np.asarray(found)

    def weight(self, residuals: Array) -> tuple[Array, float]:
        """(q, q) weight of residuals (n, q) and how many epochs one independent one is worth.

        The latter of the distances; each kind is weighed by its own.
        """
        p = self.rods.shape[1]
        distances, q = residuals[:, :p], residuals.shape[1]
        tau = autocorrelation_time(distances)
        found = np.zeros((q, q))
        found[:p, :p] = np.linalg.inv(np.atleast_2d(np.cov(distances.T)) + 1e-12 * np.eye(p)) / tau
        if q > p:
            slopes = residuals[self.moving, p:]
            found[p, p] = 1 / (float(slopes.var()) + 1e-12) / autocorrelation_time(slopes)
        return found, tau


def _clipped(residuals: Array, least: float = 0.0) -> Array:
    """Residuals (n, q) as far as they count."""
    spread = 1.4826 * np.median(np.abs(residuals - np.median(residuals, axis=0)), axis=0)
    most = np.maximum(FALSE * spread, least)
    return np.clip(residuals, -most, most)
