"""From a campaign's receivers to the path: the whole chain, without printing or drawing."""

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from rtk_gt.campaign.digits import too_coarse
from rtk_gt.campaign.inputs import antenna_places, check_places, load_drive, offset_prior
from rtk_gt.campaign.outcome import RtkOutcome
from rtk_gt.lasting.errors import seen_of_all, seen_of_some
from rtk_gt.lasting.jumps import SeenSizes
from rtk_gt.lasting.lasting_error import JumpErrors, LastingError
from rtk_gt.lasting.settled import settle
from rtk_gt.offsets.checks import PriorCheck, check_prior, check_units
from rtk_gt.offsets.estimate import Offsets, distance_names, estimate_offsets
from rtk_gt.offsets.memory import error_model
from rtk_gt.offsets.minima import all_minima, default_layout
from rtk_gt.offsets.noise import GpsNoise
from rtk_gt.offsets.prior import OffsetPrior
from rtk_gt.offsets.slow_errors import ErrorModel
from rtk_gt.path.antennas import Places
from rtk_gt.path.choice import Choice, check_attitude, check_order, choose
from rtk_gt.path.clocks import Clocks, right_clocks
from rtk_gt.path.common_errors import common_errors
from rtk_gt.path.consistency import consistency
from rtk_gt.path.covariance import reference_covariance
from rtk_gt.path.coverage import coverage
from rtk_gt.path.interpolation import HoldOut, hold_out
from rtk_gt.path.leaps import leaping_poses
from rtk_gt.path.motion_check import motion_check
from rtk_gt.path.vehicle_path import VehiclePath, vehicle_path
from rtk_gt.receivers.digits import rounded_eta
from rtk_gt.receivers.fixes import Fixes
from rtk_gt.receivers.quality import AreaQuality, area_qualities
from rtk_gt.receivers.steps import Steps
from rtk_gt.receivers.together import check_together
from rtk_gt.settings import RtkSettings
from validation.campaign.folder import Campaign
from validation.errors import GtvalError
from validation.pieces.processes import give_back_memory
from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame
from validation.systems import Progress, no_progress

ENOUGH = 300
"""Steps from which on slow errors are looked for where the drive tells no distances: of 42 steps a
second of white noise passed for some that last 5 s."""


def solve_campaign(campaign: Campaign, progress: Progress = no_progress) -> RtkOutcome:
    """The path of a campaign's vehicle, with all that is known of its quality.

    Raises
    ------
    GtvalError
        If the files are bad, or the receivers are never RTK-fixed together.
    """
    count = len(campaign.section("rtk", RtkSettings).receivers)
    if 0 < count < 3:
        said = "one receiver, which gives positions" if count == 1 else "two receivers, which give "
        said += "" if count == 1 else "positions and headings"
        raise GtvalError(
            f"{campaign.toml} names {said} (`gtval rtk`); this command needs the poses of a "
            "vehicle with three"
        )
    progress("reading the receivers", 0.0)
    check_places(campaign)
    given = load_drive(campaign)
    settings, records, steps = given.settings, given.records, given.steps
    progress("offsets of the receivers", 0.3)
    check_together(records, steps, settings.simultaneous)
    give_back_memory()
    prior = offset_prior(settings, steps.frame)
    heights = OffsetPrior(heights=prior.heights)
    search = not too_coarse(records)
    ready = prepare(steps, settings, heights, search=search)
    eta = rounded_eta(records, ready.quick.sigma, settings.eta)
    if eta > settings.eta:
        settings = settings.model_copy(update={"eta": eta})
        ready = prepare(steps, settings, heights, search=search)
    steps, jumps = ready.steps, ready.jumps
    check_units(prior, ready.quick, distance_names(steps.receivers))
    chosen, stated, model = offsets_of(ready, prior, settings, antenna_places(settings))
    offsets, antennas = chosen.offsets, chosen.antennas
    give_back_memory()
    noise = GpsNoise(settings.sigma or offsets.sigma, settings.eta)
    progress("path", 0.5)
    good = _without_false(steps, offsets)
    base = _base_of_all(settings, records)
    common = common_errors(records, good, noise, settings.common_sigma, base)
    path = vehicle_path(
        good, offsets, antennas, noise, jumps=jumps, model=model, common=common.covariances
    )
    if jumps is not None:
        offsets = jumps.spread(offsets)
    check_attitude(path)
    give_back_memory()
    progress("quality of the path", 0.7)
    return RtkOutcome(
        campaign=campaign,
        settings=settings,
        records=records,
        steps=steps,
        prior=prior,
        stated=stated,
        offsets=offsets,
        antennas=antennas,
        left=chosen.left,
        lasting=tuple(ready.lasting),
        clocks=ready.clocks,
        seen_of_all=ready.seen_of_all,
        seen_of_some=ready.seen_of_some,
        noise=noise,
        model=model,
        common=common,
        path=path,
        leaps=leaping_poses(path, settings.max_gap),
        reference=reference_covariance(antennas.positions, noise),
        consistency=consistency(
            good.corrected(offsets.offsets).positions,
            offsets.distances,
            noise,
            settings.confidence,
        ),
        motion=motion_check(path, settings.max_gap),
        coverage=coverage(records, steps, path.times, settings.max_gap),
        hold_out=_hold_out(path, settings.max_gap),
        sensors={sensor.name: sensor for sensor in settings.sensors},
        areas=_areas(settings, records, steps.frame, offsets.offsets.within(steps.frame)),
    )


