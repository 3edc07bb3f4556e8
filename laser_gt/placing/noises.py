"""The noise of each scanner, from neighbouring stops laid over each other."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from laser_gt.matching.judgement import MatchSettings, match
from laser_gt.matching.local import residuals
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.noise import RangeNoise, Residuals, noise_from, type_limits
from laser_gt.scans.planar import between
from laser_gt.scans.scan import Sweep
from validation.pieces.results import kept_result
from validation.poses.angles import Array

MOST = 30
"""Pairs that are compared. A judgement: with some 300 points each, variances are known to 2 %, and
correlations of 0.015 show."""


@kept_result()
def scanner_noise(
    sweeps: Sequence[Prepared], poses: Array, settings: MatchSettings | None = None
) -> dict[str, RangeNoise]:
    """The noise of each scanner by its name; none of those that too few pairs show.

    Parameters
    ----------
    sweeps : sequence of Prepared
        One for each stop.
    poses : (n, 3) array
        Initial guess of their frames.
    settings : MatchSettings, optional
        How well that is known from stop to stop.

    Notes
    -----
    Neighbours in the row of stops, spread evenly; what is refuted, or what may be wrong, tells
    nothing.
    """
    found: dict[str, list[Residuals]] = {}
    views = [view for one in sweeps for view in one.sweep.views]
    limits = {view.scan.sensor: type_limits(view.scan) for view in views}
    spread = np.unique(np.linspace(0, max(len(sweeps) - 2, 0), MOST).round().astype(int))
    for start in spread[spread < len(sweeps) - 1].tolist():
        first, second = sweeps[start], sweeps[start + 1]
        one = match(first, second, between(poses[start], poses[start + 1]), settings)
        if not one.used:
            continue
        off = residuals(first.surface, second.surface, one.by_scans[0])
        last = 0
        for view in second.sweep.views:
            part = slice(last, last + len(view.scan.points))
            last = part.stop
            found.setdefault(view.scan.sensor, []).append(Residuals(off.values[part], off.window))
    noises = {sensor: noise_from(ones, limits[sensor]) for sensor, ones in found.items()}
    return {sensor: noise for sensor, noise in noises.items() if noise is not None}


def with_noise(
    sweeps: Sequence[Prepared], noises: Mapping[str, RangeNoise], stated: Mapping[str, float]
) -> tuple[Prepared, ...]:
    """The sweeps with the noise of their scanners; its total is the stated one, if there is one."""
    return tuple(Prepared(_noisy(one.sweep, noises, stated)) for one in sweeps)


def _noisy(sweep: Sweep, noises: Mapping[str, RangeNoise], stated: Mapping[str, float]) -> Sweep:
    """A sweep with the noise of its scanners."""
    views = []
    for view in sweep.views:
        scan = view.scan
        noise = noises.get(scan.sensor)
        if noise is not None:
            total = stated.get(scan.sensor, noise.total)
            scan = replace(
                scan,
                sigma=total,
                shared_sigma=noise.shared * total / noise.total,
                shared_beams=noise.length,
            )
        views.append(replace(view, scan=scan))
    return replace(sweep, views=tuple(views))
