"""A plan in tables, findings, numbers for scripts, and CSV files."""

from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from rtk_gt.planning.almanacs.almanac import DAY, SYSTEMS
from rtk_gt.planning.plan import SECTORS, SkyPlan, Window, hours_by_sector
from rtk_gt.receivers.fixes import Ints
from validation.poses.angles import Array
from validation.results import Finding, Severity, Size, Table, TableColumn, listed_ids
from validation.text_files.csv_text import csv_text

MOST_WINDOWS = 10
"""Good times that the table lists: the longest ones."""
OLD = 14 * DAY
"""Age of an almanac that is told: the end of the short-term operation of IS-GPS-200."""
LARGEST_ERROR = np.radians(0.1)
"""Error of directions that is a warning: that of line 5 of what a plan has to hold. A satellite
rises by it in 12 s, and an almanac has it after four weeks."""
WRONG = np.radians(3.0)
"""Error of directions that is an error: a judgement. A satellite rises by it in 6 minutes, so that
windows of a quarter of an hour are wrong by half."""
FAR = 50e3
"""Metres from base to rover that are told: the atmosphere differs too much for RTK. A judgement;
makers state 30 to 50 km."""
_HOLE = 0.25
"""Satellite hours of a sector against those of the mean one that make a hole. A judgement."""
_LEAST_SPAN = 0.8 * DAY
"""In less than most of a day a direction may be empty by chance: GPS comes back twice a day."""


def clock(time: float) -> str:
    """HH:MM in UTC."""
    return f"{datetime.fromtimestamp(round(time), tz=UTC):%H:%M}"


def until(time: float) -> str:
    """The same of an end: midnight is 24:00."""
    return "24:00" if round(time) % 86400 == 0 else clock(time)


def stamp(time: float) -> str:
    """Date and time in UTC, ISO 8601."""
    return f"{datetime.fromtimestamp(round(time), tz=UTC):%Y-%m-%dT%H:%M:%SZ}"


def plan_tables(plan: SkyPlan) -> list[Table]:
    """Good times, satellites by hour, and by direction."""
    return [window_table(plan), hour_table(plan), sector_table(plan)]


def _where(plan: SkyPlan) -> str:
    name = plan.rover.place.name
    return name if plan.base is None else f"{name} and {plan.base.place.name}"


def _wanted(plan: SkyPlan) -> str:
    wanted = plan.wanted
    return f"at least {wanted.satellites} satellites and a PDOP of at most {wanted.pdop:g}"


def window_table(plan: SkyPlan) -> Table:
    """The longest good times."""
    found = plan.windows()
    shown = found[:MOST_WINDOWS]
    note = f"{stamp(plan.times[0])[:10]}, times in UTC, with {_wanted(plan)}."
    if len(found) > len(shown):
        note += f" The {len(shown)} longest of {len(found)}."
    columns: list[TableColumn] = [
        ("from", "", [clock(one.start) for one in shown]),
        ("to", "", [until(one.end) for one in shown]),
        ("minutes", ".0f", [one.length / 60 for one in shown]),
        ("fewest satellites", "", [one.least for one in shown]),
        ("worst PDOP", ".1f", [one.pdop for one in shown]),
    ]
    if not shown:
        return Table(f"Good times: {_where(plan)}", [c[0] for c in columns], [], (), note)
    return Table.of_columns(f"Good times: {_where(plan)}", columns, note)


def _worst(values: Array) -> float | None:
    """The greatest, None where one is missing: no position there."""
    return None if np.isnan(values).any() else float(values.max())


def by_hour(plan: SkyPlan) -> list[Ints]:
    """Rows of the plan's times in each hour."""
    hour = np.floor(plan.times[:-1] / 3600.0)
    return [np.flatnonzero(hour == one) for one in np.unique(hour)]


