"""What is added to a source's stamps to get the reference's time, and how sure that is."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import LinAlgError

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.trajectory import GAP_INTERVALS, Trajectory
from validation.trajectories.clock.continuous import ContinuousPath, continuous_path
from validation.trajectories.clock.fit import Fit
from validation.trajectories.clock.judging import LEAST_SHARE, Best, Prepared, excluded, judged
from validation.trajectories.clock.jumps import joined, parted, sharpened, suspected
from validation.trajectories.clock.result import ClockEstimate
from validation.trajectories.clock.rows import DELAY, DRIFT, Rows, Variances
from validation.trajectories.clock.search import (
    SEARCH_ROWS,
    Candidate,
    candidate,
    gap,
    refined,
    settled,
    thinned,
)
from validation.trajectories.clock.stamps import frame_line
from validation.trajectories.clock.start import STEP, starting_peaks
from validation.trajectories.clock.telling import no_overlap_in_words

WINDOW = 60.0
"""Seconds to both sides; the largest difference of two scales of time in use is 37 s."""
DENSER = 0.7
"""Ratio of median intervals below which the source is taken as the continuous one. A judgement:
the reference stays it unless the source is clearly better sampled."""

CLEARER = 4.0
"""Times that the likelihood ratio of turns must be that of the same turns the other way round,
which are alike by chance only: of 24 drives of four minutes it was 6 to 77, and of 24 pairs that do
not belong together up to 2.5."""
NEARLY_THE_SAME = 0.9
"""Or correlation of turn rates: a slalom is its own mirror image half a period later."""


def estimate_clock(
    reference: Trajectory,
    source: Trajectory,
    *,
    window: float = WINDOW,
    confidence: float = 0.95,
) -> ClockEstimate:
    """Delay and drift of a source's stamps against the reference's.

    Parameters
    ----------
    reference, source : Trajectory
        Of one robot, each in a frame and on a mount of its own; the reference may be odometry.
    window : float
        Seconds to both sides in which the delay is sought.
    confidence : float
        Of the intervals.

    Raises
    ------
    GtvalError
        If one of them has fewer than three poses.

    Notes
    -----
    Maximum likelihood over mount, delay, drift, an odometer's scales and bias, and a frame that
    wanders with the motion by a most likely strength: what the frame takes up tells nothing of the
    delay. Intervals have at least the spread that blocks of the record show among themselves.
    """
    return sync(reference, [source], window=window, confidence=confidence)[source.system]


def sync(
    reference: Trajectory,
    sources: Sequence[Trajectory],
    *,
    window: float = WINDOW,
    confidence: float = 0.95,
    progress: Callable[[str, float], None] = lambda _what, _share: None,
) -> Mapping[str, ClockEstimate]:
    """The clock of each source against one reference, by name; see `estimate_clock`."""
    progress(reference.system, 0.0)
    ready = _prepared(reference, reference.epoch)
    found = {}
    for number, source in enumerate(sources):
        progress(f"clock of {source.system}", (number + 1) / (len(sources) + 1))
        found[source.system] = _followed(ready, source, window, confidence, reference.epoch)
    return found


def _followed(
    reference: Prepared, source: Trajectory, window: float, confidence: float, epoch: int
) -> ClockEstimate:
    """The estimate of a source, by pieces where its clock jumps."""
    whole, best, sign = _estimated(reference, _prepared(source, epoch), window, confidence, epoch)
    own = None if best is None else suspected(best)
    if best is None or own is None:
        return whole
    stamps = source.times_since(epoch)

    def pieces(stamp: float) -> tuple[ClockEstimate, ...]:
        """Before and after a stamp, each with jumps of its own; none where a side is too short."""
        parts = [source.select(part) for part in parted(stamps, [stamp])]
        if min(map(len, parts)) < 3:
            return ()
        # Where the whole tells no delay and no part does, there is nothing to follow.
        if whole.verdict == "not_determinable" and not any(map(tells, parts)):
            return ()
        return tuple(_followed(reference, part, window, confidence, epoch) for part in parts)

    def tells(part: Trajectory) -> bool:
        found, *_ = _estimated(reference, _prepared(part, epoch), window, confidence, epoch)
        return found.verdict != "not_determinable"

    # Rows of the reference have its stamps.
    back = 0.0 if sign > 0 else best.candidate.delay
    found = pieces(own.stamp_s + back)
    if len(found) == 2 and all(one.verdict == "determined" for one in found):
        first, last = (found[0].pieces or found[:1])[-1], (found[1].pieces or found[1:])[0]
        delays = sign * np.array([first.delay_s, last.delay_s])
        noise = np.minimum(first.noise, last.noise), np.minimum(first.wander, last.wander)
        again = sharpened(best, delays, *noise)
        if again != own:
            found, own = pieces(again.stamp_s + back), again
    more = [jump.place for one in found for jump in one.jumps]
    between = sorted([own.later(back), *more], key=lambda place: place.stamp_s)
    flat = [piece for one in found for piece in (one.pieces or (one,))]
    return joined(whole, flat, between) if flat else whole


@dataclass(frozen=True)
class Turns:
    """Headings without positions, as a gyroscope gives them.

    Parameters
    ----------
    system : str
        Name of the source.
    times : (n,) array
        Seconds since ``epoch``, increasing.
    headings : (n,) array
        Radians; they may drift.
    epoch : int
        Whole seconds taken off the stamps.
    either_way : bool
        Whether they may count clockwise: a gyroscope's axis may point down.
    """

    system: str
    times: Array
    headings: Array
    epoch: int = 0
    either_way: bool = False

    @classmethod
    def of_rates(cls, system: str, times: Array, rates: Array, epoch: int = 0) -> "Turns":
        """The same from rates about the upward axis, in radians a second."""
        steps = np.diff(times) * (rates[1:] + rates[:-1]) / 2
        turned = np.concatenate([[0.0], np.cumsum(steps)])
        return cls(system, times, turned, epoch, either_way=True)


def turn_clock(
    reference: Trajectory,
    source: Turns,
    *,
    window: float = WINDOW,
    confidence: float = 0.95,
) -> ClockEstimate:
    """Delay and drift of the stamps of a source that has headings only; see `estimate_clock`.

    Raises
    ------
    GtvalError
        If one of them has fewer than three poses, or the reference has no headings.

    Notes
    -----
    The same fit, in which positions have no weight: turns alone tell the delay. How alike turns
    are by chance the same source shows that turns the other way; where its own are hardly more
    alike, and not nearly the same either, nothing is told.
    """
    if not reference.has_orientation:
        raise GtvalError(
            f"'{reference.system}' has positions without headings: nothing that has headings only "
            "can be compared with it"
        )
    ready = _prepared(reference, reference.epoch)
    if len(source.times) < 3:
        raise GtvalError(f"'{source.system}': three headings at least have a clock")
    times = source.times + (source.epoch - reference.epoch)
    line = frame_line(times)
    times = times if line is None else line.times
    gap = GAP_INTERVALS * float(np.median(np.diff(times)))
    path = continuous_path(times, None, source.headings, gap)
    mirrored = replace(path, headings=-path.headings, turn_rates=-path.turn_rates)
    likely, chance = (_highest_score(ready.path, one, window) for one in (path, mirrored))
    headings, reason = source.headings, ""
    if source.either_way and chance > CLEARER * likely:
        likely, chance, path, headings = chance, likely, mirrored, -headings
        reason = "its axis points down"
    none = np.zeros((len(times), 2))
    other = Prepared(source.system, times, none, headings, line, path)
    found, *_ = _estimated(ready, other, window, confidence, reference.epoch)
    if found.verdict == "not_determinable":
        return found
    alike = _alike(ready.path, path, found.delay_s)
    if alike < NEARLY_THE_SAME and likely < CLEARER * chance:
        reason = f"its turns are not those of {reference.system} (correlation {alike:.2f})"
        nothing = ClockEstimate(source.system, reference.epoch, "not_determinable", reason)
        return replace(nothing, confidence=confidence)
    return replace(found, reason=found.reason or reason)


def _highest_score(reference: ContinuousPath, source: ContinuousPath, window: float) -> float:
    """Score of the delay at which the turns are most alike; 0 where there is none."""
    peaks = starting_peaks(reference, source, window, most=1)
    return float(peaks.scores[0]) if len(peaks.scores) else 0.0


def _alike(reference: ContinuousPath, source: ContinuousPath, delay: float) -> float:
    """Correlation of the turn rates of two paths with a delay added to the source's times."""
    at = np.arange(source.times[0], source.times[-1], STEP)
    at = at[source.supported(at) & reference.supported(at + delay)]
    if len(at) < 3:
        return 0.0
    rates = reference.at(at + delay)[1][:, 2], source.at(at)[1][:, 2]
    return float(np.corrcoef(*rates)[0, 1])


