"""What a fit of two clocks tells: verdict, intervals, parts of the record, frame and mount."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import special

from validation.poses.angles import Array
from validation.trajectories.clock.continuous import ContinuousPath
from validation.trajectories.clock.fit import PRIOR, Fit
from validation.trajectories.clock.result import ClockEstimate, Part, Verdict
from validation.trajectories.clock.rows import DELAY, DRIFT, Variances
from validation.trajectories.clock.search import Candidate, Gap, gap, transferred
from validation.trajectories.clock.stamps import FrameLine
from validation.trajectories.clock.telling import UNCLEAR, motion_in_words, rivals_in_words

STEPS = (5.0, 20.0)
"""Standard deviations by which the delay is moved to see whether the fit gets worse as it must."""
FAR_STEPS = (0.3, 1.0)
"""Seconds, likewise: beyond the time in which rates made of noise are alike."""
LEAST_RISE = 9.0
"""Of -2 log likelihood, where 25 is expected; noise alone gives 0 with some units of spread."""
FAR_RISE, FAR_SCORE = 25.0, 5.0
"""Least rise, and least rise in its own standard deviations along the record, for a delay to be
excluded. The lowest of a thousand chance values is at 3.3 to 4 standard deviations."""
ROW_RISE = 0.5
"""Or least rise for each pose. Noise of n poses makes a rise of about sqrt(n), 0.04 a pose where n
is 700; a robot that moves makes several a pose."""
LEAST_SHARE = 0.2
"""Of the best one's poses, below which another delay's overlap is no rival: two records' ends
look alike by chance."""
WIDEST = 0.5
"""Seconds of a whole interval beyond which nothing is determined; five frames of 10 Hz."""
MOST_WIDER, FINE = 8.0, 0.1
"""Times that an interval is widened at most where the fit does not rise as it must, and the part of
the time from stamp to stamp that it must stay within. In drives of 20 minutes with 6,000 poses the
model's interval is 0.1 ms, where the fit is not as sharp as that: what is uncertain by a
millisecond is still told."""
ROUGH = 0.5
"""Seconds over which rates are averaged; what is left is rough. A robot that speeds up by 0.6 m/s^2
at once leaves 0.04 m/s for half a second."""
ROUGH_SHARE = 0.18
"""Most of the information on the drift that rough rates may make up. Measured with an odometer of
4 mm and 6 mrad a square root of a metre, at noise of 3 to 30 mm: ordinary drives 0.006 to 0.05,
laps between two stops 0.015 to 0.16, a straight line with one start 0.20 to 0.27 (whose intervals
missed the truth), constant motion 0.72 to 0.87."""
NOISE_SHARE = 0.5
"""Most of the information on the delay that the noise of the path's own rates may make up."""
BLOCK = 10.0
"""Seconds of poses that count as one for the spread along the record; errors that last longer are
part of the wandering frame."""
BELIEF = 10.0
"""Blocks that the model counts as, against the spread that the record shows. With 20 blocks a
ratio of variances that is truly 1 has a standard deviation of 0.32, shrunk to 0.2 by this."""
LEAST_SAID = 1e-12
"""Information that a block has at least, 1/s^2 or in variances: as good as none."""
PARTS = 4
"""Parts of a record that have a delay each."""


@dataclass(frozen=True)
class Prepared:
    """A trajectory from above with times freed of jitter, and its continuous path."""

    name: str
    times: Array
    positions: Array
    headings: Array | None
    line: FrameLine | None
    path: ContinuousPath

    @property
    def interval(self) -> float:
        """Median interval of the stamps, seconds."""
        return float(np.median(np.diff(self.times)))


@dataclass(frozen=True)
class Best:
    """The delay that fits best, its variances, and others that fit no worse.

    Parameters
    ----------
    candidate : Candidate
        The fit with all rows.
    variances : Variances
        The most likely ones.
    rivals : tuple of (delay, score)
        Delays that are not excluded.
    starts : Fit
        With the rows that rivals were judged by.
    """

    candidate: Candidate
    variances: Variances
    rivals: tuple[tuple[float, float], ...]
    starts: Fit


