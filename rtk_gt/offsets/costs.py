"""How likely offsets are: -2 log likelihoods of the drive and of what is known beforehand."""

import numpy as np

from rtk_gt.offsets.estimate import SMALLEST_SIGMA, Offsets
from rtk_gt.offsets.noise import pair_incidence
from rtk_gt.offsets.prior import OffsetPrior
from rtk_gt.receivers.steps import Steps, pair_differences
from validation.poses.angles import Array

FALSE = 25.0
"""Cost of a step at most: a false fix contradicts all solutions alike."""
_SOME = 2000
"""Steps at least of which costs are taken, where there are more: each counts for several then."""
_STEPS, _SETTLED = 15, 0.1
"""At most; and by how much less a cost must be to go on."""


def costs_of(found: list[Offsets]) -> list[float]:
    """-2 log likelihood of each, of drive and knowledge; each independent step counts once."""
    best = min(found, key=lambda one: one.sigma)
    sigma = max(best.sigma, SMALLEST_SIGMA)
    return [
        float(np.minimum(one.squares / sigma**2, FALSE).sum()) / best.correlation_time + one.against
        for one in found
    ]


def stride_of(steps: Steps) -> int:
    """One of how many steps `settled_cost` looks at; each counts for so many.

    The noise of a difference of costs is that of the steps that are looked at, as many times.
    """
    return max(len(steps) // _SOME, 1)


def settled_cost(steps: Steps, offsets: Offsets, best: Offsets, prior: OffsetPrior) -> float:
    """-2 log likelihood at the minimum near some offsets, of drive and knowledge.

    Each independent step counts once. Estimates leave directions in which noise is as large as
    what the drive says to the prior, which moves costs by tens; here all of them are minimised.

    Parameters
    ----------
    steps : Steps
        The complete ones.
    offsets : Offsets
        Near a minimum.
    best : Offsets
        With the least noise, which is that of all.
    prior : OffsetPrior
        What is known beforehand.
    """
    rows = np.arange(0, len(steps), stride_of(steps))
    positions, sigma = steps.positions[rows], max(best.sigma, SMALLEST_SIGMA)
    m, count = 3 * (len(steps.receivers) - 1), len(steps) / len(rows) / best.correlation_time
    differences = positions - positions[:, :1]
    information, wanted = prior.of_offsets(
        differences[:, 1:].mean(0), offsets.offsets.values[1:].ravel()
    )
    known = np.isfinite(prior.distances) if len(prior.distances) else np.zeros(0, dtype=bool)
    weight = np.zeros(len(offsets.distances))
    stated = weight.copy()
    if known.any():
        weight[known] = prior.distance_sigmas[known] ** -2.0
        stated[known] = prior.distances[known]
    at = np.concatenate([offsets.offsets.values[1:].ravel(), offsets.distances])

    def looked(at: Array) -> tuple[float, Array, Array]:
        """Cost, normal matrix and right-hand side there."""
        residual, slope, spread = _distances_at(positions, at[:m], at[m:], offsets.eta)
        whitening = np.linalg.pinv(spread, rcond=1e-6, hermitian=True) / sigma**2
        squares = ((residual @ whitening) * residual).sum(1)
        away, off = at[:m] - wanted, at[m:] - stated
        against = float(away @ information @ away + weight @ off**2)
        log_spread = np.log(np.maximum(np.linalg.eigvalsh(spread), 1e-6)).sum()
        cost = count * float(np.minimum(squares, FALSE).sum() + len(rows) * log_spread) + against
        use = (count * (squares < FALSE))[:, None, None]
        left = np.swapaxes(slope, 1, 2) @ whitening * use
        normal = (left @ slope).sum(0)
        right = -(left @ residual[..., None]).sum(0)[:, 0]
        normal[:m, :m] += information
        right[:m] -= information @ away
        normal[m:, m:] += np.diag(weight)
        right[m:] -= weight * off
        return cost, normal, right

    cost, normal, right = looked(at)
    damping = 1e-9
    for _ in range(_STEPS):
        size = np.diagonal(normal) + 1e-9 * np.trace(normal)
        step = np.linalg.solve(normal + damping * np.diag(size), right)
        there = looked(at + step)
        if there[0] > cost:
            damping = max(10 * damping, 1e-3)
            continue
        better = cost - there[0]
        at, (cost, normal, right), damping = at + step, there, damping / 10
        if better < _SETTLED:
            break
    return cost


def _distances_at(
    positions: Array, offsets: Array, distances: Array, eta: float
) -> tuple[Array, Array, Array]:
    """Residuals (t, p) of distances, their slopes (t, p, 3 (r - 1) + p), their noise (p, p)."""
    placed = positions.copy()
    placed[:, 1:] += offsets.reshape(-1, 3)
    rods = pair_differences(placed)
    lengths = np.linalg.norm(rods, axis=-1)
    along = rods / np.maximum(lengths, 1e-9)[..., None]
    t, p = lengths.shape
    r = positions.shape[1]
    by_receiver = pair_incidence(r)[None, :, :, None] * along[:, :, None, :]
    slope = np.concatenate(
        [by_receiver[:, :, 1:].reshape(t, p, -1), np.broadcast_to(-np.eye(p), (t, p, p))], axis=2
    )
    errors = by_receiver.reshape(t, p, -1) * np.tile([1.0, 1.0, eta], r)
    spread = np.einsum("tpa,tqa->pq", errors, errors) / t
    return lengths - distances, slope, spread
