"""The command ``gtval rtk plan``."""

import re
from datetime import UTC, date, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from validation.commands.options import AS_JSON, PATH, STRICT

if TYPE_CHECKING:
    from rtk_gt.planning.against_log import AgainstLog
    from rtk_gt.planning.inputs import Asked
    from rtk_gt.planning.plan import Place, SkyPlan
    from rtk_gt.receivers.fixes import Fixes
    from validation.poses.angles import Array

MOST_TIMES = 20_000
"""Of a plan: a day by 5 s. A judgement: each takes some kB for each satellite."""
FARTHEST = 50e3
"""Metres from the place planned to the log: the sky is turned by half a degree so far away."""
WHERE = (float, float, float)


@click.command()
@click.argument("campaign", type=PATH, required=False)
@click.option("--almanac", type=PATH, help="YUMA, SEM, two-line elements or RINEX navigation.")
@click.option("--day", type=click.DateTime(["%Y-%m-%d"]), help="UTC; that of the log by default.")
@click.option("--from", "start", default="00:00", show_default=True, help="Time of day, UTC.")
@click.option("--to", "end", default="24:00", show_default=True, help="Time of day, UTC.")
@click.option(
    "--step",
    type=click.FloatRange(0.01, 60),
    default=5.0,
    show_default=True,
    help="Minutes between the times planned.",
)
@click.option("--place", "names", multiple=True, help="A place of campaign.toml; all by default.")
@click.option("--at", type=WHERE, help="Latitude, longitude, height of the rover: degrees, m.")
@click.option("--base", type=WHERE, help="The same of the base station.")
@click.option("--horizon", type=PATH, help="CSV azimuth,elevation (degrees) around --at.")
@click.option("--base-horizon", type=PATH, help="The same around --base.")
@click.option("--mask", type=click.FloatRange(0, 89), help="Least elevation, degrees.")
@click.option("--satellites", type=click.IntRange(4, 60), help="Least number at a good time.")
@click.option("--pdop", type=click.FloatRange(1, 100), help="Greatest PDOP at a good time.")
@click.option(
    "--system",
    "systems",
    multiple=True,
    type=click.Choice(["G", "E", "R", "C", "J", "X"]),
    help="Only these satellites; several times for several.",
)
@click.option("--log", type=PATH, help="Hold the plan against this log.")
@click.option("--sky", type=PATH, help="Write the sky plot to this .png or .svg file.")
@click.option("--figure", type=PATH, help="The same of satellites and DOP over time.")
@click.option("--log-figure", type=PATH, help="The same of predicted and seen; needs --log.")
@click.option("-o", "--output", type=PATH, help="CSV file; others stand beside it.")
@AS_JSON
@STRICT
def plan(
    campaign: Path | None, *, log: Path | None, as_json: bool, strict: bool, **options: Any
) -> None:
    """Satellites over a place and a day, before the drive; and held against its log.

    From an almanac, offline: how many satellites base and rover have together above mask and
    obstacles, PDOP, HDOP and VDOP, and the best times. Places, obstacles and limits are those of
    [rtk.plan] in campaign.toml, or options; an option counts more.
    """
    from rtk_gt.planning.inputs import read_log
    from validation.commands.output import tell_check

    _check_options(log, **options)
    asked = _asked(campaign)
    day = None if options["day"] is None else options["day"].date()
    record = None if log is None else read_log(log, day)
    plans, held = _planned(campaign, asked, record, day, options)
    files = _files(plans, held, options)
    facts, tables, findings = _told(plans, held)
    tell_check(
        {**facts, "files": [str(path) for path in files]},
        tables,
        findings,
        as_json=as_json,
        strict=strict,
        more="\n".join(f"Written: {path}" for path in files),
    )


