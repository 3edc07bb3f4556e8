"""A hypothesis worth trying, and what the survey's rows say besides distances."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.special import logsumexp

from survey.causes.trial import Fit, Rows, Trial
from survey.estimation.geometry import rotate
from survey.estimation.network import design
from survey.readings.point_names import robot_point
from survey.readings.readings import Readings
from validation.poses.angles import Array
from validation.statistics.hypotheses import Parameter, parameter

Sizes = Callable[[Fit], list[Parameter]]
LENGTH_RANGE = 1.0
"""Metres within which an error of a length lies before anything is known: 0.5 m to either side. A
judgement; ten times as much would cost a hypothesis 4.6, as much as ten times the places."""


@dataclass(frozen=True)
class Lead:
    """A hypothesis that the linearised survey speaks for.

    Parameters
    ----------
    kind : str
        'offset', 'scale', 'height', 'moved', 'vframe_point', 'rig_mark', 'rig_point',
        'exchanged_targets', 'exchanged_rig_points', 'stop_number', 'exchanged_rows', 'blunders'.
    extent : str
        Where: 'all', 'station', 'observer', 'day', 'from', 'until', 'block', 'point', 'rows'.
    subject : tuple of str
        Names: the stop, the points, the observer.
    rows : (r,) array of int
        Distances that it speaks about.
    gain : float
        Decrease of chi-squared, to first order.
    places : float
        Number of places of the same kind that were searched.
    build : callable
        The trial with it, from one without.
    sizes : callable
        Its numbers, from the solution.
    also : tuple of str
        What it cannot be told from, because it is the same readings.
    cost : float
        Of freedom that is not in ``sizes``, as `Parameter.cost`.
    equal : tuple of Lead
        Those that ``also`` names.
    """

    kind: str
    extent: str
    subject: tuple[str, ...]
    rows: Rows
    gain: float
    places: float
    build: Callable[[Trial], Trial]
    sizes: Sizes = field(default=lambda _: [])
    also: tuple[str, ...] = ()
    cost: float = 0.0
    equal: tuple["Lead", ...] = ()


@dataclass(frozen=True)
class Log:
    """What is known of the n distances besides their lengths.

    Parameters
    ----------
    order : (n,) array of int
        Rows in the order in which they were read.
    station : tuple of str, length n
        Where the laser was: a stop, or a Vframe point.
    observer, day : tuple of str, length n
        '' where not noted.
    """

    order: Rows
    station: tuple[str, ...]
    observer: tuple[str, ...]
    day: tuple[str, ...]

    def groups(self, names: Sequence[str]) -> dict[str, Rows]:
        """Rows by name, in the order read, '' left out."""
        numbers: dict[str, int] = {}
        number = np.array([numbers.setdefault(names[row], len(numbers)) for row in self.order])
        rows = self.order[np.argsort(number, kind="stable")]
        ends = np.cumsum(np.bincount(number, minlength=len(numbers)))
        own = np.split(rows, ends[:-1])
        return {name: group for name, group in zip(numbers, own, strict=True) if name}


def log_of(readings: Readings, vframe: Sequence[str]) -> Log:
    """The log of readings; in the order of the file where not all have a time."""
    stations = []
    for a, b in zip(readings.start, readings.end, strict=True):
        stop = robot_point(a) or robot_point(b)
        stations.append(stop[0] if stop else a if a in vframe or b not in vframe else b)
    times = readings.time
    order = np.arange(len(readings))
    if all(times):
        order = np.array(sorted(order, key=lambda row: (times[row], row)), dtype=np.intp)
    days = tuple(time.replace(" ", "T").split("T")[0] if time else "" for time in times)
    return Log(order, tuple(stations), readings.observer, days)


def effect_size(fit: Fit) -> list[Parameter]:
    """The last of the common errors: an offset, a scale, or a height from its square.

    It costs what its mean effect on the readings would cost as an offset: laws that change the
    readings alike cost the same.
    """
    effect, b = fit.trial.effects[-1], float(fit.values[-1])
    by = np.zeros((1, fit.trial.unknowns))
    by[0, -1] = 1.0
    sigma = float(np.sqrt(fit.covariance(by)[0, 0]))
    rows = effect.rows
    column = fit.jacobian[rows][:, [-1]].toarray()[:, 0] * fit.trial.network.sigma[rows]
    seen = sigma * float(np.sqrt(np.mean(column**2)))
    if effect.law != "height":
        unit = "m" if effect.law == "offset" else ""
        return [parameter(effect.law, unit, b, sigma, LENGTH_RANGE, cost_sigma=seen)]
    low, high = (float(np.sqrt(max(b + s * 1.96 * sigma, 0.0))) for s in (-1, 1))
    size = float(np.sqrt(max(b, 1e-9)))
    of_size = sigma / (2 * size)
    return [
        parameter("height", "m", size, of_size, LENGTH_RANGE, interval=(low, high), cost_sigma=seen)
    ]


def place_sizes(row: int, old: int | None, nominal: Array | None, sigma: float) -> Sizes:
    """How far a point is off another point ``old``, or off a nominal place known to ``sigma``."""

    def sizes(fit: Fit) -> list[Parameter]:
        by = np.zeros((2, fit.trial.unknowns))
        by[[0, 1], [2 * row, 2 * row + 1]] = 1.0
        base = nominal
        if old is not None:
            by[[0, 1], [2 * old, 2 * old + 1]] = -1.0
            base = fit.at.points[old]
        return _two(fit.at.points[row] - np.asarray(base), fit.covariance(by), sigma)

    return sizes


def mark_sizes(mark: int) -> Sizes:
    """How far the mark ``mark`` (of the network's marks) is off its rig point, robot frame."""

    def sizes(fit: Fit) -> list[Parameter]:
        net = fit.trial.network
        row, pose = int(net.mark[mark]), int(net.mark_pose[mark])
        state, body = fit.at.poses[pose], int(net.mark_rig[mark])
        seen = rotate(-state[2], fit.at.points[row] - state[:2])
        p, f, _ = net.sizes
        c, s = np.cos(state[2]), np.sin(state[2])
        back = np.array([[c, s], [-s, c]])
        by = np.zeros((2, fit.trial.unknowns))
        by[:, 2 * row : 2 * row + 2] = back
        by[:, p + 3 * pose : p + 3 * pose + 2] = -back
        by[:, p + 3 * pose + 2] = [seen[1], -seen[0]]
        by[:, p + f + 2 * body : p + f + 2 * body + 2] -= np.eye(2)
        return _two(seen - fit.at.rig[body], fit.covariance(by), net.marking_sigma)

    return sizes


def rig_sizes(body: int) -> Sizes:
    """How far a rig point is off its nominal place, robot frame."""

    def sizes(fit: Fit) -> list[Parameter]:
        net = fit.trial.network
        first = sum(net.sizes[:2]) + 2 * body
        by = np.zeros((2, fit.trial.unknowns))
        by[[0, 1], [first, first + 1]] = 1.0
        return _two(fit.at.rig[body] - net.rig[body], fit.covariance(by), net.rig_sigma)

    return sizes


def _two(shift: Array, covariance: Array, nominal: float) -> list[Parameter]:
    """Both coordinates of a shift; its own spread ``nominal`` is not part of the cause."""
    whole = covariance + nominal**2 * np.eye(2)
    # What both cost together is shared between them: det of the covariance, not its diagonal.
    joint = float(np.linalg.det(whole)) ** 0.25
    return [
        parameter(name, "m", float(value), float(np.sqrt(variance)), LENGTH_RANGE, cost_sigma=joint)
        for name, value, variance in zip("xy", shift, np.diagonal(whole), strict=True)
    ]


def blunder_sizes(rows: Rows) -> Sizes:
    """Reading less truth of dropped distances."""

    def sizes(fit: Fit) -> list[Parameter]:
        net = fit.trial.network
        residual, jacobian = design(net, fit.at)
        by = csr_array(jacobian[rows])
        by.resize(len(rows), fit.trial.unknowns)
        variance = fit.cofactors.leverage(by) + 1
        sigma = net.sigma[rows]
        return [
            parameter(f"row {row}", "m", float(v * s), float(np.sqrt(q) * s), LENGTH_RANGE)
            for row, v, s, q in zip(rows, residual[rows], sigma, variance, strict=True)
        ]

    return sizes


def look_elsewhere(trial: Trial, places: float) -> float:
    """What a lead of a large survey (`MANY`) must gain besides, for its places; else nothing."""
    return 2 * float(np.log(max(places, 1.0))) if len(trial.network.distance) > MANY else 0.0


MANY = 3000
"""Distances above which a lead that cannot pay for its places is not solved: some of a thousand
stops and marks always fit better by chance, and each solution takes as long as the survey's. A
judgement: 26 stops of the document have 1,248, and 60 would have 3,000."""


def aligned(station: Sequence[str]) -> npt.NDArray[np.bool_]:
    """(n + 1,) edges of n readings at which the laser is moved; both ends are."""
    moved = [a != b for a, b in pairwise(station)]
    return np.array([True, *moved, True], dtype=bool)


def spread_places(
    evidence: Array, natural: npt.NDArray[np.bool_]
) -> tuple[tuple[int, ...], float] | None:
    """The likeliest of many places, and the number of places that it stands for.

    Parameters
    ----------
    evidence : (...) array
        2 log of the evidence of each but for a constant, -inf where there is none.
    natural : (...) array of bool
        Places that people are likely to choose: together as likely as all.

    Returns
    -------
    index, places : tuple of int, float
        ``places`` is such that a search of so many, all but one of them hopeless, would have the
        evidence of all these together: neighbours that fit as well take part.
    """
    live = np.isfinite(evidence)
    if not live.any():
        return None
    each = np.where(natural, 0.5 / max(int(natural.sum()), 1), 0.0) + 0.5 / evidence.size
    prior = 2 * np.log(each)
    index = np.unravel_index(int((evidence + prior).argmax()), evidence.shape)
    rest = (evidence - evidence[index]) / 2 + prior / 2
    return tuple(int(i) for i in index), float(np.exp(-logsumexp(rest[live])))


def largest_gains(gain: Array) -> Array:
    """(...) sums of the runs along the last axis that `longest_gain` finds, 0 where none."""
    total = np.cumsum(gain, axis=-1)
    before = np.minimum(np.minimum.accumulate(total, axis=-1), 0.0)
    low = np.concatenate([np.zeros_like(total[..., :1]), before[..., :-1]], axis=-1)
    return np.asarray(np.maximum((total - low).max(axis=-1, initial=0.0), 0.0))


def longest_gain(gain: Array) -> tuple[int, int] | None:
    """Ends of the run of the largest sum; None if nothing is positive."""
    best, total, start, found = 0.0, 0.0, 0, None
    for k, value in enumerate(gain):
        if total <= 0:
            total, start = 0.0, k
        total += float(value)
        if total > best:
            best, found = total, (start, k + 1)
    return found
