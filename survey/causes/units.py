"""Readings in another unit than metres, which no linearised survey can show."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from survey.causes.common_errors import sets_of
from survey.causes.lead import Lead, Log, effect_size, longest_gain
from survey.causes.linear import Linear
from survey.causes.start import all_restarted, relocated, restarted
from survey.causes.trial import CAUCHY, Effect, Rows, Trial
from survey.estimation.geometry import rotate
from survey.readings.readings import Mask
from validation.poses.angles import Array
from validation.statistics.units import PER_METRE

HOPELESS_MISFIT = 100.0
"""Standardised misfit of a reading that is off by decimetres, as another unit makes it."""
LEAST_OF_A_UNIT = 4
"""Readings with such a misfit from which other units are tried: fewer are blunders."""


def unit_leads(trial: Trial, linear: Linear, log: Log) -> Iterator[Lead]:
    """Sets of readings that fit when they are taken as feet, yards and so on.

    The whole survey is located anew with the readings in each unit that leaves them in the
    range of the others.
    """
    n = len(trial.network.distance)
    far = np.abs(linear.at_start[:n]) > HOPELESS_MISFIT
    if far.sum() < LEAST_OF_A_UNIT:
        return
    # All readings may fit one another, and not the frames that they are to fit.
    bent = bool((np.abs(linear.at_start[n:]) > HOPELESS_MISFIT).any())
    now = _robust_cost(trial, trial.network.distance)
    alone: dict[float, list[str]] = {per_metre: [] for per_metre in PER_METRE.values()}
    for extent, subject, rows, places in sets_of(log):
        if extent == "station" and far[rows].sum() < LEAST_OF_A_UNIT:
            continue
        if extent != "station" and not _mostly_far(far, rows) and not (extent == "all" and bent):
            continue
        stop = subject[0] if extent == "station" and subject[0] in trial.network.poses else None
        for per_metre, distance in _in_units(trial, rows):
            there = _there(trial, stop, distance)
            gain = now - _robust_cost(there, distance)
            if gain > LEAST_OF_A_UNIT * CAUCHY**2:
                alone[per_metre] += [stop] if stop is not None else []
                yield _lead(extent, subject, rows, distance, per_metre, gain, places)
    for per_metre, stations in alone.items():
        rows = _block(trial, log, stations, per_metre)
        if LEAST_OF_A_UNIT <= len(rows) < n:
            distance = trial.network.distance.copy()
            distance[rows] /= per_metre
            gain = now - _robust_cost(_again(trial, log, rows, distance), distance)
            if gain > LEAST_OF_A_UNIT * CAUCHY**2:
                places = n * n / 2.0
                yield _lead("block", (), rows, distance, per_metre, gain, places, log)


def _mostly_far(far: Mask, rows: Rows) -> bool:
    """Whether a good part of some readings, or of the others, is far off.

    In another unit than the others are those that the survey as it stands fits, or those that it
    does not; either way one kind is off but for a few.
    """
    inside = int(far[rows].sum())
    outside = int(far.sum()) - inside
    return inside > SOME * len(rows) or outside > SOME * (len(far) - len(rows))


SOME = 0.2
"""Share of readings in another unit that are off by decimetres at least. A judgement: nearly all
are; a robust solution between both units fits a few."""


def _in_units(trial: Trial, rows: Rows) -> Iterator[tuple[float, Array]]:
    """Units that some distances may be in, and all distances with those in metres."""
    for per_metre in PER_METRE.values():
        distance = trial.network.distance.copy()
        distance[rows] /= per_metre
        if np.median(distance[rows]) >= SHORTEST:
            yield per_metre, distance


def _there(trial: Trial, stop: str | None, distance: Array) -> Trial:
    """The trial with a stop, or where there is none everything, located anew."""
    return relocated(trial, distance) if stop is None else restarted(trial, stop, distance)


def _again(trial: Trial, log: Log, rows: Rows, distance: Array) -> Trial:
    """The trial with the stops of some readings, or where that fits better all, located anew.

    Where many are in another unit, the points that they end at are in wrong places too.
    """
    known = {*trial.network.poses}
    stops = [stop for stop in dict.fromkeys(log.station[row] for row in rows) if stop in known]
    alone = all_restarted(trial, stops, distance)
    if len(stops) < MANY_STOPS * len(known):
        return alone
    ways = (alone, relocated(trial, distance))
    return min(ways, key=lambda way: _robust_cost(way, distance))


MANY_STOPS = 0.2
"""Share of the stops in another unit from which the points may be in wrong places. A judgement:
the robust solution holds the points where most of their readings are."""


def _block(trial: Trial, log: Log, stations: list[str], per_metre: float) -> Rows:
    """The run of readings that fit in the unit, with all readings of some stations at first."""
    net = trial.network
    rows = np.flatnonzero(np.isin(np.array(log.station), stations))
    for _ in range(2):
        distance = net.distance.copy()
        distance[rows] /= per_metre
        there = _again(trial, log, rows, distance).start
        P = there.points.copy()
        state = there.poses[net.mark_pose]
        # A mark whose readings are in both units is where the stop says, not where they say.
        P[net.mark] = state[:, :2] + rotate(state[:, 2], net.rig[net.mark_rig])
        D = np.linalg.norm(P[net.first] - P[net.second], axis=1)
        now, then = (
            np.minimum(((shown - D) / COARSE) ** 2, 10.0**2)
            for shown in (net.distance, net.distance / per_metre)
        )
        run = longest_gain((now - then)[log.order])
        rows = log.order[slice(*run)] if run else np.empty(0, dtype=np.intp)
    return rows


COARSE = 0.02
"""Metres that are no misfit while units are told apart: a mark may be some centimetres off its rig
point, and another unit makes metres."""


BEFORE_ALL = 1e12
"""Gain that puts a unit before what the linearised survey says of the same readings: that is no
guide to readings three times too long."""
SHORTEST = 0.5
"""Median distance, in metres, below which no survey of a room is: readings in another unit would
be of a table."""


def _robust_cost(trial: Trial, distance: Array) -> float:
    net, P = trial.network, trial.start.points
    off = (distance - np.linalg.norm(P[net.first] - P[net.second], axis=1)) / net.sigma
    return float(CAUCHY**2 * np.log1p((off / CAUCHY) ** 2).sum())


def _lead(
    extent: str,
    subject: tuple[str, ...],
    rows: Rows,
    distance: Array,
    per_metre: float,
    gain: float,
    places: float,
    log: Log | None = None,
) -> Lead:
    def build(base: Trial) -> Trial:
        effects = (*base.effects, Effect("scale", rows, per_metre - 1))
        sigma = base.network.sigma.copy()
        sigma[rows] *= per_metre  # what was read is exact to so many of its own units
        base = replace(base, network=replace(base.network, sigma=sigma))
        if log is not None:
            return replace(_again(base, log, rows, distance), effects=effects)
        stop = subject[0] if extent == "station" and subject[0] in base.network.poses else None
        return replace(_there(base, stop, distance), effects=effects)

    gain += BEFORE_ALL
    cost = 2 * len(rows) * float(np.log(per_metre))  # of the wider errors, as for all errors
    return Lead("scale", extent, subject, rows, gain, places, build, effect_size, cost=cost)
