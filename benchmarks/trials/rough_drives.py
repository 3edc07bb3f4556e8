"""Other drives with errors that last, of a vehicle and receivers as rough as they come.

Nothing is shared with `lasting_errors` but the shape of the result. The road is a random profile
whose spectrum falls with the square of the wave number, as measured roads do, under hills, with
potholes; the body is a damped spring for height, pitch and roll; the driver accelerates and turns
in by steps that a pedal and a wheel smooth, stops, and gusts push him. Antennas are elsewhere on
each vehicle. Sentences are lost singly and in bursts, and receivers fall back to float for seconds.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from rtk_gt.receivers.steps import Steps
from trials.lasting_errors import ETA, FINE, SITE, START, Errors, Made
from validation.poses.angles import Array

ROUGH = (2e-6, 2e-5)
"""Power of the road's height at one turn a metre, m^3, class A to B of ISO 8608."""
WHEELBASE, TRACK = 2.6, 1.6
LOST, BURSTS = 0.01, 300.0
"""Share of the sentences that are lost singly, and seconds between bursts of them."""
FLOAT = 500.0
"""Seconds between float spells of a receiver."""
KINDS = {
    "restart level": (0.05, 2.0),
    "restart up": (0.05, 2.0),
    "all level": (0.10, 2.0),
    "all up": (0.10, 2.0),
    "false level": (0.08, 1.0),
    "false up": (0.15, 1.0),
}
"""Least size, metres, and how many times as large the largest is."""


@dataclass(frozen=True)
class Put:
    """An error that was put in: receivers, first and last second, size (3,)."""

    kind: str
    receivers: tuple[int, ...]
    start: float
    end: float
    size: Array


def rough_drive(
    seed: int,
    errors: Errors,
    *,
    seconds: float = 600.0,
    every: tuple[float, ...] = (0.2, 0.2, 0.2),
    bumps: int = 0,
) -> Made:
    """A drive; ``every`` receiver writes a fix so many seconds.

    With ``bumps`` the road is smooth but for so many speed bumps, 5 to 10 cm high, on ramps of
    0.4 to 1.2 m.
    """
    rng, antennas, poses = _moved(seed, seconds, bumps)
    R = Rotation.from_euler("ZYX", poses[:, 3:]).as_matrix()
    true = poses[:, None, :3] + np.einsum("tij,rj->tri", R, antennas)
    offsets = np.concatenate([np.zeros((1, 3)), rng.normal(0, [80, 80, 3], (2, 3))])
    rows = np.arange(0, round(seconds / FINE), round(min(every) / FINE))
    positions, kinds = np.full((len(rows), 3, 3), np.nan), np.full((len(rows), 3), -1)
    noise = _noise(rng, errors, rows * FINE)
    for r in range(3):
        at = np.arange(0, len(rows), round(every[r] / min(every)))
        positions[at, r] = true[rows[at], r] - offsets[r] + noise[at, r]
        kinds[at, r] = 4
        _floats(rng, rows * FINE, positions[:, r], kinds[:, r])
        gone = rng.uniform(size=len(rows)) < LOST
        for begin in rng.uniform(0, seconds, rng.poisson(seconds / BURSTS)):
            gone |= np.abs(rows * FINE - begin) < rng.uniform(0.3, 2.5)
        positions[gone, r], kinds[gone, r] = np.nan, -1
    some = (kinds >= 0).any(1)
    steps = Steps(
        ("rear", "left", "right"), START + rows[some] * FINE, positions[some], kinds[some], SITE
    )
    return Made(steps, poses[rows[some]], offsets, antennas)


def rough_motion(seed: int, seconds: float) -> tuple[Array, Array]:
    """Antennas (3, 3) and poses (n, 6), one every `FINE` seconds, of a drive."""
    return _moved(seed, seconds)[1:]


def _moved(seed: int, seconds: float, bumps: int = 0) -> tuple[np.random.Generator, Array, Array]:
    """The generator behind a drive, its antennas and its poses."""
    rng = np.random.default_rng([seed, 77])
    antennas = np.array(
        [
            [rng.uniform(-0.4, 0.3), rng.uniform(-0.3, 0.3), rng.uniform(0.0, 0.2)],
            [rng.uniform(1.2, 2.0), rng.uniform(0.3, 0.7), rng.uniform(0.0, 0.2)],
            [rng.uniform(1.2, 2.0), -rng.uniform(0.3, 0.7), rng.uniform(0.0, 0.2)],
        ]
    )
    return rng, antennas, _driven(rng, seconds, bumps)


