"""Rooms in which one thing went wrong, made independently of the sample rooms."""

from dataclasses import dataclass, replace

import numpy as np

from survey.causes.lead import effect_size, mark_sizes, place_sizes
from survey.causes.trial import Effect, fit, law, renamed, with_point
from survey.causes.start import whole_trial
from survey.estimation.solve import solve_survey
from survey.readings.instrument import reading_sigma
from survey.readings.readings import Readings
from validation.campaign.folder import Instrument, RobotFrame, Vframe

METER = Instrument(model="m", tolerance=0.0015, setup_sigma=0.002, resolution=0.001)
RIG = RobotFrame(marking_sigma=0.001, shape_sigma=0.001, sides_sigma=0.001)


@dataclass(frozen=True)
class Sample:
    """A survey, and what is wrong with it.

    ``names`` are the points of the readings before anything went wrong, ``truth`` is what the
    search should name first: kind, and names or rows.
    """

    vframe: Vframe
    rig: RobotFrame
    world: tuple[str, ...]
    readings: Readings
    stops: int
    exact: np.ndarray
    kind: str = "none"
    subject: tuple[str, ...] = ()
    rows: tuple[int, ...] = ()
    sizes: tuple[float, ...] = ()

    def solved(self):
        return solve_survey(self.vframe, self.rig, self.readings, self.world)


