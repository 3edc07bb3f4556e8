"""What a summary says in words: what has changed, and what is missing."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from validation.days.charted import Series, Summary
from validation.results import Finding, Severity, Size, listed_ids
from validation.statistics.control.changes import Change
from validation.statistics.control.limits import FIRST
from validation.statistics.control.trend import trend

WORSE_FIRST = ("bias", "spread")


@dataclass(frozen=True)
class Noticed:
    """One change of one series."""

    series: Series
    change: Change

    @property
    def began(self) -> tuple[int, int, int]:
        """The day it most likely began, and between which, as places in the summary."""
        days, one = self.series.days, self.change
        return days[one.began], days[one.began_low], days[one.began_high]

    @property
    def day(self) -> int:
        """The day it was noticed, as a place in the summary."""
        return self.series.days[self.change.noticed]

    @cached_property
    def by_all_days(self) -> tuple[Change, int]:
        """What it is by all days to the next change, and the number of that day or of all days.

        What was noticed alone where these days are no single change: a drift that has ended.
        """
        chart, change = self.series.chart, self.change
        later = [other for other in chart.changes if other.noticed > change.noticed]
        end = next((other.began for other in later if not other.goes_on), len(chart.values))
        end = max(end, change.noticed + 1)
        start = self.series.since(change)
        if change.kind == "drift" and not chart.drifts_on(start, change.noticed + 1, end):
            return change, change.noticed + 1
        return chart.likeliest_of(start, end), end


def findings_of(summary: Summary) -> list[Finding]:
    """All that is to be said of the days, changes first."""
    found = [_finding(summary, group) for group in groups(summary)]
    changed = {one.subject for one in found}
    found += _shared(summary)
    for system in summary.systems:
        series = summary.of_system(system)
        most = max(len(one.days) for one in series)
        if most < FIRST:
            text = (
                f"{most} day{'s' if most > 1 else ''} with this system; a change is noticed from "
                f"the {FIRST}th on. Run it on more days."
            )
            found.append(Finding("note", text, system, "too_few_days", (Size("days", most),)))
        elif system not in changed:
            text = f"No change of its bias or its spread was noticed in {most} days."
            found.append(Finding("good", text, system, "no_change", (Size("days", most),)))
        missing = [
            summary.label(place)
            for place, day in enumerate(summary.days)
            if system not in day.systems
        ]
        if missing:
            text = f"Not among the systems of {len(missing)} of {len(summary.days)} days: "
            text += f"{listed_ids(missing)}."
            sizes = (Size("days without it", len(missing)),)
            found.append(Finding("note", text, system, "system_missing", sizes))
    found += [finding for day in summary.days for finding in day.findings]
    undated = [day.folder.name for day in summary.days if day.moment is None]
    if undated and len(summary.days) > 1:
        text = (
            "The days are in the order of the names of their folders, as no date is stated by "
            f'{listed_ids(undated)}. Write date = "YYYY-MM-DD" in campaign.toml.'
        )
        severity: Severity = "note" if len(undated) == len(summary.days) else "warning"
        sizes = (Size("campaigns without a date", len(undated)),)
        found.append(Finding(severity, text, "order", "order_by_name", sizes))
    return found


def groups(summary: Summary) -> list[list[Noticed]]:
    """What was noticed, changes of one kind of one system together that may have one cause.

    That is, whose beginnings may be the same day: the components of one move.
    """
    found: list[list[Noticed]] = []
    every = [
        Noticed(one, change)
        for one in summary.series
        for change in one.chart.changes
        if not change.goes_on
    ]
    for one in sorted(every, key=lambda one: (one.day, one.began[0])):
        group = next((some for some in found if _together(some[0], one)), None)
        if group is None:
            found.append([one])
        else:
            group.append(one)
    return found


def _together(first: Noticed, other: Noticed) -> bool:
    same = first.series.system == other.series.system and first.series.of == other.series.of
    return same and _may_be_one(first, other)


def _may_be_one(first: Noticed, other: Noticed) -> bool:
    """Whether two changes may have begun on the same day."""
    return first.began[1] <= other.began[2] and other.began[1] <= first.began[2]


def _finding(summary: Summary, group: Sequence[Noticed]) -> Finding:
    """One line on changes that belong together."""
    first = min(group, key=lambda one: one.day)
    of, system = first.series.of, first.series.system
    drifts = [one for one in group if one.by_all_days[0].kind == "drift"]
    began, low, high = (summary.label(day) for day in first.began)
    about = began if low == high else f"{began} ({low} to {high})"
    parts = ", ".join(_how_much(one, summary.step) for one in group)
    what = "The bias" if of == "bias" else "The spread of the errors"
    verb = "drifts" if len(drifts) * 2 > len(group) else "has changed"
    text = f"{what} {verb} since about {about}: {parts}. Noticed on {summary.label(first.day)}"
    last = [one for one in group if one.series.days[-1] > one.day and one.series.of == "bias"]
    if last:
        now = ", ".join(
            f"{_in_small(one, *_since(one))} in {one.series.component.name}" for one in last
        )
        text += f"; on the last day the bias differs from the days before the change by {now}"
    slopes = [told for one in group if (told := _slope(summary, one))]
    if slopes:
        text += f"; by all days it drifts by {', '.join(slopes)}"
    ended = [one.series.component.name for one in group if _has_ended(one)]
    if ended:
        text += f"; in {', '.join(ended)} it has not gone on like that to the last day"
    text += ". Do not use what was recorded since then before the cause is known: look at what was "
    text += (
        "moved, exchanged or calibrated anew, and run `gtval explain` on a day before and after."
    )
    sizes = tuple(
        Size(
            f"{one.series.name}, change when noticed",
            size,
            one.series.component.unit,
            low,
            high,
            0.95,
        )
        for one in group
        for size, low, high in [one.series.moved(one.change)]
    )
    worse = of == "bias" or any(one.change.size > 0 for one in group)
    code = "bias_changed" if of == "bias" else "spread_changed"
    return Finding("warning" if worse else "note", text, system, code, sizes)


def _since(one: Noticed) -> tuple[float]:
    """By how much the last day differs from those before the change."""
    return (float(one.series.values[-1]) - one.series.before(one.change),)


def _has_ended(one: Noticed) -> bool:
    """Whether a drift did not go on as it was when it was noticed."""
    _, end = one.by_all_days
    more = end < len(one.series.days)
    return one.change.kind == "drift" and end == one.change.noticed + 1 and more


def _slope(summary: Summary, one: Noticed) -> str:
    """'x +2.0 mm a day (+1.8 to +2.2) since 2026-03-10', by all days that tell; '' without more."""
    whole, end = one.by_all_days
    if end <= one.change.noticed + 1 or one.series.of == "spread" or whole.kind == "step":
        return ""
    rows = slice(max(whole.began - 1, 0), end)
    days = np.arange(rows.start, rows.stop)  # counted as the change counts them
    found = trend(days, one.series.values[rows], one.series.chart.sigmas[rows])
    ends = [_in_small(one, value, unit=False) for value in (found.low, found.high)]
    began = summary.label(one.series.days[whole.began])
    name, steep = one.series.component.name, _in_small(one, found.per_day)
    return f"{name} {steep} a {summary.step} ({ends[0]} to {ends[1]}) since {began}"


def _how_much(one: Noticed, step: str) -> str:
    """'x +2.1 mm a day, +8.2 mm (+6.5 to +9.9) when noticed'."""
    size, low, high = one.series.moved(one.change)
    name = one.series.component.name
    if one.series.of == "spread":
        before = one.series.before(one.change)
        both = [_in_small(one, value, sign=False) for value in (before, before + size)]
        return f"{name} from {both[0]} to {both[1]}"
    ends = [_in_small(one, value, unit=False) for value in (low, high)]
    moved = f"{_in_small(one, size)} ({ends[0]} to {ends[1]})"
    if one.change.kind == "drift":
        return f"{name} {_in_small(one, one.change.per_day)} a {step}, {moved} when noticed"
    return f"{name} {moved}"


def _in_small(one: Noticed, value: float, *, unit: bool = True, sign: bool = True) -> str:
    """A length in millimetres, an angle in milliradians."""
    small = "mm" if one.series.component.kind == "length" else "mrad"
    return f"{1000 * value:{'+' if sign else ''}.1f}{' ' + small if unit else ''}"


def _shared(summary: Summary) -> Iterator[Finding]:
    """Changes that systems have in common: what they share are the validation poses."""
    biases = [group for group in groups(summary) if group[0].series.of == "bias"]
    for number, group in enumerate(biases):
        for other in biases[number + 1 :]:
            pairs = [(a, b) for a in group for b in other if _alike(a, b)]
            if pairs and group[0].series.system != other[0].series.system:
                systems = f"'{group[0].series.system}' and '{other[0].series.system}'"
                day = summary.label(pairs[0][0].began[0])
                names = ", ".join(a.series.component.name for a, _ in pairs)
                text = (
                    f"{systems} changed alike in {names} at about {day}. What both have in common "
                    "are the validation poses: look first at the survey of these days, at its "
                    "Vframe marks and at the stops."
                )
                sizes = tuple(
                    Size(
                        f"{one.series.name} of {one.series.system}",
                        one.change.size,
                        one.series.component.unit,
                        one.change.low,
                        one.change.high,
                        0.95,
                    )
                    for pair in pairs
                    for one in pair
                )
                yield Finding("warning", text, "survey", "changed_alike", sizes)


def _alike(first: Noticed, other: Noticed) -> bool:
    """Whether two systems changed by the same, at the same time, in the same component."""
    same = first.series.component == other.series.component and _may_be_one(first, other)
    by_day = abs(first.day - other.day) <= 1
    return (
        same
        and by_day
        and (first.change.low <= other.change.high and other.change.low <= first.change.high)
    )