def hour_table(plan: SkyPlan) -> Table:
    """Fewest satellites and worst DOP of each hour."""
    hours = by_hour(plan)
    columns: list[TableColumn] = [("hour", "", [clock(plan.times[rows[0]]) for rows in hours])]
    if plan.base is not None:
        counts = plan.base.count, plan.rover.count
        for name, count in zip(("base", "rover"), counts, strict=True):
            columns.append((name, "", [int(count[rows].min()) for rows in hours]))
    label = "satellites" if plan.base is None else "common"
    columns.append((label, "", [int(plan.count[rows].min()) for rows in hours]))
    for name, values in dops(plan).items():
        columns.append((name, ".1f", [_worst(values[rows]) for rows in hours]))
    note = "Hours in UTC; the fewest satellites and the worst DOP of each."
    return Table.of_columns(f"Satellites by hour: {_where(plan)}", columns, note)


def dops(plan: SkyPlan) -> dict[str, Array]:
    """PDOP, HDOP and VDOP by these names."""
    found = plan.dop
    return {"PDOP": found.position, "HDOP": found.horizontal, "VDOP": found.vertical}


def sector_table(plan: SkyPlan) -> Table:
    """Satellite hours by direction."""
    hours = hours_by_sector(plan)
    return Table(
        f"Satellite hours by direction: {plan.rover.place.name}",
        SECTORS,
        [[float(one) for one in hours]],
        [".1f"] * len(SECTORS),
        "Hours times satellites above mask and obstacles, in each eighth of the compass.",
    )


def almanac_findings(plan: SkyPlan) -> list[Finding]:
    """How old the almanac is, and what of it is not used."""
    almanac = plan.almanac
    age = oldest(plan)
    error = almanac.direction_error(age)
    subject = almanac.source.name
    findings = []
    days = abs(age) / DAY
    when = "before" if age >= 0 else "after"
    text = (
        f"The {almanac.kind} elements hold up to {days:.1f} days {when} the times planned: "
        f"directions are wrong by about {np.degrees(error):.2g} degrees (one standard deviation)."
    )
    sizes = (Size("age", abs(age), "s"), Size("error of directions", error, "rad"))
    if error > WRONG:
        text += " That is no plan: get the almanac of these days."
        findings.append(Finding("error", text, subject, "almanac_age", sizes))
    elif error > LARGEST_ERROR:
        text += " Satellites may have been moved or replaced, too; get a newer file."
        findings.append(Finding("warning", text, subject, "almanac_age", sizes))
    elif abs(age) > OLD:
        text += " Satellites that were moved or replaced since are not in it."
        findings.append(Finding("note", text, subject, "almanac_age", sizes))
    if almanac.unhealthy:
        text = f"Left out, as the file calls them unhealthy: {listed_ids(almanac.unhealthy)}."
        left = (Size("satellites", len(almanac.unhealthy), "satellites"),)
        findings.append(Finding("note", text, subject, "satellites_left_out", left))
    return [*findings, *(Finding("note", note, subject, "almanac") for note in almanac.notes)]


def oldest(plan: SkyPlan) -> float:
    """Seconds from the record to the time that are furthest apart; below 0 before the record."""
    ages = plan.almanac.ages(plan.times[[0, -1]])
    return float(ages.ravel()[np.argmax(np.abs(ages))])


