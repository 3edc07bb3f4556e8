"""Errors compared between who made the poses: cameras, scanners, receivers, observers, days."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy import special

from validation.poses.angles import Array, wrap
from validation.poses.pose_table import MAKERS, Component
from validation.results import Finding, Section, Size, Table
from validation.statistics.evaluation import Evaluation
from validation.statistics.neighbours import is_said, weigh

FEWEST = 2
"""Stops of a maker below which it is left out: one stop tells nothing of its scatter."""
MOST_SPLITS = 6
"""Makers up to which every split in two is looked at; of more, each one against the others."""
SHUFFLES = (999, 4999)
"""Least and most exchanges of the errors: p-values are known to 0.007 and 0.003 at 0.05."""
SHUFFLED_NUMBERS = 1_000_000
"""Numbers that are shuffled in all: a third of a second."""
SHOWN, HINT = 0.05, 0.10
"""Chance by which a difference is shown, of all that was looked at, and by which it is a hint."""

_PART = re.compile(rf"\b({'|'.join(MAKERS)}) ([^,]+)")


@dataclass(frozen=True)
class SourceDifference:
    """What makers of poses differ by in one component.

    Parameters
    ----------
    system, whose, kind : str
        Of the errors; whose poses say who made them; 'camera', 'day', ...
    component : Component
        Which.
    means : mapping of str to (float, int)
        Mean error and number of stops of each maker.
    split : (tuple of str, tuple of str)
        The two groups that differ most.
    split_means : (float, float)
        Their mean errors.
    split_p, looked_p, p_value, family_p : float
        Chance of so large a difference of these two groups, had they been chosen beforehand; had
        any split been looked at; of so large differences between all makers; and the last for
        every component and kind that was looked at.
    dependent : bool
        Whether neighbours depend on each other beside that: p is then too small.
    """

    system: str
    whose: str
    kind: str
    component: Component
    means: Mapping[str, tuple[float, int]]
    split: tuple[tuple[str, ...], tuple[str, ...]]
    split_means: tuple[float, float]
    split_p: float
    looked_p: float
    p_value: float
    family_p: float
    dependent: bool

    @property
    def verdict(self) -> str:
        """'shown', 'hint' or ''."""
        if self.family_p < SHOWN and not self.dependent:
            return "shown"
        return "hint" if self.p_value < HINT else ""


def makers_of(sources: Sequence[str], kind: str) -> list[str]:
    """Who of one kind made each pose: '4+1' of 'camera 4+1'; empty where that is not said."""
    found = [dict(_PART.findall(source)) for source in sources]
    return [one.get(kind, "").strip() for one in found]


def source_differences(evaluation: Evaluation, seed: int = 0) -> list[SourceDifference]:
    """Errors of one system between all makers that validation and system name.

    Parameters
    ----------
    evaluation : Evaluation
        The errors.
    seed : int
        Of the exchanges.

    Returns
    -------
    list of SourceDifference
        One for each kind and component; empty where fewer than two makers of a kind have two
        stops or more.

    Notes
    -----
    Exchange test: the share of the square sum that lies between makers, against that of errors
    dealt out anew, exact for errors that could as well have been exchanged. What was looked at is
    allowed for by the least p-value of all kinds and components in each exchange (Westfall and
    Young, Resampling-based multiple testing, 1993).
    """
    comparison = evaluation.comparison
    means = np.array([one.mean for one in evaluation.statistics])
    angles = np.array([one.kind == "angle" for one in comparison.components])
    values = comparison.errors - np.nan_to_num(means)
    values = np.where(angles, wrap(values), values)
    factors = []
    for table in (comparison.validation, comparison.gt):
        for kind in MAKERS:
            names = np.array(makers_of(table.sources, kind))
            known = [n for n in dict.fromkeys(names) if n and (names == n).sum() >= FEWEST]
            if len(known) > 1:
                factors.append((table.system, kind, names, known))
    tested = [_Tested(values[np.isin(names, known)], names[np.isin(names, known)], known, seed)
              for _, _, names, known in factors]  # fmt: skip
    if not tested:
        return []
    least = min(len(one.p_values) for one in tested)
    smallest = np.min([one.p_values[:least].min(1) for one in tested], axis=0)
    found = []
    for (whose, kind, _, known), one in zip(factors, tested, strict=True):
        for column, component in enumerate(comparison.components):
            family = float((smallest <= one.p_values[0, column]).mean())
            centre = float(means[column])
            split, two, own, looked = one.best_split(column)
            found.append(
                SourceDifference(
                    evaluation.system,
                    whose,
                    kind,
                    component,
                    {n: (centre + one.mean(n, column), one.count(n)) for n in known},
                    split,
                    (centre + two[0], centre + two[1]),
                    own,
                    looked,
                    float(one.p_values[0, column]),
                    family,
                    one.dependent(angles, column),
                )
            )
    return found


class _Tested:
    """Errors (n, c) of n stops with their makers, and the same dealt out anew."""

    def __init__(self, values: Array, names: Array, known: Sequence[str], seed: int) -> None:
        self.values, self.known = values, list(known)
        self.member = np.array([names == one for one in known], dtype=float)
        self.counts = self.member.sum(1)
        self._names = names
        n = len(values)
        count = int(np.clip(SHUFFLED_NUMBERS // n, *SHUFFLES))
        rng = np.random.default_rng(seed)
        rows = [np.arange(n), *(rng.permutation(n) for _ in range(count))]
        # (m, L, c) sums of each maker, those of the table itself first.
        self.sums = np.array([self.member @ values[row] for row in rows])
        between = (self.sums**2 / self.counts[:, None]).sum(1) - values.sum(0) ** 2 / n
        self.p_values = _ranks(between)

    def mean(self, name: str, column: int) -> float:
        """Of the errors of one maker."""
        row = self.known.index(name)
        return float(self.sums[0, row, column] / self.counts[row])

    def count(self, name: str) -> int:
        """Stops of one maker."""
        return int(self.counts[self.known.index(name)])

    def best_split(
        self, column: int
    ) -> tuple[tuple[tuple[str, ...], tuple[str, ...]], tuple[float, float], float, float]:
        """The two groups that differ most, their means, and p without and with the looking."""
        sums, n, total = self.sums[:, :, column], len(self.values), self.values[:, column].sum()
        best = np.full(len(sums), -np.inf)
        chosen: tuple[int, ...] = ()
        for some in _splits(len(self.known)):
            count = self.counts[list(some)].sum()
            one = sums[:, list(some)].sum(1)
            between = one**2 / count + (total - one) ** 2 / (n - count) - total**2 / n
            chosen = some if between[0] > best[0] else chosen
            best = np.maximum(best, between)
        count = float(self.counts[list(chosen)].sum())
        inside = float(sums[0, list(chosen)].sum())
        means = inside / count, float(total - inside) / (n - count)
        squares = float(np.square(self.values[:, column] - total / n).sum())
        left = max(squares - best[0], 1e-300) / max(n - 2, 1)
        own = 2 * float(special.stdtr(max(n - 2, 1), -np.sqrt(best[0] / left)))
        rest = [i for i in range(len(self.known)) if i not in chosen]
        names = tuple(tuple(self.known[i] for i in some) for some in (chosen, rest))
        # Of numbers that are equal but for rounding, none is the larger.
        looked = float((best >= best[0] * (1 - 1e-9)).mean())
        return (names[0], names[1]), means, own, looked

    def dependent(self, angles: Array, column: int) -> bool:
        """Whether neighbours depend on each other, once the makers' means are taken out."""
        same = angles == angles[column]
        slopes = np.repeat(self.member.T[:, None], same.sum(), axis=1)
        left = self.values - self.member.T @ (self.sums[0] / self.counts[:, None])
        if len(left) <= len(self.known) + 2 or (np.ptp(left[:, same], axis=0) == 0).any():
            return False
        gain = weigh(np.arange(len(left), dtype=float), left[:, same], slopes).gain
        return is_said(gain, len(left))


