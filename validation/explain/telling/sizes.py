"""Whether errors are as large as stated: one place for all that a report says of it."""

from collections.abc import Sequence

import numpy as np

from validation.explain.analysis import Explanation, SystemExplanation
from validation.explain.fitting.settled import Settled
from validation.poses.angles import wrap
from validation.results import Finding, Severity, Size
from validation.statistics.conclusions import measured_nees, nees_size
from validation.statistics.evaluation import Evaluation

KINDS = ("positions", "headings")
OF_SIZES = frozenset({
    "nees_above", "nees_inside", "nees_below", "covariance_too_small", "covariance_too_large",
})  # fmt: skip
"""Codes of findings on the size of errors: where errors are explained too, one stands for all."""


def left_findings(settled: Settled) -> list[Finding]:
    """Whether what is left agrees with the stated covariances, where nothing else says so."""
    told, system = [], settled.pairs.system
    for name, (factor, low, high) in zip(KINDS, settled.misfit, strict=True):
        size = _ratio(name, factor, low, high)
        if low > 1:
            text = (
                f"What remains of the {name} is {factor:.2g} times as large as the stated "
                f"covariances say (99 % interval {low:.2g} to {high:.2g}). Either they are too "
                "small, or poses share errors (of cameras, of a frame), or the errors have a cause "
                f"that is not among the explanations. {_what_then(settled)}"
            )
            told.append(Finding("warning", text, system, "covariance_too_small", (size,)))
        elif high < 1:
            text = (
                f"What remains of the {name} is only {factor:.2g} times as large as the stated "
                f"covariances say (99 % interval {low:.2g} to {high:.2g}): they are too large"
                f"{_or_shared(settled)}. {_hidden(settled)}"
            )
            told.append(Finding("note", text, system, "covariance_too_large", (size,)))
    return told


SMALL, FEW = 3.0, 60
"""Standard deviations of a pose, and poses, below which what lasts longer than the table may pass
for a constant cause. Of clean tables of 20 poses with a correlation of 0.95 beside a survey as
noisy, a cause is claimed in 15 % (100 tables), of 1.5 deviations in half of them and of 2.6 in the
largest; no test that finds independent errors dependent in 20 % of the tables sees more than 67 %
of these. With 60 poses it is claimed in less than 1 %."""


def looks_constant(settled: Settled) -> str:
    """That an error that lasts may look like a small cause; empty where nothing is to be said."""
    if len(settled.pairs) >= FEW or settled.serial is not None or settled.fit.model.drifts:
        return ""
    taken = settled.before - settled.after
    taken[:, 2] = wrap(taken[:, 2])
    sigma = np.sqrt(np.diagonal(settled.fit.covariances[0], axis1=-2, axis2=-1))
    if (np.sqrt(np.square(taken / sigma).mean(0)) > SMALL).any():
        return ""
    return (
        " It is below three standard deviations of a pose: an error that lasts longer than these "
        f"{len(settled.pairs)} poses would look the same. Repeat some stops on another day."
    )


BY_ERRORS = "Their level was estimated from the errors instead; intervals and p-values are by that."


def _what_then(settled: Settled) -> str:
    """What covariances that are too small do to the rest."""
    if settled.pairs.contradicted:
        return BY_ERRORS
    return (
        "Intervals are too narrow by this factor, and p-values too small. Leave the covariances "
        "out of the tables, and the noise is estimated instead."
    )


def _hidden(settled: Settled) -> str:
    """What covariances that are too large do to the rest."""
    return BY_ERRORS if settled.pairs.contradicted else "Small causes of error stay hidden."


def _ratio(name: str, factor: float, low: float, high: float) -> Size:
    return Size(f"what remains of the {name} over what is stated", factor, "", low, high, 0.99)


def _or_shared(settled: Settled) -> str:
    """Why else errors may be small: not where that is known and counted."""
    if settled.pairs.follows is not None:
        return " (what the survey placed is counted)"
    return (
        ", or poses and survey share errors that cancel in the differences (as with a frame that "
        "is placed by surveyed stops: state placed_by)"
    )


def told_once(
    findings: Sequence[Finding], evaluations: Sequence[Evaluation], explanation: Explanation | None
) -> list[Finding]:
    """The findings, with one on the size of each system's errors where there were several.

    Parameters
    ----------
    findings : sequence of Finding
        Of the comparison and of the explanation.
    evaluations : sequence of Evaluation
        The comparisons.
    explanation : Explanation, optional
        For what is left.
    """
    told = {one.system: one for one in explanation.systems} if explanation is not None else {}
    made = {
        one.system: size_finding(one, told[one.system]) for one in evaluations if one.system in told
    }
    result: list[Finding] = []
    done = set()
    for one in findings:
        ours = made.get(one.subject) if one.code in OF_SIZES else None
        if ours is None:
            result.append(one)
        elif one.subject not in done:
            result.append(ours)
            done.add(one.subject)
    return result


def size_finding(evaluation: Evaluation, one: SystemExplanation) -> Finding | None:
    """How large errors are against what is stated, as they came and as far as they are explained.

    None where nothing is stated or explained.
    """
    test, settled = evaluation.comparison.test, one.settled
    if test is None or settled is None:
        return None
    known = [(name, *row) for name, row in zip(KINDS, settled.misfit.tolist(), strict=True)]
    known = [row for row in known if row[1] == row[1]]
    if not known:
        return None
    larger = any(low > 1 for _, _, low, _ in known)
    smaller = not larger and any(high < 1 for *_, high in known)
    out = _taken_out(settled)
    left = " and ".join(
        f"{factor:.2g} times in the {name} (99 % interval {low:.2g} to {high:.2g})"
        for name, factor, low, high in known
    )
    came = {
        "above": "larger than the stated covariances allow",
        "inside": "as large as the stated covariances say",
        "below": "smaller than the stated covariances say",
    }[test.verdict]
    first = f"The errors are {came}: {measured_nees(test)}."
    then = f"{out or 'By kind'}, they are {left} as large as stated."
    end = _conclusion(test.verdict, larger=larger, smaller=smaller, out=out, settled=settled)
    text = " ".join(part for part in (first, then, end) if part)
    severity: Severity = "warning" if larger or test.verdict == "above" else "good"
    if severity == "good" and (smaller or test.verdict == "below"):
        severity = "note"
    sized = {"above": "nees_above", "below": "nees_below"}.get(test.verdict, "nees_inside")
    sizes = nees_size(test), *(_ratio(*row) for row in known)
    return Finding(severity, text, one.system, sized, sizes)


def _taken_out(settled: Settled) -> str:
    """'Without a wrong mount and 2 cells that do not fit'; empty if nothing is taken out."""
    model, cells = settled.fit.model, settled.cells
    flagged = int((~cells).sum())
    parts = [model.words] if model.parts else []
    parts += [f"{flagged} {'cell' if flagged == 1 else 'cells'} in doubt"] if flagged else []
    return f"Without {' and '.join(parts)}" if parts else ""


def _conclusion(came: str, *, larger: bool, smaller: bool, out: str, settled: Settled) -> str:
    """What follows from both."""
    if larger:
        return (
            "The stated covariances are too small, or poses share errors, or there is a cause that "
            f"was not found. {_what_then(settled)}"
        )
    end = ""
    if came == "above" and out:
        end = "What was taken out accounts for the excess."
    elif came == "above":
        end = "The covariances are too small, or there is a systematic error."
    if smaller:
        end += f" The stated covariances are too large{_or_shared(settled)}."
    return end.strip()
