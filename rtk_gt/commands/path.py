"""The commands ``gtval rtk ...``."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import AS_JSON, CAMPAIGN, progress_bar

if TYPE_CHECKING:
    from rtk_gt.campaign.outcome import RtkOutcome


@click.group()
def rtk() -> None:
    """Outdoor ground truth from three or more RTK-GPS receivers on a vehicle."""


@rtk.command()
@CAMPAIGN
@AS_JSON
@click.option("--dry-run", is_flag=True, help="Print only; write nothing.")
def run(campaign: Path, as_json: bool, dry_run: bool) -> None:
    """Find offsets, path, uncertainty and coverage; write them to CAMPAIGN/results.

    `gtval run CAMPAIGN` does the same with a report, beside the campaign's other systems.
    """
    from rtk_gt.system import result_of, rtk_facts
    from validation.poses.pose_files import pose_files
    from validation.text_files.writing import write_files

    outcome = _solved(campaign)
    result = result_of(outcome)
    folder = outcome.campaign.results
    if not dry_run:
        write_files(folder, {**result.files, **pose_files(result.tables)})
    if as_json:
        from validation.report.terminal import print_json

        print_json({**rtk_facts(outcome), "findings": result.findings})
        return
    from rtk_gt.campaign import sections
    from validation.report.terminal import print_findings, print_table

    for table in (
        sections.coverage_table(outcome),
        sections.offset_table(outcome),
        sections.observability_table(outcome),
        sections.distance_table(outcome),
        sections.uncertainty_table(outcome),
    ):
        print_table(table)
    print_findings(result.findings)
    if not dry_run:
        click.echo(f"\nResults: {folder}")


@rtk.command()
@CAMPAIGN
@AS_JSON
def coverage(campaign: Path, as_json: bool) -> None:
    """Show which parts of a drive have ground truth; needs no offsets. Writes nothing."""
    from rtk_gt.campaign.outcome import recorded_steps
    from rtk_gt.path.coverage import coverage as covered
    from rtk_gt.settings import RtkSettings
    from validation.campaign.folder import load_campaign
    from validation.report.terminal import print_json, print_table

    loaded = load_campaign(campaign)
    settings = loaded.section("rtk", RtkSettings)
    _need_receivers(loaded.toml, settings)
    records, steps = recorded_steps(loaded, settings)
    found = covered(records, steps, steps.times[steps.complete], settings.max_gap)
    if as_json:
        print_json(found)
        return
    from rtk_gt.campaign.sections import coverage_table_of, gap_table_of

    print_table(coverage_table_of(found))
    print_table(gap_table_of(found))


@rtk.command("reference-covariance")
@CAMPAIGN
@click.option(
    "--samples",
    type=click.IntRange(1000, 10**9),
    default=10**7,
    show_default=True,
    help="Simulated measurements; 10^7 take ten seconds.",
)
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True)
@AS_JSON
def reference_covariance(campaign: Path, samples: int, seed: int, as_json: bool) -> None:
    """Covariance W* of a pose at the origin, to first order and by simulation.

    Of the antennas and the noise that the drive of CAMPAIGN gives; without offsets. Writes nothing.
    """
    import numpy as np

    from rtk_gt.campaign.sections import reference_table
    from rtk_gt.path.covariance import simulated_covariance
    from validation.report.terminal import print_json, print_table

    outcome = _solved(campaign)
    simulated = simulated_covariance(
        outcome.antennas.positions, outcome.noise, samples, np.random.default_rng(seed)
    )
    if as_json:
        print_json({"first_order": outcome.reference, "simulated": simulated, "samples": samples})
        return
    print_table(reference_table(outcome.reference, simulated, outcome.noise, samples))


@rtk.command("sensor-path")
@CAMPAIGN
@click.argument("sensor")
@click.argument("times", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), help="CSV or .tum file.")
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
def sensor_path(
    campaign: Path,
    sensor: str,
    times: Path,
    output: Path | None,
    published_interpolation: bool,
    additive_angles: bool,
) -> None:
    """Poses of a sensor at the TIMES (a CSV file with a column time) of its own data.

    SENSOR is one of campaign.toml, or 'vehicle'. Times in gaps of the ground truth give no pose.
    """
    from rtk_gt.sensors.times import VEHICLE, read_times, sensor_poses
    from validation.errors import GtvalError
    from validation.poses.pose_table import to_csv, to_tum
    from validation.text_files.writing import write_files

    wanted = read_times(times)
    outcome = _solved(campaign)
    table, missing = sensor_poses(
        outcome, sensor, wanted, published=published_interpolation, additive_angles=additive_angles
    )
    if len(table) == 0:
        raise GtvalError(
            f"{times}: none of its {missing} times is where there is ground truth "
            f"({outcome.path.times[0]:.3f} to {outcome.path.times[-1]:.3f} seconds since 1970 UTC, "
            "without gaps). Are they of the same drive and clock?"
        )
    text = to_tum(table) if output and output.suffix == ".tum" else to_csv(table)
    if output is None:
        click.echo(text, nl=False)
    else:
        write_files(output.parent, {output.name: text})
    said = f"{len(table)} poses; {missing} times are in gaps of the ground truth."
    if additive_angles and sensor != VEHICLE:
        said += " Angles were added, not composed: wrong where the vehicle pitches or rolls."
    click.echo(said, err=True)


def _need_receivers(toml: Path, settings: object) -> None:
    from validation.errors import GtvalError

    if not getattr(settings, "receivers", None):
        raise GtvalError(f"{toml} names no [[rtk.receivers]]")


def _solved(campaign: Path) -> "RtkOutcome":
    from rtk_gt.campaign.outcome import solve_campaign
    from validation.campaign.folder import load_campaign

    loaded = load_campaign(campaign)
    with progress_bar("rtk") as report:
        return solve_campaign(loaded, report)
