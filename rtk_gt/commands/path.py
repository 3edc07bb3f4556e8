"""The commands ``gtval rtk coverage``, ``reference-covariance`` and ``sensor-path``."""

from pathlib import Path

import click

from rtk_gt.commands.drive import along_path, sensor_named, solved
from validation.commands.options import AS_JSON, CAMPAIGN, PATH, SEED

VEHICLE = "vehicle"
"""What sensor-path calls the vehicle itself."""


@click.command()
@CAMPAIGN
@AS_JSON
def coverage(campaign: Path, as_json: bool) -> None:
    """Show which parts of a drive have ground truth; needs no offsets. Writes nothing."""
    from rtk_gt.campaign.inputs import load_drive
    from rtk_gt.path.coverage import coverage as covered
    from validation.campaign.folder import load_campaign
    from validation.report.terminal import print_json, print_table

    given = load_drive(load_campaign(campaign))
    steps = given.steps
    posed = steps.times[steps.complete]
    found = covered(given.records, steps, posed, given.settings.max_gap)
    if as_json:
        print_json(found)
        return
    from rtk_gt.campaign.sections import coverage_table, gap_table

    print_table(coverage_table(found))
    print_table(gap_table(found))


@click.command("reference-covariance")
@CAMPAIGN
@click.option(
    "--samples",
    type=click.IntRange(1000, 10**9),
    default=10**7,
    show_default=True,
    help="Simulated measurements; 10^7 take ten seconds.",
)
@SEED
@AS_JSON
def reference_covariance(campaign: Path, samples: int, seed: int, as_json: bool) -> None:
    """Covariance W* of a pose at the origin, to first order and by simulation.

    Of the antennas and the noise that the drive of CAMPAIGN gives; without offsets. Writes nothing.
    """
    import numpy as np

    from rtk_gt.campaign.sections import reference_table
    from rtk_gt.path.covariance import simulated_covariance
    from validation.report.terminal import print_json, print_table

    outcome = solved(campaign)
    simulated = simulated_covariance(
        outcome.antennas.positions, outcome.noise, samples, np.random.default_rng(seed)
    )
    if as_json:
        print_json({"first_order": outcome.reference, "simulated": simulated, "samples": samples})
        return
    print_table(reference_table(outcome.reference, simulated, outcome.noise, samples))


@click.command("sensor-path")
@CAMPAIGN
@click.argument("sensor")
@click.argument("times", type=PATH)
@click.option("-o", "--output", type=PATH, help="CSV or .tum file.")
@click.option(
    "--published-interpolation",
    is_flag=True,
    help="Splines in x and y, lines else, instead of what does best on the data.",
)
@click.option(
    "--additive-angles",
    is_flag=True,
    help="Add the angles of vehicle and sensor (Eq. 30), as published files do. Wrong where the"
    " vehicle pitches or rolls; only to compare with such files.",
)
@AS_JSON
def sensor_path(
    campaign: Path,
    sensor: str,
    times: Path,
    output: Path | None,
    published_interpolation: bool,
    additive_angles: bool,
    as_json: bool,
) -> None:
    """Poses of a sensor at the TIMES (a CSV file with a column time) of its own data.

    SENSOR is one of campaign.toml, or 'vehicle'. Times in gaps of the ground truth give no pose.
    """
    from rtk_gt.campaign.pose_tables import table_at
    from rtk_gt.sensors.sensor_files import read_times
    from validation.poses.pose_table import to_csv
    from validation.poses.tum_text import to_tum
    from validation.report.terminal import print_json
    from validation.text_files.writing import write_files

    wanted = read_times(times)
    outcome = solved(campaign)
    own = None if sensor == VEHICLE else sensor_named(outcome, sensor)
    found = along_path(outcome, wanted, times, published=published_interpolation)
    table = table_at(found, own, additive_angles=additive_angles)
    text = to_tum(table) if output and output.suffix == ".tum" else to_csv(table)
    if output is not None:
        write_files(output.parent, {output.name: text})
    missing = found.times[~found.available]
    if as_json:
        print_json(
            {
                "sensor": sensor,
                "times": found.times[found.available],
                "poses": table.poses,
                "covariances": table.covariances,
                "methods": found.methods,
                "times_in_gaps": missing,
            }
        )
    elif output is None:
        click.echo(text, nl=False)
    said = f"{len(table)} poses; {len(missing)} times are in gaps of the ground truth."
    if additive_angles and own is not None:
        said += " Angles were added, not composed: wrong where the vehicle pitches or rolls."
    click.echo(said, err=True)


COMMANDS: list[click.Command] = [coverage, reference_covariance, sensor_path]
