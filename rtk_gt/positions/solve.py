"""From one receiver's record to positions, coverage and quality; no printing, no drawing."""

from dataclasses import replace
from functools import partial

import numpy as np

from rtk_gt.campaign.digits import too_coarse
from rtk_gt.campaign.inputs import (
    DriveRecords,
    antenna_places,
    check_places,
    load_drive,
    offset_prior,
)
from rtk_gt.lasting.errors import seen_of_all
from rtk_gt.lasting.settled import settle
from rtk_gt.offsets.checks import check_prior
from rtk_gt.offsets.minima import all_minima
from rtk_gt.offsets.noise import GpsNoise
from rtk_gt.path.coverage import coverage
from rtk_gt.positions.heading import Headings, headings
from rtk_gt.positions.jumps import PositionJumps, of_first, with_jumps, without_jumps
from rtk_gt.positions.odometry import FEWEST, odometry_overlay
from rtk_gt.positions.outcome import PositionsOutcome
from rtk_gt.positions.scatter import scatter_beside_stated
from rtk_gt.positions.trajectories import fixed_trajectory
from rtk_gt.receivers.host_clock import host_clock
from rtk_gt.receivers.quality import area_qualities, qualities
from rtk_gt.receivers.together import check_together
from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError
from validation.systems import Progress, no_progress


def solve_positions(campaign: Campaign, progress: Progress = no_progress) -> PositionsOutcome:
    """Where the receiver of a campaign was, and how much of that is ground truth.

    Raises
    ------
    InputError
        If the record is bad. One that is never RTK-fixed is none: its coverage is 0.
    """
    progress("reading the receiver", 0.0)
    given = load_drive(campaign)
    record, steps = given.records[0], given.steps
    found, why = None, ""
    progress("errors that last", 0.2)
    jumps = of_first(steps, search=given.settings.robust and not too_coarse(given.records))
    if len(given.records) == 2:
        progress("heading", 0.3)
        try:
            found, jumps = _headings(campaign, given)
        except InputError:
            raise
        except GtvalError as error:  # the positions stand without it
            why = str(error)
    positions, left_out, spread = without_jumps(record, steps.frame, jumps.lasting)
    good = record.fixed & ~left_out
    posed = record.times[good] if found is None else found.times
    progress("quality of the positions", 0.7)
    outcome = PositionsOutcome(
        campaign=campaign,
        settings=given.settings,
        record=record,
        records=given.records,
        frame=steps.frame,
        positions=positions,
        coverage=coverage(given.records, steps, posed, given.settings.max_gap),
        kinds=qualities(record),
        clock=host_clock(record),
        steps=steps,
        lasting=tuple(jumps.lasting),
        left_out=left_out,
        jump_covariances=spread,
        seen_of_all=jumps.seen_of_all,
        areas=area_qualities(given.settings.outlines, record, positions),
        headings=found,
        without_heading=why,
        scatter=scatter_beside_stated(record, positions),
    )
    if not given.settings.odometry:
        return outcome
    progress("odometry", 0.9)
    path = campaign.folder / given.settings.odometry
    if outcome.fixed.sum() < FEWEST:
        few = f"{int(outcome.fixed.sum())} positions are RTK-fixed, {FEWEST} are needed"
        return replace(outcome, without_overlay=few)
    try:
        return replace(outcome, overlay=odometry_overlay(path, fixed_trajectory(outcome)))
    except InputError:
        raise
    except GtvalError as error:  # the positions stand without it
        return replace(outcome, without_overlay=str(error))


def _headings(campaign: Campaign, given: DriveRecords) -> tuple[Headings, PositionJumps]:
    """Positions and headings of two receivers, and their errors that last."""
    settings, steps = given.settings, given.steps
    check_places(campaign)
    check_together(given.records, steps, settings.simultaneous)
    looked_for = settings.robust and not too_coarse(given.records)
    steps, lasting, jumps = settle(steps, eta=settings.eta, robust=looked_for)
    places = antenna_places(settings)
    if places.positions is not None:
        arm = places.positions[1] - places.positions[0]
    else:
        arm = np.array([1.0, 0.0, places.heights[1] - places.heights[0]])
    prior = offset_prior(settings, steps.frame)
    find = partial(
        all_minima, steps, eta=settings.eta, robust=settings.robust, layout=places.positions
    )
    minima = find(prior=prior, near=np.nan_to_num(prior.offsets) if len(prior.offsets) else None)
    check_prior(find, prior, minima.best, steps)
    if jumps is not None:
        others = tuple(jumps.spread(one) for one in minima.others)
        minima = replace(minima, best=jumps.spread(minima.best), others=others)
    noise = None if settings.sigma is None else GpsNoise(settings.sigma, settings.eta)
    found = headings(minima, steps, arm, noise, settings.max_gap)
    least = seen_of_all(steps, found.offsets)
    return with_jumps(found, lasting), PositionJumps(lasting, least)
