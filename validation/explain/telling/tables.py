"""The explanation as tables."""

from collections.abc import Sequence

import numpy as np

from validation.errors import GtvalError
from validation.explain.analysis import Explanation, SystemExplanation
from validation.explain.fitting.planning import poses_for_bias, poses_for_deviation
from validation.explain.sources.equivalence import PairedComparison, good_enough
from validation.explain.sources.repeatability import Repeatability
from validation.explain.sources.verdicts import CELLS, Verdict
from validation.explain.telling.number_words import table_of_parameters
from validation.results import Table

Rows = list[list[str | int | float | None]]
COMPONENTS = ("x", "y", "theta")


def candidate_table(one: SystemExplanation) -> Table:
    """All explanations of a system with both criteria, the chosen one marked."""
    assert one.selection is not None
    selection = one.selection
    lowest = min(item.criterion for item in selection.candidates)
    best = max(item.loo.score for item in selection.candidates)
    rows: Rows = []
    for item in selection.candidates:
        mark = "chosen" if item.name == selection.chosen.name else ""
        if not item.observability.complete:
            mark = "not determined"
        p = max(item.p_values.values(), default=None)
        rows.append(
            [
                *(item.name, len(item.model.parameters), item.criterion - lowest),
                *(item.loo.score - best, 1000 * item.loo.typical_length),
                *(1000 * item.loo.typical_angle, p, mark),
            ]
        )
    return Table(
        f"{one.system}: explanations compared",
        [
            *("explanation", "parameters", "BIC above the least", "log score below the best"),
            *("left-out position [mm]", "left-out heading [mrad]", "largest p of a part", ""),
        ],
        rows,
        ["", "d", ".1f", ".1f", ".1f", ".1f", ".1g", ""],
        note=f"Left-out: median error of poses predicted from the others. A part counts if its p "
        f"is below {selection.threshold:.2g} and left-out poses are predicted better. p: of normal "
        "errors with a few gross ones, allowed for neighbours that are alike.",
    )


def parameter_table(one: SystemExplanation, confidence: float) -> Table:
    """Fitted parameters of the chosen explanation."""
    assert one.settled is not None
    note = (
        f"{100 * confidence:.3g} % intervals, for nearly normal errors; wider where neighbours "
        "depend on each other. p: chance of such a value, were it zero. Flagged cells are left out."
    )
    found = one.settled.parameters(confidence)
    return table_of_parameters(one.system, one.name, found, note, ".5f")


def cause_table(systems: Sequence[SystemExplanation]) -> Table:
    """One row a system: what explains its errors, and what is left of them."""
    rows: Rows = []
    for one in systems:
        settled = one.settled
        if settled is None:
            rows.append([one.system, "too few poses", None, None, None])
            continue
        x, y, _ = settled.spread(settled.before)
        left = settled.spread(settled.after)
        read = one.selection.pairs.convention.words if one.selection else ""
        words = "a drift" if one.wanders else settled.fit.model.words
        if settled.fit.model.parts and not one.credible([o for o in systems if o is not one]):
            words = f"in part: {words}"
        words = " and ".join(part for part in (read, words) if part)
        rows.append([one.system, words, np.hypot(x, y), np.hypot(left[0], left[1]), left[2]])
    return Table(
        "Where the errors come from",
        ["system", "explained by", "positions before [m]", "positions after [m]", "headings [rad]"],
        rows,
        ["", "", ".4f", ".4f", ".4f"],
        note="Standard deviations around the mean, of the poses that fit, before and after what is "
        "explained is taken out. They do not contain the mean error itself.",
    )


def before_after_table(systems: Sequence[SystemExplanation]) -> Table:
    """Mean and standard deviation before and after, over all cells and without flagged ones."""
    rows: Rows = []
    for one in systems:
        settled = one.settled
        if settled is None:
            continue
        both = settled.before, settled.after
        for column, name in enumerate(COMPONENTS):
            used = int(settled.cells[:, 0 if column < 2 else 1].sum())
            rows.append(
                [
                    *(one.system, name),
                    *(settled.spread(e, everything=True)[column] for e in both),
                    used,
                    *(settled.mean(e)[column] for e in both),
                    *(settled.spread(e)[column] for e in both),
                    settled.noise[column],
                ]
            )
    return Table(
        "Errors before and after the systematic part is taken out [m, rad]",
        [
            *("system", "component", "std before (all)", "std after (all)", "cells not flagged"),
            *("mean before", "mean after", "std before", "std after"),
            "rms after, per degree of freedom",
        ],
        rows,
        ["", "", ".4f", ".4f", "d", ".4f", ".4f", ".4f", ".4f", ".4f"],
        note="std: standard deviation around the mean; the mean is not in it. All columns after "
        "'cells not flagged' are of these cells only. The last one divides by the degrees of "
        "freedom that the fit has left. Poses known by construction are not counted.",
    )


def verdict_table(explanation: Explanation) -> Table:
    """All cells that do not fit."""
    result = explanation.arbitration
    note = (
        f"Chance of any entry in a table of good poses: {100 * result.false_alarm:.3g} %, if "
        f"errors are normal; about {100 * result.rate:.2g} % by the tails that this table shows."
    )
    title = "Poses that do not fit, and the source that is wrong"
    return _verdict_table(title, result.verdicts, note)


def suspect_table(explanation: Explanation) -> Table | None:
    """Cells to look at again; None if there are none."""
    if not explanation.arbitration.suspects:
        return None
    note = (
        "No source is called wrong for these, and nothing is left out. One such entry is normal, "
        "even if all poses are good. p: the share of good tables with normal errors "
        "that have one as large."
    )
    # How sure it would be of the culprit says nothing about whether there is one.
    suspects = explanation.arbitration.suspects
    return _verdict_table("To be looked at again", suspects, note, certainty=False)


