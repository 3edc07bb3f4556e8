"""The drive that commands work on: solved, its sensors, its path at the times of a file."""

from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from validation.commands.options import progress_bar

if TYPE_CHECKING:
    from rtk_gt.campaign.outcome import RtkOutcome
    from rtk_gt.path.interpolation import Interpolated
    from rtk_gt.sensors.camera_pose import Lens
    from rtk_gt.settings import Sensor
    from validation.poses.angles import Array
    from validation.poses.trajectory import Trajectory


class Number(click.FloatRange):
    """A number within limits; click's own range lets NaN pass."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """The number, or a usage error."""
        number = float(super().convert(value, param, ctx))
        if isnan(number):
            self.fail("nan is not a number", param, ctx)
        return number


FINITE = Number(-1e9, 1e9)
SIGMA = Number(1e-9, 1e3)


def solved(campaign: Path) -> "RtkOutcome":
    """The drive of a campaign."""
    from rtk_gt.campaign.solve import solve_campaign
    from validation.campaign.folder import load_campaign

    loaded = load_campaign(campaign)
    with progress_bar("rtk") as report:
        return solve_campaign(loaded, report)


def drive_trajectory(campaign: Path) -> "Trajectory":
    """The path of a campaign's vehicle in time, from however many receivers; a GtvalError if none.

    One receiver gives positions, two level positions and headings.
    """
    from rtk_gt.campaign.pose_tables import vehicle_trajectory
    from rtk_gt.positions.solve import solve_positions
    from rtk_gt.positions.trajectories import heading_trajectory
    from rtk_gt.settings import RtkSettings
    from validation.campaign.folder import load_campaign
    from validation.errors import GtvalError

    loaded = load_campaign(campaign)
    if len(loaded.section("rtk", RtkSettings).receivers) > 2:
        outcome = solved(campaign)
        return vehicle_trajectory(outcome.path, outcome.settings.max_gap)
    with progress_bar("rtk") as report:
        positions = solve_positions(loaded, report)
    if positions.fixed.sum() < 3:
        raise GtvalError(
            f"{campaign}: {int(positions.fixed.sum())} positions are RTK-fixed; there is no path"
        )
    return heading_trajectory(positions)


def sensor_named(outcome: "RtkOutcome", name: str) -> "Sensor":
    """A sensor of campaign.toml; a GtvalError lists those there are."""
    from validation.errors import GtvalError

    known = {one.name: one for one in outcome.settings.sensors}
    if name not in known:
        said = ", ".join(known) or "none"
        raise GtvalError(f"no sensor '{name}' in {outcome.campaign.toml}; there are: {said}")
    return known[name]


def along_path(
    outcome: "RtkOutcome", times: "Array", file: Path, *, published: bool = False
) -> "Interpolated":
    """Vehicle poses at the times of a file; a GtvalError if there is ground truth at none."""
    from rtk_gt.path.interpolation import path_at
    from validation.errors import GtvalError

    found = path_at(
        outcome.path,
        times,
        max_gap=outcome.settings.max_gap,
        hold_out=outcome.hold_out,
        published=published,
    )
    if not found.available.any():
        path = outcome.path.times
        raise GtvalError(
            f"{file}: none of its times, {times.min():.3f} to {times.max():.3f}, is where there is "
            f"ground truth ({path[0]:.3f} to {path[-1]:.3f} seconds since 1970 UTC, without gaps). "
            "Are they of the same drive and clock?"
        )
    return found


def lens_of(numbers: tuple[float, ...]) -> "Lens":
    """The lens of fx fy cx cy k1 k2 p1 p2."""
    import numpy as np

    from rtk_gt.sensors.camera_pose import Lens

    fx, fy, cx, cy, *distortion = numbers
    if not (fx > 0 and fy > 0):
        raise click.UsageError(f"--lens: focal lengths {fx:g}, {fy:g} pixels; both must be above 0")
    return Lens(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), np.array(distortion))


def need_picture(option: str, file: Path | None) -> None:
    """A usage error where a picture has another ending than those that are drawn."""
    if file is not None and file.suffix.lower() not in {".png", ".svg"}:
        raise click.UsageError(f"{option} writes .png or .svg, not '{file.suffix}'")
