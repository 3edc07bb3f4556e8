"""Strength of the prior and noise of the sources, by maximum likelihood.

The likelihood is that of all measurements with the trajectory integrated out, on the equations as
they are linear at the present state. Its slope in a variance is that of the expected squares of
the residuals (Fisher's identity), which the marginal covariances give at the cost of one solution.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.trajectories.smoothing.equations import Solved, Weights, solve
from validation.trajectories.smoothing.geometry import advance, lengths, strength_groups
from validation.trajectories.smoothing.prior import information, log_determinants
from validation.trajectories.smoothing.problem import Problem, Residuals, State, residuals, shifts

LOW = {"strength": 1e-8, "position": 1e-6, "angle": 1e-6, "jitter": 1e-5, "odometry": 1e-6}
HIGH = {"strength": 1e4, "position": 10.0, "angle": 3.0, "jitter": 0.3, "odometry": 1.0}
"""Bounds of what is estimated, far outside of what is met: they keep a noise that the data put at
nothing from running to minus infinity in its logarithm."""
ITERATIONS = 15
"""Steps of the search; from the second round on it starts a few percent from its end."""

STIFFEST = 1e8
"""Ratio of the prior's information to a frame's; of 16 digits 8 remain for the frames."""

NO_PRIOR = 1e4
"""Strength of a prior that says nothing: 300 times what the hardest start of a robot asks for."""

Name = tuple[str, int]


@dataclass(frozen=True)
class Noise:
    """Standard deviations and strengths.

    Parameters
    ----------
    strength : (g,) array
        Of each group of freedoms, m^2/s^3 or rad^2/s^3.
    position, angle : (q,) arrays
        Of each source, m and rad, or factors of stated ones.
    jitter : (q,) array
        Of the stamps of each source, s.
    odometry : (6,) array
        Along, across and in angle: each a walk per root of a second, and one per root of a metre.
    """

    strength: Array
    position: Array
    angle: Array
    jitter: Array
    odometry: Array

    def get(self, names: list[Name]) -> Array:
        """Values of some."""
        return np.array([getattr(self, field)[place] for field, place in names])

    def put(self, names: list[Name], values: Array) -> "Noise":
        """With some replaced."""
        fields = {
            field: getattr(self, field).copy()
            for field in ("strength", "position", "angle", "jitter", "odometry")
        }
        for (field, place), value in zip(names, values, strict=True):
            fields[field][place] = value
        return replace(self, **fields)


def strengths(problem: Problem, noise: Noise) -> Array:
    """(m,) strength of the prior in each freedom."""
    found = np.empty(problem.m)
    for group, value in zip(strength_groups(problem.kind), noise.strength, strict=True):
        found[group] = value
    return found


def _scaled(problem: Problem, noise: Noise) -> Array:
    """(f, m, m) covariances of the frames without jitter."""
    source, d, m = problem.frames.source, lengths(problem.kind), problem.m
    factor = np.empty((len(source), m))
    factor[:, :d], factor[:, d:] = noise.position[source, None], noise.angle[source, None]
    if problem.frames.stated is None:
        return np.asarray(np.einsum("fi,ij->fij", factor**2, np.eye(m)))
    return np.asarray(factor[:, :, None] * problem.frames.stated * factor[:, None, :])


def frame_covariances(problem: Problem, noise: Noise, along: Array) -> Array:
    """(f, m, m) covariances of the frames, with what jitter adds along the motion."""
    jittered = noise.jitter[problem.frames.source, None] * along
    return _scaled(problem, noise) + jittered[:, :, None] * jittered[:, None, :]


def odometry_variances(problem: Problem, noise: Noise) -> Array:
    """(n - 1, m) variances of the odometry over each step, in the moving frame."""
    assert problem.steps is not None
    dt, moved = np.diff(problem.times), problem.steps.moved
    pairs = noise.odometry.reshape(3, 2) ** 2
    return (pairs[:, 0] * dt[:, None] + pairs[:, 1] * moved[:, None])[:, _parts(problem)]


def _parts(problem: Problem) -> list[int]:
    """0, 1 or 2 for each freedom: along, across, angle."""
    d = lengths(problem.kind)
    return [0] + [1] * (d - 1) + [2] * (problem.m - d)


def weights_of(problem: Problem, found: Residuals, noise: Noise, trust: Array) -> Weights:
    """Inverse covariances of everything; those of frames times their trust (f,)."""
    inverse = np.linalg.inv(frame_covariances(problem, noise, found.along))
    odometry = None
    if problem.steps is not None:
        inverse_variances = problem.steps.known[:, None] / odometry_variances(problem, noise)
        odometry = (found.turned * inverse_variances[:, None, :]) @ np.swapaxes(found.turned, 1, 2)
    return Weights(inverse * trust[:, None, None], strengths(problem, noise), odometry)


def estimate_noise(problem: Problem, state: State, noise: Noise, names: list[Name]) -> Noise:
    """The noise under which the measurements are most likely.

    Parameters
    ----------
    problem : Problem
        A part of the measurements, without outliers, short enough to be solved many times.
    state : State
        Where the equations are made linear.
    noise : Noise
        Start.
    names : list of (str, int)
        What is estimated; the rest stays.
    """
    found = residuals(problem, state)
    low = np.log([LOW[field] for field, _ in names])
    low[[field == "strength" for field, _ in names]] = np.log(_least_strength(problem, noise))
    high = np.log([HIGH[field] for field, _ in names])

    def cost(logs: Array) -> tuple[float, Array]:
        try:
            value, slope = _likelihood(problem, found, state, noise.put(names, np.exp(logs)), names)
        except (GtvalError, np.linalg.LinAlgError):
            # Beyond the precision of numbers: the search turns back.
            return 1e15, np.zeros(len(logs))
        return -value, -slope

    start = np.clip(np.log(noise.get(names)), low, high)
    best = minimize(
        cost,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=list(zip(low, high, strict=True)),
        options={"maxiter": ITERATIONS, "ftol": 1e-7},
    )
    return noise.put(names, np.exp(best.x))


def odometry_noise(problem: Problem, state: State, noise: Noise) -> Noise:
    """The noise of the odometry under which the poses are most likely, whatever the robot did.

    Parameters
    ----------
    problem : Problem
        As for `estimate_noise`.
    state : State
        Where the equations are made linear; its rates carry the frames to their knots.
    noise : Noise
        Start, and the noise of the sources.

    Notes
    -----
    A prior of the motion takes part of this noise for motion: robots move more smoothly than white
    noise on acceleration, and the likelihood makes up for the power that such a prior expects
    where there is none. So the prior is put out of work, and the odometry is judged by the poses
    at both ends of its ways alone.
    """
    if problem.steps is None:
        return noise
    frames = problem.frames
    along = state.rates[frames.knot] * (frames.offset + shifts(problem, state.shared))[:, None]
    at_knots = replace(
        frames,
        poses=advance(problem.kind, frames.poses, -along),
        offset=-shifts(problem, state.shared),
    )
    free = replace(noise, strength=np.full(len(noise.strength), NO_PRIOR))
    names = [("odometry", place) for place in range(6)]
    found = estimate_noise(replace(problem, frames=at_knots), state, free, names)
    return replace(noise, odometry=found.odometry)


def all_covariances(solved: Solved) -> tuple[Array, Array]:
    """Covariances of all knots (n, 2m, 2m), and of each with the next (n, 2m, 2m)."""
    chunks = list(solved.factor.covariances())[::-1]
    own = np.concatenate([inverse[:-1] for _, inverse, _ in chunks])
    return own, np.concatenate([beside for *_, beside in chunks])


def _least_strength(problem: Problem, noise: Noise) -> float:
    """The strength below which the equations lose their last digits.

    The prior's information of a step, 12 / (q T^3), is then `STIFFEST` times that of a frame.
    """
    step = float(np.median(np.diff(problem.times)))
    variance = float(np.median(frame_variances(problem, noise)))
    return float(np.clip(12 * variance / (step**3 * STIFFEST), LOW["strength"], 1e-2))


def frame_variances(problem: Problem, noise: Noise) -> Array:
    """(f,) variance of a position in each axis."""
    d = lengths(problem.kind)
    scaled = _scaled(problem, noise)
    return np.asarray(np.einsum("fii->f", scaled[:, :d, :d]) / d)


def _likelihood(
    problem: Problem, found: Residuals, state: State, noise: Noise, names: list[Name]
) -> tuple[float, Array]:
    """Logarithm of the likelihood, less a constant, and its slope in the logarithms."""
    weights = weights_of(problem, found, noise, np.ones(len(problem.frames.knot)))
    solved = solve(problem, found, weights, state.shared, hold=True)
    slopes = {}
    total = -solved.factor.log_determinant
    inverse, beside = all_covariances(solved)
    for part in (_of_frames, _of_prior, _of_odometry):
        value, some = part(problem, found, noise, weights, solved, (inverse, beside))
        total += value
        slopes.update(some)
    return total / 2, np.array([slopes[name] for name in names])


Slopes = tuple[float, dict[Name, float]]


def _of_frames(
    problem: Problem,
    found: Residuals,
    noise: Noise,
    weights: Weights,
    solved: Solved,
    covariances: tuple[Array, Array],
) -> Slopes:
    """Twice the part of the frames in the likelihood, and its slopes."""
    m, d, frames = problem.m, lengths(problem.kind), problem.frames
    W, tau = weights.frames, found.offset
    change = solved.changes[frames.knot]
    e = found.frames - change[:, :m] - tau[:, None] * change[:, m:]
    squares = e[:, :, None] * e[:, None, :] + seen_covariances(
        covariances[0][frames.knot], tau[:, None, None]
    )
    value = np.linalg.slogdet(W)[1].sum() - np.einsum("fi,fij,fj->", e, W, e)
    slope = (W @ squares @ W - W) / 2
    scaled = _scaled(problem, noise)
    both = 2 * np.einsum("fij,fji->fi", slope, scaled)
    by_jitter = np.einsum("fi,fij,fj->f", found.along, slope, found.along)
    q = problem.count
    totals = (
        np.bincount(frames.source, both[:, :d].sum(1), q),
        np.bincount(frames.source, both[:, d:].sum(1), q),
        np.bincount(frames.source, by_jitter, q) * 2 * noise.jitter**2,
    )
    slopes = {
        (name, place): float(total[place])
        for name, total in zip(("position", "angle", "jitter"), totals, strict=True)
        for place in range(q)
    }
    return float(value), slopes


def seen_covariances(blocks: Array, tau: Array) -> Array:
    """(f, m, m) covariances of poses seconds tau (f, 1, 1) after states with blocks (f, 2m, 2m)."""
    m = blocks.shape[1] // 2
    mixed = blocks[:, :m, m:]
    mixed = mixed + np.swapaxes(mixed, 1, 2)
    return np.asarray(blocks[:, :m, :m] + tau * mixed + tau**2 * blocks[:, m:, m:])


def _of_prior(
    problem: Problem,
    found: Residuals,
    _: Noise,
    weights: Weights,
    solved: Solved,
    covariances: tuple[Array, Array],
) -> Slopes:
    """Twice the part of the prior in the likelihood, and its slopes."""
    m, linked = problem.m, problem.linked
    dt = np.diff(problem.times)[linked]
    inverse, beside = covariances
    E = np.zeros((len(dt), 2 * m, 2 * m))
    S = np.zeros_like(E)
    E[:, :m, :m], S[:, :m, :m] = found.jacobians(linked)
    E[:, m:, m:], S[:, m:, m:] = np.eye(m), -np.eye(m)
    S[:, :m, m:] = -dt[:, None, None] * np.eye(m)
    x = solved.changes
    e = (
        found.prior[linked]
        + np.einsum("nij,nj->ni", E, x[1:][linked])
        + np.einsum("nij,nj->ni", S, x[:-1][linked])
    )
    n = len(x)
    ends, starts = inverse[1:n][linked], inverse[: n - 1][linked]
    cross = S @ beside[: n - 1][linked] @ np.swapaxes(E, 1, 2)
    spread = E @ ends @ np.swapaxes(E, 1, 2) + S @ starts @ np.swapaxes(S, 1, 2)
    spread = spread + cross + np.swapaxes(cross, 1, 2)
    W = information(dt, weights.strengths)
    k = np.arange(m)
    squares = np.zeros(m)
    quadratic = np.zeros(m)
    for i in (k, m + k):
        for j in (k, m + k):
            w = W[:, i, j]
            quadratic += (w * e[:, i] * e[:, j]).sum(0)
            squares += (w * spread[:, i, j]).sum(0)
    squares += quadratic
    value = -log_determinants(dt, weights.strengths) - quadratic.sum()
    slopes = {
        ("strength", place): float((squares[group] - 2 * len(dt)).sum() / 2)
        for place, group in enumerate(strength_groups(problem.kind))
    }
    return float(value), slopes


def _of_odometry(
    problem: Problem,
    found: Residuals,
    noise: Noise,
    _: Weights,
    solved: Solved,
    covariances: tuple[Array, Array],
) -> Slopes:
    """Twice the part of the odometry in the likelihood, and its slopes."""
    if problem.steps is None:
        return 0.0, {}
    m, known = problem.m, problem.steps.known
    back = np.swapaxes(found.turned[known], 1, 2)
    E, S = back @ -found.jacobians(known)[0], back @ found.leads[known]
    x, (inverse, beside) = solved.changes, covariances
    n = len(x)
    e = (
        np.einsum("nij,nj->ni", back, found.odometry[known])
        + np.einsum("nij,nj->ni", E, x[1:, :m][known])
        + np.einsum("nij,nj->ni", S, x[:-1, :m][known])
    )
    ends, starts = inverse[1:n, :m, :m][known], inverse[: n - 1, :m, :m][known]
    spread = np.einsum("nij,njk,nik->ni", E, ends, E) + np.einsum("nij,njk,nik->ni", S, starts, S)
    spread += 2 * np.einsum("nij,njk,nik->ni", S, beside[: n - 1, :m, :m][known], E)
    variances = odometry_variances(problem, noise)[known]
    value = -np.log(variances).sum() - (e**2 / variances).sum()
    slope = ((e**2 + spread) / variances - 1) / variances / 2
    dt, moved = np.diff(problem.times)[known], problem.steps.moved[known]
    parts = np.array(_parts(problem))
    slopes = {}
    for part in range(3):
        own = slope[:, parts == part].sum(1)
        for place, grows in ((2 * part, dt), (2 * part + 1, moved)):
            slopes["odometry", place] = float(2 * noise.odometry[place] ** 2 * (own @ grows))
    return float(value), slopes
