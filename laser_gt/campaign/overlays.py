"""Scan j laid over scan i through the surveyed poses, for any pair: AD2.3's own look at its mount.

The document took the first scan into the robot frame, through the validation poses into the other
robot frame, and from there into the second scan's; for the stops 13 and 14, and 6 and 2, the two
did not come to lie on each other.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from laser_gt.campaign.outcome import LaserOutcome
from laser_gt.matching.verdicts import Match
from laser_gt.scans.nearest import NearestGrid
from laser_gt.scans.planar import between, compose, transform
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.results import Figure, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

Pair = tuple[str, str]
_SHARED = 0.3
"""Metres: points farther from the other scan show what it did not see. A judgement, as a wrong
mount shifts walls by a decimetre."""
MOST = 2
"""Pairs that are shown where none was chosen: those between which the robot turned most."""


@dataclass(frozen=True)
class Overlay:
    """Two scans over each other in several ways.

    Parameters
    ----------
    pair : (str, str)
        The stops.
    poses : mapping of str to (3,) array
        The second laser frame in the first one's, by where that comes from: 'stated mount' and
        'found mount' through the surveyed poses, 'matched' from the scans alone.
    gaps : mapping of str to float
        Median distance of the second scan's points from the first scan, metres, of those that
        come within 0.3 m of it; NaN where none does.
    """

    pair: Pair
    poses: Mapping[str, Array]
    gaps: Mapping[str, float]


def chosen_pairs(outcome: LaserOutcome, asked: Sequence[Pair] = ()) -> list[Pair]:
    """The pairs that were asked for, else those of the settings, else those with most turn.

    Raises
    ------
    GtvalError
        Naming the stops of a pair that were not scanned, or not surveyed.
    """
    pairs = list(asked) or list(outcome.settings.overlay_pairs)
    scanned, surveyed = set(outcome.inputs.stops), set(outcome.survey.stops)
    for pair in pairs:
        for known, what in ((scanned, "scan"), (surveyed, "surveyed pose")):
            if missing := [stop for stop in pair if stop not in known]:
                said = ", ".join(missing)
                raise GtvalError(f"overlay {'-'.join(pair)}: there is no {what} of stop {said}")
    if pairs:
        return pairs
    turned = sorted(_accepted(outcome).values(), key=lambda match: -abs(match.pose[2]))
    both = [(m.reference, m.moving) for m in turned if {m.reference, m.moving} <= surveyed]
    return list(dict.fromkeys(both))[:MOST]


def _accepted(outcome: LaserOutcome) -> dict[Pair, Match]:
    """The first accepted match of each pair, of any engine."""
    found: dict[Pair, Match] = {}
    for matching in outcome.matchings.values():
        for match in matching.used:
            found.setdefault((match.reference, match.moving), match)
    return found


def overlays(outcome: LaserOutcome, pairs: Sequence[Pair]) -> list[Overlay]:
    """Each pair by the stated mount, by the one found, and as matched."""
    where = dict(zip(outcome.survey.stops, outcome.survey.poses, strict=True))
    mounts = {"stated mount": outcome.inputs.mount}
    if outcome.mount_check is not None:
        mounts["found mount"] = outcome.mount_check.found.mount
    matched = _accepted(outcome)
    found = []
    for first, second in pairs:
        poses = {
            name: between(compose(where[first], mount), compose(where[second], mount))
            for name, mount in mounts.items()
        }
        if (first, second) in matched:
            poses["matched"] = matched[first, second].pose
        elif (second, first) in matched:
            poses["matched"] = between(matched[second, first].pose, np.zeros(3))
        sweeps = outcome.inputs.by_stop
        points = (sweeps[first].sweep.points, sweeps[second].sweep.points)
        gaps = {name: median_gap(*points, pose) for name, pose in poses.items()}
        found.append(Overlay((first, second), poses, gaps))
    return found


def median_gap(reference: Array, moving: Array, pose: Array) -> float:
    """Median distance, metres, of points (n, 2) at a pose from the nearest of points (m, 2)."""
    squares = NearestGrid(reference).squared_distance(*transform(pose, moving).T)
    near = squares[squares < _SHARED**2]
    return float(np.sqrt(np.median(near))) if len(near) else np.nan


def overlay_table(shown: Sequence[Overlay]) -> Table:
    """How far apart the scans lie, before and after."""
    ways = list(dict.fromkeys(way for one in shown for way in one.gaps))
    columns = ["pair"]
    for way in ways:
        columns += [f"{way}: gap [mm]", "x [m]", "y [m]", "theta [rad]"]
    rows: list[list[str | int | float | None]] = []
    for one in shown:
        row: list[str | int | float | None] = ["-".join(one.pair)]
        for way in ways:
            pose = one.poses.get(way)
            gap = one.gaps.get(way, np.nan)
            row.append(1e3 * gap if np.isfinite(gap) else None)
            row += [None] * 3 if pose is None else [float(v) for v in pose]
        rows.append(row)
    return Table(
        "Scans over each other",
        columns,
        rows,
        ["", *[".1f", ".4f", ".4f", ".4f"] * len(ways)],
        "Gap: median distance of the second scan's points from the first scan. Through the "
        "surveyed poses with the mount as stated and as found; as matched: from the scans alone.",
    )


def overlay_figure(outcome: LaserOutcome, shown: Sequence[Overlay]) -> Figure:
    """The picture of all of them."""

    def draw() -> "MatplotlibFigure":
        from laser_gt.campaign.figures import overlay_picture  # noqa: PLC0415

        drawn = [(one.pair, one.poses, one.gaps) for one in shown]
        return overlay_picture(drawn, outcome.inputs.by_stop)

    names = ", ".join("-".join(one.pair) for one in shown)
    return Figure(
        "laser_mount_overlay",
        f"Scans of two stops ({names}) laid over each other through the surveyed poses, with the "
        "stated mount and with the one found, and as matched without the survey.",
        "Where the mount or a surveyed pose is wrong, walls appear twice.",
        draw,
    )
