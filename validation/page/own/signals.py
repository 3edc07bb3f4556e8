"""Signals of trajectories for the page, and the delay of a part: made in a process beside it."""

import time
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from validation.campaign.folder import Campaign, Published, load_campaign
from validation.errors import GtvalError
from validation.figures.thinning import rows_shown
from validation.page.own.moving import changed, origins
from validation.poses.angles import Array, circular_mean, wrap
from validation.poses.trajectory import Trajectory
from validation.trajectories.clock.correlation import correlate_headings
from validation.trajectories.clock.estimate import estimate_clock
from validation.trajectories.clock.result import ClockEstimate
from validation.trajectories.clock.search import FEWEST_ROWS
from validation.trajectories.formats import read_trajectory
from validation.trajectories.motion import motion_at
from validation.trajectories.settings import TimeSettings

PLACES = 500
"""Along a plot: there are at most some thousands of points of each signal."""
NEAR = 2.0
"""Seconds to both sides of where a person put a part, in which its delay is sought: what the
correlation of AD2.3 looked through."""


@lru_cache(maxsize=16)
def _read(path: Path, entry_json: str, system: str, _changed: tuple[int, int]) -> Trajectory:
    """A trajectory from above; read again only where its file has changed."""
    if not entry_json:
        return read_trajectory(path, system=system).planar()
    entry = Published.model_validate_json(entry_json)
    return read_trajectory(
        path,
        system=system,
        format=entry.format or None,
        unit=entry.unit,
        body=entry.body or None,
        topic=entry.topic or None,
    ).planar()


def _trajectory(campaign: Campaign, system: str) -> Trajectory:
    """The trajectory of a system.

    Raises
    ------
    GtvalError
        If there is none, or its file is bad.
    """
    origin = origins(campaign).get(system)
    if origin is None:
        raise GtvalError("there is no such trajectory in the campaign")
    told = "" if origin.entry is None else origin.entry.model_dump_json()
    return _read(origin.path, told, system, changed(origin.path))


def signals_told(
    folder: str, reference: str, source: str, span: tuple[float, float] | None
) -> dict[str, Any]:
    """The signals of a reference and a source, thinned; and parts of the source that turn.

    Parameters
    ----------
    folder : str
        Of the campaign.
    reference, source : str
        Systems.
    span : (float, float), optional
        Seconds since the first pose of the reference that are wanted; all by default.

    Returns
    -------
    dict
        Times in seconds since the reference's first pose, headings in degrees without jumps,
        those of the source turned to the reference's, turn rates in degrees a second, speeds.

    Raises
    ------
    GtvalError
        If there is no such trajectory, or a file is bad.
    """
    campaign = load_campaign(Path(folder))
    true, seen = _trajectory(campaign, reference), _trajectory(campaign, source)
    begin = float(true.times[0])
    parts = []
    try:
        found = correlate_headings(true, seen).parts
        own = seen.times_since(true.epoch)
        parts = [
            [round(p.first_s - begin, 3), round(p.last_s - begin, 3)]
            for p in found
            if ((own >= p.first_s) & (own <= p.last_s)).sum() >= FEWEST_ROWS
        ]
    except GtvalError:
        pass  # too little in common, or no headings: no part is proposed
    return {
        "reference": _signal(true, true, begin, span),
        "source": _signal(seen, true, begin, span),
        "span": [0.0, float(true.times[-1]) - begin],
        "own_span": (seen.times_since(true.epoch)[[0, -1]] - begin).tolist(),
        "parts": parts,
    }


