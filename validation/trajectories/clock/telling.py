"""Delays in words: what motion there is, which offset has a name, whether a tolerance is kept."""

from collections.abc import Sequence

import numpy as np

from validation.poses.angles import Array
from validation.trajectories.clock.fit import Fit
from validation.trajectories.clock.result import ClockEstimate
from validation.trajectories.clock.rows import State

NAMED = {
    18.0: "GPS time is 18 s ahead of UTC",
    19.0: "TAI is 19 s ahead of GPS time",
    37.0: "TAI is 37 s ahead of UTC",
}
"""Differences of the scales of time since 2017."""
UNCLEAR = "the motion tells too little"
"""What is said of motion that is neither rest nor even."""
NO_TURN, EVEN_TURN = "the robot does not turn", "the robot turns at a constant rate"
"""What is said of a source that has headings only."""
NEXT_TO = 0.5
"""Seconds around a named offset within which it is named; usual latencies stay below."""
HOUR = 3600.0


def named_offset(delay: float) -> str:
    """What a delay next to an offset in common use is; empty where there is none."""
    size = abs(delay)
    for offset, text in NAMED.items():
        if abs(size - offset) <= NEXT_TO:
            return text
    hours = round(size / HOUR)
    if hours and abs(size - hours * HOUR) <= NEXT_TO:
        plural = "s" if hours > 1 else ""
        return f"{hours} whole hour{plural}: a time zone, or summer time"
    return ""


def motion_in_words(fit: Fit, state: State) -> str:
    """What motion the two have in common, where it tells no delay."""
    rate = fit.path.at(fit.times(state.parameters))[1]
    speed, turn = np.hypot(rate[:, 0], rate[:, 1]), rate[:, 2]
    noise = np.sqrt(fit.path.rate_variance)
    top = float(np.quantile(speed, 0.9))
    turned = float(np.quantile(np.abs(turn), 0.9))
    still_turning = turned < max(0.01, 4 * noise[1])
    if not fit.with_position:
        steady = float(turn.std()) < max(0.05 * turned, 4 * noise[1])
        return NO_TURN if still_turning else EVEN_TURN if steady else UNCLEAR
    if top < max(0.01, 4 * noise[0]) and still_turning:
        return "the robot stands still"
    even = float(speed.std()) < max(0.02 * top, 4 * noise[0])
    if still_turning and even:
        return "the robot drives straight at constant speed"
    if even and float(turn.std()) < max(0.05 * turned, 4 * noise[1]):
        return "the robot turns at a constant rate at constant speed"
    return UNCLEAR


def no_overlap_in_words(reference: Array, source: Array, window: float) -> str:
    """By how much two records miss each other."""
    ahead = max(reference[0] - source[-1], source[0] - reference[-1])
    if ahead <= 0:
        return "the two have less than 5 s in common, or no motion in it"
    start = reference[0] - source[0]
    text = f"the records miss each other by {ahead:.6g} s, and the search ends at {window:g} s"
    name = named_offset(float(start))
    if not name:
        hours = round(start / HOUR)
        if hours and abs(start - hours * HOUR) < 600:
            name = f"{abs(hours)} whole hours would bring them together"
    return f"{text} ({name}); try a larger --window" if name else f"{text}; try a larger --window"


def rivals_in_words(delay: float, others: Sequence[float]) -> str:
    """By which periods a delay is open."""
    apart = sorted({round(abs(other - delay), 2) for other in others})
    listed = ", ".join(f"{one:g} s" for one in apart[:3])
    return f"the motion repeats itself: other delays fit as well, {listed} away"


def ambiguous_by(one: ClockEstimate) -> float | None:
    """The smallest step to a delay that fits as well, seconds; None where there is none."""
    return min((abs(delay - one.delay_s) for delay, _ in one.rivals), default=None)


def stamps_in_words(delay: float) -> str:
    """'stamps 100 ms late' for a delay of -0.1 s."""
    size = abs(delay)
    if size < 5e-5:
        return "stamps right to 0.1 ms"
    shown = f"{size * 1e3:.3g} ms" if size < 1 else f"{size:.4g} s"
    return f"stamps {shown} {'late' if delay < 0 else 'early'}"


def largest_errors(estimate: ClockEstimate) -> Array:
    """(2, 2) position and heading errors that uncorrected stamps make at 95 % of the speeds.

    Returns
    -------
    (2, 2) array
        Row 0 for positions in metres, row 1 for headings in radians; column 0 the least, column 1
        the most that the interval of the delay allows.
    """
    low, high = estimate.low_s, estimate.high_s
    most = max(abs(low), abs(high))
    least = 0.0 if low <= 0 <= high else min(abs(low), abs(high))
    fast = np.array([estimate.speeds[1], estimate.turn_rates[1]])
    return np.asarray(fast[:, None] * np.array([least, most]))


def within(least: float, most: float, tolerance: float) -> str:
    """'within', 'over' or 'open': the whole interval on one side of a tolerance, or not."""
    if not np.isfinite(most):
        return "open"
    if most <= tolerance:
        return "within"
    return "over" if least > tolerance else "open"
