"""The commands ``gtval instrument-check`` and ``gtval walls-check``."""

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import AS_JSON, FIGURE, PATH, STRICT

if TYPE_CHECKING:
    from validation.campaign.folder import Instrument

_SPECIFICATION = click.option(
    "--campaign", type=PATH, help="Take the specification from this campaign folder."
)
_TOLERANCE = click.option(
    "--tolerance",
    type=click.FloatRange(min=0, min_open=True),
    help="Half width that the maker states, metres; needed without --campaign.",
)


@click.command("instrument-check")
@click.argument("readings", type=PATH)
@_SPECIFICATION
@_TOLERANCE
@click.option("--resolution", type=click.FloatRange(min=0), help="Last digit shown, metres.")
@FIGURE
@AS_JSON
@STRICT
def instrument_check(
    *,
    readings: Path,
    campaign: Path | None,
    tolerance: float | None,
    resolution: float | None,
    figure: Path | None,
    as_json: bool,
    strict: bool,
) -> None:
    """Offset, scale and noise of a hand laser over known lengths.

    READINGS is a CSV file with the columns true and reading in metres, and optionally sigma, the
    standard deviation of each reading. What the maker states comes from --campaign or
    --tolerance.
    """
    from survey.chapters.lengths import instrument_table, read_lengths
    from survey.studies.instrument_check import check_instrument
    from survey.studies.instrument_verdict import settings_snippet, verdict
    from validation.commands.output import tell_check

    instrument = _specification(campaign, tolerance, resolution)
    length, reading, sigma, lines = read_lengths(readings, instrument)
    check = check_instrument(length, reading, instrument, sigma)
    findings = verdict(check, lines)
    snippet = settings_snippet(check, instrument)
    if figure is not None:
        from survey.figures.studies import instrument_figure
        from validation.figures.writing import write_figure

        write_figure(figure, instrument_figure(length, reading, check, instrument))
    tell_check(
        {"check": check, "settings": snippet or None},
        [instrument_table(check)],
        findings,
        as_json=as_json,
        strict=strict,
        more=f"For campaign.toml:\n\n{snippet}".rstrip()
        if snippet
        else "No lines for campaign.toml: see above.",
    )


def _specification(
    folder: Path | None, tolerance: float | None, resolution: float | None = None
) -> "Instrument":
    """The instrument of the campaign, with what the options change."""
    from survey.readings.hardware import missing_hardware
    from validation.campaign.folder import Instrument, load_campaign
    from validation.errors import InputError

    base = Instrument()
    if folder is not None:
        campaign = load_campaign(folder)
        base = campaign.settings.instrument
        missing = missing_hardware(campaign, frame=False, rig=False)
        if missing and tolerance is None:
            raise InputError(missing)
    elif tolerance is None:
        raise click.UsageError(
            "state the tolerance of the distance meter, in metres, as its maker does: for example "
            "--tolerance 0.0015; or name a campaign folder that states it: --campaign DIR"
        )
    for name, value in (("tolerance", tolerance), ("resolution", resolution)):
        if value is not None and not isfinite(value):
            raise click.BadParameter(f"{name} is not a finite number")
    changes = {"tolerance": tolerance, "resolution": resolution}
    return base.model_copy(update={k: v for k, v in changes.items() if v is not None})


@click.command("walls-check")
@click.argument("distances", type=PATH)
@_SPECIFICATION
@_TOLERANCE
@AS_JSON
@STRICT
def walls_check(
    distances: Path, campaign: Path | None, tolerance: float | None, as_json: bool, strict: bool
) -> None:
    """Whether walls are parallel, from distances between them.

    DISTANCES is a CSV file with the columns wall_a, wall_b, position and distance in metres: the
    distance from wall a to wall b, at right angles to wall a, at a position along wall a.
    """
    from survey.chapters.walls import read_walls, walls_table
    from survey.studies.walls import wall_findings
    from validation.commands.output import tell_check

    pairs = read_walls(distances, _specification(campaign, tolerance))
    findings = [finding for pair in pairs for finding in wall_findings(pair)]
    tables = [walls_table(pairs)]
    tell_check({"walls": pairs}, tables, findings, as_json=as_json, strict=strict)
