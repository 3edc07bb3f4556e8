"""Rooms in which one thing went wrong, made independently of the sample rooms."""

from dataclasses import dataclass, replace

import numpy as np

from survey.causes.lead import effect_size
from survey.causes.linear import Linear
from survey.causes.start import whole_trial
from survey.causes.trial import Effect, fit, law, renamed, with_point
from survey.estimation.geometry import rotate
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
    "exchanged_for_a_time", "stop_run",
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
    """The survey with one thing wrong: ``sigmas`` of its own estimate, or of a given ``size``.

    None where the survey has nothing of the kind, as a second observer.
    """
    what, _, extent = kind.partition("_")
    maker = MAKERS.get(kind) or MAKERS[what]
    made = maker(sample, rng, extent, sigmas, size)
    if made is None:
        return None
    readings, exact, truth = made
    kind_, subject, rows, sizes = truth
    readings = replace(readings, distance=np.round(exact, 3))
    return replace(sample, readings=readings, kind=kind_, subject=subject, rows=rows, sizes=sizes)


def _common(what):
    def make(sample, rng, extent, sigmas, size):
        rows, subject = rows_of(sample, rng, extent)
        if rows is None:
            return None
        if size is None:
            solved = fit(replace(base_trial(sample), effects=(Effect(what, rows, 0.0),)))
            (number,) = effect_size(solved)
            size = float(rng.choice([-1.0, 1.0])) * sigmas * number.sigma
        d = sample.exact.copy()
        d[rows] = law(what, d[rows], size)[0]
        return sample.readings, d, (what, subject, tuple(rows), (size,))

    return make


def _height(sample, rng, extent, sigmas, size):
    r, d = sample.readings, sample.exact.copy()
    subject = ()
    if extent == "point":
        subject = (str(rng.choice(sample.world)),)
        rows = _ending_at(r, subject[0])
    elif extent == "stop":
        rows, subject = rows_of(sample, rng, "stop")
    else:
        rows = np.array([i for i in range(len(r)) if r.end[i] in sample.world])
    if size is None:
        solved = fit(replace(base_trial(sample), effects=(Effect("height", rows, 0.0),)))
        by = np.zeros((1, solved.trial.unknowns))
        by[0, -1] = 1
        size = float(np.sqrt(sigmas * np.sqrt(solved.covariance(by)[0, 0])))
    d[rows] = np.hypot(d[rows], size)
    return r, d, ("height", subject, tuple(rows), (size,))


def _ending_at(r, name):
    return np.array([i for i in range(len(r)) if name in {r.start[i], r.end[i]}])


def _moved(sample, rng, _, sigmas, size):
    d, trial = sample.exact.copy(), base_trial(sample)
    name = str(rng.choice(sample.world))
    point, rows = trial.network.points.index(name), _ending_at(sample.readings, name)
    k = int(rng.integers(3, len(rows) - 2))
    split, new = with_point(trial, "later", trial.start.points[point])
    shift = _shift(fit(renamed(split, rows[k:], point, new)), new, point, 0.0, rng, sigmas, size)
    _move(d, trial, rows[k:], point, shift)
    return sample.readings, d, ("moved", (name,), tuple(rows[k:]), tuple(shift))


def _vframe_point(sample, rng, _, sigmas, size):
    d, trial = sample.exact.copy(), base_trial(sample)
    name = str(rng.choice(list(sample.vframe.points)))
    point = trial.network.points.index(name)
    solved = fit(replace(trial, released=frozenset({name})))
    shift = _shift(solved, point, None, sample.vframe.sigma, rng, sigmas, size)
    _move(d, trial, _ending_at(sample.readings, name), point, shift)
    return sample.readings, d, ("vframe_point", (name,), (), tuple(shift))


def _rig_mark(sample, rng, _, sigmas, size):
    d, trial = sample.exact.copy(), base_trial(sample)
    net = trial.network
    q = int(rng.integers(len(net.mark)))
    point = int(net.mark[q])
    name = net.points[point]
    solved = fit(replace(trial, released=frozenset({name})))
    theta = solved.at.poses[net.mark_pose[q], 2]
    covariance = solved.covariance(_mark_rows(solved, q)) + net.marking_sigma**2 * np.eye(2)
    shift = _draw(covariance, rng, sigmas, size)
    turn = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
    _move(d, trial, _ending_at(sample.readings, name), point, turn @ shift)
    return sample.readings, d, ("rig_mark", tuple(name.split("/")), (), tuple(shift))


def _exchanged_targets(sample, rng, *_):
    r = sample.readings
    rows, (stop,) = rows_of(sample, rng, "stop")
    a, b = (str(x) for x in rng.choice(sample.world, 2, replace=False))
    swap, end = {a: b, b: a}, list(r.end)
    for i in rows:
        end[i] = swap.get(end[i], end[i])
    truth = ("exchanged_targets", (stop, a, b), (), ())
    return replace(r, end=tuple(end)), sample.exact.copy(), truth


def _starts(sample, swap, truth):
    """The survey with names of marks written for others."""
    r = sample.readings
    start = tuple(swap.get(name, name) for name in r.start)
    return replace(r, start=start), sample.exact.copy(), truth