def _splits(count: int) -> list[tuple[int, ...]]:
    """One side of every way to part the makers in two."""
    if count > MOST_SPLITS:
        return [(one,) for one in range(count)]
    sizes = range(1, count)
    return [some for k in sizes for some in combinations(range(count), k) if 0 in some]


def _ranks(values: Array) -> Array:
    """(m, c) share of each column that is as large as a value or larger."""
    found = np.empty(values.shape)
    for column, one in enumerate(values.T):
        ordered = np.sort(one)
        found[:, column] = 1 - np.searchsorted(ordered, one * (1 - 1e-9), "left") / len(one)
    return found


def source_findings(found: Sequence[SourceDifference]) -> list[Finding]:
    """What is shown, and what is a hint, in words."""
    return [
        Finding(
            "warning" if one.verdict == "shown" else "note",
            _sentence(one),
            one.system,
            "differs_by_source" if one.verdict == "shown" else "source_hint",
            tuple(
                Size(
                    f"mean error in {one.component.name} of {' and '.join(names)}",
                    float(mean),
                    one.component.unit,
                )
                for names, mean in zip(one.split, one.split_means, strict=True)
            ),
        )
        for one in found
        if one.verdict
    ]


def _sentence(one: SourceDifference) -> str:
    """'Errors in y differ by camera: +2 mm in 1 and 2, +79 mm in 3 and 4 ...'."""
    sides = ", ".join(
        f"{1000 * mean:+.0f} m{one.component.unit} in {' and '.join(names)}"
        for names, mean in zip(one.split, one.split_means, strict=True)
    )
    looked = len(one.means) > 2
    chosen = f"p = {one.split_p:.2g} had these two been asked for beforehand, " if looked else ""
    text = (
        f"Errors in {one.component.name} by {one.kind}: {sides}. {chosen[:1].upper()}{chosen[1:]}"
        f"{'p' if looked else 'P'} = {one.p_value:.2g} between all {len(one.means)}, "
        f"{one.family_p:.2g} with all components that were looked at."
    )
    if one.dependent:
        text += " Neighbours depend on each other, so that p is too small."
    if one.verdict == "shown":
        return f"{text} Look at what differs between them: calibration, mount, place."
    return f"{text} That is a hint, not a finding: measure more stops of each."