def _check_options(log: Path | None, **options: Any) -> None:
    """Raise a usage error where an option lacks the one that it belongs to."""
    for name, needed in (("horizon", "at"), ("base_horizon", "base")):
        if options[name] is not None and options[needed] is None:
            option = name.replace("_", "-")
            raise click.UsageError(
                f"--{option} needs --{needed}; places of campaign.toml state a horizon of their own"
            )
    if options["log_figure"] is not None and log is None:
        raise click.UsageError("--log-figure needs --log")
    if options["names"] and options["at"] is not None:
        raise click.UsageError("--place or --at, not both")


def _asked(campaign: Path | None) -> "Asked":
    """What campaign.toml states; nothing without one."""
    from rtk_gt.planning.inputs import Asked, from_campaign
    from rtk_gt.settings import SkySettings
    from validation.campaign.folder import load_campaign

    if campaign is None:
        return Asked(SkySettings(), (), None)
    return from_campaign(load_campaign(campaign))


def _planned(
    campaign: Path | None,
    asked: "Asked",
    record: "Fixes | None",
    day: date | None,
    options: dict[str, Any],
) -> "tuple[list[SkyPlan], AgainstLog | None]":
    """A plan for each place of the rover, and the first held against the log."""
    import numpy as np

    from rtk_gt.planning.against_log import by_minutes, compare
    from rtk_gt.planning.almanacs.reading import read_almanac
    from rtk_gt.planning.inputs import typed_place
    from rtk_gt.planning.plan import Wanted, sky_plan

    stated = asked.settings
    rovers = _rovers(asked, record, options)
    base = asked.base
    if options["base"] is not None:
        base = typed_place("base", options["base"], options["base_horizon"])
    mask, satellites, pdop = (
        getattr(stated, name) if options[name] is None else options[name]
        for name in ("mask", "satellites", "pdop")
    )
    wanted = Wanted(np.radians(mask).item(), satellites, pdop)
    on = _day(day, record)
    almanac = read_almanac(_almanac(campaign, stated.almanac, options["almanac"]), on)
    systems = options["systems"] or tuple(stated.systems)
    times = _times(on, options["start"], options["end"], options["step"])
    plans = [sky_plan(almanac, times, wanted, rover, base, systems) for rover in rovers]
    if record is None:
        return plans, None
    _check_nearness(plans[0].rover.place, record)
    seen = by_minutes(record)
    at_log = sky_plan(almanac, seen.times, wanted, rovers[0], base, systems)
    return plans, compare(at_log, seen)


def _rovers(asked: "Asked", record: "Fixes | None", options: dict[str, Any]) -> "tuple[Place, ...]":
    """Places of the rover: by options, of campaign.toml, or the middle of the log."""
    from rtk_gt.planning.inputs import named_rovers, place_of_log, typed_place
    from validation.errors import GtvalError

    if options["at"] is not None:
        return (typed_place("rover", options["at"], options["horizon"]),)
    if asked.rovers or options["names"]:
        return named_rovers(asked, options["names"])
    if record is not None:
        return (place_of_log(record),)
    raise GtvalError(
        "no place is stated: give --at LATITUDE LONGITUDE HEIGHT, or [[rtk.plan.places]] in "
        "campaign.toml"
    )


def _almanac(campaign: Path | None, stated: str, given: Path | None) -> Path:
    """The almanac's file."""
    from validation.errors import GtvalError

    if given is not None:
        return given
    if campaign is None or not stated:
        raise GtvalError(
            "no almanac is stated: give --almanac FILE, or `almanac` in [rtk.plan] of campaign.toml"
        )
    return (campaign.parent if campaign.is_file() else campaign) / stated


def _day(day: date | None, record: "Fixes | None") -> date:
    """The day planned."""
    from validation.errors import GtvalError

    if day is not None:
        return day
    if record is None:
        raise GtvalError("no day is stated: give --day, such as --day 2026-11-30")
    return datetime.fromtimestamp(float(record.times[0]), tz=UTC).date()