def _exchanged_rig_points(sample, rng, *_):
    stop = str(rng.integers(1, sample.stops + 1))
    a, b = (str(x) for x in rng.choice(list(RIG.points), 2, replace=False))
    swap = {f"{stop}/{a}": f"{stop}/{b}", f"{stop}/{b}": f"{stop}/{a}"}
    return _starts(sample, swap, ("exchanged_rig_points", (stop, a, b), (), ()))


def _stop_number(sample, rng, *_):
    stop, other = (str(k) for k in rng.choice(np.arange(1, sample.stops + 1), 2, replace=False))
    point = str(rng.choice(list(RIG.points)))
    swap = {f"{stop}/{point}": f"{other}/{point}"}
    return _starts(sample, swap, ("stop_number", (other, stop, point), (), ()))


def _new_stop(sample, rng, *_):
    stop = int(rng.integers(1, sample.stops))
    swap = {f"{stop + 1}/{p}": f"{stop}/{p}" for p in RIG.points}
    return _starts(sample, swap, ("stop_number", (str(stop), ""), (), ()))


def _exchanged_for_a_time(sample, rng, *_):
    r = sample.readings
    first, last = np.sort(rng.choice(np.arange(2, sample.stops), 2, replace=False))
    a, b = (str(x) for x in rng.choice(sample.world, 2, replace=False))
    swap, stops = {a: b, b: a}, {str(k) for k in range(first, last + 1)}
    end = tuple(
        swap.get(there, there) if here.split("/")[0] in stops and "/" in here else there
        for here, there in zip(r.start, r.end, strict=True)
    )
    truth = ("exchanged_targets", (str(first), a, b, str(last)), (), ())
    return replace(r, end=end), sample.exact.copy(), truth


def _stop_run(sample, rng, *_):
    stop, other = (str(k) for k in rng.choice(np.arange(1, sample.stops + 1), 2, replace=False))
    rows = [i for i, name in enumerate(sample.readings.start) if name.startswith(f"{stop}/")]
    rows = rows[int(rng.integers(0, len(rows) // 2)) :]
    start = list(sample.readings.start)
    for i in rows:
        start[i] = f"{other}/{start[i].split('/')[1]}"
    truth = ("stop_number", (), tuple(rows), ())
    return replace(sample.readings, start=tuple(start)), sample.exact.copy(), truth


def _exchanged_rows(sample, rng, _, sigmas, __):
    d = sample.exact.copy()
    i = j = 0
    while i == j or abs(d[i] - d[j]) < max(sigmas, 8.0) * 0.0035:
        i, j = (int(k) for k in np.sort(rng.choice(np.arange(6, len(d)), 2, replace=False)))
        if rng.uniform() < 0.5:
            j = min(i + 1, len(d) - 1)
    d[[i, j]] = d[[j, i]]
    return sample.readings, d, ("exchanged_rows", (), (i, j), ())


def _blunders(sample, rng, extent, sigmas, size):
    d, count = sample.exact.copy(), int(extent)
    rows = np.sort(rng.choice(len(d), count, replace=False))
    red = Linear(fit(base_trial(sample))).redundancy[rows]
    each = sigmas * sample.readings.sigma[rows] / np.sqrt(red) if size is None else abs(size)
    sizes = rng.choice([-1.0, 1.0], count) * each * rng.uniform(1, 1.5, count)
    d[rows] += sizes
    return sample.readings, d, ("blunders", (), tuple(int(i) for i in rows), tuple(sizes))


MAKERS = {
    "offset": _common("offset"),
    "scale": _common("scale"),
    "height": _height,
    "moved": _moved,
    "vframe_point": _vframe_point,
    "rig_mark": _rig_mark,
    "exchanged_targets": _exchanged_targets,
    "exchanged_rig_points": _exchanged_rig_points,
    "stop_number": _stop_number,
    "new_stop": _new_stop,
    "exchanged_rows": _exchanged_rows,
    "exchanged_for_a_time": _exchanged_for_a_time,
    "stop_run": _stop_run,
    "blunders": _blunders,
}


def _mark_rows(solved, q):
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


def _shift(solved, row, old, nominal, rng, sigmas, size):
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
    what, kind = best.what, sample.kind
    rows = set(readings_rows[what.rows].tolist())
    names = {"exchanged_rows", "exchanged_targets"}
    if kind == "exchanged_rows":
        return what.kind in names and rows == set(sample.rows)
    if what.kind != kind:
        return False
    if kind in {"offset", "scale", "height"} or (kind == "stop_number" and sample.rows):
        # A block may begin or end a few readings off: chance decides about them.
        return len(rows ^ set(sample.rows)) <= max(6, 0.25 * len(sample.rows))
    if kind in {"exchanged_targets", "exchanged_rig_points"}:
        named, truth = what.subject, sample.subject
        same = named[0] == truth[0] and named[3:] == truth[3:]
        return same and {*named[1:3]} == {*truth[1:3]}
    if kind == "blunders":
        return set(sample.rows) <= rows
    return what.subject == sample.subject
