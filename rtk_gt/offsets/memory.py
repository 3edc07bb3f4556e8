"""How long the errors of the receivers last: white noise and a first-order process beside it.

What the distances of the antennas leave shows the errors of the receivers along the rods, which
turn with the vehicle. The model is that of the errors themselves, east, north and up of each
receiver, so that a turn is no loss of memory.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import block_diag, cho_solve, cholesky

from rtk_gt.offsets.estimate import Offsets
from rtk_gt.offsets.noise import LEAST_SPREAD, pair_incidence
from rtk_gt.offsets.slow_errors import MOST_NUMBERS, ErrorModel, mean_memory
from rtk_gt.receivers.steps import Steps, pair_differences
from validation.pieces.results import kept_result
from validation.poses.angles import Array

SHORTEST, LONGEST = 2.0, 0.2
"""Memories that are tried: from so many blocks to this share of the record; what lasts longer looks
like offsets."""
_MEMORIES = 7
_SHARES = (0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.87, 0.92, 0.95, 0.97, 0.98, 0.99, 0.995, 0.999)
"""Of the slow errors in the variance of the mean of a block. Between neighbours of half as many a
true share of 0.93 was taken for 0.95, with memories half as long again and variances of 1.5."""
CORRELATED_GAIN = 9.0
"""By which slow errors must fit better than white ones, in twice the logarithm of the likelihood:
two more numbers reach it in one of a hundred drives with white noise."""
TILT = 1.0
"""Shorter memories have more weight beforehand, by this power: the likelihood of a short record
hardly bounds them, and their variance grows with them. Measured over 40 drives of ten memories."""
_RARE = 1e-3
"""Weight below which a model is left out."""
FEWEST_BLOCKS = 30
"""Fewer tell no memory."""


@dataclass(frozen=True)
class _Blocks:
    """Means of n blocks of residuals, and what they are made of.

    ``residuals`` (n, p); their derivatives ``fitted`` (n, p, k) by all that was fitted and
    ``errors`` (n, p, 3 r) by the receivers' errors, for a sigma of 1; ``times`` (n,) and ``length``
    of a block; ``white`` (n, p, p) covariance of the mean of white errors; ``within`` the variance
    of one epoch within its block.
    """

    times: Array
    residuals: Array
    fitted: Array
    errors: Array
    white: Array
    within: float
    length: float


@kept_result()
def error_model(steps: Steps, offsets: Offsets) -> ErrorModel | None:
    """White and slow errors of the receivers; None where slow ones do not show.

    Parameters
    ----------
    steps : Steps
        As the offsets are from, without errors that jump.
    offsets : Offsets
        With their residuals.

    Notes
    -----
    Restricted likelihood (Patterson and Thompson 1971) of the residuals, blocks of them averaged:
    offsets and distances that were fitted have taken the slowest part away. Of a short record one
    memory fits nearly as well as others; all are kept with their weights.
    """
    if not offsets.known:
        return None
    blocks = _blocks(steps, offsets)
    if blocks is None:
        return None
    span = float(blocks.times[-1] - blocks.times[0])
    usual = span / len(blocks.times)
    memories = np.geomspace(SHORTEST * usual, max(LONGEST * span, 4 * usual), _MEMORIES)
    base, _ = _restricted(blocks, block_diag(*blocks.white))
    if base < min(_cost(blocks, *one)[0] for one in product(memories[::3], _SHARES[::2])):
        return None  # nothing near: white noise, as of most drives
    tried = list(product(memories, _SHARES))
    costs, variances = np.array([_cost(blocks, *one) for one in tried]).T
    if base - costs.min() < CORRELATED_GAIN:
        return None
    weights = np.exp(-(costs - costs.min()) / 2) * np.array([tau**-TILT for tau, _ in tried])
    weights /= weights.sum()
    kept = weights > _RARE
    shares = np.array([share for _, share in tried])
    slow = np.sqrt(variances * shares)[kept]
    found = np.array([memory for memory, _ in tried])[kept]
    weights = weights[kept] / weights[kept].sum()
    kept_inside = np.array([mean_memory(blocks.length, memory)[0] for memory in found])
    inside = float(weights @ (slow**2 * (1 - kept_inside)))
    white = np.sqrt(max(blocks.within - inside, 0.0))
    return ErrorModel(float(white), slow, found, weights)


def _blocks(steps: Steps, offsets: Offsets) -> _Blocks | None:
    """The residuals of the good steps in blocks of equal numbers."""
    used = steps.select(steps.complete)
    good = offsets.weights > 0
    rods = pair_differences(used.positions[good] + offsets.offsets.values)
    along = rods / np.linalg.norm(rods, axis=-1, keepdims=True)
    n, p = along.shape[:2]
    r = len(steps.receivers)
    incidence = pair_incidence(r)
    by_receiver = (incidence[None, :, :, None] * along[:, :, None, :]).reshape(n, p, 3 * r)
    fitted = np.concatenate([by_receiver[:, :, 3:], np.broadcast_to(-np.eye(p), (n, p, p))], axis=2)
    errors = by_receiver * np.tile([1.0, 1.0, offsets.eta], r)
    spread = np.einsum("tpa,tqa->pq", errors, errors) / n
    values, axes = np.linalg.eigh(spread)
    axes = axes[:, values > LEAST_SPREAD * values[-1]].T
    count = min(MOST_NUMBERS // len(axes), n)
    if count < FEWEST_BLOCKS:
        return None
    edges = np.arange(count + 1) * n // count
    sizes = np.diff(edges)

    def mean(values: Array) -> Array:
        total = np.add.reduceat(values, edges[:-1], axis=0)
        return np.asarray(total / sizes.reshape(-1, *[1] * (values.ndim - 1)))

    residuals = offsets.residuals[good] @ axes.T
    errors = axes @ errors
    middle = mean(residuals)
    own = np.einsum("tpa,tqa->tpq", errors, errors)
    inside = np.square(residuals - np.repeat(middle, sizes, axis=0)).sum()
    level = (np.trace(own, axis1=1, axis2=2) * np.repeat(1 - 1 / sizes, sizes)).sum()
    within = float(inside / level) if level > 0 else 0.0
    return _Blocks(
        mean(used.times[good]), middle, mean(axes @ fitted), mean(errors),
        mean(own) / sizes[:, None, None], within,
        float(np.median(np.diff(mean(used.times[good])))),
    )  # fmt: skip


def _cost(blocks: _Blocks, memory: float, share: float) -> tuple[float, float]:
    """Twice the negative log likelihood of a memory and a share of slow errors, and the variance.

    The variance is that of slow errors and of the mean of a block of white ones together, for
    errors of a sigma of 1.
    """
    n, p = blocks.residuals.shape
    flat = blocks.errors.reshape(n * p, -1)
    lags = np.abs(blocks.times[:, None] - blocks.times)
    same, other = mean_memory(blocks.length, memory)
    kept = np.where(np.eye(n) > 0, same, other * np.exp(-lags / memory))
    slow = (flat @ flat.T).reshape(n, p, n, p) * kept[:, None, :, None]
    level = float(np.trace(blocks.white.sum(0)) / np.square(flat).sum())
    white = block_diag(*blocks.white) / level
    cost, variance = _restricted(blocks, share * slow.reshape(n * p, n * p) + (1 - share) * white)
    return cost, variance


def _restricted(blocks: _Blocks, covariance: Array) -> tuple[float, float]:
    """Twice the negative restricted log likelihood, and the variance that makes it least."""
    size = len(covariance)
    factor = cholesky(covariance + 1e-9 * np.trace(covariance) / size * np.eye(size), lower=True)
    values = blocks.residuals.reshape(-1)
    design = blocks.fitted.reshape(size, -1)
    solved = cho_solve((factor, True), np.column_stack([design, values]))
    information = design.T @ solved[:, :-1]
    eigenvalues, vectors = np.linalg.eigh(information)
    some = eigenvalues > 1e-10 * eigenvalues[-1]
    right = (vectors.T @ (design.T @ solved[:, -1]))[some]
    squares = float(values @ solved[:, -1] - np.square(right) @ (1 / eigenvalues[some]))
    free = size - int(some.sum())
    determinant = 2 * np.log(np.diagonal(factor)).sum() + np.log(eigenvalues[some]).sum()
    variance = max(squares, 1e-30) / free
    return float(free * np.log(variance) + determinant), variance
