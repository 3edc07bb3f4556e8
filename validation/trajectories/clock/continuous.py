"""A path in continuous time through noisy poses: its pose and its rates at any time."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.optimize import minimize_scalar

from validation.poses.angles import Array, wrap
from validation.statistics.robust import SIGMA_OF_MEDIAN

MOST_SAMPLES = 40_000
"""Poses beyond which neighbours are averaged: ten minutes at 66 Hz. No robot moves faster than
that; a laboratory's cameras of 1 kHz cost time only."""
OUTLIER = 4.0
"""Standard deviations beyond which a pose loses its weight."""
FASTEST = (1, 2, 4, 8)
"""One in how many of the poses, the ones in the quickest motion, show how far off poses are: an
odometer is exact while its robot stands, which may be most of the time, and a wrong pose is told
from one in motion by what others in motion are off by. With the median of all, a drive of 50 s with
5 s at each stop had a path up to 95 mm beside its odometry, and now 0.4 mm."""
FEWEST_FAST = 25
"""Poses that show it at least: a median to a quarter."""


@dataclass(frozen=True)
class ContinuousPath:
    """Positions and headings at n times with their rates, cubic in between.

    Parameters
    ----------
    times : (n,) array
        Seconds.
    positions, velocities : (n, 2) array
        Metres, m/s.
    headings, turn_rates : (n,) array
        Radians, unwrapped; rad/s. Zero where there is no heading.
    gap : float
        Nothing is given across a longer interval, seconds.
    has_heading : bool
        Whether headings are known.
    noise : (2,) array
        Standard deviation of the poses about the path: metres, radians.
    rate_variance : (2,) array
        Mean variance of the rates that noise alone makes: (m/s)^2 of each coordinate, (rad/s)^2.
    has_position : bool
        Whether positions are known; a gyroscope has headings only, and all positions are zero.

    Notes
    -----
    The cubic through two poses and rates is the mean of the model of white noise on acceleration.
    """

    times: Array
    positions: Array
    velocities: Array
    headings: Array
    turn_rates: Array
    gap: float
    has_heading: bool
    noise: Array
    rate_variance: Array
    has_position: bool = True

    def supported(self, t: Array) -> npt.NDArray[np.bool_]:
        """(m,) whether poses stand on both sides of each time, and no gap in between."""
        left = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 2)
        width = self.times[left + 1] - self.times[left]
        return np.asarray((t >= self.times[0]) & (t <= self.times[-1]) & (width <= self.gap))

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """(m, 3) poses, their first and their second derivative at times with support."""
        left = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 2)
        width = (self.times[left + 1] - self.times[left])[:, None]
        u = (t - self.times[left])[:, None] / width
        values = np.column_stack([self.positions, self.headings])
        rates = np.column_stack([self.velocities, self.turn_rates])
        rise = values[left + 1] - values[left]
        v0, v1 = rates[left] * width, rates[left + 1] * width
        square, cube = 3 * rise - 2 * v0 - v1, v0 + v1 - 2 * rise
        pose = values[left] + u * (v0 + u * (square + u * cube))
        first = (v0 + u * (2 * square + 3 * u * cube)) / width
        second = (2 * square + 6 * u * cube) / width**2
        return pose, first, second

    def rough_rates(self, t: Array, window: float) -> Array:
        """(m, 3) rates at times less their running means over a window; 0 beside gaps."""
        steps = np.diff(self.times)
        size = max(1, round(window / float(np.median(steps))))
        rates = np.column_stack([self.velocities, self.turn_rates])
        rough = rates - uniform_filter1d(rates, size, axis=0, mode="nearest")
        broken = np.append(steps > self.gap, False).astype(float)
        rough[uniform_filter1d(broken, 2 * size + 1, mode="nearest") > 1e-9] = 0.0
        return np.column_stack([np.interp(t, self.times, column) for column in rough.T])

    def corrected(self, scale: float, turn_scale: float, turn_bias: float) -> "ContinuousPath":
        """The path of an odometer with these errors taken out, from the same first pose.

        Parameters
        ----------
        scale, turn_scale : float
            Share added to distances and to turns.
        turn_bias : float
            Added to the turn rate, rad/s.
        """
        turned = turn_scale * (self.headings - self.headings[0])
        turned = turned + turn_bias * (self.times - self.times[0])
        steps = np.diff(self.positions, axis=0)
        half = (turned[1:] + turned[:-1]) / 2
        moved = (1 + scale) * _turned(steps, half)
        positions = self.positions[0] + np.vstack([np.zeros(2), np.cumsum(moved, axis=0)])
        return replace(
            self,
            positions=positions,
            velocities=(1 + scale) * _turned(self.velocities, turned),
            headings=self.headings + turned,
            turn_rates=(1 + turn_scale) * self.turn_rates + turn_bias,
        )

    def turned_by(self, weights: Array) -> Array:
        """(n, 2) change of the positions for a small turn of the heading by weights, per unit.

        Parameters
        ----------
        weights : (n,) array
            The turn at each time; all that comes after a place turns about it.
        """
        steps = np.diff(self.positions, axis=0)
        half = (weights[1:] + weights[:-1]) / 2
        moved = half[:, None] * np.column_stack([-steps[:, 1], steps[:, 0]])
        return np.vstack([np.zeros(2), np.cumsum(moved, axis=0)])


