"""What the results of one campaign say of its systems: bias and spread, with their intervals."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from scipy import special

from validation.campaign.folder import Campaign, load_campaign
from validation.campaign.provenance import earlier_record
from validation.campaign.stored import stored_tables
from validation.days.order import moment_of
from validation.errors import GtvalError
from validation.poses.pose_table import PLANAR, SPATIAL, Component
from validation.results import VALIDATION_SYSTEM, Finding, Size
from validation.shown import Shown
from validation.solving import late_finding
from validation.statistics.dependence import mean_of_series
from validation.statistics.error_statistics import ComponentStatistics
from validation.statistics.evaluation import evaluate
from validation.text_files.csv_tables import Column, header_of, read_csv

STATISTICS, IN_TIME = "statistics.csv", "errors_in_time_"
_ENDS = re.compile(r"ci([\d.]+)_(low|high)$")
COMPONENTS = {one.name: one for one in (*SPATIAL, *PLANAR)}


@dataclass(frozen=True)
class DayErrors:
    """Errors of one component of one system on one day, metres or radians.

    Parameters
    ----------
    system : str
        The system.
    component : Component
        Which number of its poses.
    n : int
        Errors.
    mean, low, high : float
        Bias with its interval, of that day alone; NaN where there is none.
    std : float
        Sample standard deviation.
    confidence : float
        Of the intervals.
    sigma : float
        Standard deviation of the mean, by the errors of the day; NaN where unknown.
    """

    system: str
    component: Component
    n: int
    mean: float
    low: float
    high: float
    std: float
    confidence: float
    sigma: float

    @property
    def std_interval(self) -> tuple[float, float]:
        """Interval of the standard deviation of normal errors, by chi-squared."""
        if self.n < 2:
            return np.nan, np.nan
        tail = (1 - self.confidence) / 2
        low, high = special.chdtri(self.n - 1, [tail, 1 - tail])
        freedom = self.n - 1
        return self.std * float(np.sqrt(freedom / low)), self.std * float(np.sqrt(freedom / high))


@dataclass(frozen=True, repr=False)
class Day(Shown):
    """One campaign.

    Parameters
    ----------
    folder : Path
        Where it is.
    name : str
        What it is called.
    date : str
        As it states it.
    errors : tuple of DayErrors
        Of all its systems.
    findings : tuple of Finding
        What is to be known of its results.
    """

    folder: Path
    name: str
    date: str
    errors: tuple[DayErrors, ...]
    findings: tuple[Finding, ...] = ()

    @property
    def moment(self) -> datetime | None:
        """When it was, as far as it says so."""
        return moment_of(self.date)

    @property
    def systems(self) -> tuple[str, ...]:
        """Names of the systems compared, in the order of the results."""
        return tuple(dict.fromkeys(one.system for one in self.errors))


class NoResultsError(GtvalError):
    """A campaign that was not run yet, or of which nothing was compared."""


def read_day(folder: Path) -> Day:
    """What the results of a campaign say; nothing is computed anew but what is not stored.

    Parameters
    ----------
    folder : Path
        The campaign folder.

    Raises
    ------
    NoResultsError
        If there are none.
    GtvalError
        If campaign.toml or the results are bad.
    """
    campaign = load_campaign(folder)
    if not campaign.results.is_dir():
        raise NoResultsError(f"there are no results; `gtval run {folder}` makes them")
    statistics = campaign.results / STATISTICS
    tables = stored_tables(campaign)
    late = [*tables.findings, *late_finding("results", tables.others)]
    stored = statistics.is_file()
    errors = _stored(statistics) if stored else _compared(campaign, tables.tables)
    known = {one.system for one in errors}
    for path in sorted(campaign.results.glob(f"{IN_TIME}*.csv")):
        system = path.stem.removeprefix(IN_TIME)
        if system not in known:
            errors += _in_time(path, system, campaign.settings.comparison.confidence)
    if not errors:
        raise NoResultsError("nothing in its results is compared with validation poses")
    settings = campaign.settings
    found = (*_out_of_date(folder, late), *_with_errors(folder, earlier_record(campaign)))
    return Day(folder, settings.name, settings.date, tuple(errors), found)


def _stored(path: Path) -> list[DayErrors]:
    """The rows of statistics.csv."""
    ends = {
        found[2]: (found[0], float(found[1]))
        for found in map(_ENDS.match, header_of(path))
        if found
    }
    names = ["n", "mean", "std", *(name for name, _ in ends.values())]
    columns = [Column(name) for name in ("system", "component")]
    table = read_csv(path, columns + [Column(name, "number", blank=True) for name in names])
    confidence = ends["low"][1] / 100 if "low" in ends else 0.95
    found = []
    for row in range(len(table)):
        number = {name: table.numbers[name][row] for name in names}
        component = COMPONENTS.get(table.text["component"][row])
        if component is None:
            table.flag(row, "component", f"one of {', '.join(COMPONENTS)}")
            continue
        if np.isnan(number["n"]) or np.isnan(number["mean"]):
            continue
        low, high = (number[ends[end][0]] if end in ends else np.nan for end in ("low", "high"))
        told = (int(number["n"]), number["mean"], low, high, number["std"])
        found.append(_day_errors(table.text["system"][row], component, told, confidence))
    table.raise_problems()
    return found


def _compared(campaign: Campaign, tables: Sequence[Any]) -> list[DayErrors]:
    """The poses under results/ compared here, where no run has written its statistics."""
    by_name = {table.system: table for table in tables}
    truth = by_name.pop(VALIDATION_SYSTEM, None)
    if truth is None:
        return []
    return [
        _of_statistics(table.system, one)
        for table in by_name.values()
        for one in evaluate(truth, table, campaign.settings.comparison).statistics
    ]


def _of_statistics(system: str, one: ComponentStatistics) -> DayErrors:
    told = (one.n, one.mean, one.ci_low, one.ci_high, one.std)
    return _day_errors(system, one.component, told, one.confidence)


def _day_errors(
    system: str,
    component: Component,
    told: tuple[int, float, float, float, float],
    confidence: float,
) -> DayErrors:
    """With the standard deviation of the mean that its interval says, else that of n errors."""
    n, mean, low, high, std = told
    sigma = np.nan
    if n > 1:
        sigma = std / np.sqrt(n)
        if np.isfinite(high - low):
            sigma = (high - low) / 2 / float(special.stdtrit(n - 1, (1 + confidence) / 2))
    return DayErrors(system, component, n, mean, low, high, std, confidence, float(sigma))


def _in_time(path: Path, system: str, confidence: float) -> list[DayErrors]:
    """Bias and spread of errors on the move, whose neighbours are alike."""
    names = [name for name in COMPONENTS if f"d{name}" in header_of(path)]
    table = read_csv(path, [Column(f"d{name}", "number", blank=True) for name in names])
    table.raise_problems()
    found = []
    for name in names:
        values = np.array(table.numbers[f"d{name}"])
        one = mean_of_series(values[np.isfinite(values)], confidence)
        if one.n:
            sigma = np.sqrt(one.spread.variance) if one.spread is not None else np.nan
            numbers = (one.n, one.mean, one.low, one.high, one.std)
            found.append(DayErrors(system, COMPONENTS[name], *numbers, confidence, float(sigma)))
    return found


def _out_of_date(folder: Path, late: Sequence[Finding]) -> list[Finding]:
    """One line for all that is out of date in a campaign."""
    if not late:
        return []
    text = f"Results are out of date, or of unknown origin: {late[0].text}"
    return [Finding("warning", text, str(folder), "out_of_date")]


def _with_errors(folder: Path, record: Mapping[str, Any]) -> list[Finding]:
    """Whether the run of that day said that its numbers must not be used."""
    listed = record.get("findings")
    told = [one for one in listed if isinstance(one, dict)] if isinstance(listed, list) else []
    errors = [one for one in told if one.get("severity") == "error"]
    if not errors:
        return []
    first = f"{errors[0].get('subject', '')}: {errors[0].get('sentence', '')}"
    text = (
        f"The run of this day found errors ({len(errors)}), the first: {first} Its numbers are "
        "shown, and must not be used before that is settled."
    )
    sizes = (Size("errors", len(errors)),)
    return [Finding("warning", text, str(folder), "day_with_errors", sizes)]
