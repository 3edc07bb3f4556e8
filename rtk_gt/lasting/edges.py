"""Where an error begins or ends, as the motion shows it beside the distances of the whole drive."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rtk_gt.lasting.causes import evidence, rotations_within
from rtk_gt.lasting.contrasts import Contrasts, contrasts, sides_of
from rtk_gt.lasting.jumps import ALIKE
from rtk_gt.lasting.lacking_fixes import own_interval
from rtk_gt.receivers.fixes import Bools
from validation.pieces.results import kept_result
from validation.poses.angles import Array

NEAR = 30.0
"""Gain below the greatest within which the jump may be elsewhere: 5 standard deviations."""


@dataclass(frozen=True)
class Motion:
    """What shows the motion of the vehicle, at more times than all receivers have a fix together.

    Parameters
    ----------
    times : (m,) array
        Seconds.
    positions : (m, c, 3) array
        Of some antennas, metres; NaN where one has none.
    headings : (m,) array
        Of something fixed to the vehicle, radians.
    columns : tuple of int
        Of these antennas.
    """

    times: Array
    positions: Array
    headings: Array
    columns: tuple[int, ...]


@dataclass(frozen=True)
class View:
    """A motion with its contrasts, and the intervals of it that are looked at."""

    motion: Motion
    seen: Contrasts
    looked_at: Bools

    def own(self, cause: tuple[int, ...]) -> tuple[int, ...]:
        """Columns of those of some receivers that it shows."""
        return tuple(k for k, name in enumerate(self.motion.columns) if name in cause)


def views_of(motions: Sequence[Motion]) -> list[View]:
    """All motions that show something: the first one's, and what others show about its pauses.

    Of the first one by lines all intervals are looked at; by the guess of neighbours those that it
    tells, by as many of them as there are.
    """
    views: list[View] = []
    for motion in motions:
        first = motion is motions[0]
        sides = sides_of(motion.times, motion.positions)
        looked = [sides[0], *(one for one in reversed(sides) if one.guessed)] if sides else []
        found = [contrasts(motion.times, motion.positions, motion.headings, one) for one in looked]
        if first and (not found or found[0] is None):
            break
        looked_at = np.ones(len(motion.times) - 1, dtype=bool)
        if not first:
            whole, middle = motions[0], (motion.times[1:] + motion.times[:-1]) / 2
            at = np.searchsorted(whole.times, middle) - 1
            looked_at = (at >= 0) & (at < len(whole.times) - 1)
            looked_at[looked_at] &= ~views[0].seen.moving[at[looked_at]]
        for one in found:
            if one is None:
                continue
            here = looked_at if first and not one.guessed else looked_at & one.moving
            views.append(View(motion, one, here))
            if one.guessed:
                # The next ones look nearer by, and see less.
                looked_at = looked_at & ~one.moving
    return views


@dataclass(frozen=True)
class Edge:
    """Where an error begins or ends: times of the fixes on both sides, and what the motion says.

    ``information`` (3, 3) on the size and ``right`` (3,), that times the size; ``window``, what it
    may be between.
    """

    before: float
    after: float
    information: Array
    right: Array
    gain: float
    window: tuple[float, float]


@kept_result()
def edge_of(
    times: Array,
    views: Sequence[View],
    cause: tuple[int, ...],
    name: str,
    gains: Array,
    known: tuple[Array, Array],
) -> Edge:
    """The interval at which motion and distances show a jump of a known size best.

    ``gains`` (n + 1,) are those of the distances; the size is known with its covariance.
    """
    shown = [view for view in views if view.own(cause)]
    # Over a pause of the first view what others show of these receivers counts.
    rest = shown[0].motion
    hidden = np.zeros(len(rest.times) - 1, dtype=bool)
    for view in shown[1:]:
        middle = (view.motion.times[1:] + view.motion.times[:-1])[view.looked_at] / 2
        hidden[np.searchsorted(rest.times, middle) - 1] = True
    first = replace(shown[0], looked_at=shown[0].looked_at & ~hidden)
    edges = [_edge_by(times, view, cause, name, gains, known) for view in [first, *shown[1:]]]
    if all(edge is None for edge in edges):
        anywhere = replace(shown[0], looked_at=np.ones(len(hidden), dtype=bool))
        edges = [_edge_by(times, anywhere, cause, name, gains, known, np.inf)]
    found = [edge for edge in edges if edge is not None]
    best = max(found, key=lambda edge: edge.gain)
    likely = [edge.window for edge in found if edge.gain > best.gain - ALIKE]
    return replace(best, window=(min(b for b, _ in likely), max(e for _, e in likely)))


def _edge_by(
    times: Array,
    view: View,
    cause: tuple[int, ...],
    name: str,
    gains: Array,
    known: tuple[Array, Array],
    near: float = NEAR,
) -> Edge | None:
    """The same by one view; None where the distances show none that it looks at."""
    motion, own = view.motion, view.own(cause)
    # Of each interval of the motion the first epoch of all receivers after it.
    after = np.minimum(np.searchsorted(times, motion.times[1:] - 1e-6), len(gains) - 1)
    by_distance = gains[after] - gains.max()
    rows = np.flatnonzero((by_distance > -near) & view.looked_at)
    if len(rows) == 0:
        return None
    turns = rotations_within(motion.headings, rows)
    right, information = evidence(view.seen, own, rows, name == "last")
    right = np.einsum("nij,nj->ni", turns, right)
    information = np.einsum("nij,njk,nlk->nil", turns, information, turns)
    size, weight = known[0], np.linalg.inv(known[1])
    best = np.linalg.solve(information + weight, (right + weight @ size)[..., None])[..., 0]
    off = best - size
    gain = 2 * (best * right).sum(1) - np.einsum("ni,nij,nj->n", best, information, best)
    gain = gain - np.einsum("ni,ij,nj->n", off, weight, off) + by_distance[rows]
    at = int(gain.argmax())
    begin, end = own_interval(motion.positions, own, int(rows[at]))
    likely = rows[gain > gain[at] - ALIKE]
    return Edge(
        float(motion.times[begin]), float(motion.times[end]), information[at], right[at],
        float(gain[at]), (float(motion.times[likely[0]]), float(motion.times[likely[-1] + 1])),
    )  # fmt: skip
