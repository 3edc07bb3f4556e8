"""The delay of one camera's stamps against another's, from what both see at the same time.

Poses of both are in one frame, so that the robot's place tells the delay wherever it moves; turns
are not needed. What cameras, lenses and markers are off by is the same error in all frames, and is
an unknown of the fit.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from scipy import special

from validation.poses.angles import Array, wrap
from validation.trajectories.clock.judging import BELIEF, LEAST_SHARE, WIDEST, excluded
from validation.trajectories.clock.jumps import CLEAR, SHIFTS, jump_place, sharpest_place
from validation.trajectories.clock.result import Verdict
from validation.trajectories.clock.search import Gap
from vision_gt.driving.seen import Seen

FEWEST_ROWS = 12
"""Frames that both must share. A delay, a drift and a frame are five numbers of three times as
many, and their scatter is known to a sixth."""
MOST_ROWS = 3000
"""Frames of an overlap that are used: more tell no more beside the errors that all share."""
GRID = 0.05
"""Seconds between the delays that are tried: a robot at 1 m/s moves half of `ROUGH` in it."""
ROUGH = (0.1, 0.1)
"""Metres and radians within which two poses are of one time, before the noise is known."""
BLOCK = 2.0
"""Seconds of errors that count as one: a path through noisy poses has errors as long as that."""
MEDIAN_OF_3 = float(special.chdtri(3, 0.5))
"""Median of the sum of three squares, in variances."""
CUT = float(special.chdtri(3, 0.003))
"""Squared distance beyond which a pose loses weight: 0.3 % of good ones."""
MOVED = float(special.chdtri(3, 0.001))
"""Gain by a free frame from which on a camera is not where the network has it."""
LEAST_NOISE = np.array([1e-5, 1e-5, 1e-5])
"""Metres and radians that a pose is uncertain by at least, as in the clocks against odometry."""
ANY_DELAY = 1e3
"""Seconds: a delay of which nothing is known."""
DRIFT = 1e-4
"""Standard deviation of a clock's rate against another's: ten times that of a usual quartz."""
FREE = 10.0
"""Metres and radians: a frame of which nothing is known."""
ROUNDS = 8


@dataclass(frozen=True)
class PairDelay:
    """What is added to the stamps of one camera to get the time of another's.

    Parameters
    ----------
    verdict : {"determined", "ambiguous", "not_determinable"}
        Whether the poses tell it.
    reason : str
        Why not.
    delay, drift, at : float
        Seconds at the stamp ``at``, and its change in s/s.
    covariance : (2, 2) array
        Of delay and drift.
    freedom : float
        Of Student's distribution for intervals.
    rows : int
        Frames that both see.
    """

    verdict: Verdict
    reason: str = ""
    delay: float = np.nan
    drift: float = 0.0
    at: float = np.nan
    covariance: Array = field(default_factory=lambda: np.full((2, 2), np.nan))
    freedom: float = BELIEF
    rows: int = 0

    @property
    def quantile(self) -> float:
        """Half of a 95 % interval in standard deviations."""
        return float(special.stdtrit(self.freedom, 0.975))

    @property
    def half(self) -> float:
        """Half of the 95 % interval of the delay, seconds."""
        return self.half_at(self.at)

    def delay_at(self, stamp: float) -> float:
        """The delay at a stamp."""
        return self.delay + self.drift * (stamp - self.at)

    def half_at(self, stamp: float) -> float:
        """Half of the 95 % interval of the delay at a stamp, seconds."""
        carried = np.array([1.0, stamp - self.at])
        return self.quantile * float(np.sqrt(carried @ self.covariance @ carried))

    def reverse(self) -> "PairDelay":
        """The delay of the first camera's stamps against the second's."""
        return replace(self, delay=-self.delay, drift=-self.drift, at=self.at + self.delay)


def pair_delay(first: Seen, second: Seen, window: float) -> PairDelay:
    """The delay of the second camera's stamps against the first's.

    Parameters
    ----------
    first, second : Seen
        Poses in one frame.
    window : float
        Seconds to both sides in which it is looked for.

    Notes
    -----
    Least squares of the second's poses about the path through the first's, with bounded weights.
    Unknown are delay, drift, and the independent errors of variance one that all frames share; and
    the frame, where poses fit clearly better with a free one. Intervals have the spread that blocks
    of the overlap show among themselves. A delay is told where it is open by less than `WIDEST`,
    and no other one fits as well.
    """
    best = _best(first, second, window)
    return best if isinstance(best, PairDelay) else _judged(best, _delays(window))


Parting = tuple[int, int, int]
"""The last pose before a jump, and two between which the jump may be, by their numbers."""


def jump_between(first: Seen, second: Seen, window: float) -> Parting | None:
    """Where the delay of the second camera against the first jumps; None where it does not."""
    best = _best(first, second, window)
    if isinstance(best, PairDelay):
        return None
    shifts = np.concatenate([[0.0], -SHIFTS, SHIFTS])
    times = second.times[best.rows]
    last = jump_place(best.costs(best.delay + shifts))
    if last is None:
        return None
    found = _parts(first, second, int(best.rows[last]), window)
    if found is None:
        return None
    delays = np.array([one.delay + one.drift * (times[last] - one.at) for one in found])
    last, least, most = sharpest_place(best.costs(delays), times, float(delays[1] - delays[0]))
    if _parts(first, second, int(best.rows[last]), window) is None:
        return None
    return int(best.rows[last]), int(best.rows[least]), int(best.rows[most + 1])


def _parts(
    first: Seen, second: Seen, last: int, window: float
) -> tuple[PairDelay, PairDelay] | None:
    """The delays up to a pose and after it; None where they are not told, or are the same."""
    one, two = second.part(0, last + 1), second.part(last + 1, len(second.times))
    if one is None or two is None:
        return None
    before, after = pair_delay(first, one, window), pair_delay(first, two, window)
    if not before.verdict == after.verdict == "determined":
        return None
    at = float(second.times[last])
    apart = abs(after.delay_at(at) - before.delay_at(at))
    half = np.hypot(before.half_at(at), after.half_at(at))
    return (before, after) if apart > CLEAR * half else None


def _delays(window: float) -> Array:
    """Delays that are tried."""
    return np.arange(-window, window + GRID / 2, GRID)


def _best(first: Seen, second: Seen, window: float) -> "_Fit | PairDelay":
    """The delay that fits best, or why there is none."""
    grid = _delays(window)
    agreeing = np.array([_agreeing(first, second, delay).sum() for delay in grid])
    if agreeing.max(initial=0.0) < FEWEST_ROWS / 2:
        return PairDelay("not_determinable", "no other camera sees the robot at the same time")
    tops = np.flatnonzero(
        (agreeing >= np.append(agreeing[1:], -1)) & (agreeing > np.append(-1, agreeing[:-1]))
    )
    tops = tops[np.argsort(-agreeing[tops])][:4]
    fits = [one for top in tops if (one := _fitted(first, second, float(grid[top]))) is not None]
    if not fits:
        return PairDelay("not_determinable", "too few frames are of the same time as another's")
    return max(fits, key=lambda one: one.agreeing())


def _agreeing(first: Seen, second: Seen, delay: float) -> Array:
    """(n,) by how much each of the second's poses agrees with the first's path, 1 to 0."""
    times = second.times + delay
    inside = first.path.supported(times)
    off = second.poses[inside] - first.path.at(times[inside])[0]
    off[:, 2] = wrap(off[:, 2])
    far = (off[:, :2] ** 2).sum(1) / ROUGH[0] ** 2 + off[:, 2] ** 2 / ROUGH[1] ** 2
    found = np.zeros(len(times))
    found[inside] = np.maximum(1 - far / 4, 0)
    return found


@dataclass(frozen=True)
class _Fit:
    """Delay, drift, frame and shared errors that fit best.

    ``unknowns`` are the delay, the drift, the frame's (x, y, heading) about ``middle``, and the
    shared errors.
    """

    first: Seen
    second: Seen
    rows: npt.NDArray[np.intp]
    at: float
    unknowns: Array
    prior: Array
    scale: float

    @property
    def delay(self) -> float:
        return float(self.unknowns[0])

    def times(self, delay: float) -> Array:
        stamps = self.second.times[self.rows]
        return np.asarray(stamps + delay + self.unknowns[1] * (stamps - self.at))

    def agreeing(self) -> float:
        """Number of frames that agree."""
        return float(_agreeing(self.first, self.second, self.delay).sum())

    def equations(self) -> tuple[Array, Array, Array]:
        """(n, 3) residuals, (n, 3, p) their changes, and (n, 3, 3) inverse covariances."""
        one, two, rows = self.first, self.second, self.rows
        times = self.times(self.delay)
        pose, rate, _ = one.path.at(times)
        beside = _nearest(one.times, times)
        shared = (two.common[rows] - one.common[beside]).astype(float)
        at = two.poses[rows]
        changes = np.zeros((len(rows), 3, 5 + shared.shape[2]))
        changes[:, :, 0] = -rate
        changes[:, :, 1] = -rate * (two.times[rows] - self.at)[:, None]
        changes[:, :, 2:5] = np.eye(3)
        middle = at[:, :2].mean(0)
        changes[:, 0, 4], changes[:, 1, 4] = -(at[:, 1] - middle[1]), at[:, 0] - middle[0]
        changes[:, :, 5:] = -shared
        off = at - pose
        off[:, 2] = wrap(off[:, 2])
        off += np.einsum("nij,j->ni", changes[:, :, 2:], self.unknowns[2:])
        between = one.between(times)[:, :, None] ** 2 * np.eye(3) / self.scale
        own = two.own[rows] + one.own[beside] + between
        inverse = np.linalg.inv(own + np.diag(LEAST_NOISE**2))
        return off, changes, np.asarray(inverse)

    def expected(self, inverse: Array) -> float:
        """Mean square of a residual over what is said of it: less, as the path is smooth.

        What noise a smooth path has is the same for neighbours, and so none of it averages out.
        """
        beside = self.first.own[_nearest(self.first.times, self.times(self.delay))]
        lacking = (1 - self.first.calm) * np.einsum("nij,nji->n", inverse, beside)
        return 1 - float(lacking.mean()) / 3

    def distances(self, off: Array, inverse: Array) -> Array:
        """(n,) squared distances in standard deviations."""
        return np.asarray(np.einsum("ni,nij,nj->n", off, inverse, off) / self.scale)

    def costs(self, delays: Array) -> Array:
        """(k, n) bounded costs of the rows under other delays."""
        found = np.full((len(delays), len(self.rows)), np.nan)
        for row, delay in enumerate(delays):
            inside = self.first.path.supported(self.times(float(delay)))
            if not inside.any():
                continue
            unknowns = np.concatenate([[delay], self.unknowns[1:]])
            other = replace(self, rows=self.rows[inside], unknowns=unknowns)
            found[row, inside] = _row_costs(other, self.scale)
        # The first are those of the delay that fits: it has poses on both sides of all rows.
        return np.where(np.isnan(found), _row_costs(self, self.scale), found)

    def stepped(self, wide: float = 1.0) -> tuple["_Fit", float]:
        """After a step, and how many standard deviations the delay moved."""
        off, changes, inverse = self.equations()
        far = self.distances(off, inverse) / wide
        weight = np.minimum(1.0, (CUT / np.maximum(far, 1e-12)) ** 2) / self.scale
        weighted = inverse * weight[:, None, None]
        turned = np.swapaxes(changes, 1, 2) @ weighted
        information = np.tensordot(turned, changes, axes=((0, 2), (0, 1))) + np.diag(self.prior)
        gradient = np.einsum("npi,ni->p", turned, off) + self.prior * self.unknowns
        step = -np.linalg.solve(information, gradient)
        step *= min(1.0, GRID / max(abs(float(step[0])), 1e-12))
        # Of a way that tells nothing of it, what is known of the delay is a rounding error.
        known = float(np.linalg.inv(information)[0, 0])
        moved = abs(float(step[0])) / np.sqrt(known) if known > 0 else np.inf
        return replace(self, unknowns=self.unknowns + step), moved


def _nearest(times: Array, at: Array) -> npt.NDArray[np.intp]:
    """Place of the nearest of increasing times."""
    right = np.clip(np.searchsorted(times, at), 1, len(times) - 1)
    return np.asarray(right - (at - times[right - 1] < times[right] - at))


def _fitted(first: Seen, second: Seen, delay: float) -> _Fit | None:
    """The fit that starts at a delay; its frame is free where that is clearly better."""
    inside = np.flatnonzero(
        first.path.supported(second.times + delay - GRID)
        & first.path.supported(second.times + delay + GRID)
    )
    if len(inside) < FEWEST_ROWS:
        return None
    rows = inside[:: -(-len(inside) // MOST_ROWS)]
    shared = second.common.shape[2]
    prior = np.concatenate([[ANY_DELAY**-2, DRIFT**-2], np.full(3, 1e12), np.ones(shared)])
    unknowns = np.zeros(5 + shared)
    unknowns[0] = delay
    # The drift counts from where the robot moves: there the delay is told, and not the drift.
    speed = (first.path.at(second.times[rows] + delay)[1] ** 2).sum(1) + 1e-9
    at = float(np.average(second.times[rows], weights=speed))
    held = _settled(_Fit(first, second, rows, at, unknowns, prior, 1.0))
    if held is None:
        return None
    loose = np.concatenate([prior[:2], np.full(3, FREE**-2), prior[5:]])
    free = _settled(replace(held, prior=loose))
    if free is None:
        return held
    return free if _cost(held, held) - _cost(free, held) > MOVED else held


def _settled(fit: _Fit) -> _Fit | None:
    """The fit where it no longer moves, with the scale of noise that it shows."""
    for number in range(ROUNDS):
        off, _, inverse = fit.equations()
        squares = np.einsum("ni,nij,nj->n", off, inverse, off)
        scale = max(float(np.median(squares)) / MEDIAN_OF_3 / fit.expected(inverse), 1e-3)
        fit, moved = replace(fit, scale=scale).stepped()
        if not np.isfinite(moved) or not fit.first.path.supported(fit.times(fit.delay)).all():
            return None
        if number > 2 and moved < 1e-2:
            break
    return fit


def _cost(fit: _Fit, by: _Fit) -> float:
    """Sum of bounded costs and of the priors, with the noise of another fit."""
    return float(_row_costs(fit, by.scale).sum() + (fit.prior[5:] * fit.unknowns[5:] ** 2).sum())


def _row_costs(fit: _Fit, scale: float) -> Array:
    """(n,) bounded costs."""
    off, _, inverse = fit.equations()
    far = replace(fit, scale=scale).distances(off, inverse)
    return np.where(far <= CUT, far, 2 * CUT - CUT**2 / np.maximum(far, CUT))


def _judged(best: _Fit, grid: Array) -> PairDelay:
    """Verdict, delay and interval of a fit."""
    covariance, freedom = _covariance(best)
    found = PairDelay(
        "determined",
        "",
        best.delay,
        float(best.unknowns[1]),
        best.at,
        covariance,
        freedom,
        len(best.rows),
    )
    if 2 * found.half > WIDEST:
        said = (
            f"the robot hardly moves while both see it: the delay is open by {2 * found.half:.1f} s"
        )
        return replace(found, verdict="not_determinable", reason=said)
    rival = _rival(best, grid, found.half)
    if rival is not None:
        said = f"a delay that is {abs(rival):.2g} s away fits as well"
        return replace(found, verdict="ambiguous", reason=said)
    return found


def _rival(best: _Fit, grid: Array, half: float) -> float | None:
    """How far another delay is that fits as well; None where there is none.

    Moved by more than three halves of the interval, poses that both still see must fit worse.
    """
    own = _row_costs(best, best.scale)
    block = np.floor((best.second.times[best.rows] - best.second.times[best.rows[0]]) / BLOCK)
    near = max(3 * half, GRID)
    far = grid[np.abs(grid - best.delay) > near]
    for delay in [best.delay - near, best.delay + near, *far]:
        inside = best.first.path.supported(best.times(float(delay)))
        if inside.mean() < LEAST_SHARE:
            continue
        unknowns = best.unknowns.copy()
        unknowns[0] = delay
        other = replace(best, rows=best.rows[inside], unknowns=unknowns)
        rises = _row_costs(other, best.scale) - own[inside]
        starts = np.flatnonzero(np.diff(block[inside], prepend=-1.0))
        sums = np.add.reduceat(rises, starts)
        rise, scatter = float(rises.sum()), float(sums.std() * np.sqrt(len(sums))) + 1e-9
        if not excluded(Gap(rise, rise / scatter, float(inside.mean())), float(inside.sum())):
            return float(delay - best.delay)
    return None


def _covariance(fit: _Fit) -> tuple[Array, float]:
    """Covariance of delay and drift, and the freedom of their intervals.

    What the model says, times the spread that blocks show among themselves (as in
    `validation.trajectories.clock.judging`), and what comes of the errors that all frames share.
    """
    off, changes, inverse = fit.equations()
    far = fit.distances(off, inverse)
    weight = np.minimum(1.0, (CUT / np.maximum(far, 1e-12)) ** 2) / fit.scale
    turned = np.swapaxes(changes, 1, 2) @ (inverse * weight[:, None, None])
    information = turned @ changes
    total = np.linalg.inv(information.sum(0) + np.diag(fit.prior))
    gain = total[:, :2]
    block = np.floor((fit.second.times[fit.rows] - fit.second.times[fit.rows[0]]) / BLOCK)
    starts = np.flatnonzero(np.diff(block, prepend=-1.0))
    scores = np.add.reduceat(np.einsum("npi,ni->np", turned, off) @ gain, starts, axis=0)
    expected = np.add.reduceat(np.einsum("pk,npq,qk->nk", gain, information, gain), starts, axis=0)
    counts = expected.sum(0) ** 2 / np.maximum((expected**2).sum(0), 1e-300)
    ratio = (scores**2).sum(0) / np.maximum(expected.sum(0), 1e-300)
    ratio *= counts / np.maximum(counts - 1, 1.0)
    factors = np.sqrt(np.maximum((counts * ratio + BELIEF) / (counts + BELIEF), 1.0))
    noise = gain.T @ information.sum(0) @ gain
    shared = gain.T @ np.diag(fit.prior) @ gain
    covariance = noise * np.outer(factors, factors) + shared
    for one in (fit.first.line, fit.second.line):
        if one is not None:
            covariance = covariance + one.covariance
    return np.asarray(covariance), float(counts[0] + BELIEF)