def _turned(vectors: Array, angle: Array) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    x, y = vectors.T
    return np.column_stack([c * x - s * y, s * x + c * y])


def continuous_path(
    times: Array, positions: Array | None, headings: Array | None, gap: float
) -> ContinuousPath:
    """The path through noisy poses, by white noise on acceleration of the most likely strength.

    Parameters
    ----------
    times : (n,) array
        Increasing, seconds.
    positions : (n, 2) array, optional
        Metres.
    headings : (n,) array, optional
        Radians; half turns among them are taken out.
    gap : float
        Longest interval that is no gap, seconds.

    Notes
    -----
    Poses far off lose their weight (Tukey's), so that some wrong ones do no harm.
    """
    lifted = None if headings is None else unwrapped(times, headings, gap)
    places = np.zeros((len(times), 2)) if positions is None else positions
    if len(times) > MOST_SAMPLES:
        times, places, lifted = _averaged(times, places, lifted)
    moves = None if positions is None else _Smoother(times, places, gap)
    turns = None if lifted is None else _Smoother(times, lifted[:, None], gap)
    zero = np.zeros(len(times))
    return ContinuousPath(
        times,
        places if moves is None else moves.values,
        places if moves is None else moves.rates,
        zero if turns is None else turns.values[:, 0],
        zero if turns is None else turns.rates[:, 0],
        gap,
        turns is not None,
        np.array([0.0 if one is None else one.sigma for one in (moves, turns)]),
        np.array([0.0 if one is None else one.rate_variance for one in (moves, turns)]),
        moves is not None,
    )


def unwrapped(times: Array, headings: Array, gap: float) -> Array:
    """Headings without jumps by whole or half turns; half turns of single poses are taken out."""
    doubled = np.exp(2j * headings)
    if np.median(np.diff(times)) < 0.25:
        doubled = _running_mean(doubled, 5)
    around = np.unwrap(np.angle(doubled)) / 2
    lifted = headings + np.pi * np.round((around - headings) / np.pi)
    # Of the two directions of each stretch, the one that most of its poses have.
    starts = np.flatnonzero(np.diff(times, prepend=-np.inf) > gap)
    flipped = np.abs(wrap(lifted - headings)) > np.pi / 2
    sizes = np.diff([*starts, len(times)])
    share = np.add.reduceat(flipped.astype(float), starts) / sizes
    return np.asarray(lifted + np.pi * np.repeat(share > 0.5, sizes))


def _running_mean(values: npt.NDArray[np.complex128], size: int) -> npt.NDArray[np.complex128]:
    real = uniform_filter1d(values.real, size, mode="nearest")
    return np.asarray(real + 1j * uniform_filter1d(values.imag, size, mode="nearest"))


