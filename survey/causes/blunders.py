"""Independent blunders as one hypothesis among the others."""

from dataclasses import replace

import numpy as np

from survey.causes.lead import LENGTH_RANGE, Lead, blunder_sizes
from survey.causes.linear import UNSEEN, Linear
from survey.causes.trial import Rows, Trial
from validation.poses.angles import Array

MOST = 25
"""Blunders looked for: a room with more has another cause, or nobody to trust."""


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
    scatter = _scatter(v[live] ** 2 / q[live])
    spread = trial.network.sigma * np.sqrt(scatter)
    cost = 2 * np.log(np.maximum(LENGTH_RANGE / (2.5 * spread), 1.0))
    taken: list[Array] = []
    gain, worth, rows = 0.0, 0.0, []
    found: list[tuple[float, Lead]] = []
    for k in range(1, most + 1):
        w2 = np.where(live, v**2 / np.where(live, q, 1.0), 0.0) / scatter
        worst = int(w2.argmax())
        if not live.any() or w2[worst] < cost[worst]:
            break
        gain += float(scatter * w2[worst])
        # The redundancy that is left widens the interval of the blunder, which costs less.
        worth += float(w2[worst] - cost[worst] - np.log(q[worst]) - 2 * np.log((n - k + 1) / k))
        rows.append(worst)
        column = linear.column(worst) - sum((one * one[worst] for one in taken), np.zeros(n))
        v = v - column * (v[worst] / column[worst])
        taken.append(column / np.sqrt(column[worst]))
        q = q - taken[-1] ** 2
        live &= q > UNSEEN
        live[worst] = False
        found.append((worth, _lead(np.array(rows, dtype=np.intp), gain, n)))
    if not found:
        return []
    best = max(range(len(found)), key=lambda k: found[k][0])
    return [found[k][1] for k in (best, best - 1, best + 1) if 0 <= k < len(found)]


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
    for i in range(k):
        places *= (n - i) / (i + 1)
    return Lead("blunders", "rows", (str(k),), rows, gain, places, build, blunder_sizes(rows))
