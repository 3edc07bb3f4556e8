"""The command ``gtval rtk export``."""

from pathlib import Path

import click

from validation.commands.options import AS_JSON, CAMPAIGN, PATH


@click.command()
@CAMPAIGN
@click.option("--to", "output", type=PATH, required=True, help=".kml, .geojson, .gpx or .csv file.")
@click.option("--sensor", default="", help="A sensor of campaign.toml instead of the vehicle.")
@click.option("--every", type=click.FloatRange(0, 1e6), default=0.0, help="Seconds between points.")
@click.option("--only", multiple=True, help="A kind of fix: 'RTK fixed'; several for several.")
@AS_JSON
def export(
    campaign: Path, *, output: Path, sensor: str, every: float, only: tuple[str, ...], as_json: bool
) -> None:
    """Write the results of a run as a file for maps, with the quality of each point.

    Time, kind of fix, satellites, HDOP and standard deviations stand at each point, as far as the
    results have them. CAMPAIGN must have been run.
    """
    import numpy as np

    from rtk_gt.exports.points import stored_points
    from rtk_gt.exports.texts import FORMATS, export_text
    from rtk_gt.settings import RtkSettings
    from validation.campaign.folder import load_campaign
    from validation.errors import GtvalError
    from validation.report.terminal import print_findings, print_json
    from validation.text_files.writing import write_files

    suffix = output.suffix.lower()
    if suffix not in FORMATS:
        raise GtvalError(f"{output}: points can be written as {', '.join(FORMATS)} only")
    loaded = load_campaign(campaign)
    points, findings = stored_points(loaded, sensor)
    there = sorted(set(points.kinds))
    if only:
        points = points.select(np.flatnonzero(np.isin(points.kinds, only)))
    if not len(points):
        said = ", ".join(there) or "none"
        raise GtvalError(f"no point of the kind {', '.join(only) or 'wanted'}; there are: {said}")
    points = points.every(every) if every else points
    gap = max(loaded.section("rtk", RtkSettings).max_gap, 1.5 * every)
    write_files(output.parent, {output.name: export_text(points, suffix, gap)})
    if as_json:
        kinds = {kind: points.kinds.count(kind) for kind in sorted(set(points.kinds))}
        told = {"file": str(output), "points": len(points), "kinds": kinds}
        print_json({**told, "findings": findings})
        return
    click.echo(f"{len(points)} points: {output}")
    print_findings(findings)


COMMANDS: list[click.Command] = [export]
