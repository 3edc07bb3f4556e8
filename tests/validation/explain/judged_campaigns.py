"""Campaigns whose errors depend on their neighbours, have heavy tails, or have a named cause."""

import zlib
from dataclasses import dataclass

import numpy as np
from explain_campaigns import matrix, pose
from scipy import signal

from validation.poses.pose_table import PoseTable

SIGMA = np.array([0.01, 0.01, 0.008])
"""Of the errors of a system, in metres and radians."""
OTHERS = ("rig", "cams", "sonar")


@dataclass(frozen=True)
class Kind:
    """One kind of campaign.

    ``noise`` 'gauss', 'ar0.8' or 't3'; ``cause`` as in `spoiled`; ``n`` stops; ``path`` 'room'
    (stops anywhere, at any heading) or 'drive' (a smooth path, headings along it); ``systems`` how
    many there are, of which the first has the cause; ``survey`` the survey's noise over the
    systems'; ``gross`` the size in standard deviations of the one pose of the first system that is
    wrong; ``size`` how large the cause is.
    """

    noise: str = "gauss"
    cause: str = "none"
    n: int = 20
    path: str = "room"
    systems: int = 1
    survey: float = 0.0
    gross: float = 0.0
    size: float = 1.0
    stated: bool = False

    @property
    def name(self):
        """In short."""
        return f"{self.noise} {self.cause} n={self.n} {self.path} systems={self.systems}"


def noise(kind, rng, n, count=3):
    """(n, count) errors with standard deviation 1 (t3: as it comes, in its own scale)."""
    if kind.startswith("ar"):
        rho = float(kind[2:])
        steps = rng.normal(size=(n, count)) * np.sqrt(1 - rho**2)
        steps[0] = rng.normal(size=count)
        return signal.lfilter([1], [1, -rho], steps, axis=0)
    if kind.startswith("t"):
        return rng.standard_t(float(kind[1:]), (n, count))
    return rng.normal(size=(n, count))


def stops_of(path, rng, n):
    """(n, 3) true poses."""
    if path == "room":
        return np.column_stack(
            [rng.uniform(-3, 3, n), rng.uniform(-4, 4, n), rng.uniform(-np.pi, np.pi, n)]
        )
    # Smooth turns and steps of 0.5 to 0.8 m, heading along the way.
    turns = np.cumsum(rng.normal(size=n) * 0.35)
    steps = rng.uniform(0.5, 0.8, n)
    z = np.cumsum(steps * np.exp(1j * turns))
    heading = np.angle(np.gradient(z))
    return np.column_stack([z.real, z.imag, heading])


def spoiled(cause, truth, size=1.0):  # noqa: C901, PLR0912  (one branch a cause)
    """(n, 3) what a system with the named fault gives."""
    n = len(truth)
    out = truth.copy()
    if cause == "frame":
        out = pose(np.linalg.inv(matrix(size * np.array([0.05, -0.04, 0.02]))) @ matrix(truth))
    elif cause == "turned_frame":
        out = pose(np.linalg.inv(matrix([1.0, 2.0, 3.0])) @ matrix(truth))
    elif cause == "mount":
        out = pose(matrix(truth) @ matrix(size * np.array([0.06, -0.04, 0.02])))
    elif cause == "lever":
        out = pose(matrix(truth) @ matrix([0.31, 0.05, 1.7]))
    elif cause == "scale":
        out[:, :2] /= 1 + 0.02 * size
    elif cause == "mirror":
        out[:, 1], out[:, 2] = -out[:, 1], -out[:, 2]
    elif cause == "exchanged":
        out[:, [0, 1]], out[:, 2] = out[:, [1, 0]], np.pi / 2 - out[:, 2]
    elif cause == "exchanged_positions":
        out[:, [0, 1]] = out[:, [1, 0]]
    elif cause == "mirror_positions":
        out[:, 1] = -out[:, 1]
    elif cause == "degrees":
        out[:, 2] = np.degrees(np.angle(np.exp(1j * out[:, 2])))
    elif cause == "millimetres":
        out[:, :2] *= 1000
    elif cause == "motion":
        z = out[:, 0] + 1j * out[:, 1]
        along = np.angle(np.diff(z))
        out[:, 2] = np.append(along, along[-1])
    elif cause == "drift":
        steps = np.arange(n)[:, None] - (n - 1) / 2
        out -= size * steps * np.array([0.2, -0.1, 0.02]) / n
    elif cause == "growing":
        out -= size * np.arange(n)[:, None] * np.array([0.2, -0.1, 0.02]) / n
    elif cause == "time":
        velocity = np.gradient(np.column_stack([out[:, :2], np.unwrap(out[:, 2])]), axis=0)
        out += size * 0.15 * velocity
    return out