def _prepared(trajectory: Trajectory, epoch: int) -> Prepared:
    if len(trajectory) < 3:
        raise GtvalError(f"trajectory of '{trajectory.system}': three poses at least have a clock")
    flat = trajectory.planar()
    times = flat.times_since(epoch)
    line = frame_line(times)
    if line is not None:
        times = line.times
    headings = flat.headings if flat.has_orientation else None
    path = continuous_path(times, flat.positions, headings, flat.gap)
    return Prepared(trajectory.system, times, flat.positions, headings, line, path)


def _estimated(
    reference: Prepared, source: Prepared, window: float, confidence: float, epoch: int
) -> tuple[ClockEstimate, Best | None, float]:
    """The estimate as if the clock did not jump, its fit, and the sign of the fit's delay."""
    # What has headings only can be the continuous one, but no source of positions.
    swapped = source.interval < DENSER * reference.interval or not source.path.has_position
    dense, sparse = (source, reference) if swapped else (reference, source)
    nothing = ClockEstimate(source.name, epoch, "not_determinable", confidence=confidence)
    nothing = replace(nothing, jitter_s=source.line.jitter if source.line else np.nan)
    peaks = starting_peaks(dense.path, sparse.path, window)
    if not len(peaks.delays):
        reason = no_overlap_in_words(reference.times, source.times, window)
        return replace(nothing, reason=reason), None, 1.0
    middle = float(sparse.times[0] + sparse.times[-1]) / 2
    rows = Rows.of(sparse.times, sparse.positions, sparse.headings)
    fit = Fit(dense.path, rows, middle)
    try:
        best = _best(fit, peaks.delays, sparse.line is None)
    except LinAlgError:
        best = None
    if best is None:
        return replace(nothing, reason="the two have too few poses in common"), None, 1.0
    told = judged(best, (dense, sparse, swapped), nothing)
    return told, best, -1.0 if swapped else 1.0