def judged(
    best: Best, pair: tuple[Prepared, Prepared, bool], nothing: ClockEstimate
) -> ClockEstimate:
    """The estimate of a fit.

    Parameters
    ----------
    best : Best
        The fit.
    pair : tuple
        The continuous and the other trajectory, and whether the first one is the source.
    nothing : ClockEstimate
        With what is known before.
    """
    dense, sparse, swapped = pair
    one, variances = best.candidate, best.variances
    fit, state = one.fit, one.state
    values = fit.residuals(state)
    weights = fit.weights(values, variances)
    solved, _ = fit.solve(state, values, variances, weights, PRIOR, one.activity)
    covariance = np.asarray(np.linalg.inv(solved.information), dtype=float)
    own = covariance[DELAY, DELAY]
    if not (np.diag(covariance) > 0).all():
        # Of a way that tells nothing of it, what is known of the delay is a rounding error.
        return replace(nothing, reason=f"{motion_in_words(fit, state)}: the delay is open")
    ratio, freedom, parts = _spread(one, variances, covariance)
    inflated = covariance * np.maximum(ratio, 1.0)
    both = inflated[DELAY : DRIFT + 1, DELAY : DRIFT + 1].copy()
    for line in (dense.line, sparse.line):
        if line is not None:
            both += line.covariance
    quantile = float(special.stdtrit(freedom, (1 + nothing.confidence) / 2))
    half = quantile * np.sqrt(np.diag(both))
    sign = -1.0 if swapped else 1.0
    delay, drift = sign * state.parameters[DELAY], sign * state.parameters[DRIFT]
    at = fit.middle + (0.0 if swapped else delay)
    verdict, reason, wider = _verdict(best, own, half[0], source_interval=sparse.interval)
    half = half * wider
    source = sparse if not swapped else dense
    jitter = source.line.jitter if source.line else float(np.sqrt(variances.jitter))
    speed = np.hypot(values.rates[:, 0], values.rates[:, 1])
    turn = np.abs(values.rates[:, 2])
    scored = tuple(sorted(((sign * d, s) for d, s in best.rivals), key=lambda p: p[1]))
    frame, mount, mount_covariance = _transforms(one, covariance, swapped)
    if not fit.with_position:
        frame[:2], mount[:2], mount_covariance[:2] = np.nan, np.nan, np.nan
        mount_covariance[:, :2] = np.nan
    told = verdict != "not_determinable"
    return replace(
        nothing,
        verdict=verdict,
        reason=reason,
        delay_s=float(delay) if told else np.nan,
        at_s=float(at),
        low_s=float(delay - half[0]) if told else np.nan,
        high_s=float(delay + half[0]) if told else np.nan,
        drift_ppm=float(drift * 1e6) if told else np.nan,
        drift_low_ppm=float((drift - half[1]) * 1e6) if told else np.nan,
        drift_high_ppm=float((drift + half[1]) * 1e6) if told else np.nan,
        jitter_s=jitter,
        period_s=source.line.period if source.line else np.nan,
        interval_s=source.interval,
        frame=frame,
        mount=mount,
        mount_covariance=mount_covariance,
        rivals=scored if told else (),
        parts=tuple(
            Part(
                part.first_s,
                part.last_s,
                float(sign * part.delay_s),
                float(sign * part.delay_s - wider * quantile * part.high_s),
                float(sign * part.delay_s + wider * quantile * part.high_s),
            )
            for part in parts
        )
        if told
        else (),
        noise=np.sqrt(
            [
                variances.position if fit.with_position else np.nan,
                variances.heading if fit.with_heading else np.nan,
            ]
        ),
        wander=np.sqrt([variances.walk, variances.turn_walk]),
        speeds=np.array([np.sqrt(np.mean(speed**2)), np.quantile(speed, 0.95)]),
        turn_rates=np.array([np.sqrt(np.mean(turn**2)), np.quantile(turn, 0.95)]),
        poses=len(fit.rows),
        inflation=float(np.sqrt(np.maximum(ratio[DELAY, DELAY], 1.0))),
    )