def _areas(
    settings: RtkSettings, records: Sequence[Fixes], frame: LocalFrame, offsets: Array
) -> dict[str, tuple[AreaQuality, ...]]:
    """How the fixes of each receiver are in each named area; empty where there is none."""
    if not settings.areas:
        return {}
    return {
        one.receiver: area_qualities(
            settings.outlines, one, frame.from_geodetic(one.geodetic) + offset
        )
        for one, offset in zip(records, offsets, strict=True)
    }


class Prepared(NamedTuple):
    """Steps at one time and without errors that last, with what was found of clocks and errors."""

    steps: Steps
    clocks: Clocks | None
    lasting: list[LastingError]
    jumps: JumpErrors | None
    model: ErrorModel | None
    seen_of_all: SeenSizes
    seen_of_some: SeenSizes
    quick: Offsets


def prepare(
    steps: Steps, settings: RtkSettings, prior: OffsetPrior | None = None, *, search: bool = True
) -> Prepared:
    """Recorded steps made ready: clocks set right, jumps and false fixes taken out.

    Parameters
    ----------
    steps : Steps
        As recorded.
    settings : RtkSettings
        The table [rtk].
    prior : OffsetPrior, optional
        What is known of the antennas' heights, for `settle`.
    search : bool
        Whether errors that last are looked for at all: none can be told from coarse digits.

    Raises
    ------
    GtvalError
        As `estimate_offsets`.
    """
    steps, clocks = right_clocks(steps, settings.eta)
    looked_for = settings.robust and search
    steps, lasting, jumps = settle(steps, eta=settings.eta, robust=looked_for, prior=prior)
    quick = estimate_offsets(
        steps, eta=settings.eta, robust=settings.robust, bent="never", prior=prior
    )
    model = error_model(steps, quick)
    of_all, of_some = seen_of_all(steps, quick), seen_of_some(steps, quick)
    return Prepared(steps, clocks, lasting, jumps, model, of_all, of_some, quick)


def offsets_of(
    ready: Prepared, prior: OffsetPrior, settings: RtkSettings, places: Places
) -> tuple[Choice, PriorCheck | None, ErrorModel | None]:
    """The vehicle's offsets, what is stated beside the drive, and the model of slow errors.

    Where the drive alone tells no distances, it tells nothing of its errors, but with what is
    stated. Parameters and errors as of `solve_offsets`.
    """
    model = ready.model
    chosen, stated = solve_offsets(ready.steps, prior, settings, places, model)
    if model is None and not ready.quick.known and chosen.offsets.steps >= ENOUGH:
        model = error_model(ready.steps, chosen.offsets)
        if model is not None:
            chosen, stated = solve_offsets(ready.steps, prior, settings, places, model)
    return chosen, stated, model


def solve_offsets(
    steps: Steps,
    prior: OffsetPrior,
    settings: RtkSettings,
    places: Places,
    model: ErrorModel | None = None,
) -> tuple[Choice, PriorCheck | None]:
    """The vehicle's offsets with the antennas' places, and what is stated beside the drive.

    Parameters
    ----------
    steps : Steps
        As recorded.
    prior : OffsetPrior
        What is known beforehand.
    settings : RtkSettings
        The table [rtk].
    places : Places
        What is stated of the antennas.
    model : ErrorModel, optional
        Of the receivers' errors, where they are slow.

    Raises
    ------
    GtvalError
        If the steps and what is stated leave the offsets open, allow several, or contradict each
        other.
    """
    layout = default_layout(prior, len(steps.receivers))
    if places.positions is not None:
        layout = places.positions
    elif places.others is not None:
        layout = np.vstack([layout[:3], places.others])
    near = None
    if len(prior.offsets):
        near = np.nan_to_num(prior.offsets)
    find = partial(
        all_minima, steps, eta=settings.eta, robust=settings.robust, layout=layout, model=model
    )
    minima = find(prior=prior, near=near)
    stated = check_prior(find, prior, minima.best, steps)
    largest = settings.largest_distance_sigma
    if minima.mirrored is not None and minima.mirrored.distance_sigmas.max() < largest:
        check_order(minima, steps, places, settings.max_gap)
    _check_determined(minima.best, largest)
    return choose(minima, steps, places, settings.max_gap), stated


def _check_determined(offsets: Offsets, largest: float) -> None:
    """Raise if not even the distances of the antennas are known: then there is no path."""
    worst = float(offsets.distance_sigmas.max())
    if worst > largest:
        count = int((offsets.signal <= 0).sum())
        raise GtvalError(
            f"this drive does not determine the offsets of its receivers: in {count} of "
            f"{len(offsets.signal)} directions it says nothing, and the distances of the "
            f"antennas are open by {worst:.1f} m (largest_distance_sigma = {largest:g}). The "
            "vehicle turned or tilted too little. State "
            "[rtk.known_distances] (a tape measure will do) or [rtk.known_offsets] from a longer "
            "drive; `gtval rtk coverage` works without"
        )


def _base_of_all(settings: RtkSettings, records: Sequence[Fixes]) -> Fixes | None:
    """The record of the receiver that all others are told from; None if there is none."""
    names = {one.base for one in settings.receivers} - {""}
    told = sum(bool(one.base) for one in settings.receivers)
    if len(names) != 1 or told < len(records) - 1:
        return None
    return next(one for one in records if one.receiver in names)


def _without_false(steps: Steps, offsets: Offsets) -> Steps:
    """The complete steps but those whose distances say that a fix is false."""
    rows = np.flatnonzero(steps.complete)
    return steps.select(rows[offsets.weights > 0])


def _hold_out(path: VehiclePath, max_gap: float) -> HoldOut | None:
    try:
        return hold_out(path, max_gap)
    except GtvalError:
        return None