def _best(fit: Fit, delays: Array, with_jitter: bool) -> Best | None:
    """The delay that fits best, with the others that fit no worse."""
    few = thinned(fit, SEARCH_ROWS)
    tried: list[tuple[float, Candidate, Variances]] = []
    for delay in delays:
        one = candidate(few, float(delay))
        if one is None:
            continue
        try:
            one, variances = refined(one, None)
        except LinAlgError:
            continue
        tried.append((float(delay), one, variances))
    if not tried:
        return None
    most = max(len(one.fit.rows) for _, one, _ in tried)
    tried = [entry for entry in tried if len(entry[1].fit.rows) >= LEAST_SHARE * most]
    yard = Variances(
        min(entry[2].position for entry in tried),
        min(entry[2].heading for entry in tried),
        1e-4,
        1e-4,
    )

    def cost(entry: tuple[float, Candidate, Variances]) -> float:
        costs = entry[1].fit.row_costs(entry[1].state, yard)
        return float(costs.mean()) - 0.5 * len(costs) / most

    delay = min(tried, key=cost)[1].delay
    found: Best | None = None
    for _ in range(3):
        found, better = _at(fit, few, delay, delays, with_jitter)
        if not better:
            break
        delay = min(better, key=lambda one: one[1])[0]
    if found is None or not found.rivals:
        return found
    # Of delays that fit alike the smallest is told: clocks are rarely off by a lap.
    least = min((delay for delay, _ in found.rivals), key=abs)
    if abs(least) < abs(found.candidate.delay):
        return _at(fit, few, least, delays, with_jitter)[0] or found
    return found


def _at(
    fit: Fit, few: Fit, delay: float, delays: Array, with_jitter: bool
) -> tuple[Best | None, list[tuple[float, float]]]:
    """The fit that starts at a delay, and other delays that fit better."""
    start = candidate(fit, delay)
    if start is None:
        return None, []
    start, variances = refined(start, None)
    # The middle of what both have, at which the delay and the drift are least dependent.
    middle = float(start.fit.rows.times[0] + start.fit.rows.times[-1]) / 2
    best, variances = settled(_about(start, middle), variances, with_jitter)
    rivals = _rivals(few, delays, best, variances)
    left = tuple((other, score) for other, score, out in rivals if not out)
    better = [(other, score) for other, score, _ in rivals if score < 0]
    return Best(best, variances, left, few), better


def _about(one: Candidate, middle: float) -> Candidate:
    """The same with the delay counted at another stamp."""
    par = one.state.parameters.copy()
    par[DELAY] += par[DRIFT] * (middle - one.fit.middle)
    new = Fit(one.fit.path, one.fit.rows, middle)
    return replace(one, fit=new, state=replace(one.state, parameters=par))


def _rivals(
    few: Fit, delays: Array, best: Candidate, variances: Variances
) -> list[tuple[float, float, bool]]:
    """Delay, score of how much worse it fits, and whether it is excluded, of each other start."""
    found = []
    for delay in delays:
        start = candidate(few, float(delay))
        if start is None or abs(delay - best.delay) < 0.3:
            continue
        try:
            one, _ = refined(start, variances)
        except LinAlgError:
            continue
        if abs(one.delay - best.delay) < 0.3:
            continue
        between = gap(best, one, variances)
        small = between.share * len(best.fit.rows) < LEAST_SHARE * _expected(few, best)
        out = small or excluded(between, between.share * len(best.fit.rows))
        found.append((one.delay, between.score if not small else np.inf, out))
    return found


def _expected(few: Fit, best: Candidate) -> float:
    """Number of the best one's poses that a thinned rival with all of them would share."""
    return float(np.isin(best.fit.rows.times, few.rows.times).sum())
