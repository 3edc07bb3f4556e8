"""Independent blunders as one hypothesis among the others."""

from dataclasses import replace

import numpy as np
from scipy.special import gammaln

from survey.causes.lead import LENGTH_RANGE, Lead, blunder_sizes
from survey.causes.linear import UNSEEN, Linear
from survey.causes.trial import Rows, Trial
from validation.poses.angles import Array

MOST = 25
"""Blunders looked for one after the other. Where more stand out from what all others agree on, as
1 % of a large survey does, those are the blunders, as one hypothesis of as many numbers."""


def blunder_leads(trial: Trial, linear: Linear, most: int = MOST) -> list[Lead]:
    """The number of independent blunders that pays best for itself, and one less and one more.

    Parameters
    ----------
    trial : Trial
        Without them.
    linear : Linear
        Where it was solved.
    most : int
        Blunders looked for.

    Returns
    -------
    list of Lead
        The best first; empty where no reading is worth being free.

    Notes
    -----
    One after the other: the distance with the largest |w| becomes free, a rank-one downdate of
    the residuals and of the diagonal of their cofactor, of which only the columns of the
    distances found are made.
    """
    n = len(trial.network.distance)
    q, v = linear.redundancy.copy(), linear.residual[:n].copy()
    live = (q > UNSEEN) & trial.used[:n]
    cost = 2 * np.log(np.maximum(LENGTH_RANGE / (2.5 * trial.network.sigma), 1.0))
    many = _outstanding(trial, linear, cost)
    if len(many) > most == MOST:
        return [_many_lead(many, linear)]
    taken: list[Array] = []
    rows: list[int] = []
    w2_of, left = [], []
    for _ in range(most):
        w2 = np.where(live, v**2 / np.where(live, q, 1.0), 0.0)
        worst = int(w2.argmax())
        if not live.any() or w2[worst] < cost[worst]:
            break
        w2_of.append(float(w2[worst]))
        left.append(float(q[worst]))
        rows.append(worst)
        column = linear.column(worst) - sum((one * one[worst] for one in taken), np.zeros(n))
        v = v - column * (v[worst] / column[worst])
        taken.append(column / np.sqrt(column[worst]))
        q = q - taken[-1] ** 2
        live &= q > UNSEEN
        live[worst] = False
    if not rows:
        return []
    # What all scatter by is seen where the blunders are gone.
    scatter = _scatter(v[live] ** 2 / q[live])
    each = np.array(w2_of) / scatter - cost[rows] + np.log(scatter)
    # The redundancy that is left widens the interval of the blunder, which costs less.
    each += -np.log(left) - 2 * np.log((n - np.arange(len(rows))) / np.arange(1, len(rows) + 1))
    best, gain = int(each.cumsum().argmax()), np.cumsum(w2_of)
    return [
        _lead(np.array(rows[: k + 1], dtype=np.intp), float(gain[k]), n)
        for k in (best, best - 1, best + 1)
        if 0 <= k < len(rows)
    ]


def _outstanding(trial: Trial, linear: Linear, cost: Array) -> Rows:
    """Readings that fit too badly by far at the robust solution, each by itself."""
    n = len(cost)
    q = np.maximum(linear.redundancy, UNSEEN)
    w2 = linear.at_start[:n] ** 2 / q
    return np.flatnonzero((w2 > cost + 2 * np.log(n)) & trial.used[:n])


def _many_lead(rows: Rows, linear: Linear) -> Lead:
    """More blunders than are looked for one after the other, all that stand out."""
    n, k = len(linear.redundancy), len(rows)
    q = np.maximum(linear.redundancy[rows], UNSEEN)
    gain = float((linear.at_start[rows] ** 2 / q).sum())
    choices = gammaln(n + 1) - gammaln(k + 1) - gammaln(n - k + 1)
    return replace(_lead(rows, gain, 0), places=1.0, cost=2 * float(choices))


def _scatter(squares: Array) -> float:
    """How many times the readings' variance exceeds what is stated, by the better half of them."""
    return max(float(np.median(squares)) / MEDIAN, 1.0) if len(squares) else 1.0


MEDIAN = 0.4549
"""Median of chi-squared with one degree of freedom."""


def _lead(rows: Rows, gain: float, n: int) -> Lead:
    def build(base: Trial) -> Trial:
        return replace(base, dropped=base.dropped | {int(row) for row in rows})

    k = len(rows)
    places = 1.0
    for i in range(min(k, n)):
        places *= (n - i) / (i + 1)
    return Lead("blunders", "rows", (str(k),), rows, gain, places, build, blunder_sizes(rows))
