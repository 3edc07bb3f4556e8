"""Drives of a robot past cameras, with clocks that are off: nastier than the models know."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from validation.poses.trajectory import Trajectory

LEVELS = (
    {"noise": (0.003, 0.002), "jitter": 0.0, "outliers": 0.005, "drift": 0.0},
    {"noise": (0.008, 0.005), "jitter": 0.002, "outliers": 0.02, "drift": 0.0},
    {"noise": (0.015, 0.010), "jitter": 0.010, "outliers": 0.03, "drift": 100e-6},
    {"noise": (0.030, 0.020), "jitter": 0.030, "outliers": 0.05, "drift": 200e-6},
)


@dataclass(frozen=True)
class Drive:
    reference: Trajectory
    sources: list[Trajectory]
    delays: np.ndarray  # at the middle of the drive
    drifts: np.ndarray
    middle: float

    def delay_at(self, k, at):
        return self.delays[k] + self.drifts[k] * (at - self.middle)


def ordinary(rng, duration):
    """Goals at random in a room of 10 x 8 m, with stops: (times, x, y, theta)."""
    dt = 0.05
    n = int(duration / dt) + 1
    out = np.empty((n, 3))
    x, y, th, v, w = 2.0, 2.0, 0.3, 0.0, 0.0
    goal, top, wait = rng.uniform([0.5, 0.5], [9.5, 7.5]), 0.5, 0.0
    for i in range(n):
        out[i] = x, y, th
        dx, dy = goal[0] - x, goal[1] - y
        far = np.hypot(dx, dy)
        turn = np.remainder(np.arctan2(dy, dx) - th + np.pi, 2 * np.pi) - np.pi
        if far < 0.3 and wait <= 0:
            goal, top = rng.uniform([0.5, 0.5], [9.5, 7.5]), rng.uniform(0.2, 0.9)
            wait = rng.uniform(1, 5) if rng.random() < 0.3 else 0.0
        wait -= dt
        wanted = 0.0 if wait > 0 else top * max(0.0, np.cos(turn)) * min(1.0, far)
        spin = 0.0 if wait > 0 else np.clip(1.5 * turn, -0.8, 0.8)
        v += np.clip(wanted - v, -0.6 * dt, 0.6 * dt)
        w += np.clip(spin - w, -1.5 * dt, 1.5 * dt)
        x, y, th = x + v * dt * np.cos(th), y + v * dt * np.sin(th), th + w * dt
    return np.arange(n) * dt, out


def along(speed_profile, turn_profile, duration):
    """The path of given speeds and turn rates, from (2, 2, 0.3)."""
    dt = 0.01
    t = np.arange(0, duration + dt / 2, dt)
    v, w = speed_profile(t), turn_profile(t)
    th = 0.3 + np.concatenate([[0.0], np.cumsum((w[1:] + w[:-1]) / 2 * dt)])
    c, s = v * np.cos(th), v * np.sin(th)
    x = 2 + np.concatenate([[0.0], np.cumsum((c[1:] + c[:-1]) / 2 * dt)])
    y = 2 + np.concatenate([[0.0], np.cumsum((s[1:] + s[:-1]) / 2 * dt)])
    return t[::5], np.column_stack([x, y, th])[::5]


def odometry(rng, t, pose):
    """Steps of a body with white errors, errors of scale, a bias of the turn rate."""
    dp = np.diff(pose, axis=0)
    mid = (pose[1:, 2] + pose[:-1, 2]) / 2
    ds = np.cos(mid) * dp[:, 0] + np.sin(mid) * dp[:, 1]
    side = -np.sin(mid) * dp[:, 0] + np.cos(mid) * dp[:, 1]
    moved = np.abs(ds) + 0.2 * np.abs(dp[:, 2])
    ds = ds * (1 + 0.01 * rng.normal()) + 0.004 * np.sqrt(moved) * rng.normal(size=len(ds))
    side = side + 0.002 * np.sqrt(moved) * rng.normal(size=len(ds))
    moving = moved > 1e-6
    dth = dp[:, 2] * (1 + 0.01 * rng.normal()) + 0.006 * np.sqrt(moved) * rng.normal(size=len(ds))
    dth += 1e-3 * rng.normal() * np.diff(t) * moving
    th = np.concatenate([[0.0], np.cumsum(dth)])
    m = (th[1:] + th[:-1]) / 2
    x = np.concatenate([[0.0], np.cumsum(np.cos(m) * ds - np.sin(m) * side)])
    y = np.concatenate([[0.0], np.cumsum(np.sin(m) * ds + np.cos(m) * side)])
    return np.column_stack([x, y, th])


def latency(rng, n, std):
    """Exponential half the time, else a gamma: mean and draws of a standard deviation."""
    if std == 0:
        return 0.0, np.zeros(n)
    shape = rng.choice([1.0, 2.0])
    return std * np.sqrt(shape), rng.gamma(shape, std / np.sqrt(shape), n)


def drive(  # noqa: PLR0915  (one drive, from its path to its stamps)
    rng,
    level=0,
    cameras=4,
    duration=None,
    reference="odometry",
    path=None,
    whole=False,
    delay_range=(-0.3, 0.34),
    **changed,
):
    """A drive with its sources; truth beside it."""
    facts = {**LEVELS[level], **changed}
    if path is None:
        t0, pose = ordinary(rng, duration or rng.uniform(300, 600))
    else:
        t0, pose = path
    duration = t0[-1]
    true = CubicSpline(t0, pose)
    tr = np.arange(0.0, duration, 0.02)
    if isinstance(reference, str):
        ref = odometry(rng, tr, true(tr))
    else:
        ref = true(tr) + rng.normal(size=(len(tr), 3)) * reference
    ref[:, 2] = np.remainder(ref[:, 2] + np.pi, 2 * np.pi) - np.pi
    sources, delays, drifts = [], [], []
    sp, sh = facts["noise"]
    for k in range(cameras):
        period = 0.1 * (1 + 1e-4 * rng.normal())
        t = np.arange(rng.uniform(0.5, 0.6), duration - 0.5, period)
        p = true(t)
        if not whole:
            cx, cy = rng.uniform(2.5, 7.5), rng.uniform(2, 6)
            seen = (np.abs(p[:, 0] - cx) < 2.8) & (np.abs(p[:, 1] - cy) < 2.4)
            if seen.sum() < 400:
                seen[:] = True
            t, p = t[seen], p[seen]
        kept = rng.random(len(t)) > 0.03
        t, p = t[kept], p[kept]
        n = len(t)
        mount = np.array([*rng.normal(0, 0.1, 2), rng.uniform(-3, 3)])
        frame = np.array([*rng.normal(0, 5, 2), rng.uniform(-3, 3)])
        c, s = np.cos(p[:, 2]), np.sin(p[:, 2])
        q = p[:, :2] + np.column_stack([c * mount[0] - s * mount[1], s * mount[0] + c * mount[1]])
        cf, sf = np.cos(frame[2]), np.sin(frame[2])
        q = np.column_stack([cf * q[:, 0] - sf * q[:, 1], sf * q[:, 0] + cf * q[:, 1]]) + frame[:2]
        th = p[:, 2] + mount[2] + frame[2]
        q = q + sp * rng.normal(size=(n, 2))
        th = th + sh * rng.normal(size=n)
        bad = rng.random(n) < facts["outliers"]
        kind = rng.random(n)
        q[bad & (kind < 0.6)] += rng.normal(0, 0.5, (int((bad & (kind < 0.6)).sum()), 2))
        th[bad & (kind < 0.3)] += rng.normal(0, 0.5, int((bad & (kind < 0.3)).sum()))
        th[bad & (kind >= 0.6)] += np.pi
        delay, drift = rng.uniform(*delay_range), facts["drift"] * rng.choice([-1, 1])
        mean, late = latency(rng, n, facts["jitter"])
        stamps = t - delay - drift * (t - duration / 2) + late
        if rng.random() < 0.5:
            # Messages that come in one burst keep their order, 2 ms apart.
            step = 0.002 * np.arange(n)
            stamps = np.maximum.accumulate(stamps - step) + step
        order = np.argsort(stamps, kind="stable")
        stamps, q, th = stamps[order], q[order], th[order]
        new = np.concatenate([[True], np.diff(stamps) > 1e-9])
        stamps, q, th = stamps[new], q[new], th[new]
        th = np.remainder(th + np.pi, 2 * np.pi) - np.pi
        sources.append(Trajectory(f"camera_{k + 1}", stamps, np.column_stack([q, th])))
        delays.append(delay - mean)
        drifts.append(drift)
    return Drive(
        Trajectory("reference", tr, ref), sources, np.array(delays), np.array(drifts), duration / 2
    )
