"""Does one system err less than another? The sizes of their errors at the same stops, in pairs."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import special

from validation.poses.angles import Array
from validation.results import AS_PUBLISHED, Section, Table
from validation.statistics.conclusions import almost_zero
from validation.statistics.error_statistics import mean_interval
from validation.statistics.evaluation import Evaluation

MILLI, POSITION = 1e3, "position"
FEWEST_STOPS = 5
"""Stops in common below which nothing is said. A judgement: Student's quantile of four is 3.2."""


@dataclass(frozen=True)
class PairedErrors:
    """Sizes of the errors of two systems at the same stops, the first less the second.

    Parameters
    ----------
    first, second : str
        The systems.
    component, unit : str
        Which error: a component's absolute value, or the length of the position error.
    n : int
        Stops in common.
    without : tuple of str
        Stops left out, as one of the systems took its pose over from the validation.
    mean, low, high : float
        Mean of |first| - |second| and its interval, metres or radians.
    p_value : float
        Two-sided chance of a mean at least as far from zero if neither errs less.
    level : float
        Below which that is a difference: what all statements together may be wrong by, shared.
    """

    first: str
    second: str
    component: str
    unit: str
    n: int
    without: tuple[str, ...]
    mean: float
    low: float
    high: float
    p_value: float
    level: float

    @property
    def better(self) -> str:
        """The system that errs less; empty where no difference is shown."""
        if not self.p_value < self.level:
            return ""
        return self.first if self.mean < 0 else self.second


def paired_errors(
    evaluations: Sequence[Evaluation], confidence: float = 0.95
) -> list[PairedErrors]:
    """Every two systems compared at the stops that they have in common.

    Parameters
    ----------
    evaluations : sequence of Evaluation
        The systems; the published way of one is left out.
    confidence : float
        Of the intervals; 1 - confidence is what all statements together may be wrong by.

    Notes
    -----
    AD2.3, "Overall conclusions for indoor validation", compares means and standard deviations over
    different stops. Here each stop is its own control: what is hard at a stop for both systems, and
    an error of its validation pose, leaves the difference to a large part. Student's t of the
    differences; stops are taken as independent. Statements share the level (Bonferroni).
    """
    own = [one for one in evaluations if not one.system.endswith(AS_PUBLISHED)]
    found = [sizes for a, b in combinations(own, 2) for sizes in _sizes(a, b)]
    level = (1 - confidence) / max(sum(not without for *_, without, _ in found), 1)
    rows = []
    for first, second, component, unit, without, off in found:
        n, mean, std = len(off), float(off.mean()), float(off.std(ddof=1))
        low, high = mean_interval(mean, std, n, confidence)
        with np.errstate(divide="ignore", invalid="ignore"):
            p_value = float(2 * special.stdtr(n - 1, -np.abs(mean) / (std / np.sqrt(n))))
        numbers = (mean, float(low), float(high), p_value, level)
        rows.append(PairedErrors(first, second, component, unit, n, without, *numbers))
    return rows


Sizes = tuple[str, str, str, str, tuple[str, ...], Array]


def _sizes(a: Evaluation, b: Evaluation) -> Iterator[Sizes]:
    """Differences of the sizes of errors: of all stops, then without taken-over ones."""
    first, second = a.comparison, b.comparison
    if first.components != second.components:
        return
    there, taken_over = set(second.ids), {*almost_zero(first), *almost_zero(second)}
    common = [name for name in first.ids if name in there]
    zero = tuple(name for name in common if name in taken_over)
    places = [{name: row for row, name in enumerate(one.ids)} for one in (first, second)]
    for without in dict.fromkeys([(), zero]):
        ids = [name for name in common if not without or name not in taken_over]
        if len(ids) < FEWEST_STOPS:
            continue
        rows = [[place[name] for name in ids] for place in places]
        one, other = np.abs(first.errors[rows[0]]), np.abs(second.errors[rows[1]])
        for k, component in enumerate(first.components):
            off = one[:, k] - other[:, k]
            yield a.system, b.system, component.name, component.unit, without, off
        off = first.distances[rows[0]] - second.distances[rows[1]]
        yield a.system, b.system, POSITION, "m", without, off


def paired_section(pairs: Sequence[PairedErrors]) -> Section:
    """The chapter that says whether one system errs less than another."""
    rows: list[tuple[str | int | float, ...]] = [
        (
            *(one.first, one.second, f"{one.component} [m{one.unit}]", one.n),
            ", ".join(one.without),
            *(MILLI * value for value in (one.mean, one.low, one.high)),
            *(one.p_value, one.better or "not shown"),
        )
        for one in pairs
    ]
    table = Table(
        "Size of the error of the first system less that of the second, at the same stops",
        ("first", "second", "error", "n", "without", "mean", "low", "high", "p", "errs less"),
        rows,
        ("", "", "", "", "", "+.1f", "+.1f", "+.1f", ".2g", ""),
        "Mean and its 95 % interval, Student's t, stops taken as independent. A difference is "
        f"called one where p < {pairs[0].level:.2g}: all statements of this table together are "
        "wrong in one campaign of twenty where there is none. Without: stops at which a system "
        "took its pose over from the validation, so that its error is zero by construction.",
    )
    return Section("Does one system err less than another?", [table])
