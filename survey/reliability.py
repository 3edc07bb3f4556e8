"""Which reading is wrong, and how wrong a reading could be without being noticed.

Baarda's data snooping on the joint adjustment. Nothing is deleted: a blunder is reported with
every reading that could be it, and with the measurement to repeat.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from survey.network import Adjustment, distance_entries
from validation.angles import Array

CRITICAL_W = 3.29
"""|w| above which a reading is suspect: two-sided 0.1 % of the normal distribution."""
DETECTABLE = 4.13
"""Non-centrality of a blunder found with 80 % power at 0.1 % (Baarda)."""
TIE = 10.8
"""w^2 within this of the largest (chi-squared, 1 degree of freedom, 0.1 %) is not told apart."""
MIN_REDUNDANCY = 1e-6
"""A reading that the others check by less than this share has no w."""


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
    search allows for, so that one blunder does not accuse its neighbours. With Q_v the
    cofactor of the residuals, the test value of reading i is (Q_v-projected residual)_i; adding
    an unknown for reading k is the rank-one downdate of residuals and Q_v.
    """
    n = len(adjustment.network.distance)
    J = adjustment.jacobian[:n].toarray() * np.sqrt(adjustment.weight)[:, None]
    normal_inverse = adjustment.covariance
    Q = np.eye(n) - J @ normal_inverse @ J.T
    v = adjustment.residual[:n].copy()
    sigma = adjustment.network.sigma
    suspicions: list[BlunderSuspicion] = []
    used: list[int] = []
    while len(suspicions) < most:
        r = np.diagonal(Q)
        live = r > MIN_REDUNDANCY
        live[used] = False
        w = np.where(live, v / np.sqrt(np.where(live, r, 1.0)), 0.0)
        if not live.any():
            break
        worst = int(np.abs(w).argmax())
        if abs(w[worst]) < CRITICAL_W:
            break
        tied = np.flatnonzero(live & (w[worst] ** 2 - w**2 < TIE) & (np.abs(w) > CRITICAL_W / 2))
        order = tied[np.argsort(-np.abs(w[tied]))]
        suspicions.append(BlunderSuspicion(order, w[order], v[order] * sigma[order] / r[order]))
        used.append(worst)
        v = v - Q[:, worst] * (v[worst] / r[worst])
        Q = Q - np.outer(Q[:, worst], Q[worst]) / r[worst]
    return suspicions


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
