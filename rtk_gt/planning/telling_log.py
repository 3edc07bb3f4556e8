"""Predicted and seen in tables, findings, numbers for scripts, and a CSV file."""

import numpy as np

from rtk_gt.planning.against_log import LEAST_MISSING, AgainstLog, Stretch
from rtk_gt.planning.telling import clock, stamp, until
from validation.results import Finding, Size, Table, TableColumn
from validation.text_files.csv_text import csv_text

MOST_ROWS = 15
"""Rows of a table: what fits on a screen."""


def log_tables(held: AgainstLog) -> list[Table]:
    """The log by stretches of equal length, and where satellites were missing."""
    tables = [seen_table(held)]
    if held.stretches:
        tables.append(stretch_table(held))
    return tables


def seen_table(held: AgainstLog) -> Table:
    """Satellites and HDOP, predicted and seen, over the log."""
    parts = np.array_split(np.arange(len(held.seen.times)), min(MOST_ROWS, len(held.seen.times)))
    hdop = held.plan.dop.horizontal

    def median(values: "np.ndarray[tuple[int, ...], np.dtype[np.float64]]") -> float | None:
        known = values[np.isfinite(values)]
        return float(np.median(known)) if len(known) else None

    columns: list[TableColumn] = [
        ("from", "", [clock(held.seen.times[rows[0]] - 30) for rows in parts]),
        ("minutes", "", [len(rows) for rows in parts]),
        ("predicted", ".0f", [median(held.predicted[rows].astype(float)) for rows in parts]),
        ("seen", ".0f", [median(held.seen.satellites[rows]) for rows in parts]),
        ("HDOP predicted", ".1f", [median(hdop[rows]) for rows in parts]),
        ("HDOP seen", ".1f", [median(held.seen.hdop[rows]) for rows in parts]),
    ]
    note = "Medians over the minutes; times in UTC."
    return Table.of_columns("Satellites predicted and seen", columns, note)


def stretch_table(held: AgainstLog) -> Table:
    """Where fewer satellites were seen, and what may have been hidden."""
    shown = sorted(held.stretches, key=lambda one: one.start - one.end)[:MOST_ROWS]
    shown = sorted(shown, key=lambda one: one.start)
    columns: list[TableColumn] = [
        ("from", "", [clock(one.start) for one in shown]),
        ("to", "", [until(one.end) for one in shown]),
        ("missing", "", [one.missing for one in shown]),
        ("obstacle [deg]", "", [_shape(one) if one.explained else "none" for one in shown]),
        ("others", "", [one.as_good for one in shown]),
        ("hidden", "", [", ".join(one.hidden) if one.explained else "" for one in shown]),
    ]
    note = (
        "Obstacle: the smallest that explains numbers and HDOP best, as azimuths from / to and its "
        "upper edge; none: a single one does not explain them. Others: how many of those tried do "
        "as well. Hidden: satellites that it hides in the middle of the time."
    )
    if len(held.stretches) > len(shown):
        note += f" The {len(shown)} longest of {len(held.stretches)}."
    return Table.of_columns("Fewer satellites than predicted", columns, note)


def _shape(one: Stretch) -> str:
    """'310 / 40, 35'."""
    obstacle = one.obstacle
    top = f"{np.degrees(obstacle.height):.0f}"
    if obstacle.half_width > np.pi - 1e-6:
        return f"around, {top}"
    ends = np.array([-1, 1]) * obstacle.half_width + obstacle.middle
    first, last = np.degrees(np.mod(ends, 2 * np.pi)).round()
    return f"{first:.0f} / {last:.0f}, {top}"


