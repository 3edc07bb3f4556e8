"""Tolerance intervals of the errors of a comparison, which allow for what neighbours share."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from validation.poses.angles import Array, wrap
from validation.poses.pose_table import Component
from validation.statistics.evaluation import Evaluation
from validation.statistics.neighbours import FEWEST, WITHHELD, is_said, weigh
from validation.statistics.standards.tolerance import (
    NOT_NORMAL,
    FreeBound,
    Tolerance,
    free_bound,
    length_bound,
    normal_tolerance,
    normality_p_value,
)

NAN = float("nan")
NO_BOUND = FreeBound(NAN, NAN, NAN)
DEPENDENT = "neighbours in the table depend on each other"


class Errors(NamedTuple):
    """Errors of one component.

    ``values`` (n,) metres or radians, angles not wrapped; ``effective`` independent ones that tell
    as much, NaN where that is not known; ``reason`` says why they are fewer.
    """

    component: Component
    values: Array
    effective: float
    reason: str

    @property
    def independent(self) -> bool:
        """Whether they are taken as independent."""
        return self.effective == len(self.values)

    @property
    def mean(self) -> float:
        """Of the values."""
        return float(self.values.mean())

    @property
    def std(self) -> float:
        """Around the mean; zero for one value."""
        return float(self.values.std(ddof=1)) if len(self.values) > 1 else 0.0


def errors_of(evaluation: Evaluation) -> list[Errors]:
    """Every component's errors, in the order of the stops; those of one kind have one memory."""
    columns = []
    for one, values in zip(evaluation.statistics, evaluation.comparison.errors.T, strict=True):
        turned = one.component.kind == "angle" and np.isfinite(one.mean)
        columns.append(one.mean + wrap(values - one.mean) if turned else values)
    kinds = [one.component.kind for one in evaluation.statistics]
    told = {
        kind: worth(np.column_stack([v for v, k in zip(columns, kinds, strict=True) if k == kind]))
        for kind in dict.fromkeys(kinds)
    }
    return [
        Errors(one.component, values, *told[one.component.kind])
        for one, values in zip(evaluation.statistics, columns, strict=True)
    ]


def worth(values: Array) -> tuple[float, str]:
    """Independent errors that tell as much, NaN where that is not known, and why they are fewer.

    Parameters
    ----------
    values : (n, c) array
        Of c components with one memory, in the order of the stops.
    """
    n = len(values)
    if n < FEWEST or (np.ptp(values, axis=0) == 0).any():
        return float(n), ""
    found = weigh(np.arange(n, dtype=float), values - values.mean(0), np.ones((*values.shape, 1)))
    if not is_said(found.gain, n):
        return float(n), ""
    effective = min(found.effective(), float(n))
    if found.short > WITHHELD:
        return NAN, f"does not hold: {DEPENDENT}, and the table is too short to allow for it"
    return effective, f"{DEPENDENT}: counted as {effective:.1f} of {n}"


def tolerances(errors: Sequence[Errors], content: float, confidence: float) -> list[Tolerance]:
    """Of each component, and of the length of the position where it has several.

    Parameters
    ----------
    errors : sequence of Errors
        Of all components.
    content, confidence : float
        Share of the errors that is held, and how surely.
    """
    found = [_tolerance(one, content, confidence) for one in errors]
    lengths = [i for i, one in enumerate(errors) if one.component.kind == "length"]
    if len(lengths) > 1:
        parts = [errors[i] for i in lengths]
        normal = all(np.isfinite(found[i].low) for i in lengths)
        lowest = min(found[i].normality_p for i in lengths)
        reason = next((found[i].reason for i in lengths if found[i].reason), "")
        bound = _length(parts, content, confidence) if normal else NAN
        sizes = np.linalg.norm([one.values for one in parts], axis=0)
        free = free_bound(sizes, content, confidence) if parts[0].independent else NO_BOUND
        least, n = parts[0].effective, len(sizes)
        found.append(
            Tolerance("position", "m", n, least, NAN, NAN, bound, bound, free, lowest, reason)
        )
    return found


def _tolerance(one: Errors, content: float, confidence: float) -> Tolerance:
    """Of one component."""
    n, reason = len(one.values), one.reason
    factor, low, high = NAN, NAN, NAN
    normality = normality_p_value(one.values)
    if normality < NOT_NORMAL:
        said = f"errors are not normal (p = {normality:.2g}): no normal interval"
        reason = f"{reason}; {said}" if reason else said
    elif np.isfinite(one.effective):
        factor, low, high = normal_tolerance(
            one.mean, one.std, n, one.effective, content, confidence
        )
    free = free_bound(np.abs(one.values), content, confidence) if one.independent else NO_BOUND
    bound = max(abs(low), abs(high)) if np.isfinite(low) else NAN
    name, unit = one.component.name, one.component.unit
    return Tolerance(
        *(name, unit, n, one.effective, factor, low, high, bound, free, normality, reason)
    )


def _length(parts: Sequence[Errors], content: float, confidence: float) -> float:
    """Bound of the length of the position error."""
    k = len(parts)
    each = 1 - (1 - content) / k, 1 - (1 - confidence) / k
    ends = [
        normal_tolerance(one.mean, one.std, len(one.values), one.effective, *each)[1:]
        for one in parts
    ]
    return length_bound(np.array([one.mean for one in parts]), *np.array(ends).T)