def spoilt_by(made: Made, seed: int, kind: str) -> tuple[Made, Put]:
    """The drive with an error of a kind in it, and that error."""
    rng = np.random.default_rng([seed, 13, list(KINDS).index(kind)])
    times = made.steps.times
    start = times[0] + rng.uniform(0.15, 0.8) * (times[-1] - times[0])
    least, more = KINDS[kind]
    length, angle = least * rng.uniform(1.0, more), rng.uniform(0, 2 * np.pi)
    size = length * np.array([np.cos(angle), np.sin(angle), 0.0])
    if kind.endswith("up"):
        size = np.array([0.0, 0.0, length * rng.choice([-1, 1])])
    who = {
        "restart": [(0,), (1, 2), (0, 1), (2,)][rng.integers(4)],
        "all": (0, 1, 2),
        "false": (int(rng.integers(3)),),
    }[kind.split(maxsplit=1)[0]]
    end = start + rng.uniform(5, 60) if kind.startswith("false") else np.inf
    rows = np.flatnonzero((times >= start) & (times < end))
    # Told by the first fixes that have it and have it no more.
    fixed = (made.steps.kinds[:, who] == 4).any(1)
    start = times[fixed & (times >= start)][0]
    end = times[fixed & (times >= end)][0] if np.isfinite(end) else end
    return made.jumped(list(who), rows, size), Put(kind, who, float(start), float(end), size)


def _noise(rng: np.random.Generator, errors: Errors, times: Array) -> Array:
    """(t, 3, 3) errors of three receivers."""
    keep = np.exp(-(times[1] - times[0]) / errors.memory)
    driven = rng.standard_normal((len(times), 3, 3)) * np.sqrt(1 - keep**2)
    driven[0] /= np.sqrt(1 - keep**2)
    slow = errors.slow * np.asarray(lfilter([1.0], [1.0, -keep], driven, axis=0))
    white = errors.white * rng.standard_normal((len(times), 3, 3))
    return np.asarray((white + slow) * [1.0, 1.0, ETA])


def _floats(rng: np.random.Generator, times: Array, positions: Array, kinds: Array) -> None:
    """Spells in which a receiver has decimetres of error and says so."""
    for begin in rng.uniform(0, times[-1], rng.poisson(times[-1] / FLOAT)):
        here = (times > begin) & (times < begin + rng.uniform(2, 15)) & (kinds == 4)
        positions[here] += rng.normal(0, 0.3, 3) + rng.normal(0, 0.05, (here.sum(), 3))
        kinds[here] = 5


def _driven(rng: np.random.Generator, seconds: float, bumps: int) -> Array:
    """(n, 6) poses of the roof, one every `FINE` seconds."""
    n = round(seconds / FINE) + 1
    t = np.arange(n) * FINE
    fastest = rng.uniform(5.0, 12.0)
    speed = _held(rng, n, 6.0, lambda size: rng.uniform(0.25, 1.0, size) * fastest)
    for at in rng.uniform(0, seconds, max(rng.poisson(seconds / 150), 1)):
        speed[(t > at) & (t < at + rng.uniform(5, 25))] = 0.0
    speed = gaussian_filter1d(speed, rng.uniform(1.2, 2.0) / FINE)
    bend = _held(rng, n, 4.0, lambda size: rng.normal(0, 0.05, size) * (rng.random(size) < 0.6))
    bend = bend + _held(
        rng, n, 3.0, lambda size: rng.choice([-1, 1], size) * (rng.random(size) < 0.12) * 0.14
    )
    # No more than 2.5 m/s^2 aside, and never tighter than 5 m.
    most = np.minimum(2.5 / np.maximum(speed, 1.0) ** 2, 0.2)
    bend = gaussian_filter1d(np.clip(bend, -most, most), 0.35 / FINE)
    yaw = rng.uniform(-np.pi, np.pi) + np.cumsum(speed * bend) * FINE
    ahead = np.column_stack([np.cos(yaw), np.sin(yaw)])
    place = np.cumsum(speed[:, None] * ahead, axis=0) * FINE
    way = np.cumsum(speed) * FINE
    hills, gradient = _hills(rng, place)
    slope = (gradient * ahead).sum(1)
    across = (gradient * ahead[:, ::-1] * [-1, 1]).sum(1)
    left, right = (_bumpy(rng, way, bumps),) * 2 if bumps else (_road(rng, way), _road(rng, way))
    front, rear = (
        ((left + right) / 2)[:, None],
        _behind(way, (left + right) / 2, WHEELBASE)[:, None],
    )
    push, aside = np.gradient(speed, FINE), speed**2 * bend
    gust = gaussian_filter1d(rng.standard_normal(n), 0.5 / FINE)
    gust = gust / gust.std() * rng.uniform(0.0, 0.008)
    wanted = np.column_stack(
        [
            (front[:, 0] + rear[:, 0]) / 2,
            -np.arctan(slope) - (front - rear)[:, 0] / WHEELBASE - np.radians(0.5) * push,
            np.arctan(across) + (left - right) / TRACK + np.radians(0.8) * aside + gust,
        ]
    )
    body = np.column_stack([_sprung(wanted[:, k], rng.uniform(1.0, 1.8)) for k in range(3)])
    return np.column_stack([place, hills + body[:, 0], yaw, body[:, 1], body[:, 2]])


