"""Which reading is wrong, and how wrong a reading could be without being noticed.

Baarda's data snooping on the joint adjustment. Nothing is deleted: a blunder is reported with
every reading that could be it, and with the measurement to repeat.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.special import ndtri

from survey.estimation.adjustment import Adjustment, adjust
from survey.estimation.network import Network, distance_entries
from survey.readings.levels import CRITICAL
from validation.errors import GtvalError
from validation.poses.angles import Array

DETECTABLE = 4.13
"""Non-centrality of a blunder found with 80 % power at 0.1 % (Baarda)."""
FALSE_ALARM = 0.05
"""Chance that a campaign without any blunder is said to have one: usual."""
GROSS = 0.1
"""Metres from which a blunder is left out before others are sought: at 2 m what is not linear in it
reaches 0.1^2 / (2 * 2) m, a standard deviation of a reading."""
TOLD_APART = 2.33
"""Normal deviate (1 %, one-sided) from which the worst reading is told apart from another."""
MIN_REDUNDANCY = 1e-6
"""A reading that the others check by less than this share has no w: rounding alone gives 1e-9."""


@dataclass(frozen=True)
class Reliability:
    """Tests of every distance.

    Parameters
    ----------
    w : (n,) array
        Standardised corrected residual, standard normal without blunders; NaN where unchecked.
    blunder : (n,) array
        Size, in metres, of the error that each reading would have if it alone were wrong.
    minimal_detectable : (n,) array
        Smallest blunder found with 80 % power, metres; infinite where unchecked.
    """

    w: Array
    blunder: Array
    minimal_detectable: Array


@dataclass(frozen=True)
class BlunderSuspicion:
    """One suspected blunder.

    Parameters
    ----------
    candidates : (c,) array of int
        Rows of the readings that could be it, the likeliest first.
    w : (c,) array
        Their test values.
    size : (c,) array
        The error that each would have, metres: reading less truth.
    """

    candidates: npt.NDArray[np.intp]
    w: Array
    size: Array


def reading_tests(adjustment: Adjustment) -> Reliability:
    """Baarda's w, implied blunders and minimal detectable blunders of all distances.

    Parameters
    ----------
    adjustment : Adjustment
        The adjusted network.

    Notes
    -----
    w = v / (sigma sqrt(r)), blunder = v / r, minimal detectable = 4.13 sigma / sqrt(r), with the
    residual v and the redundancy number r. Baarda, A Testing Procedure for Use in Geodetic
    Networks (1968).
    """
    n = len(adjustment.network.distance)
    r = adjustment.redundancy[:n]
    residual = adjustment.residual[:n]
    sigma = adjustment.network.sigma
    checked = r > MIN_REDUNDANCY
    safe = np.where(checked, r, 1.0)
    return Reliability(
        w=np.where(checked, residual / np.sqrt(safe), np.nan),
        blunder=np.where(checked, residual * sigma / safe, np.nan),
        minimal_detectable=np.where(checked, DETECTABLE * sigma / np.sqrt(safe), np.inf),
    )


def critical_w(readings: int) -> float:
    """|w| that the largest of so many readings exceeds by chance in one campaign of twenty."""
    return max(CRITICAL, float(-ndtri(FALSE_ALARM / (2 * max(readings, 1)))))


def suspected_blunders(adjustment: Adjustment, most: int = 20) -> list[BlunderSuspicion]:
    """Blunders one after the other, each with all readings that could be it.

    Parameters
    ----------
    adjustment : Adjustment
        The adjusted network.
    most : int
        Stop after so many.

    Notes
    -----
    After the worst reading is found its error is taken as one more unknown, which the following
    search allows for, so that one blunder does not accuse its neighbours. With Q the cofactor of
    the residuals v, w_i = v_i / sqrt(Q_ii); an unknown for reading k is the rank-one downdate of
    v and Q, of which only the diagonal and the columns of the readings found are made.

    Were reading j the culprit, |w_i| - |w_j| would be normal with mean -(1 - rho) |w_j| and
    variance 2 (1 - rho), rho being the correlation of w_i and w_j; j stays a candidate beside the
    worst reading i unless that is excluded at 1 %.
    """
    n = len(adjustment.network.distance)
    critical = critical_w(n)
    if n == 0 or not (np.abs(reading_tests(adjustment).w) > critical).any():
        return []
    J = csr_array(adjustment.jacobian[:n].multiply(np.sqrt(adjustment.weight)[:, None]))
    q = 1 - adjustment.cofactors.leverage(J)
    taken: list[Array] = []
    v = adjustment.residual[:n].copy()
    suspicions: list[BlunderSuspicion] = []
    live = q > MIN_REDUNDANCY
    while len(suspicions) < most and live.any():
        root = np.sqrt(np.where(live, q, 1.0))
        w = np.where(live, v / root, 0.0)
        worst = int(np.abs(w).argmax())
        if abs(w[worst]) < critical:
            break
        column = -(J @ adjustment.cofactors.times(J[[worst]].toarray()[0]))
        column[worst] += 1
        column -= sum((one * one[worst] for one in taken), start=np.zeros(n))
        rho = np.abs(column) / (root[worst] * root)
        order = _candidates(worst, np.abs(w), np.where(live, rho, 0.0))
        size = v[order] * adjustment.network.sigma[order] / root[order] ** 2
        suspicions.append(BlunderSuspicion(order, w[order], size))
        v = v - column * (v[worst] / column[worst])
        taken.append(column / np.sqrt(column[worst]))
        q = q - taken[-1] ** 2
        live &= q > MIN_REDUNDANCY
        live[worst] = False
    return suspicions


def blunders_one_by_one(adjustment: Adjustment, most: int = 20) -> list[BlunderSuspicion]:
    """`suspected_blunders`, gross ones left out before others are sought.

    A blunder of decimetres bends the whole network: readings far from it are then off by more
    than what is linear in it, and would be accused for nothing.
    """
    found = suspected_blunders(adjustment, most)
    rows = np.arange(len(adjustment.network.distance))
    gross: list[BlunderSuspicion] = []
    while fresh := [one for one in found if abs(one.size[0]) > GROSS]:
        gross += fresh
        wrong = [int(one.candidates[0]) for one in gross]
        rows = np.setdiff1d(np.arange(len(adjustment.network.distance)), wrong)
        try:
            rest = adjust(_only(adjustment.network, rows), adjustment.parameters)
        except GtvalError:  # without them something is open: then nothing is known better
            return suspected_blunders(adjustment, most)
        left = suspected_blunders(rest, most - len(gross)) if most > len(gross) else []
        found = [replace(one, candidates=rows[one.candidates]) for one in left]
    return [*gross, *found]


def _only(network: Network, rows: npt.NDArray[np.intp]) -> Network:
    """A network with some of its distances."""
    return replace(
        network,
        first=network.first[rows],
        second=network.second[rows],
        distance=network.distance[rows],
        sigma=network.sigma[rows],
    )


def _candidates(worst: int, w: Array, rho: Array) -> npt.NDArray[np.intp]:
    """The worst reading and those that cannot be told apart from it, the likeliest first."""
    spread = np.sqrt(2 * np.maximum(1 - rho, 0.0))
    excess = w[worst] - w + (1 - rho) * w
    tied = (w > 0) & (excess <= TOLD_APART * spread + 1e-9)
    tied[worst] = True
    rows = np.flatnonzero(tied)
    return rows[np.argsort(-w[rows], kind="stable")]


def added_reading_gain(
    adjustment: Adjustment, first: npt.NDArray[np.intp], second: npt.NDArray[np.intp], sigma: Array
) -> Array:
    """What one more reading would take away from the covariance, for many candidates at once.

    Parameters
    ----------
    adjustment : Adjustment
        The network without it.
    first, second : (c,) array of int
        Rows in ``network.points`` of the ends of each candidate.
    sigma : (c,) array
        Standard deviation of the candidates, metres.

    Returns
    -------
    (c, u) array
        Decrease of the variance of every unknown.

    Notes
    -----
    Rank-one update: (C a)(C a)^T / (sigma^2 + a^T C a) with the candidate's design row a.
    """
    points = adjustment.parameters.points
    entries = distance_entries(points[first], points[second])
    columns = np.concatenate(
        [2 * first[:, None] + np.arange(2), 2 * second[:, None] + np.arange(2)], axis=1
    )
    C = adjustment.covariance
    Ca = np.einsum("ce,ceu->cu", entries, C[columns])
    aCa = np.einsum("ce,ce->c", entries, np.take_along_axis(Ca, columns, axis=1))
    return np.asarray(Ca**2 / (np.square(sigma) + aCa)[:, None])