def source_section(found: Sequence[SourceDifference]) -> Section:
    """Every maker's mean errors, with the tests."""
    rows: list[list[str | int | float | None]] = [
        [one.system, one.kind, name, f"{one.component.name} [{one.component.unit}]", n, mean]
        for one in found
        for name, (mean, n) in one.means.items()
    ]
    means = Table(
        "Mean errors by who made the pose",
        ["system", "by", "who", "component", "stops", "mean"],
        rows,
        ["", "", "", "", "d", ".4f"],
        f"Makers of fewer than {FEWEST} stops are left out.",
    )
    tests: list[list[str | int | float | None]] = [
        [
            *(one.system, one.kind, one.component.name),
            " | ".join(" ".join(names) for names in one.split),
            *(one.split_p, one.looked_p, one.p_value, one.family_p, one.verdict),
        ]
        for one in found
    ]
    note = (
        "'asked': p of the two groups, had they been chosen beforehand, by Student's t for normal "
        "errors; 'looked': had any two groups been looked at; 'all': between all; 'family': with "
        "all components and kinds looked at. The last three by exchanging errors, which takes "
        "them as independent."
    )
    columns = ["system", "by", "component", "groups", "asked", "looked", "all", "family", ""]
    told = Table("Whether makers differ", columns, tests, ["", "", "", "", *[".2g"] * 4, ""], note)
    return Section("Errors by source", [means, told], folded=True)


def source_json(found: Sequence[SourceDifference]) -> list[Mapping[str, object]]:
    """All numbers, for scripts."""
    return [{**vars(one), "component": one.component.name, "verdict": one.verdict} for one in found]