def _held(rng: np.random.Generator, n: int, usual: float, drawn: object) -> Array:
    """(n,) values that are held for exponential times of a usual length, seconds."""
    lengths = np.maximum((rng.exponential(usual, n // 20 + 2) / FINE).astype(int), 20)
    return np.repeat(drawn(len(lengths)), lengths)[:n]  # type: ignore[operator]


def _road(rng: np.random.Generator, way: Array) -> Array:
    """(n,) heights of one track of the road at places along it, metres."""
    step = 0.1
    count = int((way[-1] - way[0]) / step) + 400
    power = np.exp(rng.uniform(*np.log(ROUGH)))
    # White slopes of this power, leaking over 10 m: the hills are apart.
    slopes = rng.standard_normal(count) * 2 * np.pi * np.sqrt(power / 2 / step)
    heights = lfilter([step], [1.0, -np.exp(-step / 10.0)], slopes)
    for at in rng.integers(0, count, count // 4000 + 1):
        heights[at : at + 8] -= rng.uniform(0.02, 0.05)
    # The tyre averages over its foot.
    return np.interp(way - way[0] + 20.0, np.arange(count) * step, gaussian_filter1d(heights, 2.0))


def _bumpy(rng: np.random.Generator, way: Array, bumps: int) -> Array:
    """(n,) heights of a smooth road with speed bumps, metres."""
    heights = np.zeros(len(way))
    for _ in range(bumps):
        past = way - way[0] - rng.uniform(0.1, 0.9) * (way[-1] - way[0])
        ramp, flat = rng.uniform(0.4, 1.2), rng.uniform(0.3, 4.0)
        up, down = past / ramp, (flat + 2 * ramp - past) / ramp
        heights += rng.uniform(0.05, 0.10) * np.clip(np.minimum(up, down), 0.0, 1.0)
    return heights


def _behind(way: Array, heights: Array, distance: float) -> Array:
    """(n,) heights that the rear wheels have at the same time."""
    keys = way + 1e-9 * np.arange(len(way))
    return np.interp(way - distance, keys, heights)


def _sprung(wanted: Array, often: float, damping: float = 0.35) -> Array:
    """(n,) what a spring of some turns a second makes of a wanted motion."""
    w = 2 * np.pi * often
    a = np.array([1.0, 2 * damping * w, w * w])
    k = 2 / FINE
    top = np.array([2 * damping * w * k + w * w, 2 * w * w, w * w - 2 * damping * w * k])
    low = np.array([k * k + a[1] * k + a[2], 2 * (a[2] - k * k), k * k - a[1] * k + a[2]])
    start = wanted[0]
    return np.asarray(start + lfilter(top / low[0], low / low[0], wanted - start))


def _hills(rng: np.random.Generator, place: Array) -> tuple[Array, Array]:
    """Heights (n,) and gradients (n, 2)."""
    lengths, turns = rng.uniform(50, 300, 10), rng.uniform(0, 2 * np.pi, 10)
    waves = 2 * np.pi / lengths[:, None] * np.column_stack([np.cos(turns), np.sin(turns)])
    phases = place @ waves.T + rng.uniform(0, 2 * np.pi, 10)
    size = np.tan(np.radians(rng.uniform(3.0, 7.0))) / np.sqrt(10) * lengths / (2 * np.pi)
    return (size * np.sin(phases)).sum(1), (size * np.cos(phases)) @ waves