def _verdict_table(
    title: str, verdicts: Sequence[Verdict], note: str, *, certainty: bool = True
) -> Table:
    """One row a cell."""
    rows: Rows = []
    for one in verdicts:
        who = " or " if one.certainty == "undecided" else " and "
        row: list[str | int | float | None] = [one.stop, one.cell, who.join(one.blamed)]
        row += [one.certainty] if certainty else []
        rows.append([*row, one.size, one.table_p_value, one.reason])
    sure = ["certainty"] if certainty else []
    columns = ["pose", "cell", "source", *sure, "off by [m, rad]", "p in the whole table", "why"]
    return Table(title, columns, rows, ["", "", "", *[""] * len(sure), ".3f", ".1g", ""], note=note)


def noise_table(explanation: Explanation) -> Table:
    """Noise of each source alone, with intervals."""
    found = explanation.arbitration.variances
    intervals = found.intervals(explanation.question.confidence)
    rows: Rows = []
    for row, name in enumerate(found.names):
        for kind, cell in enumerate(CELLS):
            value = found.variances[row, kind]
            low, high = (None if np.isnan(end) else float(end) for end in intervals[row, kind])
            # Estimates outside the interval are ones that another difference has ruled out.
            sigma = None if np.isnan(value) else float(np.sqrt(max(value, 0.0)))
            if sigma is not None and low is not None and high is not None:
                sigma = min(max(sigma, low), high)
            rows.append([name, cell, sigma, low, high])
    return Table(
        "Noise of each source alone (three-cornered hat) [m, rad]",
        ["source", "cell", "standard deviation", "low", "high"],
        rows,
        ["", "", ".4f", ".4f", ".4f"],
        note="From the differences between sources that share no sensor, flagged cells left out. "
        f"{100 * explanation.question.confidence:.3g} % intervals for normal, independent errors. "
        "Zero: the data allow that the source has no noise.",
    )


def good_enough_table(
    systems: Sequence[SystemExplanation], limits: Sequence[float], confidence: float
) -> Table:
    """What is shown of each system's accuracy, and how many poses it takes to show what is asked.

    Parameters
    ----------
    systems : sequence of SystemExplanation
        Those with a fit are listed.
    limits : sequence of float
        The d of x, y and theta: bias and standard deviation are to be below it.
    confidence : float
        Of each statement.
    """
    rows: Rows = []
    for one in systems:
        settled = one.settled
        if settled is None:
            continue
        for column, name in enumerate(COMPONENTS):
            errors, limit = settled.before[:, column], limits[column]
            shown = good_enough(errors, limit, confidence)
            mean, spread = float(errors.mean()), float(errors.std(ddof=1))
            rows.append(
                [
                    *(one.system, name, len(errors), limit),
                    *(shown.bias.smallest_limit, shown.deviation_below),
                    "yes" if shown.holds else "not shown",
                    _poses_needed(mean, spread, limit, confidence),
                    _poses_needed(0.0, float(settled.noise[column]), limit, confidence),
                ]
            )
    return Table(
        "Good enough for d, and the poses needed to show it",
        [
            *("system", "component", "n", "d [m, rad]", "bias shown below", "std shown below"),
            *("both below d", "poses needed", "poses needed, corrected"),
        ],
        rows,
        ["", "", "d", ".3g", ".4f", ".4f", "", "d", "d"],
        note=f"All poses as they came, {100 * confidence:.3g} % confidence; bias by two one-sided "
        "tests. Needed: to show both with a chance of 90 %, if bias and standard deviation are as "
        "they are here, or as the corrected poses leave them; none where no number would do. "
        "All for independent, normal errors.",
    )


def _poses_needed(bias: float, sigma: float, limit: float, confidence: float) -> int | None:
    """Poses that show both bias and standard deviation to be below d; None if none can."""
    try:
        return max(
            poses_for_bias(sigma, limit, bias=bias, confidence=confidence),
            poses_for_deviation(sigma, limit, confidence=confidence),
        )
    except GtvalError:
        return None


def paired_table(pairs: Sequence[PairedComparison]) -> Table:
    """Pairs of systems on their common stops."""
    rows: Rows = [
        [
            *(f"{one.systems[0]} - {one.systems[1]}", one.component.name, one.n),
            *(one.bias_difference, one.bias_low, one.bias_high),
            *(one.size_difference, one.size_low, one.size_high),
            *(one.ratio, one.ratio_low, one.ratio_high, one.equivalence.smallest_limit),
        ]
        for one in pairs
    ]
    return Table(
        "Pairs of systems on their common stops [m, rad], as they came",
        [
            *("systems", "component", "n", "difference of errors", "low", "high"),
            *("difference of |errors|", "low", "high", "ratio of std", "low", "high"),
            "equivalent within",
        ],
        rows,
        ["", "", "d", *([".4f"] * 6), *([".2f"] * 3), ".4f"],
        note="A difference of |errors| below zero: the first is the better one. 'Equivalent "
        "within': least d for which two one-sided tests show the same bias. Student's t and F, for "
        "independent stops with normal errors.",
    )


def repeatability_table(found: Sequence[tuple[str, str, Repeatability]]) -> Table:
    """Repeatability over runs and revisits."""
    rows: Rows = [
        [system, how, one.component.name, one.deviation, one.low, one.high, one.dof]
        for system, how, one in found
    ]
    return Table(
        "Repeatability [m, rad]",
        ["system", "from", "component", "standard deviation", "low", "high", "freedom"],
        rows,
        ["", "", "", ".4f", ".4f", ".4f", "d"],
        note="Of a single measurement, with 95 % intervals (chi squared, normal errors). "
        "Revisits hold the validation's noise too, and whatever changes with the heading.",
    )