def _verdict(
    best: Best, own: float, half: float, source_interval: float
) -> tuple[Verdict, str, float]:
    """Whether the motion tells the delay, why not, and how many times wider its interval must be.

    ``own`` is the delay's variance by the model, ``half`` half of its interval, and
    ``source_interval`` the seconds from stamp to stamp.
    """
    one, variances = best.candidate, best.variances
    fit = one.fit
    words = motion_in_words(fit, one.state)
    if 2 * half > WIDEST:
        return "not_determinable", f"{words}: the delay is open by {2 * half:.1f} s", 1.0
    noise = fit.path.rate_variance
    rows = len(fit.rows)
    from_noise = rows * (2 * noise[0] / variances.position)
    from_noise += rows * fit.with_heading * noise[1] / variances.heading
    rough = _rough_share(one, variances)
    if from_noise * own > NOISE_SHARE or rough > ROUGH_SHARE:
        return "not_determinable", f"{words}: the noise of the rates is as large as the rates", 1.0
    wider, flat = 1.0, _flat(best, half)
    first = flat
    while flat and 2 * wider <= MOST_WIDER and 2 * wider * half < FINE * source_interval:
        wider *= 2
        flat = _flat(best, wider * half)
    if flat:
        return "not_determinable", f"{words}: moved by {abs(first):.2g} s it fits as well", 1.0
    if best.rivals and words != UNCLEAR:
        return "not_determinable", f"{words}: other delays fit as well", 1.0
    if best.rivals:
        told = rivals_in_words(one.delay, [delay for delay, _ in best.rivals])
        return "ambiguous", told, wider
    return "determined", "", wider


def _flat(best: Best, half: float) -> float:
    """By how much the delay can be moved without a worse fit, in seconds; 0 where it cannot.

    As the blocks of the record show it: the model alone takes noise of the rates for motion.
    """
    one, variances = best.candidate, best.variances
    rows, sigma = len(one.fit.rows), half / 2
    near = [step * sigma for step in STEPS]
    far = [step for step in FAR_STEPS if step > near[0]]
    for step in [*near, *far]:
        for side in (-step, step):
            other = transferred(one, one.delay + side, variances)
            if other is None:
                continue
            between = gap(one, other, variances)
            least = LEAST_RISE if step in near[:1] else FAR_RISE
            flat = step in far and not excluded(between, rows)
            if between.share > LEAST_SHARE and (between.rise < least or flat):
                return side
    return 0.0


def _rough_share(one: Candidate, variances: Variances) -> float:
    """Share of the information on the drift that the roughness of the path's rates makes up.

    An odometer's steps have errors of their own: its rates are rough, and what a robot's motion
    is at these frequencies is little beside them. Errors of rates are white, so that what is rough
    is most of them. Of the drift, because one start or stop tells the delay at its own time, and
    noise alone carries it to the middle of the record.
    """
    fit, state = one.fit, one.state
    values = fit.residuals(state)
    weights = fit.weights(values, variances)
    found = []
    for rates in (values.rates, fit.bare.rough_rates(fit.times(state.parameters), ROUGH)):
        rows = values.rows.copy()
        rows[:, :, DELAY] = -rates
        rows[:, :, DRIFT] = -rates * (fit.rows.times - fit.middle)[:, None]
        tried = replace(values, rows=rows)
        solved, _ = fit.solve(state, tried, variances, weights, PRIOR, one.activity)
        found.append(1 / np.linalg.inv(solved.information)[DRIFT, DRIFT])
    return float(found[1] / found[0])


def excluded(between: Gap, poses: float) -> bool:
    """Whether a delay fits so much worse that it is none."""
    clear = between.score > FAR_SCORE or between.rise > ROW_RISE * poses
    return between.rise > FAR_RISE and clear