def wrapped(poses):
    """Headings in (-pi, pi]."""
    poses = poses.copy()
    poses[:, 2] = np.angle(np.exp(1j * poses[:, 2]))
    return poses


def table(system, poses, sigma=None, ids=None):
    """A pose table with the ids 1, 2, ..."""
    n = len(poses)
    covariances = np.empty(0) if sigma is None else np.tile(np.diag(sigma**2), (n, 1, 1))
    ids = tuple(str(i + 1) for i in range(n)) if ids is None else ids
    return PoseTable(system, ids, poses, covariances)


def times_of(kind):
    """Seconds of the stops, where the cause is one of time."""
    return {str(i + 1): float(i) for i in range(kind.n)} if kind.cause == "time" else None


def campaign(kind, seed):
    """Validation, systems, the wrong stop ('' if none)."""
    rng = np.random.default_rng([zlib.crc32(repr(kind).encode()), seed])
    truth = stops_of(kind.path, rng, kind.n)
    own = kind.survey * SIGMA
    survey = truth + rng.normal(size=truth.shape) * own if kind.survey else truth
    stop = ""
    systems = []
    for number in range(kind.systems):
        cause = kind.cause if number == 0 else "none"
        before = truth
        errors = noise(kind.noise, rng, kind.n) * SIGMA
        if number == 0 and kind.gross:
            row = int(rng.integers(kind.n))
            way = rng.uniform(-np.pi, np.pi)
            errors[row, :2] += kind.gross * SIGMA[0] * np.array([np.cos(way), np.sin(way)])
            stop = str(row + 1)
        if cause in {"degrees", "millimetres", "motion"}:
            noisy = before + errors
            poses = spoiled(cause, noisy)
        else:
            poses = spoiled(cause, before, kind.size) + errors
        if cause != "degrees":
            poses = wrapped(poses)
        systems.append(table(OTHERS[number], poses, SIGMA if kind.stated else None))
    sigma = np.maximum(own, 0.001) if kind.stated else None
    return table("survey", wrapped(survey), sigma), systems, stop


def copied(n, seed, *, near=0.0, others=0):
    """A survey, a system with two wrong stops, a copy of it, and the names of the guilty.

    ``near`` is the noise of the copy over the system's; ``others`` how many more systems there are.
    """
    rng = np.random.default_rng([n, seed, others, int(1000 * near)])
    truth = stops_of("room", rng, n)
    survey = truth + rng.normal(size=truth.shape) * 0.6 * SIGMA
    wrong = truth + rng.normal(size=truth.shape) * SIGMA
    wrong[rng.choice(n, 2, replace=False), 0] += 0.15
    copy = wrong + near * rng.normal(size=truth.shape) * SIGMA
    systems = [table("rig", wrapped(wrong)), table("copy", wrapped(copy))]
    for name in OTHERS[1 : 1 + others]:
        good = truth + rng.normal(size=truth.shape) * SIGMA
        systems.append(table(name, wrapped(good)))
    return table("survey", wrapped(survey)), systems, {"rig", "copy"}