def plan_findings(plan: SkyPlan) -> list[Finding]:
    """How much of the time is good, where the sky has a hole, and a base that is far away."""
    subject = _where(plan)
    share = float(plan.good[:-1].mean())
    windows = plan.windows()
    if windows:
        best = windows[0]
        said = (
            f"{100 * share:.0f} % of the time has {_wanted(plan)}; the longest such time is "
            f"{clock(best.start)} to {until(best.end)} UTC ({best.length / 60:.0f} minutes)."
        )
    else:
        most = int(np.argmax(plan.count))
        said = (
            f"At no time are there {_wanted(plan)}; the most satellites are {plan.count[most]}, at "
            f"{clock(plan.times[most])} UTC. Choose another place or day, or a lower mask."
        )
    severity: Severity = "good" if share > 0.9 else "note" if windows else "warning"
    if plan.almanac.direction_error(oldest(plan)) > WRONG:
        said += " With an almanac of another time that says nothing."
        severity = "note"
    findings = [Finding(severity, said, subject, "good_times", (Size("share", share),))]
    hours = hours_by_sector(plan)
    least = int(np.argmin(hours))
    whole = plan.times[-1] - plan.times[0] > _LEAST_SPAN
    if whole and hours[least] < _HOLE * hours.mean():
        text = (
            f"The sky has a hole in the {SECTORS[least]}: {hours[least]:.1f} satellite hours "
            f"there, {hours.mean():.1f} in the mean direction. An obstacle on that side costs "
            "little, one on the other side much."
        )
        size = Size("satellite hours", 3600 * float(hours[least]), "s")
        findings.append(Finding("note", text, plan.rover.place.name, "sky_hole", (size,)))
    if plan.baseline > FAR:
        text = (
            f"Base and rover are {plan.baseline / 1e3:.0f} km apart, too far for RTK. Correct the "
            "places, or take a nearer base."
        )
        size = Size("distance", plan.baseline, "m")
        findings.append(Finding("warning", text, subject, "base_far", (size,)))
    return findings


def plan_facts(plan: SkyPlan) -> dict[str, object]:
    """A plan for scripts."""
    return {
        "place": plan.rover.place.name,
        "base": None if plan.base is None else plan.base.place.name,
        "baseline": plan.baseline,
        "good_share": float(plan.good[:-1].mean()),
        "windows": [_window_facts(one) for one in plan.windows()],
        "hours": [
            {
                "start": plan.times[rows[0]],
                "fewest_satellites": int(plan.count[rows].min()),
                **{f"worst_{name.lower()}": _worst(v[rows]) for name, v in dops(plan).items()},
            }
            for rows in by_hour(plan)
        ],
        "satellite_seconds": dict(zip(SECTORS, 3600 * hours_by_sector(plan), strict=True)),
    }


def _window_facts(one: Window) -> dict[str, object]:
    return {
        "start": one.start,
        "end": one.end,
        "fewest_satellites": one.least,
        "worst_pdop": one.pdop,
    }


def almanac_facts(plan: SkyPlan) -> dict[str, object]:
    """The almanac for scripts."""
    almanac, age = plan.almanac, oldest(plan)
    return {
        "file": str(almanac.source),
        "kind": almanac.kind,
        "satellites": almanac.names,
        "systems": [SYSTEMS[one] for one in sorted(set(almanac.systems))],
        "unhealthy": almanac.unhealthy,
        "age": age,
        "direction_error": almanac.direction_error(age),
    }


def plan_csv(plans: Sequence[SkyPlan]) -> str:
    """Numbers of satellites and DOP over time: one row a place and time."""
    header = ("place", "time", "base", "rover", "satellites", "pdop", "hdop", "vdop", "good")
    rows = []
    for plan in plans:
        base = [""] * len(plan.times) if plan.base is None else plan.base.count.tolist()
        found = [[round(float(one), 3) for one in values] for values in dops(plan).values()]
        rows += [
            (plan.rover.place.name, stamp(time), *others, int(good))
            for time, *others, good in zip(
                plan.times, base, plan.rover.count.tolist(), plan.count.tolist(), *found,
                plan.good.tolist(), strict=True,
            )
        ]  # fmt: skip
    return csv_text(header, rows)


def satellite_csv(plans: Sequence[SkyPlan]) -> str:
    """Directions of all satellites above the level horizon: one row a place, time and satellite."""
    header = ("place", "time", "satellite", "azimuth", "elevation", "visible")
    rows = []
    for plan in plans:
        views = [plan.rover] if plan.base is None else [plan.rover, plan.base]
        for view in views:
            azimuths, elevations = np.degrees([view.azimuth, view.elevation]).round(3)
            for at, time in enumerate(plan.times):
                rows += [
                    (view.place.name, stamp(time), plan.almanac.names[k], float(azimuths[k, at]),
                     float(elevations[k, at]), int(view.visible[k, at]))
                    for k in np.flatnonzero(elevations[:, at] > 0)
                ]  # fmt: skip
    return csv_text(header, rows)