def _times(day: date, start: str, end: str, step: float) -> "Array":
    """Times of a plan, seconds since 1970 UTC."""
    import numpy as np

    from rtk_gt.planning.almanacs.reading import midnight

    first, last = _of_day("--from", start), _of_day("--to", end)
    if not first < last:
        raise click.UsageError(f"--from {start} is not before --to {end}")
    count = int((last - first) / (60 * step)) + 1
    if not 2 <= count <= MOST_TIMES:
        raise click.UsageError(f"--step {step:g} minutes makes {count} times; 2 to {MOST_TIMES}")
    return np.asarray(midnight(day) + first + 60 * step * np.arange(count))


def _of_day(name: str, text: str) -> float:
    """Seconds of the day of HH:MM."""
    clock = re.fullmatch(r"(\d{1,2}):(\d{2})", text)
    if clock is None or int(clock[2]) > 59 or int(clock[1]) * 60 + int(clock[2]) > 1440:
        raise click.UsageError(f"{name}: '{text}' is not a time of day; expected HH:MM")
    return 3600.0 * int(clock[1]) + 60.0 * int(clock[2])


def _check_nearness(place: "Place", record: "Fixes") -> None:
    """Raise where the log was not written near the place planned."""
    import numpy as np

    from rtk_gt.planning.inputs import place_of_log
    from validation.errors import GtvalError

    there = place_of_log(record).frame.origin
    apart = float(np.linalg.norm(there - place.frame.origin))
    if apart > FARTHEST:
        raise GtvalError(
            f"{record.source} was written {apart / 1e3:.0f} km from the place '{place.name}'; give "
            "the place of the log, or the log of the place"
        )


def _files(
    plans: "list[SkyPlan]", held: "AgainstLog | None", options: dict[str, Any]
) -> list[Path]:
    """Write figures of the first place, and tables of all; their names."""
    from rtk_gt.planning.telling import plan_csv, satellite_csv
    from rtk_gt.planning.telling_log import log_csv
    from validation.text_files.writing import write_files

    written = _figures(plans[0], held, options)
    output: Path | None = options["output"]
    if output is not None:
        texts = {output.name: plan_csv(plans)}
        texts[f"{output.stem}_satellites.csv"] = satellite_csv(plans)
        if held is not None:
            texts[f"{output.stem}_log.csv"] = log_csv(held)
        write_files(output.parent, texts)
        written += [output.parent / name for name in texts]
    return written


def _figures(plan: "SkyPlan", held: "AgainstLog | None", options: dict[str, Any]) -> list[Path]:
    """Write the figures that are asked for; their names."""
    drawn: list[Path] = [
        options[name] for name in ("sky", "figure", "log_figure") if options[name] is not None
    ]
    if not drawn:
        return []
    from rtk_gt.planning.figures import log_figure, over_time_figure, sky_figure
    from validation.figures.writing import write_figure

    if options["sky"] is not None:
        write_figure(options["sky"], sky_figure(plan))
    if options["figure"] is not None:
        write_figure(options["figure"], over_time_figure(plan))
    if options["log_figure"] is not None and held is not None:
        write_figure(options["log_figure"], log_figure(held))
    return drawn


def _told(
    plans: "list[SkyPlan]", held: "AgainstLog | None"
) -> "tuple[dict[str, Any], list[Any], list[Any]]":
    """Facts, tables and findings."""
    from rtk_gt.planning import telling, telling_log

    facts: dict[str, Any] = {
        "almanac": telling.almanac_facts(plans[0]),
        "start": plans[0].times[0],
        "end": plans[0].times[-1],
        "mask": plans[0].wanted.mask,
        "places": [telling.plan_facts(one) for one in plans],
        "log": None if held is None else telling_log.log_facts(held),
    }
    tables = [table for one in plans for table in telling.plan_tables(one)]
    findings = telling.almanac_findings(plans[0])
    findings += [finding for one in plans for finding in telling.plan_findings(one)]
    if held is not None:
        tables += telling_log.log_tables(held)
        findings += telling_log.log_findings(held)
    return facts, tables, findings


COMMANDS: list[click.Command] = [plan]
