"""The command ``gtval simulate-almanac``."""

from datetime import datetime
from pathlib import Path

import click

from validation.commands.options import AS_JSON, PATH


@click.command("simulate-almanac")
@click.argument("file", type=PATH)
@click.option(
    "--day",
    type=click.DateTime(["%Y-%m-%d"]),
    required=True,
    help="Day at whose start the elements hold, UTC.",
)
@click.option(
    "--format",
    "form",
    type=click.Choice(["yuma", "sem", "tle", "rinex2", "rinex3"]),
    default="yuma",
    show_default=True,
)
@click.option("--satellites", type=click.Choice(["24", "27"]), default="27", show_default=True)
@click.option("--galileo", is_flag=True, help="Also 24 of Galileo; with tle and rinex3.")
@AS_JSON
def simulate_almanac(
    file: Path, day: datetime, form: str, satellites: str, galileo: bool, as_json: bool
) -> None:
    """Write an almanac of the nominal GPS constellation to FILE, to try `gtval rtk plan`.

    The satellites in the sky are elsewhere: a plan for a real day needs a real almanac.
    """
    from data_samples.sky.constellation import galileo_rows, gps_rows
    from data_samples.sky.texts import almanac_text
    from validation.report.terminal import print_json
    from validation.text_files.writing import write_files

    if galileo and form not in {"tle", "rinex3"}:
        raise click.UsageError(f"--galileo: a file of kind {form} has GPS only")
    rows = gps_rows(day.date(), int(satellites))
    if galileo:
        rows |= galileo_rows(day.date())
    write_files(file.parent, {file.name: almanac_text(rows, form)})
    if as_json:
        print_json({"file": str(file), "satellites": len(rows)})
    else:
        click.echo(f"{len(rows)} satellites: {file}")