def _spread(
    one: Candidate, variances: Variances, covariance: Array
) -> tuple[Array, float, list[Part]]:
    """Variance along the record over that of the model, its freedoms, and parts of the record."""
    fit = one.fit
    stamps = fit.rows.times[fit.rows.starts]
    # Blocks of covered time: a gap does not make a block.
    covered = np.concatenate([[0.0], np.cumsum(np.minimum(np.diff(stamps), 2.0))])
    block = np.minimum(covered // BLOCK, max(covered[-1] // BLOCK - 1, 0))
    first = np.flatnonzero(np.diff(block, prepend=-1.0))
    information, gradient = fit.blocks(one.state, variances, one.activity, first)
    scores = gradient @ covariance[:, DELAY : DRIFT + 1]
    h = covariance[:, DELAY : DRIFT + 1]
    # A block that tells nothing has a rounding error of either sign.
    expected = np.maximum(np.einsum("pi,bpq,qi->bi", h, information, h), LEAST_SAID)
    counts = expected.sum(0) ** 2 / (expected**2).sum(0)
    ratio = (scores**2).sum(0) / expected.sum(0)
    ratio *= counts / np.maximum(counts - 1, 1.0)
    shrunk = (counts * ratio + BELIEF) / (counts + BELIEF)
    factors = np.ones(len(covariance))
    factors[DELAY : DRIFT + 1] = np.sqrt(np.maximum(shrunk, 1.0))
    grid = np.outer(factors, factors)
    parts = _parts(one, information, gradient, first, float(factors[DELAY]))
    return grid, float(counts[0] + BELIEF), parts


def _parts(
    one: Candidate,
    information: Array,
    gradient: Array,
    first: npt.NDArray[np.intp],
    factor: float,
) -> list[Part]:
    """Delay of parts with about the same information; the mount is that of the whole."""
    fit, par = one.fit, one.state.parameters
    own = np.maximum(information[:, DELAY, DELAY], LEAST_SAID)
    total = np.cumsum(own)
    group = np.minimum(((total - own / 2) / total[-1] * PARTS).astype(int), PARTS - 1)
    ends = [*first[1:], len(fit.rows.starts)]
    found = []
    for place in np.unique(group):
        which = np.flatnonzero(group == place)
        a = own[which].sum()
        if a < WIDEST**-2:
            continue
        rows = fit.rows.times[fit.rows.starts]
        start, stop = rows[first[which[0]]], rows[min(ends[which[-1]], len(rows)) - 1]
        middle = (start + stop) / 2
        delay = par[DELAY] + par[DRIFT] * (middle - fit.middle)
        delay -= gradient[which, DELAY].sum() / a
        sigma = factor / np.sqrt(a)
        found.append(Part(float(start), float(stop), float(delay), float(-sigma), float(sigma)))
    return found


def _transforms(one: Candidate, covariance: Array, swapped: bool) -> tuple[Array, Array, Array]:
    """Frame and mount from the source to the reference, and the mount's covariance.

    The mount comes after the source's pose: ``reference = frame * source * mount``.
    """
    state, fit = one.state, one.fit
    x, y, angle = state.parameters[:3]
    turn = float(np.angle(np.exp(1j * state.angles).mean()))
    here = fit.rows.positions[fit.rows.starts].mean(0)
    c, s = np.cos(turn), np.sin(turn)
    there = state.places.mean(0)
    frame = np.array([*(there - np.array([[c, -s], [s, c]]) @ here), turn])
    # The fit's mount is where the sparse one's body lies in the dense one's: (x, y, -angle).
    own = np.array([x, y, -angle])
    change = np.diag([1.0, 1.0, -1.0])
    if swapped:
        frame = _inverse(frame)
        spread = change @ covariance[:3, :3] @ change.T
        return _wrapped(frame), _wrapped(own), spread
    jacobian = _inverse_change(own) @ change
    return _wrapped(frame), _wrapped(_inverse(own)), jacobian @ covariance[:3, :3] @ jacobian.T


def _inverse(pose: Array) -> Array:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([-c * pose[0] - s * pose[1], s * pose[0] - c * pose[1], -pose[2]])


def _inverse_change(pose: Array) -> Array:
    c, s = np.cos(pose[2]), np.sin(pose[2])
    x, y, _ = _inverse(pose)
    return np.array([[-c, -s, y], [s, -c, -x], [0.0, 0.0, -1.0]])


def _wrapped(pose: Array) -> Array:
    return np.array([pose[0], pose[1], float(np.angle(np.exp(1j * pose[2])))])
