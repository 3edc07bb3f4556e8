"""A campaign's drive solved, in the form that all systems share."""

from dataclasses import replace

import numpy as np

from laser_gt.drive_campaign.inputs import drive_inputs
from laser_gt.drive_campaign.told import (
    SYSTEM,
    drive_facts,
    drive_findings,
    drive_section,
    drive_table,
)
from laser_gt.driving.drive import solve_log
from laser_gt.driving.log import DriveOutcome
from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError, Problem
from validation.pieces.processors import processors
from validation.published.moving import stops_table
from validation.results import SystemResult, Table
from validation.systems import Progress, no_progress
from validation.trajectories.formats import trajectory_text
from validation.trajectories.stops import Stop, StopPoses, poses_at_stops

FEW = 300
"""Scans below which one process does it all: others take a second each to start."""


def solve_drive_campaign(
    campaign: Campaign, progress: Progress = no_progress, *, workers: int | None = None
) -> SystemResult:
    """The trajectory of a campaign's drive, its poses at stops, findings and report section.

    Parameters
    ----------
    campaign : Campaign
        The folder and its settings, and what the survey made of it.
    progress : callable
        Called with what is being done and the share done.
    workers : int, optional
        Processes; one for each processor by default.

    Raises
    ------
    GtvalError
        If the files are bad, or the scans cannot be matched.
    """
    inputs, stops = drive_inputs(campaign)
    scans = max(len(each) for each in inputs.scans.values())
    count = processors(workers) if scans > FEW else 1
    outcome = solve_log(inputs, count, progress)
    return result_of(outcome, stops, campaign)


def result_of(outcome: DriveOutcome, stops: list[Stop], campaign: Campaign) -> SystemResult:
    """An outcome in the form that all systems share."""
    found = _at_stops(outcome, stops, campaign)
    tables = [] if found is None else [stops_table(stops, found)]
    shown: list[Table] = [drive_table(outcome), *tables]
    return SystemResult(
        tables=[] if found is None else [found.table],
        findings=list(drive_findings(outcome)),
        sections=[drive_section(outcome, tables)],
        files={f"trajectory_{SYSTEM}.csv": trajectory_text(outcome.trajectory)},
        facts=drive_facts(outcome),
        overview=shown,
        trajectories=[outcome.trajectory],
    )


def _at_stops(outcome: DriveOutcome, stops: list[Stop], campaign: Campaign) -> StopPoses | None:
    """Poses at the stops; None where there are none, or the frame is the drive's own.

    Their covariances are those that the trajectory states, for all poses of a stop share the map,
    the mount and the surveyed stops; what each has of its own is small beside these.
    """
    if not stops or not outcome.anchors:
        return None
    trajectory = outcome.trajectory
    try:
        found = poses_at_stops(trajectory, stops)
        seconds = trajectory.times + trajectory.epoch
        by_name = {stop.name: stop for stop in stops}
        inside = [
            (seconds >= by_name[name].start) & (seconds <= by_name[name].end)
            for name in found.table.ids
        ]
        covariances = np.array([trajectory.covariances[rows].mean(0) for rows in inside])
        return replace(found, table=replace(found.table, covariances=covariances))
    except GtvalError as error:
        said = f"{error}. The stamps of the stops must be those of the odometry."
        raise InputError([Problem(campaign.toml, said, None, "laser_drive.stops")]) from None
