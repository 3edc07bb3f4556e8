"""From one receiver's record to positions, coverage and quality; no printing, no drawing."""

from dataclasses import replace
from functools import partial

import numpy as np

from rtk_gt.campaign.inputs import (
    DriveRecords,
    antenna_places,
    check_places,
    load_drive,
    offset_prior,
)
from rtk_gt.offsets.checks import check_prior
from rtk_gt.offsets.lasting import smallest_seen
from rtk_gt.offsets.minima import all_minima
from rtk_gt.offsets.noise import GpsNoise
from rtk_gt.offsets.settled import settle
from rtk_gt.path.coverage import coverage
from rtk_gt.positions.heading import Headings, headings
from rtk_gt.positions.jumps import PositionJumps, of_first, with_jumps, without_jumps
from rtk_gt.positions.outcome import AreaQuality, KindQuality, PositionsOutcome
from rtk_gt.receivers.fixes import FIX_NAMES, NO_FIX, Bools, Fixes
from rtk_gt.receivers.host_clock import host_clock
from rtk_gt.receivers.together import check_together
from rtk_gt.settings import RtkSettings
from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError
from validation.poses.angles import Array
from validation.systems import Progress, no_progress

_ORDER = (4, 5, 3, 2, 9, 1)
"""Kinds of fixes, the best first; others follow."""


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
    jumps = of_first(given.settings, steps)
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
    return PositionsOutcome(
        campaign=campaign,
        settings=given.settings,
        record=record,
        frame=steps.frame,
        positions=positions,
        coverage=coverage(given.records, steps, posed, given.settings.max_gap),
        kinds=qualities(record),
        clock=host_clock(record),
        steps=steps,
        lasting=tuple(jumps.lasting),
        left_out=left_out,
        jump_covariances=spread,
        smallest_seen=jumps.smallest_seen,
        areas=_areas(given.settings, record, steps.frame.from_geodetic(record.geodetic)),
        headings=found,
        without_heading=why,
    )


def _headings(campaign: Campaign, given: DriveRecords) -> tuple[Headings, PositionJumps]:
    """Positions and headings of two receivers, and their errors that last."""
    settings, steps = given.settings, given.steps
    check_places(campaign)
    check_together(given.records, steps, settings.simultaneous)
    steps, lasting, jumps = settle(steps, eta=settings.eta, robust=settings.robust)
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
    check_prior(find, prior, minima.best)
    if jumps is not None:
        others = tuple(jumps.spread(one) for one in minima.others)
        minima = replace(minima, best=jumps.spread(minima.best), others=others)
    noise = None if settings.sigma is None else GpsNoise(settings.sigma, settings.eta)
    found = headings(minima, steps, arm, noise, settings.max_gap)
    least = smallest_seen(steps, found.offsets)
    return with_jumps(found, lasting), PositionJumps(lasting, least)


def _areas(settings: RtkSettings, record: Fixes, positions: Array) -> tuple[AreaQuality, ...]:
    """Quality of the fixes in each named area."""
    found = []
    for area in settings.areas:
        rows = inside(np.array(area.corners), positions[:, :2])
        here = replace(record.select(rows), without_fix=0)
        found.append(AreaQuality(area.name, qualities(here)))
    return tuple(found)


def inside(corners: Array, points: Array) -> Bools:
    """(n,) whether points (n, 2) are in a polygon of corners (k, 2): by the crossings of a ray."""
    start, end = corners, np.roll(corners, -1, axis=0)
    x, y = points[:, :1], points[:, 1:]
    spans = (start[:, 1] > y) != (end[:, 1] > y)
    rise = end[:, 1] - start[:, 1]
    share = (y - start[:, 1]) / np.where(rise == 0, 1.0, rise)
    crossed = spans & (x < start[:, 0] + share * (end[:, 0] - start[:, 0]))
    return np.asarray(crossed.sum(1) % 2 == 1)


def qualities(record: Fixes) -> tuple[KindQuality, ...]:
    """Epochs and stated errors of each kind of fix, the best kind first."""
    present = {int(kind) for kind in np.unique(record.kinds)}
    order = [*(k for k in _ORDER if k in present), *sorted(present - set(_ORDER))]
    found = [_quality(record, kind) for kind in order]
    if record.without_fix:
        share = record.without_fix / record.epochs
        name = FIX_NAMES[NO_FIX]
        found.append(KindQuality(name, record.without_fix, share, None, None, None, None))
    return tuple(found)


def _quality(record: Fixes, kind: int) -> KindQuality:
    rows = record.kinds == kind
    axes = semi_axes(record.covariances[rows])
    known = record.satellites[rows & (record.satellites >= 0)]
    hdop = record.hdop[rows & np.isfinite(record.hdop)]
    return KindQuality(
        FIX_NAMES[kind],
        int(rows.sum()),
        float(rows.sum()) / record.epochs,
        _middle_and_high(axes[:, 0]),
        _middle_and_high(axes[:, 2]),
        float(np.median(known)) if len(known) else None,
        float(np.median(hdop)) if len(hdop) else None,
    )


def semi_axes(covariances: Array) -> Array:
    """(n, 3) standard deviations: longer and shorter axis of the ellipse, and up, metres."""
    axes = np.full((len(covariances), 3), np.nan)
    stated = np.isfinite(covariances).all((1, 2))
    values = np.linalg.eigvalsh(covariances[stated][:, :2, :2])
    axes[stated, :2] = np.sqrt(np.maximum(values[:, ::-1], 0.0))
    axes[stated, 2] = np.sqrt(covariances[stated, 2, 2])
    return axes


def _middle_and_high(values: Array) -> tuple[float, float] | None:
    values = values[np.isfinite(values)]
    if len(values) == 0:
        return None
    return float(np.median(values)), float(np.quantile(values, 0.95))