def _signal(
    one: Trajectory, true: Trajectory, begin: float, span: tuple[float, float] | None
) -> Mapping[str, Any]:
    """A trajectory as columns, no longer than a plot is wide; None where it has a gap."""
    times = one.times_since(true.epoch) - begin
    motion = motion_at(one, one.times)
    columns = {"speed": motion.speed, "turn": np.degrees(motion.turn_rate)}
    columns["heading"] = np.full(len(one), np.nan)
    if one.has_orientation:
        columns["heading"] = np.degrees(_turned(one, true))
    rows = np.arange(len(one))
    if span is not None:
        rows = rows[(times >= span[0]) & (times <= span[1])]
    if len(rows):
        kept = np.column_stack([np.nan_to_num(columns[name][rows]) for name in columns])
        rows = rows[rows_shown(kept, PLACES)]
    told: dict[str, Any] = {name: _listed(values[rows], 3) for name, values in columns.items()}
    told["times"] = np.round(times[rows], 4).tolist()
    # Of those left out, too: what is far apart here need not be a gap.
    stretch = np.cumsum(np.diff(times, prepend=times[0]) > one.gap)
    told["breaks"] = np.flatnonzero(np.diff(stretch[rows])).tolist()
    return told


def _turned(one: Trajectory, true: Trajectory) -> Array:
    """(n,) headings without jumps, turned by one angle to those of the reference."""
    if one is true or not true.has_orientation:
        return np.unwrap(one.headings)
    there = np.interp(one.times_since(true.epoch), true.times, np.unwrap(true.headings))
    apart = wrap(one.headings - there)
    return np.asarray(there + wrap(apart - circular_mean(apart)))


def _listed(values: Array, decimals: int) -> list[float | None]:
    """Numbers for JSON; None where there is none."""
    return [round(v, decimals) if np.isfinite(v) else None for v in values.tolist()]


def clock_told(folder: str, reference: str, source: str) -> dict[str, Any]:
    """The delay of a source as a whole, as a run and `gtval sync` find it.

    Raises
    ------
    GtvalError
        If there is no such trajectory, or a file is bad.
    """
    campaign = load_campaign(Path(folder))
    settings = campaign.section("time", TimeSettings)
    found = estimate_clock(
        _trajectory(campaign, reference),
        _trajectory(campaign, source),
        window=settings.window,
        confidence=campaign.settings.comparison.confidence,
    )
    return _estimate_told(found, 0.0)


def part_told(
    folder: str, reference: str, source: str, span: tuple[float, float], moved: float
) -> dict[str, Any]:
    """The delay of a part of a source, sought near where a person put it.

    Parameters
    ----------
    folder, reference, source
        As of `signals_told`.
    span : (float, float)
        Of the part: seconds since the reference's first pose, by the source's own stamps.
    moved : float
        Seconds that are added to the stamps before it is looked for.

    Raises
    ------
    GtvalError
        If the part has too few poses, or the reference none near it.
    """
    started = time.perf_counter()
    campaign = load_campaign(Path(folder))
    true, seen = _trajectory(campaign, reference), _trajectory(campaign, source)
    times = seen.times_since(true.epoch) - true.times[0]
    part = seen.select((times >= span[0]) & (times <= span[1]))
    if len(part) < FEWEST_ROWS:
        raise GtvalError(f"this part has {len(part)} poses of '{source}'; {FEWEST_ROWS} are needed")
    own = true.times - true.times[0]
    low, high = span[0] + moved - 2 * NEAR, span[1] + moved + 2 * NEAR
    around = true.select((own >= low) & (own <= high))
    if len(around) < FEWEST_ROWS:
        raise GtvalError(f"'{reference}' has no poses near this part")
    shifted = part.shifted(moved)
    confidence = campaign.settings.comparison.confidence
    found = estimate_clock(around, shifted, window=NEAR, confidence=confidence)
    told = _estimate_told(found, moved)
    return {**told, "milliseconds": round(1e3 * (time.perf_counter() - started))}


def _estimate_told(found: ClockEstimate, moved: float) -> dict[str, Any]:
    """An estimate, in seconds that are added to the stamps as they are."""

    def known(value: float) -> float | None:
        return round(moved + value, 6) if np.isfinite(value) else None

    return {
        "verdict": found.verdict,
        "reason": found.reason,
        "delay": known(found.delay_s),
        "low": known(found.low_s),
        "high": known(found.high_s),
        "confidence": found.confidence,
        "poses": found.poses,
    }
