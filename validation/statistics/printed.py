"""Statistics that a document prints, beside those that follow from its own tables."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations
from math import isnan
from pathlib import Path

import numpy as np

from validation.poses.angles import Array
from validation.results import Finding, Size, Table
from validation.statistics.error_statistics import two_sided_quantile
from validation.statistics.evaluation import Evaluation
from validation.text_files.csv_tables import Column, read_csv

KINDS = ("mean", "std", "max_abs")
LIMITS = ("ci95_low", "ci95_high")


@dataclass(frozen=True)
class PrintedNumbers:
    """The numbers of one system and component as printed, so that their digits are known.

    Parameters
    ----------
    system, component : str
        Of what.
    texts : mapping of str to str
        By 'mean', 'std', 'max_abs', 'ci95_low', 'ci95_high'; empty where not printed.
    """

    system: str
    component: str
    texts: Mapping[str, str]

    def value(self, kind: str) -> float:
        """The number; NaN where it is not printed."""
        return float(self.texts[kind] or "nan")

    @property
    def interval_n(self) -> int | None:
        """How many errors the interval was printed for, if it is mean +- 1.96 s / sqrt(n)."""
        half, std = (self.value("ci95_high") - self.value("ci95_low")) / 2, self.value("std")
        if isnan(half) or isnan(std) or half <= 0:
            return None
        return round((round(two_sided_quantile(0.95), 2) * std / half) ** 2)


def load_printed(path: Path) -> list[PrintedNumbers]:
    """The rows of a file of printed statistics.

    Parameters
    ----------
    path : Path
        Columns system, component, and of mean, std, max_abs, ci95_low, ci95_high what is printed.

    Raises
    ------
    InputError
        Naming every bad place.
    """
    numbers = [Column(name, "number", required=False, blank=True) for name in (*KINDS, *LIMITS)]
    table = read_csv(path, [Column("system"), Column("component"), *numbers])
    table.flag_duplicates(["system", "component"])
    table.raise_problems()
    plain = read_csv(path, [Column(c.name, required=False, blank=True) for c in numbers]).text
    names = zip(table.text["system"], table.text["component"], strict=True)
    return [
        PrintedNumbers(system, part, {kind: plain[kind][row].strip() for kind in plain})
        for row, (system, part) in enumerate(names)
    ]


def verdict(text: str, value: float) -> str:
    """How a printed number and a computed one agree: 'equal', 'cut' (not rounded), or 'differs'."""
    digits = len(text.partition(".")[2])
    printed, unit = float(text), 10.0**-digits
    if abs(printed - value) <= unit / 2 * (1 + 1e-9):
        return "equal"
    # A number that is cut is nearer to zero than the value, by less than a unit.
    cut = abs(printed) <= abs(value) and abs(printed - value) < unit and printed * value >= 0
    return "cut" if cut else "differs"


@dataclass(frozen=True)
class Judged:
    """A printed number beside the computed one."""

    numbers: PrintedNumbers
    kind: str
    computed: float

    @property
    def verdict(self) -> str:
        """Whether they agree."""
        return verdict(self.numbers.texts[self.kind], self.computed)


def judged_numbers(
    printed: Iterable[PrintedNumbers], computed: Mapping[tuple[str, str, str], float]
) -> list[Judged]:
    """Every printed number that has a computed one, by system, component and kind."""
    return [
        Judged(one, kind, computed[one.system, one.component, kind])
        for one in printed
        for kind in KINDS
        if one.texts[kind] and (one.system, one.component, kind) in computed
    ]


def evaluated(evaluations: Iterable[Evaluation]) -> dict[tuple[str, str, str], float]:
    """Mean, standard deviation and largest absolute value of all evaluations."""
    return {
        (one.system, statistics.component.name, kind): getattr(statistics, kind)
        for one in evaluations
        for statistics in one.statistics
        for kind in KINDS
    }


def printed_findings(
    judged: Iterable[Judged], numbers: Iterable[PrintedNumbers], sizes: Mapping[str, int]
) -> list[Finding]:
    """Whether the printed numbers follow from the tables, and what n their intervals used.

    Parameters
    ----------
    judged : iterable of Judged
        The numbers.
    numbers : iterable of PrintedNumbers
        Their rows, for the intervals.
    sizes : mapping of str to int
        How many errors each system has.
    """
    findings, every = [], list(judged)
    for system in dict.fromkeys(one.numbers.system for one in every):
        own = [one for one in every if one.numbers.system == system]
        off = [f"{one.numbers.component} {one.kind}" for one in own if one.verdict == "differs"]
        text = f"{len(own) - len(off)} of {len(own)} printed numbers follow from the printed table"
        said = f"; these do not: {', '.join(off)}." if off else ", to the last digit printed."
        findings.append(
            Finding(
                "warning" if off else "good",
                text + said,
                system,
                "printed_statistics",
                (Size("numbers that do not follow", len(off), "numbers"),),
            )
        )
    used: dict[str, set[int]] = {}
    for one in numbers:
        if one.interval_n is not None:
            used.setdefault(one.system, set()).add(one.interval_n)
    for system, counts in used.items():
        if system in sizes and counts != {sizes[system]}:
            said = ", ".join(map(str, sorted(counts)))
            text = (
                f"The printed intervals of the mean are mean ± 1.96 s / √n with n = {said}, but "
                f"the table has n = {sizes[system]} poses. Student's t with that n is wider."
            )
            size = Size("poses in the table", sizes[system], "poses")
            findings.append(Finding("note", text, system, "printed_interval", (size,)))
    return findings


PrintedErrors = Mapping[str, Mapping[tuple[str, str], str]]
"""By system, then by pose and component: the error as printed."""


def load_printed_errors(path: Path, components: Iterable[str]) -> PrintedErrors:
    """Errors as printed; cells that are blank were not printed, or cannot be read.

    Parameters
    ----------
    path : Path
        Columns system, pose, and one for each component.
    components : iterable of str
        Their names.

    Raises
    ------
    InputError
        Naming every bad place.
    """
    names = list(components)
    numbers = [Column(name, "number", required=False, blank=True) for name in names]
    table = read_csv(path, [Column("system"), Column("pose"), *numbers])
    table.flag_duplicates(["system", "pose"])
    table.raise_problems()
    plain = read_csv(path, [Column(name, required=False, blank=True) for name in names]).text
    found: dict[str, dict[tuple[str, str], str]] = {}
    for row, system in enumerate(table.text["system"]):
        own = found.setdefault(system, {})
        for name in names:
            if text := plain[name][row].strip():
                own[table.text["pose"][row], name] = text
    return found


def errors_finding(
    system: str, printed: PrintedErrors, computed: Mapping[tuple[str, str], float]
) -> list[Finding]:
    """Whether the printed errors of a system follow from its printed poses; none where none are.

    Parameters
    ----------
    system : str
        The system.
    printed : PrintedErrors
        As printed.
    computed : mapping of (str, str) to float
        By pose and component.
    """
    both = {cell: text for cell, text in printed.get(system, {}).items() if cell in computed}
    if not both:
        return []
    off = {
        cell: abs(float(text) - computed[cell]) * 10.0 ** len(text.partition(".")[2])
        for cell, text in both.items()
        if verdict(text, computed[cell]) == "differs"
    }
    last = [f"{name} at pose {pose}" for (pose, name), size in off.items() if size < MOST_UNITS]
    wrong = [f"{name} at pose {pose}" for (pose, name), size in off.items() if size >= MOST_UNITS]
    text = (
        f"{len(both) - len(off)} of {len(both)} printed errors follow from the printed poses, to "
    )
    text += "the last digit."
    if last:
        text += (
            f" In the last digit are off: {', '.join(last)}, as errors are that were computed "
            "before the poses were rounded."
        )
    if wrong:
        text += f" These do not follow: {', '.join(wrong)}."
    count = Size("errors that do not follow", len(wrong), "errors")
    return [Finding("warning" if wrong else "good", text, system, "printed_errors", (count,))]


MOST_UNITS = 1.5
"""Units of the last digit printed by which an error may be off that was computed before its two
poses were rounded, each by half a unit, and then rounded itself."""


def printed_table(judged: Iterable[Judged]) -> Table:
    """Printed statistics beside the computed ones."""
    rows = [
        (
            *(one.numbers.system, one.numbers.component, one.kind),
            *(one.numbers.texts[one.kind], one.computed, one.verdict),
        )
        for one in judged
    ]
    return Table(
        "Printed statistics and what follows from the tables",
        ("system", "component", "number", "printed", "computed", "verdict"),
        rows,
        ("", "", "", "", ".6f", ""),
        "Equal: to the last digit printed. Cut: the last digit printed was cut off, not rounded.",
    )


def cells_that_give(cells: Array, numbers: PrintedNumbers, most: int = 4) -> list[tuple[int, ...]]:
    """The smallest sets of cells whose statistics are the printed ones, if any has.

    Parameters
    ----------
    cells : (m,) array
        Every number of a table, whatever its component.
    numbers : PrintedNumbers
        Mean, standard deviation and largest absolute value as printed.
    most : int
        Size of the largest set that is tried.

    Returns
    -------
    list of tuple of int
        Their rows in ``cells``; more than one where several sets of the same size fit.
    """
    for size in range(2, min(most, len(cells)) + 1):
        sets = np.array(list(combinations(range(len(cells)), size)))
        values = cells[sets]
        statistics = {
            "mean": values.mean(1),
            "std": values.std(1, ddof=1),
            "max_abs": np.abs(values).max(1),
        }
        fits = np.ones(len(sets), dtype=bool)
        for kind, column in statistics.items():
            text = numbers.texts[kind]
            fits &= np.array([verdict(text, float(value)) != "differs" for value in column])
        if fits.any():
            return [tuple(int(i) for i in row) for row in sets[fits]]
    return []
