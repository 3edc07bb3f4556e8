"""Bias and spread of every system over the days, each with its control chart: what is known."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from validation.days.reading import Day, DayErrors
from validation.poses.angles import Array, circular_mean, wrap
from validation.poses.pose_table import Component
from validation.results import Finding
from validation.shown import Shown
from validation.statistics.control.changes import Change
from validation.statistics.control.charts import ControlChart, control_chart
from validation.statistics.control.trend import UNKNOWN, Trend, trend

Of = Literal["bias", "spread"]

TYPICAL = 30
"""Degrees of freedom with which the typical spread of the days stands beside that of one day, where
this one tells how well its mean is known: of three stops the spread alone is off by a factor of two
by chance, of 26 by a seventh."""
FEWEST_STOPS = 3
"""Errors of a day of which a spread is charted: that of two is zero as soon as they are alike."""
SECONDS = 86400.0


@dataclass(frozen=True, repr=False)
class Series(Shown):
    """Bias or spread of one component of one system, day by day.

    Parameters
    ----------
    system : str
        The system.
    component : Component
        Which number of its poses.
    of : {"bias", "spread"}
        Mean of its errors, or their standard deviation.
    days : (n,) tuple of int
        The days that have it, by their place in the summary.
    values, low, high : (n,) array
        The number of each day and its interval, metres or radians.
    chart : ControlChart
        Of the bias, or of the spread to the power 2/3, which is nearly normal.
    trend : Trend
        Of the values, a day.
    """

    system: str
    component: Component
    of: Of
    days: tuple[int, ...]
    values: Array
    low: Array
    high: Array
    chart: ControlChart
    trend: Trend

    @property
    def name(self) -> str:
        """'bias in x'."""
        return f"{self.of} {'of' if self.of == 'spread' else 'in'} {self.component.name}"

    def measured(self, charted: Array) -> Array:
        """Numbers of the chart in metres or radians."""
        return charted if self.of == "bias" else np.maximum(charted, 0.0) ** 1.5

    def before(self, change: Change) -> float:
        """Mean of the days before a change, since the chart last began anew; metres or radians."""
        charted = self.chart.values[self.since(change) : change.began]
        return float(self.measured(np.asarray(charted.mean())))

    def since(self, change: Change) -> int:
        """The day on which the chart that noticed a change began."""
        return max((one + 1 for one in self.chart.noticed if one < change.noticed), default=0)

    def moved(self, change: Change) -> tuple[float, float, float]:
        """By how much a change had moved the number when it was noticed, and its interval."""
        if self.of == "bias":
            return change.size, change.low, change.high
        before = self.before(change)
        base = before ** (2 / 3)
        ends = self.measured(base + np.array([change.size, change.low, change.high])) - before
        return float(ends[0]), float(ends[1]), float(ends[2])


@dataclass(frozen=True, repr=False)
class Summary(Shown):
    """Campaigns side by side.

    Parameters
    ----------
    days : tuple of Day
        In their order.
    series : tuple of Series
        Of each system each component, its bias and its spread.
    findings : tuple of Finding
        What was noticed, and what could not be read.
    dated : bool
        Whether every campaign states a day; otherwise they are in the order of their names.
    false_alarm_days : float
        Days without change between two false alarms, on average, of all charts together.
    """

    days: tuple[Day, ...]
    series: tuple[Series, ...]
    findings: tuple[Finding, ...]
    dated: bool
    false_alarm_days: float

    @property
    def systems(self) -> tuple[str, ...]:
        """All systems, in the order in which the days have them."""
        return tuple(dict.fromkeys(name for day in self.days for name in day.systems))

    @property
    def step(self) -> str:
        """What is between one and the next: 'day' where they are on successive days."""
        moments = [one.moment for one in self.days]
        dates = [one.date() for one in moments if one is not None]
        daily = {(after - before).days for before, after in pairwise(dates)} <= {1}
        return "day" if self.dated and daily else "campaign"

    def label(self, day: int) -> str:
        """What a day is called: its date, or its folder where days have none or share them."""
        one = self.days[day]
        dates = [each.date for each in self.days]
        return one.date if self.dated and len(set(dates)) == len(dates) else one.folder.name

    def of_system(self, system: str) -> tuple[Series, ...]:
        """The series of one system."""
        return tuple(one for one in self.series if one.system == system)


def all_series(days: Sequence[Day], false_alarm_days: float, *, dated: bool) -> tuple[Series, ...]:
    """Bias and spread of each component of each system, with control charts that share the alarms.

    Parameters
    ----------
    days : sequence of Day
        In their order.
    false_alarm_days : float
        Days without change between two false alarms, on average, all charts together.
    dated : bool
        Whether all days state when they were.
    """
    kinds = _kinds(days)
    wanted: list[tuple[str, Component, Of]] = [(*one, "bias") for one in kinds]
    wanted += [(*one, "spread") for one in kinds if _has_spread(days, *one)]
    charts = len(wanted)
    wanted.sort(key=lambda one: kinds.index(one[:2]))
    return tuple(_series(days, *one, charts, false_alarm_days, dated=dated) for one in wanted)


def _kinds(days: Sequence[Day]) -> list[tuple[str, Component]]:
    """Every component of every system, systems and components in the order of the days."""
    found = dict.fromkeys((one.system, one.component) for day in days for one in day.errors)
    systems = list(dict.fromkeys(system for system, _ in found))
    return sorted(found, key=lambda one: systems.index(one[0]))


def _rows(days: Sequence[Day], system: str, component: Component) -> list[tuple[int, DayErrors]]:
    """The days that have a component of a system, and its errors."""
    return [
        (place, one)
        for place, day in enumerate(days)
        for one in day.errors
        if one.system == system and one.component == component
    ]


def _has_spread(days: Sequence[Day], system: str, component: Component) -> bool:
    return any(one.n >= FEWEST_STOPS for _, one in _rows(days, system, component))


def _series(
    days: Sequence[Day],
    system: str,
    component: Component,
    of: Of,
    charts: int,
    false_alarm_days: float,
    *,
    dated: bool,
) -> Series:
    rows = _rows(days, system, component)
    sigmas = sigmas_of_means([one for _, one in rows])
    if of == "spread":
        rows = [(place, one) for place, one in rows if one.n >= FEWEST_STOPS]
    errors = [one for _, one in rows]
    if of == "bias":
        values = np.array([one.mean for one in errors])
        if component.kind == "angle":
            middle = float(circular_mean(values))
            values = middle + wrap(values - middle)
        charted = values
        low, high = (np.array([getattr(one, end) for one in errors]) for end in ("low", "high"))
    else:
        values = np.array([one.std for one in errors])
        charted, sigmas = nearly_normal(values, np.array([one.n - 1 for one in errors]))
        low, high = np.array([one.std_interval for one in errors]).T
    chart = control_chart(charted, sigmas, false_alarm_days=false_alarm_days, charts=charts)
    places = tuple(place for place, _ in rows)
    when = _when(days, places, dated=dated)
    own = sigmas if of == "bias" else 1.5 * np.sqrt(charted) * sigmas
    slope = trend(when, values, own) if len(values) else UNKNOWN
    return Series(system, component, of, places, values, low, high, chart, slope)


def _when(days: Sequence[Day], places: Sequence[int], *, dated: bool) -> Array:
    """When the days were, in days; their number where they state none or share one date."""
    if dated:
        stamps = [moment.timestamp() for one in days if (moment := one.moment) is not None]
        when = np.array(stamps)[list(places)] / SECONDS
        if np.ptp(np.array(stamps)) > 0:
            return np.asarray(when)
    return np.array(places, dtype=float)


def sigmas_of_means(errors: Sequence[DayErrors]) -> Array:
    """(n,) standard deviation of each day's mean by the errors of that day.

    The spread of a day of few stops is itself known badly, and a mean must not count for much
    because its stops agree by chance: beside it stands the typical spread of the days.
    """
    if not errors:
        return np.empty(0)
    n = np.array([one.n for one in errors], dtype=float)
    own = np.array([one.std**2 if one.n > 1 else 0.0 for one in errors])
    freedom = np.maximum(n - 1, 0.0)
    typical = float(np.median(own[freedom > 0])) if (freedom > 0).any() else 0.0
    variances = (freedom * own + TYPICAL * typical) / (freedom + TYPICAL)
    # Where neighbours are alike a mean is known worse than that of as many independent errors. That
    # they are is a matter of the system: of single days one in twenty seems so by chance.
    both = [(one.n * one.sigma**2, one.std**2) for one in errors if one.n > 1 and one.std > 0]
    ratios = [of_mean / of_one for of_mean, of_one in both if np.isfinite(of_mean)]
    alike = max(float(np.median(ratios)), 1.0) if ratios else 1.0
    return np.asarray(np.sqrt(variances * alike / n))


def nearly_normal(stds: Array, freedom: Array) -> tuple[Array, Array]:
    """(n,) standard deviations to the power 2/3, and the standard deviation of each by chance.

    Notes
    -----
    Wilson and Hilferty (1931): the cube root of chi-squared over its f degrees of freedom is
    nearly normal, with mean 1 - 2 / (9 f) and variance 2 / (9 f).
    """
    lost = 2 / (9 * np.maximum(freedom, 1))
    charted = stds ** (2 / 3) / (1 - lost)
    typical = float(np.median(charted)) if len(charted) else 0.0
    return charted, typical * np.sqrt(lost) / (1 - lost)
