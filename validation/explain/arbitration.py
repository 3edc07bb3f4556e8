"""Which source is wrong at a stop: the one that disagrees with the others.

The sources are the validation poses and every GT system with its systematic part taken out. Each
stop has two cells, its position and its heading. In each cell every source is asked how much
better the rest would agree without it; the error is laid at the door of the one whose removal
heals the cell, if that is clearly so, and the chance of blaming anyone in a clean table is kept
at a stated level over the whole table (Bonferroni over all questions asked).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from validation.angles import Array
from validation.explain.hat import DIMENSIONS, source_variances
from validation.explain.noise import Mask
from validation.explain.sources import (
    CELLS,
    Arbitration,
    Sources,
    Verdict,
    differences,
    listed,
    reason_for,
)

FALSE_ALARM = 0.05
MARGIN = 6.0
"""Two culprits are told apart if one's removal leaves a chi-squared this much smaller (odds of
20 to 1)."""

_ROUNDS = 5

SCREEN = 1e-3
"""Cells below this p-value are left out when noise levels are estimated, as one gross error that
is just not flagged would hide others."""


def arbitrate(sources: Sources, false_alarm: float = FALSE_ALARM) -> Arbitration:
    """The cells that do not fit, and who is wrong in each.

    Parameters
    ----------
    sources : Sources
        Two or more; with two, a disagreement shows but not whose it is.
    false_alarm : float
        Chance of any verdict in a table of good poses.
    """
    good = np.repeat(sources.present[..., None], 2, axis=-1)
    left_out = np.zeros_like(good)
    for step in range(_ROUNDS):
        noise, dof = _noise(sources, good & ~left_out, robust=step == 0)
        table = _Table(sources, noise, dof, false_alarm)
        _, bad, doubtful = table.verdicts(max(SCREEN, table.threshold))
        same = (left_out == (bad | doubtful)).all()
        left_out = bad | doubtful
        if same and step > 0:
            break
    found, bad, doubtful = _same_stop(sources, *table.verdicts(table.threshold))
    usable = good & ~bad & ~doubtful
    variances = source_variances(
        sources.names,
        sources.poses,
        usable,
        lost_freedom=sources.lost_freedom,
        apart=tuple(sources.sensors.values()),
    )
    return Arbitration(
        sources.names,
        sources.ids,
        tuple(found),
        sources.present,
        bad,
        doubtful,
        table.scores(bad | doubtful),
        noise,
        variances,
        false_alarm,
        table.questions,
    )


def _same_stop(
    sources: Sources, found: list[Verdict], bad: Mask, doubtful: Mask
) -> tuple[list[Verdict], Mask, Mask]:
    """Undecided cells given to a source that is responsible for the other cell of the stop."""
    result = []
    for one in found:
        if one.certainty == "undecided":
            stop, kind = sources.ids.index(one.stop), CELLS.index(one.cell)
            guilty = [name for name in one.blamed if bad[sources.names.index(name), stop, 1 - kind]]
            if len(guilty) == 1:
                doubtful[:, stop, kind] = False
                bad[sources.names.index(guilty[0]), stop, kind] = True
                others = tuple(name for name in one.blamed if name != guilty[0])
                one = replace(  # noqa: PLW2901
                    one,
                    blamed=(guilty[0],),
                    certainty="likely",
                    witnesses=(*others, *one.witnesses),
                    reason=f"this cell alone does not tell which of {listed(one.blamed)} it is, "
                    f"but {guilty[0]} is responsible for the {CELLS[1 - kind]} of the same stop",
                )
        result.append(one)
    return result, bad, doubtful


def _noise(sources: Sources, good: Mask, *, robust: bool) -> tuple[Array, Array]:
    """(S, 2) standard deviations to judge with, and their degrees of freedom.

    Sources with stated covariances keep them (what is returned for them is typical); the others
    get theirs from the differences of all pairs, those of one sensor among them, as these are
    judged too. Where that cannot tell the sources apart, the difference is shared equally.
    """
    variances = source_variances(
        sources.names, sources.poses, good, lost_freedom=sources.lost_freedom, robust=robust
    )
    # How two sources differ is known as well as the mean square of the difference is, even where
    # it is not known which of them the noise belongs to; half of it, as it stands for two.
    values, dof = variances.bounded.copy(), variances.ceilings[..., 1] / 2
    for kind in range(2):
        shared, least, freedom = _pooled(sources, good, kind, robust=robust)
        unknown = ~np.isfinite(values[:, kind])
        values[unknown, kind], dof[unknown, kind] = shared, freedom
        values[:, kind] = np.maximum(values[:, kind], least)
        dof[:, kind] = np.clip(dof[:, kind], 4.0, freedom)
    stated = sources.stated
    for s in np.flatnonzero(stated):
        diagonal = np.diagonal(sources.covariances[s], axis1=-2, axis2=-1)
        values[s, 0] = np.nanmedian(diagonal[:, :2])
        values[s, 1] = np.nanmedian(diagonal[:, 2])
        dof[s] = np.inf
    # The first, rough noise only screens what to leave out of the next one: taken as exact, lest
    # a gross error hides in its own uncertainty.
    return np.sqrt(values), np.full_like(dof, np.inf) if robust else dof


def _pooled(sources: Sources, good: Mask, kind: int, *, robust: bool) -> tuple[float, float, float]:
    """Half the typical variance of a difference, the least credible variance, and freedom."""
    values, freedom = [], []
    for a in range(len(sources.names)):
        for b in range(a):
            mask = good[a, :, kind] & good[b, :, kind]
            count = float(mask.sum()) * DIMENSIONS[kind]
            lost = max(sources.lost_freedom[a, kind], sources.lost_freedom[b, kind])
            if count - lost < 1:
                continue
            difference = differences(sources.poses[a, mask], sources.poses[b, mask], kind)
            squares = (difference**2).sum(-1)
            if robust:
                medians = (1.386, 0.455)
                values.append(float(np.median(squares)) / medians[kind])
            else:
                values.append(float(squares.sum()) / (count - lost))
            freedom.append((count - lost) * (0.4 if robust else 1.0))
    if not values:
        return 1e-8, 1e-12, 4.0
    least = max(min(values) / 20, 1e-12)
    return float(np.median(values)) / 2, least, max(*freedom, 4.0)


@dataclass(frozen=True)
class _Suspect:
    """A possible culprit of a cell: one source, or all of one sensor."""

    members: tuple[int, ...]
    gain: float
    left: float
    p_value: float


class _Table:
    """All cells judged with one set of noise levels."""

    def __init__(self, sources: Sources, noise: Array, dof: Array, false_alarm: float) -> None:
        self.sources, self.noise, self.dof = sources, noise, dof
        self.stated = sources.stated
        self.sensors = [
            tuple(sources.names.index(name) for name in group if name in sources.names)
            for group in sources.sensors.values()
        ]
        count = sources.present.sum(0)
        # With two sources there is one question: do they agree?
        groups = sum((sources.present[list(one)].sum(0) > 1) & (count > 2) for one in self.sensors)
        asked = np.where(count > 2, count, count // 2) + groups
        self.questions = max(int(2 * asked.sum()), 1)
        self.threshold = false_alarm / self.questions
        self.prepared = [self._prepare(kind) for kind in range(2)]

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
        covariances[self.stated] = sources.covariances[self.stated][..., part, part]
        there = sources.present
        covariances[~there] = np.eye(d)
        weights = np.linalg.inv(covariances) * there[..., None, None]
        values = differences(sources.poses, sources.poses[:1], kind)
        return np.where(there[..., None], values, 0.0), np.asarray(weights)

    def _whole(self, kind: int) -> Array:
        """(n,) chi-squared of all sources about their weighted mean."""
        values, weights = self.prepared[kind]
        total = weights.sum(0)
        mean = np.linalg.solve(total, np.einsum("snij,snj->ni", weights, values)[..., None])
        left = values - mean[..., 0]
        return np.asarray(np.einsum("sni,snij,snj->n", left, weights, left))

    def verdicts(self, threshold: float) -> tuple[list[Verdict], Mask, Mask]:
        """All cells with a p-value below a threshold; masks of the bad and the doubtful ones."""
        shape = (*self.sources.present.shape, 2)
        bad, doubtful = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
        found = []
        # No source can gain more than the whole disagreement, which settles most cells.
        suspicious = [
            special.chdtrc(DIMENSIONS[kind], self._whole(kind)) < threshold for kind in range(2)
        ]
        for stop in range(shape[1]):
            for kind in range(2):
                if not suspicious[kind][stop]:
                    continue
                present = [int(s) for s in np.flatnonzero(self.sources.present[:, stop])]
                while len(present) > 1:
                    verdict, members = self._judge(stop, kind, present, threshold)
                    if verdict is None:
                        break
                    found.append(verdict)
                    if verdict.certainty == "undecided":
                        doubtful[list(members), stop, kind] = True
                        break
                    bad[list(members), stop, kind] = True
                    present = [s for s in present if s not in members]
        return found, bad, doubtful

    def _judge(
        self, stop: int, kind: int, present: list[int], threshold: float
    ) -> tuple[Verdict | None, tuple[int, ...]]:
        """The verdict on one cell, None if all agree."""
        suspects = self._suspects(stop, kind, present)
        best = min(suspects, key=lambda one: one.left)
        if best.p_value >= threshold:
            return None, ()
        close = [one for one in suspects if one.left < best.left + MARGIN]
        singles = [one for one in close if len(one.members) == 1]
        if len(singles) == 1 and len(close) > 1:
            culprits, certainty = singles[0].members, "likely"
        elif len(close) == 1:
            culprits, certainty = best.members, "sure"
        else:
            culprits = tuple(sorted({s for one in close for s in one.members}))
            certainty = "undecided"
        return self._verdict(stop, kind, present, best, culprits, certainty), culprits

    def _suspects(self, stop: int, kind: int, present: list[int]) -> list[_Suspect]:
        """Every source, and every sensor with two or more sources here, without which..."""
        groups: list[tuple[int, ...]] = [(s,) for s in present]
        groups += [
            inside
            for sensor in self.sensors
            if 1 < len(inside := tuple(s for s in sensor if s in present)) < len(present)
        ]
        whole = self._disagreement(stop, kind, present)
        suspects = []
        for members in groups:
            others = [s for s in present if s not in members]
            # Of one sensor, the members still have to agree with each other.
            left = self._disagreement(stop, kind, others)
            left += self._disagreement(stop, kind, list(members))
            gain = max(whole - left, 0.0)
            p_value = self._tail(gain, kind, members, others)
            suspects.append(_Suspect(members, gain, left, p_value))
        return suspects

    def _disagreement(self, stop: int, kind: int, some: list[int]) -> float:
        """Chi-squared of sources about their weighted mean."""
        if len(some) < 2:
            return 0.0
        values, weights = self._stacked(stop, kind, some)
        total = np.linalg.inv(weights.sum(0))
        mean = total @ np.einsum("sij,sj->i", weights, values)
        left = values - mean
        return float(np.einsum("si,sij,sj->", left, weights, left))

    def _stacked(self, stop: int, kind: int, some: list[int]) -> tuple[Array, Array]:
        """(s, d) values and (s, d, d) weights of some sources at a stop."""
        values, weights = self.prepared[kind]
        return values[some, stop], weights[some, stop]

    def _tail(self, gain: float, kind: int, members: tuple[int, ...], others: list[int]) -> float:
        """Chance of the gain by noise alone, noise levels being estimates where not stated."""
        dimension = float(DIMENSIONS[kind])
        own = [float(self.noise[s, kind] ** 2) for s in members]
        rest = [float(self.noise[s, kind] ** 2) for s in others]
        parts = [
            (1 / sum(1 / v for v in group), min(float(self.dof[s, kind]) for s in which))
            for group, which in ((own, members), (rest, others))
        ]
        total = sum(v for v, _ in parts)
        below = sum(v**2 / dof for v, dof in parts)
        if below == 0:
            return float(special.chdtrc(dimension, gain))
        return float(special.fdtrc(dimension, total**2 / below, gain / dimension))

    def _verdict(
        self,
        stop: int,
        kind: int,
        present: list[int],
        best: _Suspect,
        culprits: tuple[int, ...],
        certainty: str,
    ) -> Verdict:
        """The verdict in words."""
        names = self.sources.names
        # Where a single source is held responsible instead of a sensor, so is its distance.
        members = culprits if certainty == "likely" else best.members
        others = [s for s in present if s not in members]
        size = self._distance(stop, kind, list(members), others)
        blamed = tuple(names[s] for s in culprits)
        witnesses = tuple(names[s] for s in present if s not in culprits)
        return Verdict(
            stop=self.sources.ids[stop],
            cell=CELLS[kind],
            blamed=blamed,
            certainty=certainty,  # type: ignore[arg-type]
            p_value=best.p_value,
            size=size,
            witnesses=witnesses,
            reason=reason_for(blamed, witnesses, certainty, self._sensor_of(witnesses)),
        )

    def _distance(self, stop: int, kind: int, some: list[int], others: list[int]) -> float:
        """How far the means of two groups are apart, in metres or radians."""
        values, weights = self._stacked(stop, kind, some + others)
        means = []
        for part in (slice(0, len(some)), slice(len(some), None)):
            total = np.linalg.inv(weights[part].sum(0))
            means.append(total @ np.einsum("sij,sj->i", weights[part], values[part]))
        return float(np.linalg.norm(means[0] - means[1]))

    def _sensor_of(self, names: Sequence[str]) -> str:
        """The sensor that all the named sources share; empty if they do not."""
        for sensor, members in self.sources.sensors.items():
            if len(names) > 1 and set(names) <= set(members):
                return sensor
        return ""

    def scores(self, excluded: Mask) -> Array:
        """(S, n, 2) distances from the others (not excluded) in standard deviations."""
        result = np.full(excluded.shape, np.nan)
        for kind in range(2):
            values, weights = self.prepared[kind]
            counted = weights * ~excluded[..., kind, None, None]
            total = counted.sum(0) - counted
            pull = np.einsum("snij,snj->sni", counted, values)
            pull = pull.sum(0) - pull
            known = self.sources.present & (np.linalg.det(total) > 0)
            eye = np.eye(2 - kind)
            others = np.linalg.inv(np.where(known[..., None, None], total, eye))
            own = np.linalg.inv(np.where(known[..., None, None], weights, eye))
            left = values - np.einsum("snij,snj->sni", others, pull)
            square = np.einsum("sni,snij,snj->sn", left, np.linalg.inv(own + others), left)
            result[..., kind] = np.where(known, np.sqrt(square), np.nan)
        return result
