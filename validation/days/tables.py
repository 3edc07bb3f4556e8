"""The tables and the JSON of a summary."""

from typing import Any

from validation.days.charted import Series, Summary
from validation.report.cells import Value
from validation.results import Table
from validation.statistics.control.changes import Change

SMALL = {"m": "mm", "rad": "mrad"}


def systems_table(summary: Summary) -> Table:
    """One row a system, component, and bias or spread: how it is over the days."""
    rows: list[list[Value]] = []
    for one in summary.series:
        steps = [float(number) for number in one.trend]
        values = [float(1e3 * value) for value in (one.values.mean(), _scatter(one), *steps)]
        unit = SMALL[one.component.unit]
        told = "; ".join(
            _noticed(summary, one, change) for change in one.chart.changes if not change.goes_on
        )
        last = 1e3 * float(one.values[-1])
        rows.append([one.system, one.name, unit, len(one.days), *values, last, told or "no change"])
    columns = [
        *("system", "of its errors", "unit", "days", "mean", "std of days"),
        *("trend a day", "low", "high", "last day", "noticed"),
    ]
    return Table(
        "Bias and spread over the days",
        columns,
        rows,
        ["", "", "", "d", *[".2f"] * 2, *[".3f"] * 3, ".2f", ""],
        "std of days: of the numbers of the days around their mean. Trend: slope of a straight "
        "line through all days with its 95 % interval"
        + ("" if summary.dated else ", a campaign where days state no date")
        + f". A change is noticed where chance would exceed the limit once in "
        f"{summary.false_alarm_days:g} days without change, all charts together.",
    )


def _scatter(one: Series) -> float:
    return float(one.values.std(ddof=1)) if len(one.values) > 1 else float("nan")


def _noticed(summary: Summary, one: Series, change: Change) -> str:
    """'drift since 2026-03-11, noticed 2026-03-14'."""
    began, noticed = (summary.label(one.days[day]) for day in (change.began, change.noticed))
    return f"{change.kind} since {began}, noticed {noticed}"


def days_table(summary: Summary) -> Table:
    """One row a day and system: number of stops, bias and spread of each component."""
    components = list(dict.fromkeys(one.component for one in summary.series))
    columns = ["day", "campaign", "system", "n"]
    for component in components:
        unit = SMALL[component.unit]
        columns += [f"{what} {component.name} [{unit}]" for what in ("mean", "±", "std")]
    rows: list[list[Value]] = []
    for place, day in enumerate(summary.days):
        for system in day.systems:
            own = {one.component: one for one in day.errors if one.system == system}
            cells: list[Value] = []
            for component in components:
                known = own.get(component)
                numbers = (known.mean, (known.high - known.low) / 2, known.std) if known else ()
                cells += [1e3 * number for number in numbers] or [None] * 3
            n = max(one.n for one in own.values())
            rows.append([summary.label(place), day.folder.name, system, n, *cells])
    return Table(
        "The days",
        columns,
        rows,
        ["", "", "", "d", *[".2f"] * 3 * len(components)],
        "Mean error (validation minus GT) with half of its interval, and sample standard "
        "deviation, of that day alone. Days are comparable as far as their stops are the same.",
    )


def summary_json(summary: Summary) -> dict[str, Any]:
    """A summary for scripts: metres and radians, days by their place from 0."""
    return {
        "false_alarm_days": summary.false_alarm_days,
        "dated": summary.dated,
        "days": [
            {
                "label": summary.label(place),
                "campaign": day.name,
                "folder": day.folder,
                "date": day.date,
                "systems": {system: _day_json(summary, place, system) for system in day.systems},
            }
            for place, day in enumerate(summary.days)
        ],
        "charts": [_chart_json(summary, one) for one in summary.series],
    }


def _day_json(summary: Summary, place: int, system: str) -> dict[str, Any]:
    own = [one for one in summary.days[place].errors if one.system == system]
    return {
        one.component.name: {
            "unit": one.component.unit,
            "n": one.n,
            "mean": one.mean,
            "low": one.low,
            "high": one.high,
            "std": one.std,
            "std_low": one.std_interval[0],
            "std_high": one.std_interval[1],
            "confidence": one.confidence,
        }
        for one in own
    }


def _chart_json(summary: Summary, one: Series) -> dict[str, Any]:
    chart = one.chart
    return {
        "system": one.system,
        "component": one.component.name,
        "of": one.of,
        "unit": one.component.unit,
        "days": one.days,
        "values": one.values,
        "low": one.low,
        "high": one.high,
        "centre": one.measured(chart.centre),
        "limit_low": one.measured(chart.low),
        "limit_high": one.measured(chart.high),
        "evidence": chart.evidence,
        "evidence_limit": chart.limits,
        "trend_a_day": one.trend,
        "changes": [_change_json(summary, one, change) for change in chart.changes],
    }


def _change_json(summary: Summary, one: Series, change: Change) -> dict[str, Any]:
    size, low, high = one.moved(change)
    days = {"noticed": change.noticed, "began": change.began}
    days |= {"began_low": change.began_low, "began_high": change.began_high}
    return {
        **{name: one.days[day] for name, day in days.items()},
        "noticed_on": summary.label(one.days[change.noticed]),
        "began_on": summary.label(one.days[change.began]),
        "kind": change.kind,
        "probability_of_drift": change.drift,
        "goes_on": change.goes_on,
        "size": size,
        "low": low,
        "high": high,
        "per_campaign": change.per_day if one.of == "bias" else None,
        "per_day": change.per_day if one.of == "bias" and summary.step == "day" else None,
    }