def clean(rng, stops=None, marks=None, missing=0.0):
    """A room with nothing wrong: 8 to 26 stops, 10 to 18 marks, observers and days."""
    stops = stops or int(rng.integers(8, 27))
    marks = marks or int(rng.integers(10, 19))
    vframe = Vframe(sigma=0.002)
    nominal = np.array(list(vframe.points.values()))
    floor = nominal + 0.002 * rng.standard_normal(nominal.shape)
    wide, long = rng.uniform(7, 9), rng.uniform(9, 13)
    low = np.array([-rng.uniform(2, 3.5), -rng.uniform(2, 4)])
    along = (np.arange(marks) + rng.uniform(0.2, 0.8, marks)) / marks * 2 * (wide + long)
    walls = [_on_wall(s, wide, long) for s in along]
    world = low + np.array(walls)
    poses = np.column_stack(
        [
            low + [1.2, 1.2] + rng.uniform(size=(stops, 2)) * [wide - 2.4, long - 2.4],
            rng.uniform(-np.pi, np.pi, stops),
        ]
    )
    body = np.array(list(RIG.points.values()))
    body = body + np.vstack([[0, 0], 0.001 * rng.standard_normal((2, 2))])
    sides = {
        f"{a}-{b}": float(np.linalg.norm(body[i] - body[j]) + 0.001 * rng.standard_normal())
        for (i, a), (j, b) in (((0, "O"), (1, "X")), ((0, "O"), (2, "Y")), ((1, "X"), (2, "Y")))
    }
    rig = RIG.model_copy(update={"sides": sides})
    places = dict(zip(vframe.points, floor, strict=True))
    names = tuple(str(k + 1) for k in range(marks))
    places |= dict(zip(names, world, strict=True))
    for k, (x, y, t) in enumerate(poses):
        turn = np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]])
        for point, arm in zip(RIG.points, body, strict=True):
            mark = [x, y] + turn @ arm + 0.001 * rng.standard_normal(2)
            places[f"{k + 1}/{point}"] = mark
    frame = list(vframe.points)
    pairs = [(a, b) for i, a in enumerate(frame) for b in frame[i + 1 :]]
    pairs += [(a, b) for a in frame for b in names]
    pairs += [
        (f"{k + 1}/{p}", b)
        for k in range(stops)
        for p in RIG.points
        for b in names
        if rng.uniform() >= missing
    ]
    length = np.array([np.linalg.norm(places[a] - places[b]) for a, b in pairs])
    sigma = reading_sigma(METER, length)
    exact = length + np.hypot(0.00075, 0.002) * rng.standard_normal(len(pairs))
    shown = np.round(exact, 3)
    second = int(rng.integers(stops // 3, 2 * stops // 3 + 1)) if rng.uniform() < 0.7 else stops + 1
    people = rng.choice(["A", "B", "C"], size=stops + 1)
    times, observers = [], []
    for row, (a, _) in enumerate(pairs):
        stop = int(a.split("/")[0]) if "/" in a else 0
        day = 5 if stop >= second else 4
        minute, s = divmod(row, 60)
        times.append(f"2026-03-{day:02d}T{9 + minute // 60:02d}:{minute % 60:02d}:{s:02d}")
        observers.append(str(people[stop]))
    readings = Readings(
        tuple(a for a, _ in pairs), tuple(b for _, b in pairs), shown, sigma,
        tuple(range(2, len(pairs) + 2)), tuple(observers), tuple(times),
    )  # fmt: skip
    return Sample(vframe, rig, names, readings, stops, exact)


def _on_wall(s, wide, long):
    if s < wide:
        return s, 0.0
    if s < wide + long:
        return wide, s - wide
    if s < 2 * wide + long:
        return 2 * wide + long - s, long
    return 0.0, 2 * (wide + long) - s


def base_trial(sample):
    """The clean survey as a trial at its solution."""
    trial, _ = whole_trial(sample.solved(), sample.vframe, sample.rig, sample.readings)
    return replace(trial, start=fit(trial).at)


SETS = ("all", "stop", "block", "observer", "day")
KINDS = (
    *(f"offset_{one}" for one in SETS),
    *(f"scale_{one}" for one in SETS),
    "height_point", "height_stop", "height_walls",
    "moved", "vframe_point", "rig_mark",
    "exchanged_targets", "exchanged_rig_points", "stop_number", "new_stop", "exchanged_rows",
    *(f"blunders_{k}" for k in range(1, 6)),
)  # fmt: skip


def rows_of(sample, rng, extent):
    """A set of rows by its extent, with its name."""
    r = sample.readings
    n = len(r)
    if extent == "all":
        return np.arange(n), ()
    if extent == "block":
        i, j = np.sort(rng.choice(np.arange(6, n), 2, replace=False))
        while j - i < 12:
            i, j = np.sort(rng.choice(np.arange(6, n), 2, replace=False))
        return np.arange(i, j), ()
    if extent == "stop":
        stop = str(rng.integers(1, sample.stops + 1))
        return np.array([i for i in range(n) if r.start[i].startswith(f"{stop}/")]), (stop,)
    column = r.observer if extent == "observer" else [t[:10] for t in r.time]
    names = sorted(set(column))
    if len(names) < 2:
        return None, ()
    name = str(rng.choice(names))
    return np.array([i for i in range(n) if column[i] == name]), (name,)


def spoiled(sample, kind, rng, sigmas=8.0, size=None):
    """The survey with one thing wrong: ``sigmas`` of its own estimate, or of a given ``size``."""
    what, _, extent = kind.partition("_")
    r = sample.readings
    d = sample.exact.copy()
    n = len(d)
    sign = float(rng.choice([-1.0, 1.0]))
    if what in {"offset", "scale"}:
        rows, subject = rows_of(sample, rng, extent)
        if rows is None:
            return None
        if size is None:
            trial = base_trial(sample)
            solved = fit(replace(trial, effects=(Effect(what, rows, 0.0),)))
            (number,) = effect_size(solved)
            size = sign * sigmas * number.sigma
        d[rows] = law(what, d[rows], size)[0]
        truth = (what, subject, tuple(rows), (size,))
    elif what == "height":
        trial = base_trial(sample)
        net = trial.network
        if extent == "point":
            name = str(rng.choice(sample.world))
            rows = np.array([i for i in range(n) if name in {r.start[i], r.end[i]}])
        elif extent == "stop":
            rows, (name,) = rows_of(sample, rng, "stop")
        else:
            rows = np.array([i for i in range(n) if r.end[i] in sample.world])
            name = ""
        if size is None:
            solved = fit(replace(trial, effects=(Effect("height", rows, 0.0),)))
            by = np.zeros((1, solved.trial.unknowns))
            by[0, -1] = 1
            size = np.sqrt(sigmas * np.sqrt(solved.covariance(by)[0, 0]))
        d[rows] = np.hypot(d[rows], size)
        truth = ("height", (name,) if name else (), tuple(rows), (size,))
    elif kind == "moved":
        trial = base_trial(sample)
        name = str(rng.choice(sample.world))
        point = trial.network.points.index(name)
        rows = np.array([i for i in range(n) if name in {r.start[i], r.end[i]}])
        k = int(rng.integers(3, len(rows) - 2))
        split, new = with_point(trial, "later", trial.start.points[point])
        solved = fit(renamed(split, rows[k:], point, new))
        shift = _shift(
            place_sizes(new, point, None, 0.0), solved, new, point, 0.0, rng, sigmas, size
        )
        _move(d, trial, rows[k:], point, shift)
        truth = ("moved", (name,), tuple(rows[k:]), tuple(shift))
    elif kind == "vframe_point":
        trial = base_trial(sample)
        name = str(rng.choice(list(sample.vframe.points)))
        point = trial.network.points.index(name)
        solved = fit(replace(trial, released=frozenset({name})))
        shift = _shift(None, solved, point, None, 0.002, rng, sigmas, size)
        rows = np.array([i for i in range(n) if name in {r.start[i], r.end[i]}])
        _move(d, trial, rows, point, shift)
        truth = ("vframe_point", (name,), (), tuple(shift))
    elif kind == "rig_mark":
        trial = base_trial(sample)
        net = trial.network
        q = int(rng.integers(len(net.mark)))
        point = int(net.mark[q])
        name = net.points[point]
        solved = fit(replace(trial, released=frozenset({name})))
        first, second = mark_sizes(q)(solved)
        theta = solved.at.poses[net.mark_pose[q], 2]
        by = _mark_rows(solved, q)
        whole = solved.covariance(by) + 0.001**2 * np.eye(2)
        shift = _draw(whole, rng, sigmas, size)
        turn = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
        rows = np.array([i for i in range(n) if name in {r.start[i], r.end[i]}])
        _move(d, trial, rows, point, turn @ shift)
        truth = ("rig_mark", tuple(name.split("/")), (), tuple(shift))
    elif kind == "exchanged_targets":
        rows, (stop,) = rows_of(sample, rng, "stop")
        a, b = rng.choice(sample.world, 2, replace=False)
        swap = {a: str(b), b: str(a)}
        end = list(r.end)
        for i in rows:
            end[i] = swap.get(end[i], end[i])
        r = replace(r, end=tuple(end))
        truth = (kind, (stop, str(a), str(b)), (), ())
    elif kind == "exchanged_rig_points":
        rows, (stop,) = rows_of(sample, rng, "stop")
        a, b = rng.choice(list(RIG.points), 2, replace=False)
        swap = {f"{stop}/{a}": f"{stop}/{b}", f"{stop}/{b}": f"{stop}/{a}"}
        r = replace(r, start=tuple(swap.get(x, x) for x in r.start))
        truth = (kind, (stop, str(a), str(b)), (), ())
    elif kind == "stop_number":
        stop, other = (str(k) for k in rng.choice(np.arange(1, sample.stops + 1), 2, replace=False))
        point = str(rng.choice(list(RIG.points)))
        swap = {f"{stop}/{point}": f"{other}/{point}"}
        r = replace(r, start=tuple(swap.get(x, x) for x in r.start))
        truth = (kind, (other, stop, point), (), ())
    elif kind == "new_stop":
        stop = int(rng.integers(1, sample.stops))
        swap = {f"{stop + 1}/{p}": f"{stop}/{p}" for p in RIG.points}
        r = replace(r, start=tuple(swap.get(x, x) for x in r.start))
        truth = ("stop_number", (str(stop), ""), (), ())
    elif kind == "exchanged_rows":
        while True:
            i, j = np.sort(rng.choice(np.arange(6, n), 2, replace=False))
            if rng.uniform() < 0.5:
                j = min(i + 1, n - 1)
            if i != j and abs(d[i] - d[j]) > max(sigmas, 8.0) * 0.0035:
                break
        d[[i, j]] = d[[j, i]]
        truth = (kind, (), (int(i), int(j)), ())
    else:
        count = int(extent)
        rows = np.sort(rng.choice(n, count, replace=False))
        trial = base_trial(sample)
        from survey.causes.linear import Linear

        red = Linear(fit(trial)).redundancy[rows]
        each = r.sigma[rows] / np.sqrt(red)
        sizes = rng.choice([-1.0, 1.0], count) * (sigmas * each if size is None else np.abs(size))
        sizes = sizes * rng.uniform(1, 1.5, count)
        d[rows] += sizes
        truth = ("blunders", (), tuple(int(i) for i in rows), tuple(sizes))
    kind_, subject, rows, sizes = truth
    return replace(
        sample,
        readings=replace(r, distance=np.round(d, 3)),
        kind=kind_,
        subject=subject,
        rows=rows,
        sizes=sizes,
    )


def _mark_rows(solved, q):
    from survey.estimation.geometry import rotate

    net = solved.trial.network
    row, pose, body = int(net.mark[q]), int(net.mark_pose[q]), int(net.mark_rig[q])
    state = solved.at.poses[pose]
    seen = rotate(-state[2], solved.at.points[row] - state[:2])
    p, f, _ = net.sizes
    c, s = np.cos(state[2]), np.sin(state[2])
    back = np.array([[c, s], [-s, c]])
    by = np.zeros((2, solved.trial.unknowns))
    by[:, 2 * row : 2 * row + 2] = back
    by[:, p + 3 * pose : p + 3 * pose + 2] = -back
    by[:, p + 3 * pose + 2] = [seen[1], -seen[0]]
    by[:, p + f + 2 * body : p + f + 2 * body + 2] -= np.eye(2)
    return by


def _shift(_, solved, row, old, nominal, rng, sigmas, size):
    by = np.zeros((2, solved.trial.unknowns))
    by[[0, 1], [2 * row, 2 * row + 1]] = 1.0
    if old is not None:
        by[[0, 1], [2 * old, 2 * old + 1]] = -1.0
    return _draw(solved.covariance(by) + nominal**2 * np.eye(2), rng, sigmas, size)


def _draw(covariance, rng, sigmas, size):
    angle = rng.uniform(-np.pi, np.pi)
    u = np.array([np.cos(angle), np.sin(angle)])
    if size is None:
        size = sigmas / np.sqrt(u @ np.linalg.solve(covariance, u))
    return u * size


def _move(d, trial, rows, point, shift):
    net, P = trial.network, trial.start.points
    for i in rows:
        other = net.second[i] if net.first[i] == point else net.first[i]
        before = np.linalg.norm(P[point] - P[other])
        d[i] += np.linalg.norm(P[point] + shift - P[other]) - before


def right(sample, best, readings_rows):
    """Whether a hypothesis is the truth, or the same readings under another name."""
    what = best.what
    if sample.kind == "exchanged_rows" and what.kind == "exchanged_targets":
        return set(readings_rows[what.rows].tolist()) == set(sample.rows)
    if what.kind != sample.kind:
        return False
    if sample.kind in {"offset", "scale", "height"}:
        rows = set(readings_rows[what.rows].tolist())
        truth = set(sample.rows)
        # A block may begin or end a few readings off: chance decides about them.
        return len(rows ^ truth) <= max(6, 0.25 * len(truth))
    if sample.kind == "exchanged_targets":
        return what.subject[0] == sample.subject[0] and {*what.subject[1:]} == {*sample.subject[1:]}
    if sample.kind == "exchanged_rig_points":
        return what.subject[0] == sample.subject[0] and {*what.subject[1:]} == {*sample.subject[1:]}
    if sample.kind == "exchanged_rows":
        return set(readings_rows[what.rows].tolist()) == set(sample.rows)
    if sample.kind == "blunders":
        return set(sample.rows) <= set(readings_rows[what.rows].tolist())
    return (
        tuple(what.subject[: len(sample.subject)]) == sample.subject
        or what.subject == sample.subject
    )
