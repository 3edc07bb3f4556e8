"""Points that are not where they should be: moved, or marked in the wrong place."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from survey.causes.lead import (
    Lead,
    Log,
    Sizes,
    aligned,
    mark_sizes,
    place_sizes,
    rig_sizes,
    spread_places,
)
from survey.causes.linear import UNSEEN, Linear, group_gains
from survey.causes.trial import Rows, Trial, renamed, with_point
from survey.readings.point_names import robot_point
from validation.poses.angles import Array

LEAST_READINGS = 3
"""Readings to a point before and after it moved: two fit any place."""


def place_leads(trial: Trial, linear: Linear, log: Log) -> Iterator[Lead]:
    """Moved points, and points off their nominal places."""
    yield from _moved(trial, linear, log)
    net = trial.network
    n, v, q, b = len(net.distance), len(net.fixed), len(net.mark), len(net.rig_names)
    free = group_gains(linear, n + np.arange(2 * (v + q + b)).reshape(-1, 2)).tolist()
    for k, point in enumerate(net.fixed):
        name = net.points[point]
        if name not in trial.released:
            sizes = place_sizes(int(point), None, net.nominal[k], net.nominal_sigma)
            yield _released("vframe_point", (name,), name, free[k], float(v), sizes)
    for k, point in enumerate(net.mark):
        name = net.points[point]
        stop, body = robot_point(name) or ("", "")
        if name not in trial.released:
            subject, sizes = (stop, body), mark_sizes(k)
            yield _released("rig_mark", subject, name, free[v + k], float(q), sizes)
    for k, body in enumerate(net.rig_names):
        if f"/{body}" not in trial.released:
            gain, sizes = free[v + q + k], rig_sizes(k)
            yield _released("rig_point", (body,), f"/{body}", gain, float(b), sizes)


def _released(
    kind: str,
    subject: tuple[str, ...],
    name: str,
    gain: float,
    places: float,
    sizes: Sizes,
) -> Lead:
    def build(base: Trial) -> Trial:
        return replace(base, released=base.released | {name})

    return Lead(kind, "point", subject, np.empty(0, dtype=np.intp), gain, places, build, sizes)


def _moved(trial: Trial, linear: Linear, log: Log) -> Iterator[Lead]:
    """World points and Vframe points that were elsewhere from some reading on."""
    net = trial.network
    marks = {int(i) for i in net.mark}
    rank = np.empty(len(log.order), dtype=np.intp)
    rank[log.order] = np.arange(len(log.order))
    points = [point for point in range(len(net.points)) if point not in marks]
    for point in points:
        rows = np.flatnonzero((net.first == point) | (net.second == point))
        rows = rows[np.argsort(rank[rows])]
        if len(rows) < 2 * LEAST_READINGS:
            continue
        J = linear.fit.jacobian[rows][:, [2 * point, 2 * point + 1]].toarray()
        k = np.arange(LEAST_READINGS, len(rows) - LEAST_READINGS + 1)
        s = _from_end(J * linear.residual[rows][:, None])[k]
        whole = _from_end(np.einsum("ia,ib->iab", J, J))[k]
        M = whole - _taken_up(linear, rows, J)[k]
        seen = np.linalg.eigvalsh(M)[:, 0] > UNSEEN * np.linalg.eigvalsh(whole)[:, 0]
        seen &= np.linalg.eigvalsh(whole)[:, 0] > UNSEEN * np.linalg.eigvalsh(whole)[:, 1]
        if not seen.any():
            continue
        safe = np.where(seen[:, None, None], M, np.eye(2))
        size = np.linalg.solve(safe, s[..., None])[..., 0]
        gain = np.where(seen, (size * s).sum(1), 0.0)
        evidence = np.where(seen, gain - np.linalg.slogdet(safe)[1], -np.inf)
        found = spread_places(evidence, aligned([log.station[row] for row in rows])[k])
        if found is None:
            continue
        (best,), alike = found
        yield _moved_lead(
            trial, point, rows[k[best] :], rows[k[best] - 1], float(gain[best]),
            len(points) * alike,
        )  # fmt: skip


def _taken_up(linear: Linear, rows: Rows, J: Array) -> Array:
    """(r, 2, 2) part of ``J^T J`` from each row to the last that the unknowns take up."""
    through = _from_end(J[:, :, None] * linear.reach(rows)[:, None, :])
    pairs = linear.alone(rows).tocoo()
    first, second = J[pairs.row], J[pairs.col]
    each = pairs.data[:, None, None] * first[:, :, None] * second[:, None, :]
    alone = np.zeros((len(rows), 2, 2))
    np.add.at(alone, np.minimum(pairs.row, pairs.col), each)
    return np.asarray(through @ np.swapaxes(through, 1, 2) + _from_end(alone))


def _from_end(values: Array) -> Array:
    """Sums from each row to the last."""
    return np.asarray(values[::-1].cumsum(0)[::-1])


def _moved_lead(
    trial: Trial, point: int, after: Rows, last: int, gain: float, places: float
) -> Lead:
    name = trial.network.points[point]

    def build(base: Trial) -> Trial:
        place = base.start.points[point]
        split, new = with_point(base, f"{name} later", place)
        return renamed(split, after, point, new)

    rows = np.concatenate([[last], after]).astype(np.intp)
    new = len(trial.network.points)
    return Lead(
        "moved", "point", (name,), rows, gain, places, build, place_sizes(new, point, None, 0.0)
    )
