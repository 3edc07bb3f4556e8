"""Which source is wrong at a stop: the one that disagrees with the others.

The sources are the validation poses and every GT system with its systematic part taken out. Each
stop has two cells, its position and its heading. In each cell every source is asked how much
better the rest would agree without it. The one whose removal makes the rest agree is held
responsible, if that is clear, and the chance of blaming anyone in a clean table is kept
at a stated level over the whole table. Cells that come short of it are listed apart as suspects,
as many as one is to be expected in a clean table: a careful survey looks at them again.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from validation.explain.fitting.noise import DIMENSIONS, MEDIANS, Mask
from validation.explain.sources.copies import Copies
from validation.explain.sources.hat_values import source_variances
from validation.explain.sources.judging import JudgedTable
from validation.explain.sources.tails import HEAVY
from validation.explain.sources.verdicts import (
    CELLS,
    Arbitration,
    Sources,
    Verdict,
    differences,
    listed,
)
from validation.poses.angles import Array

FALSE_ALARM = 0.05
"""Chance of any verdict in a table of good poses: one campaign in twenty, the level at which all
intervals are stated. `benchmarks/explain_rates.py --only clean` counts it."""

SUSPECT = 1.0
"""Suspects to be expected in a table of good poses, at most: worth a second look and no more."""

_ROUNDS = 5
"""Rounds of screening and estimating at most; 50 simulated tables of four sources took two or
three."""

SCREEN = 1e-3
"""Cells below this p-value are left out when noise levels are estimated, as one gross error that
is just not flagged would hide others. Of the 208 good cells of 26 stops and four sources it
takes one in every fifth table: too few to make the noise look smaller."""


SURE = 0.01
"""A verdict is not called sure where more of the tables of good poses with tails as this one's have
such an entry by chance: of a hundred campaigns, at most one has an innocent source called so."""


def arbitrate(
    sources: Sources, false_alarm: float = FALSE_ALARM, copies: tuple[Copies, ...] = ()
) -> Arbitration:
    """The cells that do not fit, and who is wrong in each.

    Parameters
    ----------
    sources : Sources
        Two or more; with two, a disagreement shows but not whose it is.
    false_alarm : float
        Chance of any verdict in a table of good poses with normal errors, below `SUSPECT`.
    copies : tuple of Copies
        Sources that are copies of one another; they are among the sensors of ``sources``.
    """
    judged = judge(sources, false_alarm)
    return replace(judged_by_tails(judged), copies=copies)


class Judged(NamedTuple):
    """An arbitration with the table it comes from, and the cells that were screened."""

    result: Arbitration
    table: JudgedTable
    screened: Mask


def judged_by_tails(judged: Judged) -> Arbitration:
    """The arbitration with what its tails say of it.

    Nothing more or less is flagged, but where tails are heavy the chance of a flag in a table of
    good poses is larger, and what such tails would show by chance is not called sure.
    """
    tails = judged.table.weigh_tails(judged.screened)
    found = []
    for one in judged.result.verdicts:
        chance = judged.table.chance_by_tails(one, tails)
        weak = chance > SURE and one.certainty == "sure"
        reason = one.reason + (f"; {_by_chance(chance, tails.heavy)}" if weak else "")
        certainty = "likely" if weak else one.certainty
        found.append(replace(one, table_p_value=chance, certainty=certainty, reason=reason))
    rate = judged.table.rate(tails)
    return replace(judged.result, verdicts=tuple(found), tails=tails, rate=rate)


def _by_chance(chance: float, heavy: float) -> str:
    """Why a verdict is not called sure."""
    if heavy > HEAVY and chance > FALSE_ALARM:
        return "but errors of this size come by chance here"
    return f"but {100 * chance:.1g} in 100 tables of good poses show as much by chance"


def judge(sources: Sources, false_alarm: float = FALSE_ALARM) -> Judged:
    """The cells that do not fit if errors are normal, and who is wrong in each."""
    good = np.repeat(sources.present[..., None], 2, axis=-1)
    left_out = np.zeros_like(good)
    for step in range(_ROUNDS):
        noise = _noise(sources, good & ~left_out, robust=step == 0)
        # The first, rough noise only screens what to leave out of the next one: taken as exact,
        # lest a gross error hides in its own uncertainty.
        table = JudgedTable(sources, noise, None if step == 0 else good & ~left_out, false_alarm)
        _, bad, doubtful = table.verdicts(least=SCREEN)
        same = (left_out == (bad | doubtful)).all()
        left_out = bad | doubtful
        if same and step > 0:
            break
    # What was screened without being flagged is a good cell's tail, and counts for the noise.
    screened = bad
    _, bad, doubtful = table.verdicts()
    left_out = bad | doubtful
    noise = _noise(sources, good & ~left_out, robust=False)
    table = JudgedTable(sources, noise, good & ~left_out, false_alarm)
    found, bad, doubtful = _same_stop(sources, *table.verdicts())
    flagged = bad | doubtful
    table.false_alarm = max(SUSPECT, false_alarm)
    suspects, *_ = table.verdicts(without=flagged)
    usable = good & ~bad & ~doubtful
    variances = source_variances(
        sources.names,
        sources.poses,
        usable,
        lost_freedom=sources.lost_freedom,
        apart=tuple(sources.sensors.values()),
    )
    result = Arbitration(
        sources.names,
        sources.ids,
        tuple(found),
        tuple(suspects),
        sources.present,
        bad,
        doubtful,
        table.scores(flagged),
        noise,
        variances,
        false_alarm,
        table.questions,
        rate=false_alarm,
    )
    table.false_alarm = false_alarm
    return Judged(result, table, screened)


def _same_stop(
    sources: Sources, found: list[Verdict], bad: Mask, doubtful: Mask
) -> tuple[list[Verdict], Mask, Mask]:
    """Undecided cells given to a source that is responsible for the other cell of the stop."""
    result = []
    for one in found:
        if one.certainty == "undecided":
            stop, kind = sources.ids.index(one.stop), CELLS.index(one.cell)
            guilty = [name for name in one.blamed if bad[sources.names.index(name), stop, 1 - kind]]
            if len(guilty) == 1:
                doubtful[:, stop, kind] = False
                bad[sources.names.index(guilty[0]), stop, kind] = True
                others = tuple(name for name in one.blamed if name != guilty[0])
                one = replace(  # noqa: PLW2901
                    one,
                    blamed=(guilty[0],),
                    certainty="likely",
                    witnesses=(*others, *one.witnesses),
                    reason=f"this cell alone does not tell which of {listed(one.blamed)} it is, "
                    f"but {guilty[0]} is blamed for the {CELLS[1 - kind]} of the same stop",
                )
        result.append(one)
    return result, bad, doubtful


def _noise(sources: Sources, good: Mask, *, robust: bool) -> Array:
    """(S, 2) standard deviations to weigh the sources by.

    Sources with stated covariances keep them (what is returned for them is typical); the others
    get theirs from the differences of all pairs, those of one sensor among them, as these are
    judged too. Where that cannot tell the sources apart, the difference is shared equally.
    """
    variances = source_variances(
        sources.names, sources.poses, good, lost_freedom=sources.lost_freedom, robust=robust
    )
    values = variances.bounded.copy()
    for kind in range(2):
        shared, least = _pooled(sources, good, kind, robust=robust)
        values[~np.isfinite(values[:, kind]), kind] = shared
        values[:, kind] = np.maximum(values[:, kind], least)
    for s in np.flatnonzero(sources.stated):
        diagonal = np.diagonal(sources.covariances[s], axis1=-2, axis2=-1)
        values[s] = np.nanmedian(diagonal[:, :2]), np.nanmedian(diagonal[:, 2])
    return np.sqrt(values)


def _pooled(sources: Sources, good: Mask, kind: int, *, robust: bool) -> tuple[float, float]:
    """Half the typical variance of a difference, and the least credible variance."""
    values = []
    for a in range(len(sources.names)):
        for b in range(a):
            mask = good[a, :, kind] & good[b, :, kind]
            count = float(mask.sum()) * DIMENSIONS[kind]
            lost = max(sources.lost_freedom[a, kind], sources.lost_freedom[b, kind])
            if count - lost < 1:
                continue
            difference = differences(sources.poses[a, mask], sources.poses[b, mask], kind)
            squares = (difference**2).sum(-1)
            if robust:
                values.append(float(np.median(squares)) / MEDIANS[kind])
            else:
                values.append(float(squares.sum()) / (count - lost))
    if not values:
        return 1e-8, 1e-12
    return float(np.median(values)) / 2, max(min(values) / 20, 1e-12)
