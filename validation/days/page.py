"""The page of a summary: one HTML file, in the manner of a campaign's report."""

from functools import partial
from importlib.metadata import version
from typing import TYPE_CHECKING

import numpy as np

from validation.days.charted import Series, Summary
from validation.days.tables import SMALL, days_table, systems_table
from validation.report.document import Document
from validation.report.html import html_report
from validation.report.terminal import most_severe_first
from validation.results import Figure, Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

    from validation.figures.days import Panel


def summary_page(summary: Summary) -> str:
    """The summary as HTML that needs no other file."""
    overview = Section("Over the days", [systems_table(summary)])
    first, last = summary.label(0), summary.label(len(summary.days) - 1)
    document = Document(
        title=f"{len(summary.days)} days of ground truth",
        description="",
        alarm="",
        facts=[
            ("days", f"{first} to {last}"),
            ("systems", ", ".join(summary.systems)),
            ("false alarms", f"one in {summary.false_alarm_days:g} days, all charts together"),
            ("made with", f"gtval {version('gtval')}"),
        ],
        findings=most_severe_first(summary.findings),
        sections=[
            overview,
            *(_section(summary, system) for system in summary.systems),
            Section("Day by day", [days_table(summary)]),
        ],
        overview=overview,
        tables_in="what gtval summary --json prints",
    )
    return html_report(document)


def _section(summary: Summary, system: str) -> Section:
    """The control charts of one system."""
    charts = Figure(
        f"control_{system}",
        f"Bias and spread of {system} by day. Points: the day, with its interval. Line and band: "
        "what the days before led to expect, and where that day alone would have been noticed. "
        "Upright line: a change was noticed; the shade before it begins where the change did.",
        f"Control charts of {system}, a row for each component. The numbers are in the tables.",
        partial(_draw, "control_charts", summary, system),
    )
    sure = Figure(
        f"evidence_{system}",
        "How sure it was on each day that there had been a change, as a normal score by the days "
        "up to then. Dashed: the limit from which it is noticed.",
        f"Evidence of a change of {system} by day, and its limit. Numbers: gtval summary --json.",
        partial(_draw, "evidence_charts", summary, system),
        folded=True,
    )
    return Section(f"System {system}", [charts, sure])


def _draw(name: str, summary: Summary, system: str) -> "MatplotlibFigure":
    """A figure of `validation.figures.days`, which is imported only when something is drawn."""
    from validation.figures import days  # noqa: PLC0415  (half a second that JSON does without)

    series = summary.of_system(system)
    names = list(dict.fromkeys(one.component for one in series))
    rows = [[_panel(one) for one in series if one.component == name] for name in names]
    labels = [summary.label(place) for place in range(len(summary.days))]
    figure: MatplotlibFigure = getattr(days, name)(rows, labels)
    return figure


def _panel(one: Series) -> "Panel":
    from validation.figures.days import Panel  # noqa: PLC0415

    chart = one.chart
    values, low, high = (1e3 * part for part in (one.values, one.low, one.high))
    centre, *ends = (1e3 * one.measured(part) for part in (chart.centre, chart.low, chart.high))
    return Panel(
        title=f"{one.name} [{SMALL[one.component.unit]}]",
        days=np.array(one.days, dtype=np.intp),
        values=values,
        low=low,
        high=high,
        centre=centre,
        limit_low=ends[0],
        limit_high=ends[1],
        evidence=chart.evidence,
        limits=chart.limits,
        changes=[(one.days[change.began], one.days[change.noticed]) for change in chart.changes],
    )
