"""Points that are not where they should be: moved, or marked in the wrong place."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from survey.causes.lead import Lead, Log, Sizes, mark_sizes, place_sizes, rig_sizes
from survey.causes.linear import UNSEEN, Linear, group_gain
from survey.causes.trial import Rows, Trial, renamed, with_point
from survey.readings.point_names import robot_point
from validation.poses.angles import Array

LEAST_READINGS = 3
"""Readings to a point before and after it moved: two fit any place."""


def place_leads(trial: Trial, linear: Linear, log: Log) -> Iterator[Lead]:
    """Moved points, and points off their nominal places."""
    yield from _moved(trial, linear, log)
    net = trial.network
    n, v, q = len(net.distance), len(net.fixed), len(net.mark)
    for k, point in enumerate(net.fixed):
        name = net.points[point]
        if name not in trial.released:
            rows = n + 2 * k + np.arange(2)
            sizes = place_sizes(int(point), None, net.nominal[k], net.nominal_sigma)
            yield _released("vframe_point", (name,), name, rows, linear, float(v), sizes)
    for k, point in enumerate(net.mark):
        name = net.points[point]
        stop, body = robot_point(name) or ("", "")
        if name not in trial.released:
            rows = n + 2 * v + 2 * k + np.arange(2)
            subject, sizes = (stop, body), mark_sizes(k)
            yield _released("rig_mark", subject, name, rows, linear, float(q), sizes)
    for k, body in enumerate(net.rig_names):
        if f"/{body}" not in trial.released:
            rows = n + 2 * v + 2 * q + 2 * k + np.arange(2)
            alike, sizes = float(len(net.rig_names)), rig_sizes(k)
            yield _released("rig_point", (body,), f"/{body}", rows, linear, alike, sizes)


def _released(
    kind: str,
    subject: tuple[str, ...],
    name: str,
    rows: Rows,
    linear: Linear,
    places: float,
    sizes: Sizes,
) -> Lead:
    gain, _ = group_gain(linear, rows)

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
    stations = len(set(log.station))
    for point in points:
        rows = np.flatnonzero((net.first == point) | (net.second == point))
        rows = rows[np.argsort(rank[rows])]
        if len(rows) < 2 * LEAST_READINGS:
            continue
        J = linear.fit.jacobian[rows][:, [2 * point, 2 * point + 1]].toarray()
        Q = linear.block(rows)
        score = _from_end(J * linear.residual[rows][:, None])
        matrix = np.einsum("ia,ij,jb->ijab", J, Q, J)
        matrix = matrix[::-1, ::-1].cumsum(0).cumsum(1)[::-1, ::-1]
        k = np.arange(LEAST_READINGS, len(rows) - LEAST_READINGS + 1)
        M, s = matrix[k, k], score[k]
        whole = _from_end(np.einsum("ia,ib->iab", J, J))[k]
        seen = np.linalg.eigvalsh(M)[:, 0] > UNSEEN * np.linalg.eigvalsh(whole)[:, 0]
        seen &= np.linalg.eigvalsh(whole)[:, 0] > UNSEEN * np.linalg.eigvalsh(whole)[:, 1]
        if not seen.any():
            continue
        safe = np.where(seen[:, None, None], M, np.eye(2))
        size = np.linalg.solve(safe, s[..., None])[..., 0]
        gain = np.where(seen, (size * s).sum(1), 0.0)
        best = int(gain.argmax())
        yield _moved_lead(
            trial, point, rows[k[best] :], rows[k[best] - 1], float(gain[best]),
            float(len(points) * stations),
        )  # fmt: skip


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
