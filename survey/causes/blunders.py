"""Independent blunders as one hypothesis among the others."""

from collections.abc import Iterator
from dataclasses import replace
from math import log

import numpy as np

from survey.causes.lead import LENGTH_RANGE, Lead, blunder_sizes
from survey.causes.linear import UNSEEN, Linear
from survey.causes.trial import Rows, Trial

MOST = 25
"""Blunders looked for: a room with more has another cause, or nobody to trust."""


def blunder_leads(trial: Trial, linear: Linear) -> Iterator[Lead]:
    """As many independent blunders as pay for themselves, and one more.

    Notes
    -----
    One after the other: the distance with the largest |w| becomes free, a rank-one downdate of
    the residuals and their cofactor.
    """
    n = len(trial.network.distance)
    near = _near(linear, n)
    Q, v = linear.block(near).copy(), linear.residual[near].copy()
    live = (np.diagonal(Q) > UNSEEN) & trial.used[:n][near]
    cost = np.array(
        [2 * log(max(LENGTH_RANGE / (2.5 * s), 1.0)) for s in trial.network.sigma[near]]
    )
    gain, rows = 0.0, []
    for _ in range(MOST):
        w2 = np.where(live, v**2 / np.where(live, np.diagonal(Q), 1.0), 0.0)
        worst = int(w2.argmax())
        if not live.any() or w2[worst] < cost[worst]:
            break
        gain += float(w2[worst])
        rows.append(int(near[worst]))
        column = Q[:, worst] / Q[worst, worst]
        v = v - column * v[worst]
        Q = Q - np.outer(column, Q[worst])
        live &= np.diagonal(Q) > UNSEEN
        live[worst] = False
        yield _lead(np.array(rows, dtype=np.intp), gain, n)


def _near(linear: Linear, n: int) -> Rows:
    """The distances among which blunders are looked for: all, or of many the worst."""
    if n <= MOST_ROWS:
        return np.arange(n)
    return np.sort(np.argsort(-np.abs(linear.residual[:n]))[:MOST_ROWS])


MOST_ROWS = 1500
"""Distances with the largest residuals that are searched in a large campaign."""


def _lead(rows: Rows, gain: float, n: int) -> Lead:
    def build(base: Trial) -> Trial:
        return replace(base, dropped=base.dropped | {int(row) for row in rows})

    k = len(rows)
    places = 1.0
    for i in range(k):
        places *= (n - i) / (i + 1)
    return Lead("blunders", "rows", (str(k),), rows, gain, places, build, blunder_sizes(rows))
