"""All cells of a table of sources against stops, judged with one set of noise levels.

Each stop has two cells, its position and its heading. In each cell every source (and every sensor
with two or more systems there) is a suspect: its gain is how much better the rest would agree
without it. Where noise is not stated, a suspect is measured against its own distances at the other
stops, so that its test is an F test that knows what it does not know.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import special

from validation.explain.fitting.noise import (
    DIMENSIONS,
    ROUNDING,
    Mask,
    determinant,
    inverse,
    regular,
)
from validation.explain.sources.tails import NORMAL, STATED, Tails, weigh_tails
from validation.explain.sources.verdicts import (
    CELLS,
    Sources,
    Verdict,
    differences,
    reason_for,
)
from validation.poses.angles import Array

MARGIN = 6.0
"""Two culprits are told apart if one's removal leaves a chi-squared this much smaller: odds of 20
to 1, as 2 log 20 = 5.99. The level of one in twenty is that of all intervals."""

Rows = npt.NDArray[np.intp] | slice
EVERY = slice(None)
_FEW = 4.0
"""Degrees of freedom of a noise level that the suspect's own other stops do not show. A judgement:
as little as two stops would show, so that only a gross error is taken for one."""


@dataclass(frozen=True)
class _Gains:
    """What each of G suspects explains at n stops, in one kind of cell.

    ``gain`` (G, n) chi-squared that its removal takes away, ``valid`` (G, n) whether it can be
    asked, and ``size`` (G, n) determinant of the standard deviations of its distance from the
    rest.
    """

    gain: Array
    valid: Mask
    size: Array


class JudgedTable:
    """The questions asked of a table, and their answers.

    Parameters
    ----------
    sources : Sources
        Two or more.
    noise : (S, 2) array
        Standard deviations of those without stated covariances, in metres and radians.
    used : (S, n, 2) array of bool, optional
        Cells from which the noise is known; where None, the noise is taken as exact.
    false_alarm : float
        Chance of any verdict in a table of good poses.

    Notes
    -----
    The chance of a false alarm is shared over all questions (Bonferroni), half to positions and
    half to headings, and in each kind in proportion to the size of the suspect's noise, as
    weighted tests allow (Genovese, Roeder and Wasserman (2006), "False discovery control with
    p-value weighting"). That is the most powerful share where a gross error of any size is
    equally likely in every source: a precise source's is many standard deviations anyway.
    """

    def __init__(
        self, sources: Sources, noise: Array, used: Mask | None, false_alarm: float
    ) -> None:
        self.sources, self.noise = sources, noise
        self.groups: list[tuple[int, ...]] = [(s,) for s in range(len(sources.names))]
        for names in sources.sensors.values():
            inside = tuple(sources.names.index(name) for name in names if name in sources.names)
            if len(inside) > 1:
                self.groups.append(inside)
        self._member = np.zeros((len(self.groups), len(sources.names)))
        for row, group in enumerate(self.groups):
            self._member[row, list(group)] = 1.0
        self._prepared = [self._prepare(kind) for kind in range(2)]
        self._first = [self._gains(kind, sources.present) for kind in range(2)]
        shares = [self._share(self._first[kind]) for kind in range(2)]
        self.share = np.stack(shares, -1)
        self.questions = max(round(sum(self._count(one) for one in self._first)), 1)
        self.false_alarm = false_alarm
        self._calibrate(used)

    def _prepare(self, kind: int) -> tuple[Array, Array]:
        """(S, n, d) values from the validation's, and (S, n, d, d) weights; 0 if missing."""
        sources, d = self.sources, 2 - kind
        part = slice(0, 2) if kind == 0 else slice(2, 3)
        covariances = np.array(
            np.broadcast_to(
                (self.noise[:, kind] ** 2)[:, None, None, None] * np.eye(d),
                (*sources.present.shape, d, d),
            )
        )
        stated = sources.stated
        covariances[stated] = sources.covariances[stated][..., part, part]
        there = sources.present
        covariances[~there] = np.eye(d)
        weights = inverse(regular(covariances)) * there[..., None, None]
        values = differences(sources.poses, sources.poses[:1], kind)
        return np.where(there[..., None], values, 0.0), np.asarray(weights)

    def _gains(self, kind: int, there: Mask, stops: Rows = EVERY) -> _Gains:
        """What each suspect explains, among the sources (S, n) that are there, at some stops."""
        values, weights = (one[:, stops] for one in self._prepared[kind])
        there = there[:, stops]
        weights = weights * there[..., None, None]
        pulls = np.einsum("snij,snj->sni", weights, values)
        own = np.einsum("gs,snij->gnij", self._member, weights)
        own_pull = np.einsum("gs,sni->gni", self._member, pulls)
        rest, rest_pull = _without(self._member, weights, pulls)
        count, inside = there.sum(0), self._member @ there
        need = np.array([min(len(group), 2) for group in self.groups])[:, None]
        valid = (inside >= need) & (inside < count)
        eye = np.eye(values.shape[-1])
        own_covariance = inverse(regular(np.where(valid[..., None, None], own, eye)))
        rest_covariance = inverse(regular(np.where(valid[..., None, None], rest, eye)))
        apart = np.einsum("gnij,gnj->gni", own_covariance, own_pull)
        apart = apart - np.einsum("gnij,gnj->gni", rest_covariance, rest_pull)
        both = regular(own_covariance + rest_covariance)
        gain = np.einsum("gni,gnij,gnj->gn", apart, inverse(both), apart)
        size = np.sqrt(determinant(both))
        return _Gains(np.where(valid, gain, 0.0), valid, np.where(valid, size, 0.0))

    def _asked(self, found: _Gains) -> Array:
        """(G, n) 1 for each question; of two sources at a stop only one is asked."""
        pair = self.sources.present.sum(0) == 2
        return np.where(pair, 0.5, 1.0) * found.valid

    def _count(self, found: _Gains) -> float:
        return float(self._asked(found).sum())

    def _share(self, found: _Gains) -> Array:
        """(G, n) share of each question in the chance of a false alarm of the whole table."""
        weight = self._asked(found) * found.size
        total = float(weight.sum())
        return weight / total / 2 if total > 0 else weight

    def _calibrate(self, used: Mask | None) -> None:
        """Mean square of every suspect's distance at the other stops, and its freedom (G, n, 2)."""
        shape = self.share.shape
        self._factor, self._dof = np.ones(shape), np.full(shape, np.inf)
        if used is None or self.sources.known:
            return
        for kind in range(2):
            found = self._gains(kind, used[..., kind])
            d = float(DIMENSIONS[kind])
            lost = float(self.sources.lost_freedom[:, kind].max())
            others = found.gain.sum(1, keepdims=True) - found.gain
            dof = d * (found.valid.sum(1, keepdims=True) - found.valid) - lost
            known = dof >= d
            self._factor[..., kind] = np.where(known, others / np.maximum(dof, 1.0), 1.0)
            self._dof[..., kind] = np.where(known, np.maximum(dof, 1.0), _FEW)
        self._factor = np.maximum(self._factor, 1e-12)

    def weigh_tails(self, bad: Mask) -> Tails:
        """Tails, by all cells: those left out for their size are what tails are of.

        A cell (S, n, 2) that is ``bad`` counts itself, but not in what the others at its stop are
        compared with.
        """
        gains, valid = [], []
        for kind in range(2):
            there = self.sources.present & ~bad[..., kind]
            found = self._gains(kind, there)
            gain, asked = found.gain.copy(), found.valid.copy()
            for s in np.flatnonzero(bad[..., kind].any(1)):
                rows = np.flatnonzero(bad[s, :, kind])
                own = there.copy()
                own[s, rows] = True
                alone = self._gains(kind, own)
                gain[s, rows], asked[s, rows] = alone.gain[s, rows], alone.valid[s, rows]
            gains.append(gain)
            valid.append(asked)
        both = np.stack(gains, -1), np.stack(valid, -1)
        prior = STATED if self.sources.known else NORMAL
        return weigh_tails(*both, len(self.sources.names), prior)

    def rate(self, tails: Tails) -> float:
        """Chance of any verdict in a table without gross errors whose tails are such."""
        levels = np.minimum(self.false_alarm * self.share, 1.0)
        limits, asked = np.full(levels.shape, np.inf), np.zeros(levels.shape)
        for kind in range(2):
            d, one = float(DIMENSIONS[kind]), np.maximum(levels[..., kind], 1e-300)
            dof = self._dof[..., kind]
            exact = np.isinf(dof)
            with_dof = d * special.fdtri(d, np.where(exact, 1.0, dof), 1 - one)
            limit = np.where(exact, special.chdtri(d, one), with_dof) * self._factor[..., kind]
            asked[..., kind] = self._asked(self._first[kind])
            limits[..., kind] = np.where(asked[..., kind] > 0, limit, np.inf)
        return tails.rate(limits, asked, self.false_alarm)

    def chance_by_tails(self, one: Verdict, tails: Tails) -> float:
        """Chance of such a disagreement anywhere in a table whose tails are such."""
        stop, kind = self.sources.ids.index(one.stop), CELLS.index(one.cell)
        gains = self._first[kind]
        own = tails.chance(kind, gains.gain[:, [stop]], self._dof[:, [stop], kind])[:, 0]
        share = self.share[:, stop, kind]
        asked = gains.valid[:, stop] & (share > 0)
        if not asked.any():
            return one.table_p_value
        return min(max(float((own[asked] / share[asked]).min()), one.table_p_value), 1.0)

    def _tails(self, kind: int, gain: Array, stops: Rows = EVERY) -> Array:
        """(G, n) chance of the gains at some stops by noise alone."""
        d = float(DIMENSIONS[kind])
        scaled, dof = gain / self._factor[:, stops, kind], self._dof[:, stops, kind]
        exact = np.isinf(dof)
        if exact.all():
            return np.asarray(special.chdtrc(d, scaled))
        some = np.where(exact, 1.0, dof)
        if kind == 0:  # of two dimensions in closed form, ten times quicker
            tail = np.exp(-some / 2 * np.log1p(scaled / some))
        else:
            tail = special.fdtrc(d, some, scaled / d)
        return np.asarray(np.where(exact, special.chdtrc(d, scaled), tail))

    def verdicts(
        self, *, least: float = 0.0, without: Mask | None = None
    ) -> tuple[list[Verdict], Mask, Mask]:
        """All cells with a suspect whose p-value is below its share of the false alarms.

        Parameters
        ----------
        least : float
            No share is taken as smaller than this.
        without : (S, n, 2) array of bool, optional
            Cells that take no part.

        Returns
        -------
        verdicts : list of Verdict
            Stop by stop.
        bad, doubtful : (S, n, 2) array of bool
            Cells held responsible, and those of which one is.
        """
        shape = (*self.sources.present.shape, 2)
        bad, doubtful = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
        there = np.repeat(self.sources.present[..., None], 2, -1)
        if without is not None:
            there &= ~without
        found: list[tuple[int, int, Verdict]] = []
        level = np.maximum(self.false_alarm * self.share, least)
        for kind in range(2):
            open_stops = np.ones(shape[1], dtype=bool)
            while open_stops.any():
                stops = np.flatnonzero(open_stops)
                gains = self._gains(kind, there[..., kind], stops)
                tails = np.where(gains.valid, self._tails(kind, gains.gain, stops), 1.0)
                open_stops[stops] = (tails < level[:, stops, kind]).any(0)
                for row in np.flatnonzero(open_stops[stops]):
                    stop = stops[row]
                    at = _Gains(gains.gain[:, row], gains.valid[:, row], gains.size[:, row])
                    asked = there[..., kind]
                    one, members = self._judge(int(stop), kind, asked, at, tails[:, row])
                    found.append((int(stop), kind, one))
                    mark = doubtful if one.certainty == "undecided" else bad
                    mark[list(members), stop, kind] = True
                    there[list(members), stop, kind] = False
                    open_stops[stop] = one.certainty != "undecided"
        found.sort(key=lambda item: item[:2])
        return [one for *_, one in found], bad, doubtful

    def _judge(
        self, stop: int, kind: int, there: Mask, gains: _Gains, tails: Array
    ) -> tuple[Verdict, tuple[int, ...]]:
        """The verdict on a cell that does not fit, and the sources that it falls on."""
        asked = np.flatnonzero(gains.valid)
        gain, present = gains.gain, np.flatnonzero(there[:, stop])
        best = int(asked[np.argmax(gain[asked])])
        close = [int(g) for g in asked if gain[g] > gain[best] - MARGIN]
        if len(close) == 1:
            culprits, certainty, about = self.groups[best], "sure", best
        else:
            several = {s for g in close for s in self.groups[g]}
            culprits, certainty, about = tuple(sorted(several)), "undecided", best
        names = self.sources.names
        share = self.share[:, stop, kind]
        whole = np.where(share > 0, tails / np.where(share > 0, share, 1.0), 1.0)
        first = int(asked[np.argmin(whole[asked])])
        culprits = tuple(s for s in culprits if s in present)
        blamed = tuple(names[s] for s in culprits)
        witnesses = tuple(names[s] for s in present if s not in culprits)
        verdict = Verdict(
            stop=self.sources.ids[stop],
            cell=CELLS[kind],
            blamed=blamed,
            certainty=certainty,  # type: ignore[arg-type]
            p_value=float(tails[first]),
            table_p_value=min(float(whole[first]), 1.0),
            size=self._distance(stop, kind, there, about),
            witnesses=witnesses,
            reason=reason_for(blamed, witnesses, certainty, self._sides(culprits)),
        )
        return verdict, culprits

    def _distance(self, stop: int, kind: int, there: Mask, group: int) -> float:
        """How far a suspect is from the rest, in metres or radians."""
        values, weights = self._prepared[kind]
        means = []
        for some in (self._member[group] > 0, self._member[group] == 0):
            w = weights[some & there[:, stop], stop]
            pull = np.einsum("sij,sj->i", w, values[some & there[:, stop], stop])
            means.append(np.linalg.solve(regular(w.sum(0)), pull))
        return float(np.linalg.norm(means[0] - means[1]))

    def _sides(self, culprits: Sequence[int]) -> list[tuple[str, ...]]:
        """The culprits, those of one sensor together."""
        names, left, sides = self.sources.names, list(culprits), []
        for group in self.groups:
            inside = [s for s in left if s in group]
            if len(group) > 1 and len(inside) > 1:
                sides.append(tuple(names[s] for s in inside))
                left = [s for s in left if s not in inside]
        return [*((names[s],) for s in left), *sides]

    def scores(self, excluded: Mask) -> Array:
        """(S, n, 2) distances from the others (not excluded) in standard deviations."""
        result = np.full(excluded.shape, np.nan)
        for kind in range(2):
            values, weights = self._prepared[kind]
            counted = weights * ~excluded[..., kind, None, None]
            pulls = np.einsum("snij,snj->sni", counted, values)
            total, pull = _without(np.eye(len(values)), counted, pulls)
            known = self.sources.present & (determinant(total) > 0)
            eye = np.eye(2 - kind)
            others = inverse(regular(np.where(known[..., None, None], total, eye)))
            own = inverse(regular(np.where(known[..., None, None], weights, eye)))
            left = values - np.einsum("snij,snj->sni", others, pull)
            square = np.einsum("sni,snij,snj->sn", left, inverse(regular(own + others)), left)
            square = square / self._factor[: len(square), :, kind]
            result[..., kind] = np.where(known, np.sqrt(square), np.nan)
        return result


def _without(member: Array, weights: Array, pulls: Array) -> tuple[Array, Array]:
    """Summed weights (G, n, d, d) and pulls (G, n, d) of all sources but those of each suspect.

    Parameters
    ----------
    member : (G, S) array
        1 for the sources of each suspect.
    weights, pulls : (S, n, d, d) and (S, n, d) array
        Of the sources.
    """
    total = weights.sum(0)
    rest = total - np.einsum("gs,snij->gnij", member, weights)
    rest_pull = pulls.sum(0) - np.einsum("gs,sni->gni", member, pulls)
    left, whole = (np.diagonal(one, axis1=-2, axis2=-1) for one in (rest, total))
    lost = np.asarray((left < ROUNDING * whole).any(-1))
    if lost.any():  # beside a far larger weight, a difference is rounding: summed anew
        others = 1 - member
        rest = np.where(lost[..., None, None], np.einsum("gs,snij->gnij", others, weights), rest)
        rest_pull = np.where(lost[..., None], np.einsum("gs,sni->gni", others, pulls), rest_pull)
    return rest, rest_pull
