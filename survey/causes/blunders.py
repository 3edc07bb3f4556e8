"""Independent blunders as one hypothesis among the others."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from survey.causes.lead import LENGTH_RANGE, Lead, blunder_sizes
from survey.causes.linear import UNSEEN, Linear
from survey.causes.trial import Rows, Trial
from validation.poses.angles import Array

MOST = 25
"""Blunders looked for: a room with more has another cause, or nobody to trust."""


def blunder_leads(trial: Trial, linear: Linear) -> Iterator[Lead]:
    """As many independent blunders as pay for themselves, and one more.

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
    taken: list[Array] = []
    gain, rows = 0.0, []
    for _ in range(MOST):
        w2 = np.where(live, v**2 / np.where(live, q, 1.0), 0.0)
        worst = int(w2.argmax())
        if not live.any() or w2[worst] < cost[worst]:
            break
        gain += float(w2[worst])
        rows.append(worst)
        column = linear.column(worst) - sum((one * one[worst] for one in taken), np.zeros(n))
        v = v - column * (v[worst] / column[worst])
        taken.append(column / np.sqrt(column[worst]))
        q = q - taken[-1] ** 2
        live &= q > UNSEEN
        live[worst] = False
        yield _lead(np.array(rows, dtype=np.intp), gain, n)


def _lead(rows: Rows, gain: float, n: int) -> Lead:
    def build(base: Trial) -> Trial:
        return replace(base, dropped=base.dropped | {int(row) for row in rows})

    k = len(rows)
    places = 1.0
    for i in range(k):
        places *= (n - i) / (i + 1)
    return Lead("blunders", "rows", (str(k),), rows, gain, places, build, blunder_sizes(rows))