def _averaged(
    times: Array, positions: Array, headings: Array | None
) -> tuple[Array, Array, Array | None]:
    """Neighbours averaged until there are few enough."""
    size = -(-len(times) // MOST_SAMPLES)
    n = len(times) // size * size

    def mean(values: Array) -> Array:
        return np.asarray(values[:n].reshape(n // size, size, *values.shape[1:]).mean(1))

    return mean(times), mean(positions), None if headings is None else mean(headings)


def _largest(off: Array, motion: Array, share: float) -> float:
    """The largest of the quantiles of what poses are off by, over the parts of `FASTEST`."""
    order = np.argsort(-motion)
    counts = [len(off) // part for part in FASTEST]
    parts = [order[:count] for count in counts if count >= FEWEST_FAST] or [order]
    return max(float(np.quantile(off[part], share)) for part in parts)


class _Smoother:
    """White noise on acceleration through values of one kind, with its strength."""

    def __init__(self, times: Array, values: Array, gap: float) -> None:
        self.steps = np.diff(times)
        self.linked = self.steps <= gap
        self.observed = values
        self.unit = float(np.median(self.steps))
        self.weights = self._first_weights()
        ratio = 0.0
        for last in (False, False, True):
            found = minimize_scalar(
                self._cost,
                bounds=(-16.0, 12.0) if not ratio else (ratio - 3, ratio + 3),
                method="bounded",
                options={"xatol": 0.1, "maxiter": 14},
            )
            ratio = float(found.x)
            self._solve(ratio)
            if not last:
                left = np.linalg.norm(values - self.values, axis=1)
                good = self.weights > 0.1
                speeds = np.linalg.norm(self.rates, axis=1)
                scale = SIGMA_OF_MEDIAN * _largest(left[good], speeds[good], 0.5) + 1e-12
                scale /= 1.0 if values.shape[1] == 1 else 1.746
                scaled = (left / scale / (OUTLIER + values.shape[1])) ** 2
                self.weights = np.where(scaled < 1, (1 - scaled) ** 2, 0.0) + 1e-9

    def _first_weights(self) -> Array:
        """Poses that are far from the median of their neighbours do not count at first."""
        # Mirrored, so that a wrong first or last pose is not most of what it is compared with.
        middle = median_filter(self.observed, size=(5, 1), mode="mirror")
        off = np.linalg.norm(self.observed - middle, axis=1)
        way = np.linalg.norm(np.roll(middle, -2, axis=0) - np.roll(middle, 2, axis=0), axis=1)
        way[:2] = way[-2:] = 0.0
        scale = _largest(off, way, 0.7) + 1e-9
        return np.where(off > 12 * scale, 1e-9, 1.0)

    def _factor(self, ratio: float) -> tuple[Array, float]:
        """Banded factor of the precision, and its part of the likelihood."""
        n = len(self.observed)
        tau = self.steps / self.unit
        strength = np.where(self.linked, np.exp(-ratio), 0.0)
        # Precision of the step's error (value, rate) of white noise on acceleration.
        a, b, c = 12 / tau**3 * strength, -6 / tau**2 * strength, 4 / tau * strength
        bands = np.zeros((4, 2 * n))
        bands[0, ::2] = self.weights
        bands[0, 1::2] = 1e-10
        # e = x1 - [[1, tau], [0, 1]] x0
        bands[0, 2::2] += a
        bands[0, 3::2] += c
        bands[1, 2:-1:2] += b
        bands[0, :-2:2] += a
        bands[0, 1:-2:2] += a * tau**2 + 2 * b * tau + c
        bands[1, :-2:2] += a * tau + b
        bands[2, :-2:2] = -a
        bands[3, :-2:2] = -b
        bands[1, 1:-2:2] += -(a * tau + b)
        bands[2, 1:-2:2] = -(b * tau + c)
        factor = cholesky_banded(bands, lower=True, check_finite=False)
        determinant = 2 * np.log(factor[0]).sum()
        linked = int(self.linked.sum())
        return factor, float(determinant + 2 * linked * ratio)

    def _cost(self, ratio: float) -> float:
        """-2 log likelihood, the noise's variance taken at its best."""
        try:
            factor, determinant = self._factor(ratio)
        except LinAlgError:
            return np.inf
        values = self._means(factor)[::2]
        weighted = self.weights[:, None] * self.observed
        rest = float(np.sum(weighted * (self.observed - values)))
        count = (self.weights > 0.1).sum()
        k = self.observed.shape[1]
        return float(count * k * np.log(max(rest, 1e-18 * count) / (count * k)) + k * determinant)

    def _means(self, factor: Array) -> Array:
        right = np.zeros((2 * len(self.observed), self.observed.shape[1]))
        right[::2] = self.weights[:, None] * self.observed
        return np.asarray(cho_solve_banded((factor, True), right, check_finite=False))

    def _solve(self, ratio: float) -> None:
        factor, _ = self._factor(ratio)
        means = self._means(factor)
        self.values, self.rates = means[::2], means[1::2] / self.unit
        weighted = self.weights[:, None] * self.observed
        rest = float(np.sum(weighted * (self.observed - self.values)))
        count = max(float(self.weights.sum()) * self.observed.shape[1], 1.0)
        variance = max(rest, 0.0) / count
        self.sigma = float(np.sqrt(variance))
        # The rates' variance at some places; they are alike where the sampling is.
        places = np.linspace(0, len(self.observed) - 1, min(8, len(self.observed))).astype(int)
        units = np.zeros((2 * len(self.observed), len(places)))
        units[2 * places + 1, np.arange(len(places))] = 1.0
        inverse = cho_solve_banded((factor, True), units, check_finite=False)
        own = inverse[2 * places + 1, np.arange(len(places))]
        self.rate_variance = float(np.median(own) * variance / self.unit**2)
