"""Causes fitted to the poses of a source, with noise that neighbours share."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median_filter

from validation.poses.angles import Array, wrap
from validation.statistics.hypotheses import LOST
from validation.statistics.robust import sigma_from_median
from validation.trajectories.causes.chain import PARAMETERS, slopes
from validation.trajectories.causes.matching import Matched, start
from validation.trajectories.causes.noise import (
    Mask,
    Noise,
    Whitener,
    effective_number,
    estimate_noise,
)

LOOSE = np.array([10.0, 10.0, 3.0, 1.0, 1.0, 3.0, 0.1, 1.0, 1e-3, 0.01, 0.01, 0.01])
"""Standard deviations about the start, in metres, radians and seconds, which keep a combination
that the drive does not show from running away; a drive that shows it knows it a hundred times
better."""
FLAG = 4.5
"""Standard deviations from the poses around at which a cell is left out. Of 10,000 good cells of a
normal distribution 0.07 go, and one in 100 of three degrees of freedom."""
NEIGHBOURS = 11
"""Poses whose median a cell is held against: a burst of five that are off still shows."""
LEAST_SPEED = 0.02
"""Metres a second below which a robot stands as far as a delay is concerned: 0.1 s of delay are
then no more than the noise of a good source."""
CLEARLY = 0.95
"""A rough delay is begun from only where it leaves less than this share of what zero leaves."""
ITERATIONS = 12
SETTLED = 0.01
"""Largest change of a parameter, in its standard deviations, at which a fit has converged."""


@dataclass(frozen=True)
class Weights:
    """What each cell counts.

    Parameters
    ----------
    cells : (n, 2) array of bool
        Positions and headings that are used.
    position, heading : Noise
        Of each component of a position, and of a heading.
    place, turn : Whitener
        Products with their inverse covariances.
    effective : (2,) array
        Independent positions and headings that would tell a mean as well.
    """

    cells: Mask
    position: Noise
    heading: Noise
    place: Whitener
    turn: Whitener
    effective: Array

    @property
    def both(self) -> Mask:
        """(n,) poses of which position and heading are used."""
        return np.asarray(self.cells.all(1))

    def __call__(self, values: Array) -> Array:
        """(n, 3, ...) inverse covariance times values."""
        return np.concatenate([self.place(values[:, :2]), self.turn(values[:, 2:])], axis=1)


def make_weights(stamps: Array, cells: Mask, position: Noise, heading: Noise) -> Weights:
    """Weights of cells with this noise."""
    effective = [
        effective_number(stamps, cells[:, kind], noise)
        for kind, noise in enumerate((position, heading))
    ]
    place, turn = (
        Whitener(stamps, cells[:, kind], noise) for kind, noise in enumerate((position, heading))
    )
    return Weights(cells, position, heading, place, turn, np.array(effective))


def single_pose_sizes(matched: Matched, parameters: Array, weights: Weights) -> Array:
    """(12,) size of each parameter that changes a pose by about its noise."""
    length, angle = weights.position.sigma, weights.heading.sigma
    places = matched.poses[weights.cells[:, 0], :2]
    extent = max(float(np.sqrt(places.var(0).sum())), 1e-3)
    span = max(float(matched.since.std()), 1e-3)
    own = matched.own_motion(parameters, weights.both)
    speed = max(float(np.sqrt(np.mean(np.abs(own.velocities) ** 2))), LEAST_SPEED)
    turn = min(angle, length / extent)
    places_and_turns = [length, length, turn, length, length, angle]
    drifts = [length / speed / span, length / span, length / span, angle / span]
    return np.array([*places_and_turns, length / extent, length / speed, *drifts])


@dataclass(frozen=True)
class Fit:
    """Parameters of some causes that make the poses likeliest; the others are zero.

    Parameters
    ----------
    columns : tuple of int
        Of `PARAMETERS` that are free.
    parameters : (12,) array
        All of them.
    squares : float
        Residuals in units of their noise, squared.
    information, products : (12, 12) array
        Of the parameters: by the mean of the motions that reference and source see, and by the one
        times the other, which holds motion, less what noise could have made of it.
    gradient : (12,) array
        Of half the squares.
    residuals : (n, 3) array
        Reference minus corrected source.
    """

    columns: tuple[int, ...]
    parameters: Array
    squares: float
    information: Array
    products: Array
    gradient: Array
    residuals: Array

    @property
    def covariance(self) -> Array:
        """(k, k) of the free parameters."""
        at = np.ix_(self.columns, self.columns)
        inverse = np.linalg.pinv(self.products[at], rcond=1e-14, hermitian=True)
        return np.asarray(inverse @ self.information[at] @ inverse)


def fit(matched: Matched, weights: Weights, free: tuple[int, ...], begin: Array) -> Fit:
    """Gauss-Newton from given parameters, with fixed weights; a step that does not help is halved.

    Parameters
    ----------
    matched : Matched
        The poses.
    weights : Weights
        Of their cells.
    free : tuple of int
        Columns that are fitted.
    begin : (12,) array
        Where it starts; zero at what is not free.

    Notes
    -----
    Combinations that the drive does not show stay where they are. Let loose they do harm: a scale
    of zero takes away the source's noise, where drift and delay can stand for its motion.
    """
    parameters = np.array(begin)
    unit = single_pose_sizes(matched, parameters, weights)[list(free)]
    columns = list(free)
    hold = 1 / LOOSE[columns] ** 2

    def held(one: Fit) -> float:
        return one.squares + float(hold @ (one.parameters - begin)[columns] ** 2)

    now = _look(matched, weights, free, parameters)
    for _ in range(ITERATIONS if columns else 0):
        at = np.ix_(columns, columns)
        seen = _seen(now.products[at], unit)
        known = now.information[at] + np.diag(hold)
        pull = now.gradient[columns] + hold * (parameters - begin)[columns]
        step = -seen @ np.linalg.solve(seen.T @ known @ seen, seen.T @ pull)
        share = 1.0
        for _ in range(5):
            trial = parameters.copy()
            trial[columns] += share * step
            then = _look(matched, weights, free, trial)
            if held(then) <= held(now) + 1e-9:
                break
            share /= 2
        else:
            break
        parameters, now = trial, then
        if share == 1.0 and float(step @ known @ step) < SETTLED**2:
            break
    return now


def _seen(products: Array, unit: Array) -> Array:
    """(k, r) combinations of parameters that the drive shows; see `weighing.lost_parameters`."""
    values, vectors = np.linalg.eigh(products * np.outer(unit, unit))
    return np.asarray(unit[:, None] * vectors[:, values >= 1 / LOST**2])


def _look(matched: Matched, weights: Weights, free: tuple[int, ...], parameters: Array) -> Fit:
    """Squares and derivatives at given parameters."""
    residuals, seen = matched.residuals(parameters)
    good = weights.both
    own = matched.own_motion(parameters, good)
    theirs, ours = (slopes(parameters, one, matched.since) for one in (seen, own))
    middle = (theirs + ours) / 2
    weighed = weights(middle)
    n = len(residuals) * 3
    # With a, b the two slopes, m their mean and d half their difference, (a'Wb + b'Wa) / 2 is
    # m'Wm - d'Wd. Noise without motion makes of it a standard deviation of at most
    # 2 d'Wd / sqrt(n): three of these are taken off, and another 2 d'Wd, so that what counts as
    # shown is motion by two thirds.
    half = (theirs - ours) / 2
    information = middle.reshape(n, 12).T @ weighed.reshape(n, 12)
    noise = half.reshape(n, 12).T @ weights(half).reshape(n, 12)
    products = information - (3 + 6 / np.sqrt(weights.effective.min())) * noise
    return Fit(
        free,
        parameters,
        float(np.sum(residuals * weights(residuals))),
        information,
        products,
        weighed.reshape(n, 12).T @ residuals.ravel(),
        residuals,
    )


def fit_all(matched: Matched, delay: float) -> tuple[Fit, Weights]:
    """All causes at once, the cells that count and their noise.

    Parameters
    ----------
    matched : Matched
        The poses.
    delay : float
        A rough guess, in seconds.
    """
    everything = tuple(range(len(PARAMETERS)))
    stamps = matched.stamps
    tried = []
    for guess in {0.0, delay}:
        parameters = start(matched, guess).parameters
        for _ in range(3):
            residuals, _ = matched.residuals(parameters)
            cells = good_cells(residuals)
            sizes = [
                max(float(sigma_from_median(residuals[:, columns])), floor)
                for columns, floor in ((slice(0, 2), 1e-6), (slice(2, 3), 1e-7))
            ]
            # Nothing is known of the memory yet: so short a one is none.
            white = [Noise(size, 1e-3 * size, 1e-3) for size in sizes]
            weights = make_weights(stamps, cells, *white)
            found = fit(matched, weights, everything, parameters)
            parameters = found.parameters
        size = float(np.median(np.hypot(found.residuals[:, 0], found.residuals[:, 1])))
        size += float(np.median(np.abs(found.residuals[:, 2])))
        tried.append((size * (1.0 if guess else CLEARLY), found, weights))
    found, weights = min(tried, key=lambda one: one[0])[1:]
    for _ in range(2):
        cells = good_cells(found.residuals)
        weights = make_weights(stamps, cells, *noises(matched, found, weights, cells))
        found = fit(matched, weights, everything, found.parameters)
    wrapped = found.parameters.copy()
    wrapped[[2, 5]] = wrap(wrapped[[2, 5]])
    return fit(matched, weights, everything, wrapped), weights


def noises(matched: Matched, found: Fit, weights: Weights, cells: Mask) -> tuple[Noise, Noise]:
    """Noise of positions and of headings in what a fit leaves.

    Only combinations that the drive shows have taken noise away. Of the others, a scale for
    example, the slopes of a robot that stands are noise themselves.
    """
    own = matched.own_motion(found.parameters, np.asarray(cells.all(1)))
    _, seen = matched.residuals(found.parameters)
    unit = single_pose_sizes(matched, found.parameters, weights)
    theirs, ours = (slopes(found.parameters, one, matched.since) for one in (seen, own))
    told = []
    for kind, rows in enumerate((slice(0, 2), slice(2, 3))):
        middle, half = ((theirs + ours)[:, rows] / 2, (theirs - ours)[:, rows] / 2)
        used = cells[:, kind]
        flat, noise = (one[used].reshape(-1, len(unit)) for one in (middle, half))
        sigma = (weights.position, weights.heading)[kind].sigma
        products = (flat.T @ flat - 4 * noise.T @ noise) / sigma**2
        by = middle @ _seen(products, unit)
        told.append(estimate_noise(matched.stamps, used, found.residuals[:, rows], by))
    return told[0], told[1]


def good_cells(residuals: Array) -> npt.NDArray[np.bool_]:
    """(n, 2) positions and headings that agree with the ones around them, and with all."""
    good = np.ones((len(residuals), 2), dtype=bool)
    for kind, columns in enumerate((slice(0, 2), slice(2, 3))):
        values = residuals[:, columns]
        around = median_filter(values, size=(min(NEIGHBOURS, len(values)), 1), mode="nearest")
        alone = values - around
        for off, limit in ((alone, FLAG), (values, 2 * FLAG)):
            sigma = max(float(sigma_from_median(off)), 1e-9)
            good[:, kind] &= (np.abs(off) < limit * sigma).all(1)
    return good