def log_findings(held: AgainstLog) -> list[Finding]:
    """Whether the drive saw what was planned."""
    subject = held.plan.rover.place.name
    known = held.missing[np.isfinite(held.missing)]
    findings = []
    if held.stretches:
        findings.append(_fewer(held, float((known >= LEAST_MISSING).mean())))
    more = float((known <= -LEAST_MISSING).mean())
    if more > 0:
        text = (
            f"In {100 * more:.0f} % of the minutes at least {LEAST_MISSING} satellites more were "
            "used than predicted. The receiver takes other systems than the almanac has, its mask "
            "is lower, the stated horizon is too high, or the almanac is of another time."
        )
        size = Size("share of minutes", more)
        findings.append(Finding("warning", text, subject, "seen_more", (size,)))
    if held.silent:
        findings.append(_silent(held))
    if not findings:
        off = float(np.abs(known).mean())
        text = f"The satellites seen are those planned, within {off:.1f} on average."
        size = Size("difference", off, "satellites")
        findings.append(Finding("good", text, subject, "seen_as_planned", (size,)))
    if held.capped:
        text = "The log counts to 12 satellites only: what was predicted above is taken as 12."
        size = Size("satellites", 12, "satellites")
        findings.append(Finding("note", text, subject, "seen_at_most", (size,)))
    return findings


def _fewer(held: AgainstLog, share: float) -> Finding:
    """That fewer satellites were used than predicted."""
    longest = max(held.stretches, key=lambda one: one.end - one.start)
    reason = "No single obstacle explains it."
    if longest.explained:
        reason = (
            f"An obstacle would do that (azimuths and upper edge in degrees: {_shape(longest)}; "
            f"{longest.as_good} of the others tried do as well): look on that side, and state it "
            "as a horizon."
        )
    text = (
        f"In {100 * share:.0f} % of the minutes with a fix at least {LEAST_MISSING} satellites "
        f"fewer were used than predicted; longest from {clock(longest.start)} to "
        f"{until(longest.end)} UTC, {longest.missing} fewer. {reason} "
        "The base, a higher mask of the receiver or a satellite under repair would do the same."
    )
    sizes = (
        Size("share of minutes", share),
        Size("missing", longest.missing, "satellites"),
        Size("longest", longest.end - longest.start, "s"),
    )
    return Finding("warning", text, held.plan.rover.place.name, "seen_less", sizes)


def _silent(held: AgainstLog) -> Finding:
    """That there was no fix where one was planned."""
    total = sum(end - start for start, end in held.silent)
    start, end = max(held.silent, key=lambda one: one[1] - one[0])
    text = (
        f"For {total / 60:.0f} min there is no fix though at least {held.plan.wanted.satellites} "
        f"satellites were predicted; longest from {clock(start)} to {until(end)} UTC. The receiver "
        "was off, indoors, or near obstacles that the plan does not know."
    )
    sizes = (Size("time", total, "s"), Size("longest", end - start, "s"))
    return Finding("warning", text, held.plan.rover.place.name, "seen_no_fix", sizes)


def log_facts(held: AgainstLog) -> dict[str, object]:
    """Predicted and seen for scripts."""
    return {
        "minutes": len(held.seen.times),
        "mean_predicted": float(held.predicted.mean()),
        "mean_seen": float(np.nanmean(held.seen.satellites)),
        "without_fix": [{"start": start, "end": end} for start, end in held.silent],
        "stretches": [
            {
                "start": one.start,
                "end": one.end,
                "missing": one.missing,
                "obstacle": one.obstacle,
                "hidden": one.hidden,
                "misfit": one.misfit,
                "others_as_good": one.as_good,
            }
            for one in held.stretches
        ],
    }


def log_csv(held: AgainstLog) -> str:
    """One row a minute."""
    header = ("time", "satellites_predicted", "satellites_seen", "hdop_predicted", "hdop_seen")
    rows = [
        (stamp(time), int(predicted), seen, round(float(hdop), 3), told)
        for time, predicted, seen, hdop, told in zip(
            held.seen.times,
            held.predicted.tolist(),
            held.seen.satellites.tolist(),
            held.plan.dop.horizontal,
            held.seen.hdop.tolist(),
            strict=True,
        )
    ]
    return csv_text(header, rows)
