"""The commands ``gtval rtk scanner``, ``camera``, ``dgps`` and ``imu``."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from rtk_gt.commands.clock import told_clock, tolerance
from rtk_gt.commands.drive import (
    FINITE,
    SIGMA,
    along_path,
    lens_of,
    need_picture,
    sensor_named,
    solved,
)
from validation.commands.options import AS_JSON, CAMPAIGN, FIGURE, PATH

if TYPE_CHECKING:
    from rtk_gt.sensors.pass_matching import ScannerCalibration
    from rtk_gt.sensors.scanner_calibration import MountedScans
    from rtk_gt.sensors.scans import LineScans
    from validation.poses.angles import Array
    from validation.results import Table


LONG_ENOUGH = 50
"""Times its correlation time a record has to last for that time to be found (Sokal 1997)."""
POSE_COLUMNS = ("x [m]", "y [m]", "z [m]", "yaw [deg]", "pitch [deg]", "roll [deg]")


@click.command()
@CAMPAIGN
@click.argument("sensor")
@click.argument("scans", type=PATH)
@click.option(
    "--also",
    nargs=2,
    type=(str, PATH),
    multiple=True,
    metavar="SENSOR SCANS",
    help="Another scanner of the same drive: both are found together, and better.",
)
@click.option("--ground", type=FINITE, help="z of the road in the vehicle frame, metres.")
@click.option(
    "--ground-sigma", type=SIGMA, default=0.01, show_default=True, help="Of --ground, metres."
)
@click.option(
    "--ground-tilt-sigma",
    type=SIGMA,
    default=0.05,
    show_default=True,
    help="How well the vehicle frame is level on a level floor, degrees.",
)
@click.option(
    "--wheels",
    type=FINITE,
    default=0.0,
    show_default=True,
    help="x of the middle of the wheels in the vehicle frame, metres; with --ground.",
)
@click.option("--hand-sigma", type=SIGMA, default=0.02, show_default=True, help="Metres.")
@click.option("--hand-sigma-deg", type=SIGMA, default=2.0, show_default=True, help="Degrees.")
@click.option(
    "--histogram",
    type=PATH,
    help="Draw the heights of the ground beside the vehicle, before and after (.png, .svg).",
)
@AS_JSON
def scanner(
    campaign: Path,
    sensor: str,
    scans: Path,
    also: tuple[tuple[str, Path], ...],
    ground: float | None,
    ground_sigma: float,
    ground_tilt_sigma: float,
    wheels: float,
    hand_sigma: float,
    hand_sigma_deg: float,
    histogram: Path | None,
    as_json: bool,
) -> None:
    """Find where a vertical scanner is on the vehicle, from passes that should agree.

    SENSOR is the scanner in campaign.toml, with its hand-measured pose; SCANS a CSV file
    time,first_angle,angle_step,ranges. Path, offsets and the scanner's place are adjusted
    together. Writes nothing but the histogram, if asked, of SENSOR.
    """
    import numpy as np

    from rtk_gt.sensors.ground import KnownGround
    from rtk_gt.sensors.scanner_calibration import MountedScans, calibrate_scanners
    from rtk_gt.sensors.sensor_files import read_line_scans
    from rtk_gt.sensors.trajectory import smooth_trajectory
    from validation.report.terminal import print_json

    need_picture("--histogram", histogram)
    files = {sensor: scans}
    for name, file in also:
        if name in files:
            raise click.UsageError(f"--also: {name} is named twice")
        files[name] = file
    read = {name: read_line_scans(file) for name, file in files.items()}
    outcome = solved(campaign)
    sigmas = np.array([hand_sigma] * 3 + [np.radians(hand_sigma_deg)] * 3)
    mounted = []
    for name, file in files.items():
        along_path(outcome, read[name].times, file)
        start = np.array(sensor_named(outcome, name).pose)
        mounted.append(MountedScans(read[name], start, sigmas, name))
    trajectory = smooth_trajectory(
        outcome.steps, outcome.path, outcome.offsets, outcome.antennas, outcome.noise,
        outcome.settings.max_gap,
    )  # fmt: skip
    known = None
    if ground is not None:
        tilt = float(np.radians(ground_tilt_sigma))
        known = KnownGround(ground, sigma=ground_sigma, tilt_sigma=tilt, wheels=wheels)
    results = calibrate_scanners(trajectory, mounted, ground=known, prior=outcome.prior)
    if histogram is not None:
        _draw_heights(histogram, read[sensor], mounted[0].start, results[0].pose)
    if as_json:
        print_json(dict(zip(files, results, strict=True)) if also else results[0])
        return
    for one, result in zip(mounted, results, strict=True):
        _say_place(one, result)


def _say_place(mounted: "MountedScans", result: "ScannerCalibration") -> None:
    import numpy as np

    from validation.report.terminal import print_table

    share = ", ".join(
        f"{name} {100 * max(float(part), 0.0):.0f} %"
        for name, part in zip(("x", "y", "z", "about x", "y", "z"), result.from_drive, strict=True)
    )
    note = (
        f"{result.pairs} points on walls and ground that several passes saw; they are off by "
        f"{100 * result.rms_before:.1f} cm before and {100 * result.rms_after:.1f} cm after. "
        f"Known from the drive and not by hand: {share}. {_determined(result.sigmas)}"
    )
    if result.left_out:
        note += f" {result.left_out} scans are in gaps of the path and were not used."
    if not result.settled:
        note += (
            " It had not settled: each choice of points still moves it, as drives do that see"
            " their walls from few directions. The true errors may be larger than these sigmas."
        )
    spread = np.sqrt(np.diagonal(result.pose_covariance))
    print_table(_poses(f"Scanner {mounted.name}", mounted.start, result.pose, spread, note))
    _say_how_to_keep(mounted.name, result.pose, spread)


@click.command()
@CAMPAIGN
@click.argument("sensor")
@click.argument("points", type=PATH)
@click.option("--lens", nargs=8, type=FINITE, required=True, help="fx fy cx cy k1 k2 p1 p2.")
@click.option(
    "--point-sigma", type=SIGMA, default=0.02, show_default=True, help="Of the points, metres."
)
@AS_JSON
def camera(
    campaign: Path,
    sensor: str,
    points: Path,
    lens: tuple[float, ...],
    point_sigma: float,
    as_json: bool,
) -> None:
    """Find where a camera is on the vehicle, from known points seen in its images.

    SENSOR is the camera in campaign.toml, with its hand-measured pose; POINTS a CSV file
    time,x,y,z,u,v. Writes nothing.
    """
    import numpy as np

    from rtk_gt.sensors.camera_pose import camera_pose, vehicle_errors
    from rtk_gt.sensors.sensor_files import read_seen_points
    from validation.report.terminal import print_json, print_table

    seen = read_seen_points(points)
    outcome = solved(campaign)
    found = along_path(outcome, seen.times, points)
    rows = found.available
    start = np.array(sensor_named(outcome, sensor).pose)
    errors = vehicle_errors(
        seen.times[rows], found.poses[rows], outcome.antennas, outcome.noise,
        outcome.offsets.covariance, point_sigma,
    )  # fmt: skip
    result = camera_pose(
        lens_of(lens), seen.points[rows], found.poses[rows], seen.pixels[rows], start, errors
    )
    in_gaps = int((~rows).sum())
    if as_json:
        print_json({**vars(result), "points_in_gaps": in_gaps})
        return
    note = (
        f"{int(rows.sum())} points in {len(np.unique(seen.times[rows]))} images, residuals of "
        f"{result.sigma:.2f} pixels, which hold the noise of the path. The sigmas hold it, too, "
        f"and the error of the offsets. {in_gaps} points are in gaps of the path."
    )
    spread = np.sqrt(np.diagonal(result.covariance))
    print_table(_poses(f"Camera {sensor}", start, result.pose, spread, note))
    _say_how_to_keep(sensor, result.pose, spread)


@click.command()
@CAMPAIGN
@click.argument("log", type=PATH)
@click.option(
    "--antenna",
    nargs=3,
    type=FINITE,
    default=(0.0, 0.0, 0.0),
    show_default=True,
    help="x y z of its antenna on the vehicle, metres.",
)
@AS_JSON
def dgps(campaign: Path, log: Path, antenna: tuple[float, ...], as_json: bool) -> None:
    """Compare another GPS receiver on the vehicle (any log) with the ground truth."""
    import numpy as np

    from rtk_gt.campaign.pose_tables import vehicle_trajectory
    from rtk_gt.receivers.formats.reading import Stated, read_receiver
    from rtk_gt.sensors.characterisation import position_errors, record_trajectory
    from validation.report.terminal import print_findings, print_json, print_table
    from validation.results import Table
    from validation.trajectories.clock.tables import clock_json

    record = read_receiver(log, Stated(log.stem))
    outcome = solved(campaign)
    found = along_path(outcome, record.times, log)
    result = position_errors(record, found, np.array(antenna), outcome.path)
    in_gaps = int((~found.available).sum())
    reference = vehicle_trajectory(outcome.path, outcome.settings.max_gap)
    moving = record_trajectory(record, outcome.path.frame)
    estimate, findings = told_clock(reference, moving)
    if as_json:
        told = None if estimate is None else clock_json(estimate, tolerance())
        print_json({**vars(result), "fixes_in_gaps": in_gaps, "clock": told})
        return
    rows: list[list[str | int | float | None]] = [
        [axis, float(bias), float(sigma)]
        for axis, bias, sigma in zip(
            ("east", "north", "up"), result.bias, result.bias_sigma, strict=True
        )
    ]
    note = (
        f"{len(result.errors)} fixes where there is ground truth, {in_gaps} in gaps. RMSE: "
        f"{result.rmse_horizontal:.3f} m horizontal, {result.rmse_vertical:.3f} m vertical; "
        f"{result.correlation_time:.1f} fixes are worth one independent fix."
    )
    if len(result.errors) < LONG_ENOUGH * result.correlation_time:
        note += (
            " Errors stay similar for too much of the record: the true standard errors may be "
            "larger. Compare a longer drive, or several."
        )
    columns = ["direction", "mean error [m]", "standard error [m]"]
    print_table(Table(f"Errors of {record.receiver}", columns, rows, ["", ".3f", ".3f"], note))
    print_findings(findings)


@click.command()
@CAMPAIGN
@click.argument("angles", type=PATH)
@FIGURE
@AS_JSON
def imu(campaign: Path, angles: Path, figure: Path | None, as_json: bool) -> None:
    """Compare the rates of an IMU (CSV time,yaw,pitch,roll in radians) with the ground truth.

    Where the turns tell that its stamps are late or early, rates are compared at the right times.
    """
    import numpy as np

    from rtk_gt.campaign.pose_tables import vehicle_trajectory
    from rtk_gt.sensors.characterisation import rate_errors
    from rtk_gt.sensors.sensor_files import read_imu
    from rtk_gt.sensors.stream_clocks import turns_of
    from validation.report.terminal import print_findings, print_json, print_table
    from validation.results import Table
    from validation.trajectories.clock.tables import clock_json

    need_picture("--figure", figure)
    times, read = read_imu(angles)
    outcome = solved(campaign)
    max_gap = outcome.settings.max_gap
    estimate, findings = told_clock(
        vehicle_trajectory(outcome.path, max_gap), turns_of(angles.stem, times, read[:, 0])
    )
    moved = estimate is not None and estimate.low_s * estimate.high_s > 0
    if estimate is not None and moved and estimate.verdict == "determined":
        times = times + estimate.delay_s
    result = rate_errors(times, read, outcome.path, max_gap)
    if figure is not None:
        from rtk_gt.sensors.figures import rates_over_time
        from validation.figures.writing import write_figure

        yaws = (outcome.path.times, outcome.path.poses[:, 3]), (times, read[:, 0])
        write_figure(figure, rates_over_time(result, max_gap, yaws))
    if as_json:
        told = None if estimate is None else clock_json(estimate, tolerance())
        print_json({"angles": result, "clock": told})
        return
    rows: list[list[str | int | float | None]] = [
        [
            one.name,
            *(
                float(np.degrees(value))
                for value in (
                    one.rmse, one.mean_rate, one.greatest_rate, one.drift, one.drift_sigma
                )
            ),
        ]
        for one in result
    ]  # fmt: skip
    columns = ["angle", "RMSE", "mean rate", "greatest rate", "drift", "its sigma"]
    note = (
        f"Degrees per second. {result[0].intervals} intervals between poses; the RMSE contains the "
        "path's noise. The rates are those of the path, the drift is the IMU's mean error."
    )
    if moved:
        note += " Compared with right stamps: the delay below is added."
    print_table(Table("Rates of the IMU", columns, rows, ["", *[".3f"] * 5], note))
    print_findings(findings)


def _poses(title: str, start: "Array", pose: "Array", spread: "Array", note: str) -> "Table":
    import numpy as np

    from validation.poses.angles import wrap
    from validation.results import Table

    change = np.concatenate([pose[:3] - start[:3], wrap(pose[3:] - start[3:])])
    rows: list[list[str | int | float | None]] = [
        [what, *(float(v) for v in values[:3]), *(float(v) for v in np.degrees(values[3:]))]
        for what, values in (
            ("measured by hand", start),
            ("found", pose),
            ("change", change),
            ("sigma", spread),
        )
    ]
    return Table(title, ["pose", *POSE_COLUMNS], rows, ["", *[".4f"] * 3, *[".3f"] * 3], note)


def _say_how_to_keep(sensor: str, pose: "Array", spread: "Array") -> None:
    """The lines of campaign.toml, where angles are in radians."""
    for line in (
        f"To use it, write under the [[rtk.sensors]] named {sensor} (metres, radians):",
        *(
            f"{name} = [{', '.join(f'{value:.6f}' for value in values)}]"
            for name, values in (("pose", pose), ("sigmas", spread))
        ),
    ):
        click.echo(line)


def _draw_heights(path: Path, scans: "LineScans", before: "Array", after: "Array") -> None:
    from rtk_gt.sensors.figures import heights_before_and_after
    from rtk_gt.sensors.scans import cloud_of
    from validation.figures.writing import write_figure

    write_figure(path, heights_before_and_after(cloud_of(scans), before, after))


def _determined(sigmas: "Array") -> str:
    """Whether two standard deviations are within 1 cm and 0.1 degrees."""
    import numpy as np

    twice = 2 * np.concatenate([100 * sigmas[:3], np.degrees(sigmas[3:])])
    limits = np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1])
    names = ("x", "y", "z", "about x", "about y", "about z")
    units = ["cm"] * 3 + ["degrees"] * 3
    open_ones = [
        f"{name} to {value:.2g} {unit}"
        for name, value, unit, limit in zip(names, twice, units, limits, strict=True)
        if value > limit
    ]
    if not open_ones:
        return "All six are determined to 1 cm and 0.1 degrees (two standard deviations)."
    return (
        f"Not determined to 1 cm and 0.1 degrees (two standard deviations): {', '.join(open_ones)}."
        " A longer drive with more headings and slopes helps."
    )


COMMANDS: list[click.Command] = [scanner, camera, dgps, imu]
