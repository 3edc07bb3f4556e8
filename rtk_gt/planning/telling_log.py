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
    note = "Medians of the minutes in which there was a fix; times in UTC."
    return Table.of_columns("Satellites predicted and seen", columns, note)


def stretch_table(held: AgainstLog) -> Table:
    """Where fewer satellites were seen, and what may have been hidden."""
    shown = sorted(held.stretches, key=lambda one: one.start - one.end)[:MOST_ROWS]
    shown = sorted(shown, key=lambda one: one.start)
    columns: list[TableColumn] = [
        ("from", "", [clock(one.start) for one in shown]),
        ("to", "", [until(one.end) for one in shown]),
        ("missing", "", [one.missing for one in shown]),
        ("perhaps hidden", "", [_hidden(one) for one in shown]),
        ("sets", "", [one.sets for one in shown]),
    ]
    note = (
        "Hidden: satellite, azimuth / elevation in degrees; the lowest set without which the HDOP "
        "is that of the log. Sets: how many would do; with 0 the lowest satellites are named."
    )
    if len(held.stretches) > len(shown):
        note += f" The {len(shown)} longest of {len(held.stretches)}."
    return Table.of_columns("Fewer satellites than predicted", columns, note)


def _hidden(one: Stretch) -> str:
    """'G05 310/14, G12 355/22'."""
    places = np.degrees([one.azimuths, one.elevations]).T
    return ", ".join(
        f"{name} {azimuth:.0f}/{elevation:.0f}"
        for name, (azimuth, elevation) in zip(one.hidden, places, strict=True)
    )


def log_findings(held: AgainstLog) -> list[Finding]:
    """Whether the drive saw what was planned."""
    subject = held.plan.rover.place.name
    lack = held.missing
    findings = []
    if held.stretches:
        longest = max(held.stretches, key=lambda one: one.end - one.start)
        share = float((lack >= LEAST_MISSING).mean())
        text = (
            f"In {100 * share:.0f} % of the minutes at least {LEAST_MISSING} satellites fewer were "
            f"used than predicted; longest from {clock(longest.start)} to {until(longest.end)} "
            f"UTC, {longest.missing} fewer. Perhaps {_hidden(longest)} were hidden then "
            "(azimuth / elevation in degrees): look for an obstacle on that side, and state it as "
            "a horizon. The base, a higher mask of the receiver or a satellite under repair would "
            "do the same."
        )
        sizes = (
            Size("share of minutes", share),
            Size("missing", longest.missing, "satellites"),
            Size("longest", longest.end - longest.start, "s"),
        )
        findings.append(Finding("warning", text, subject, "seen_less", sizes))
    more = float((lack <= -LEAST_MISSING).mean())
    if more > 0:
        text = (
            f"In {100 * more:.0f} % of the minutes at least {LEAST_MISSING} satellites more were "
            "used than predicted. The receiver takes other systems than the almanac has, its mask "
            "is lower, the stated horizon is too high, or the almanac is of another time."
        )
        findings.append(
            Finding("warning", text, subject, "seen_more", (Size("share of minutes", more),))
        )
    if not findings:
        off = float(np.abs(lack).mean())
        text = f"The satellites seen are those planned, within {off:.1f} on average."
        size = Size("difference", off, "satellites")
        findings.append(Finding("good", text, subject, "seen_as_planned", (size,)))
    if held.capped:
        text = "The log counts to 12 satellites only: what was predicted above is taken as 12."
        size = Size("satellites", 12, "satellites")
        findings.append(Finding("note", text, subject, "seen_at_most", (size,)))
    return findings


def log_facts(held: AgainstLog) -> dict[str, object]:
    """Predicted and seen for scripts."""
    return {
        "minutes": len(held.seen.times),
        "mean_predicted": float(held.predicted.mean()),
        "mean_seen": float(held.seen.satellites.mean()),
        "stretches": [
            {
                "start": one.start,
                "end": one.end,
                "missing": one.missing,
                "perhaps_hidden": one.hidden,
                "azimuths": one.azimuths,
                "elevations": one.elevations,
                "sets": one.sets,
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
