"""Which slip of the pen would explain that hardly any scans come to lie on each other."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laser_gt.campaign.inputs import LaserInputs
from laser_gt.matching.judgement import MatchSettings, match
from laser_gt.placing.guesses import guess_deviations
from laser_gt.placing.mounts import mount_slips
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.planar import between, compose
from laser_gt.scans.scan import Scan, Sweep
from validation.poses.angles import Array

PAIRS = 10
"""Pairs of stops that are tried, at most: a second of work for each slip."""
TURN_WEIGHT = 2.0
"""Metres that a radian between two stops counts for: half a field of view of half a turn, and half
of a room."""
MORE = 0.3
"""By how much the share of these pairs that are accepted must rise with the slip put right. Of a
thousand pairs with no right answer none is accepted (`benchmarks/laser_judgement.py`), so that
three of ten are no chance; a robot that drives straight on is its own mirror image, so that some
are accepted with a slip, too."""


@dataclass(frozen=True)
class Slip:
    """What was mixed up.

    Parameters
    ----------
    text : str
        In words.
    share : float
        Of the pairs tried that are accepted with it put right.
    """

    text: str
    share: float


def likely_slip(inputs: LaserInputs, settings: MatchSettings) -> Slip | None:
    """What was mixed up in mount, scans or odometry; None where no slip explains it.

    Parameters
    ----------
    inputs : LaserInputs
        What the files say.
    settings : MatchSettings
        How pairs are matched, with the standard deviation of the guess from stop to stop.

    Notes
    -----
    Each slip is put right and stops near each other are matched anew. Where several make as many
    pairs come to lie on each other, all of them are named.
    """
    odometry = inputs.odometry
    if odometry is None or len(inputs.sweeps) < 4:
        return None
    pairs, sigmas = _nearest(odometry), (settings.guess_length, settings.guess_angle)
    sweeps = inputs.sweeps

    def share(poses: Array, seen: Sequence[Prepared]) -> float:
        good = []
        for i, j in pairs:
            length, angle = guess_deviations(poses, i, j, sigmas).tolist()
            form = replace(settings, guess_length=length, guess_angle=angle)
            found = match(seen[i], seen[j], between(poses[i], poses[j]), form)
            good.append(found.verdict == "accepted")
        return float(np.mean(good))

    usual = share(compose(odometry, inputs.mount), sweeps)
    if usual > 1 - MORE:
        return None
    tried = {
        f"The mount of the laser. {said}": share(compose(odometry, meant), sweeps)
        for said, meant in mount_slips(inputs.mount).items()
    }
    mirrored = compose(odometry * np.array([1.0, -1.0, -1.0]), inputs.mount)
    tried["The odometry. It is mirrored: y and theta have the wrong sign"] = share(mirrored, sweeps)
    for said, changed in _SCANS.items():
        other = _changed(sweeps, changed)
        if other is not None:
            tried[f"The scans. {said}"] = share(compose(odometry, inputs.mount), other)
    best = max(tried.values())
    if best < usual + MORE:
        return None
    likely = [said for said, good in tried.items() if good >= best]
    text = (
        f"of the scans of stops near each other {usual:.0%} come to lie on each other as the files "
        f"have them, and {best:.0%} with this put right: {'. Or: '.join(likely)}"
    )
    return Slip(text, best)


def _nearest(odometry: Array) -> list[tuple[int, int]]:
    """The pairs of stops whose scanners look at much the same, the nearest first, at most `PAIRS`.

    Distance and turn between two stops are the same for a mount that is wrong, or a mirror image.
    """
    first, second = np.triu_indices(len(odometry), 1)
    step = between(odometry[first], odometry[second])
    apart = np.hypot(step[:, 0], step[:, 1]) + TURN_WEIGHT * np.abs(step[:, 2])
    nearest = np.argsort(apart + 0.1 * np.sqrt(second - first), kind="stable")[:PAIRS]
    return list(zip(first[nearest].tolist(), second[nearest].tolist(), strict=True))


def _reversed(scan: Scan) -> Scan:
    return replace(scan, ranges=scan.ranges[::-1].copy())


def _narrower(scan: Scan) -> Scan:
    return replace(scan, angles=scan.angles / 2)


_SCANS: dict[str, Callable[[Scan], Scan]] = {
    "Their beams are in reverse order": _reversed,
    "Their field of view was stated twice as wide as it is": _narrower,
}


def _changed(
    sweeps: Sequence[Prepared], changed: Callable[[Scan], Scan]
) -> tuple[Prepared, ...] | None:
    """The sweeps of one scanner with their scans changed; None for several scanners."""
    if any(len(one.sweep.views) > 1 for one in sweeps):
        return None
    found = []
    for one in sweeps:
        (view,) = one.sweep.views
        found.append(Prepared(Sweep((replace(view, scan=changed(view.scan)),), one.name)))
    return tuple(found)
