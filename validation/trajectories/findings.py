"""What a comparison in time says, in sentences."""

from collections.abc import Iterator

import numpy as np

from validation.errors import GtvalError
from validation.results import Finding, Severity, Size
from validation.statistics.conclusions import nees_size
from validation.statistics.dependence import UNSEEN
from validation.statistics.units import unit_of_points
from validation.trajectories.alignment import align, moved_positions
from validation.trajectories.comparison import Answer, ComponentInTime, TimeComparison

LITTLE_COVERAGE = 0.5
"""Share of the reference's time below which a comparison speaks of the lesser part of it."""
LEAST_COVERAGE = 0.1
"""Share below which that asks for action: one of four cameras sees a quarter of a room."""
FRAME_SHARE = 0.5
"""Of the rms of the position error: if a frame would take away more than half of it, most of the
error is that of the frame."""
SMALLEST_DELAY_ERROR = 0.001
"""Metres that a delay must be worth at the speeds driven, to be told: less than the noise of any
ground truth for robots."""
WORDS = {"yes": "yes", "no": "no", "cannot_tell": "it cannot be told"}


def millimetres(metres: float) -> str:
    """'31 mm', '0.4 mm', '1.25 m', or 'unknown'."""
    if not np.isfinite(metres):
        return "unknown"
    if abs(metres) >= 1:
        return f"{metres:.3g} m"
    if abs(metres) < 1e-6:  # what is left of equal numbers after rounding
        return "0 mm"
    return f"{1000 * metres:.0f} mm" if abs(metres) >= 0.01 else f"{1000 * metres:.2g} mm"


def limit_sentence(comparison: TimeComparison, answer: Answer) -> str:
    """Whether the source is good enough for a limit, with the numbers that say so."""
    limit = millimetres(answer.limit_m) if answer.limit_m < 0.01 else f"{100 * answer.limit_m:g} cm"
    rms = answer.rms
    percent = f"{100 * comparison.confidence:g} %"
    between = (
        f"{percent} interval {millimetres(rms.low)} to {millimetres(rms.high)}, "
        f"{rms.n_effective:.0f} effective of {rms.n} poses"
        if np.isfinite(rms.low)
        else f"no interval: {rms.reason}"
    )
    fitted = " + ".join(comparison.alignment.parts)
    after = f" after {fitted} {'was' if '+' not in fitted else 'were'} fitted" if fitted else ""
    return (
        f"Is '{comparison.system}' good enough for {limit}? {WORDS[answer.verdict].capitalize()}: "
        f"the rms of its position error is {millimetres(rms.rms)}{after} ({between}), and "
        f"{100 * answer.share:.0f} % of the errors are below {limit}."
    )


def findings_in_time(comparison: TimeComparison, limit: float) -> list[Finding]:
    """What a reader should take from the errors of a source.

    Parameters
    ----------
    comparison : TimeComparison
        The errors.
    limit : float
        Of the position error, metres.
    """
    return [
        *_unit(comparison),
        *_limit(comparison, limit),
        *_shared(comparison),
        *_coverage(comparison),
        *_frame(comparison),
        *_intervals(comparison),
        *_worst(comparison, limit),
        *_delay(comparison),
        *_biases(comparison, limit),
        *_consistency(comparison),
    ]


def _unit(comparison: TimeComparison) -> Iterator[Finding]:
    pairs = comparison.pairs
    unit = unit_of_points(pairs.source.positions, pairs.reference.positions)
    if unit:
        text = f"Write its positions in metres: they are in {unit}."
        yield Finding("error", text, comparison.system, "unit")


def _limit(comparison: TimeComparison, limit: float) -> Iterator[Finding]:
    answer = comparison.answer(limit)
    severity: Severity = "good" if answer.verdict == "yes" else "note"
    yield Finding(
        severity,
        limit_sentence(comparison, answer),
        comparison.system,
        {"yes": "limit_held", "no": "limit_exceeded"}.get(answer.verdict, "limit_open"),
        (_rms(comparison),),
    )


def _shared(comparison: TimeComparison) -> Iterator[Finding]:
    if comparison.pairs.shared:
        text = f"The two are not of one kind: {comparison.pairs.shared}."
        yield Finding("note", text, comparison.system, "compared_in_part")


def _coverage(comparison: TimeComparison) -> Iterator[Finding]:
    covered = comparison.coverage
    if covered.share >= LITTLE_COVERAGE:
        return
    longest = ""
    if len(covered.holes):
        start, end = covered.holes[0] - comparison.start
        longest = f"; the longest stretch without is {start:.0f} to {end:.0f} s after its start"
    text = (
        f"Only {100 * covered.share:.3g} % of the reference's {covered.span_s:.0f} s have pairs "
        f"({covered.paired} of {covered.asked} poses of the {covered.at}{longest}). Nothing is "
        "interpolated across a gap, and of the rest nothing is known."
    )
    severity: Severity = "warning" if covered.share < LEAST_COVERAGE else "note"
    size = Size("share of the reference with pairs", covered.share)
    yield Finding(severity, text, comparison.system, "little_coverage", (size,))


def _frame(comparison: TimeComparison) -> Iterator[Finding]:
    if "frame" in comparison.alignment.parts:
        return
    try:
        found = align(comparison.pairs, ["frame"])
    except GtvalError:
        return
    away = comparison.pairs.reference.positions - moved_positions(found, comparison.pairs.source)
    after = float(np.sqrt(np.square(away).sum(1).mean()))
    before = comparison.rms_position.rms
    if after < FRAME_SHARE * before:
        text = (
            f"Most of the error is that of another frame: the rms of the position error would be "
            f"{millimetres(after)} in place of {millimetres(before)} after a rotation and a "
            "translation. If the two need not share a frame, use --align frame."
        )
        size = Size("rms position in another frame", after, "m")
        yield Finding("warning", text, comparison.system, "other_frame", (_rms(comparison), size))


def _rms(comparison: TimeComparison) -> Size:
    rms = comparison.rms_position
    return Size("rms position", rms.rms, "m", rms.low, rms.high, comparison.confidence)


def _intervals(comparison: TimeComparison) -> Iterator[Finding]:
    rms = comparison.rms_position
    if rms.reason:
        text = f"No interval of the position error can be given: {rms.reason}. Record longer."
        yield Finding("warning", text, comparison.system, "interval_withheld", (_rms(comparison),))
    elif rms.short:
        text = (
            f"The record may be shorter than ten times the time over which errors are alike: its "
            f"interval may be too narrow, and {UNSEEN}. Record longer."
        )
        yield Finding("warning", text, comparison.system, "short_record", (_rms(comparison),))


def _worst(comparison: TimeComparison, limit: float) -> Iterator[Finding]:
    bad = [one for one in comparison.worst_stretches() if one.rms_m > limit]
    if not bad:
        return
    start = comparison.start
    told = ", ".join(
        f"{one.start_s - start:.1f} to {one.end_s - start:.1f} s (rms {millimetres(one.rms_m)}, "
        f"at most {millimetres(one.max_m)})"
        for one in bad
    )
    text = (
        f"The errors are worst at {told} after the start of the reference: above the limit of "
        f"{millimetres(limit)} there."
    )
    sizes = tuple(Size("rms position of the stretch", one.rms_m, "m") for one in bad)
    yield Finding("warning", text, comparison.system, "worst_stretches", sizes)


def _delay(comparison: TimeComparison) -> Iterator[Finding]:
    delay, spread = comparison.delay_by_speed
    if spread is None or "time" in comparison.alignment.parts or np.isnan(spread.low):
        return
    worth = abs(delay) * float(np.median(comparison.motion.speed))
    if spread.low <= 0 <= spread.high or worth < SMALLEST_DELAY_ERROR:
        return
    text = (
        f"The errors along the motion grow with the speed, as if the stamps were "
        f"{1000 * abs(delay):.0f} ms {'late' if delay < 0 else 'early'} (delay {delay:+.3f} s, "
        f"{spread.low:+.3f} to {spread.high:+.3f} s). Find the delay, or use --align frame+time."
    )
    size = Size("delay", float(delay), "s", spread.low, spread.high, spread.confidence)
    yield Finding("warning", text, comparison.system, "delay_suspected", (size,))


def _biases(comparison: TimeComparison, limit: float) -> Iterator[Finding]:
    for one in comparison.statistics(limit):
        if not one.note and np.isfinite(one.mean.low):
            yield _bias(one, comparison.system)


def _bias(one: ComponentInTime, system: str) -> Finding:
    unit, mean = one.component.unit, one.mean
    name, ends = f"mean error in {one.component.name}", (mean.low, mean.high)
    sizes = (Size(name, mean.mean, unit, *ends, mean.confidence),)
    measured = (
        f"{mean.mean:+.4f} {unit} ({100 * mean.confidence:g} % interval {mean.low:+.4f} to "
        f"{mean.high:+.4f} {unit}, {mean.n_effective:.0f} effective of {mean.n} poses)"
    )
    below = (
        f"It is below {one.bias.limit:g} {unit}."
        if one.bias.holds
        else f"That it is below {one.bias.limit:g} {unit} cannot be claimed; the least that can "
        f"be is {one.bias.smallest_limit:.4f} {unit}."
    )
    if mean.low <= 0 <= mean.high:
        text = f"No bias in {one.component.name} is shown: {measured} holds zero. {below}"
        return Finding("good" if one.bias.holds else "note", text, system, "no_bias_shown", sizes)
    text = f"There is a bias in {one.component.name}: {measured}. {below}"
    return Finding("note" if one.bias.holds else "warning", text, system, "bias", sizes)


def _consistency(comparison: TimeComparison) -> Iterator[Finding]:
    test = comparison.nees_test
    if test is None:
        return
    size = (nees_size(test),)
    text = (
        f"The mean NEES is {test.mean:.3g}, expected {test.per_pose} ({test.interval.low:.3g} to "
        f"{test.interval.high:.3g} for {test.poses} effective poses)"
    )
    if test.verdict == "inside":
        text = f"{text}: errors and covariances agree."
        yield Finding("good", text, comparison.system, "nees_inside", size)
    elif test.verdict == "above":
        text = f"{text}: the errors are larger than the stated covariances allow."
        yield Finding("warning", text, comparison.system, "nees_above", size)
    else:
        text = f"{text}: the stated covariances are larger than the errors."
        yield Finding("note", text, comparison.system, "nees_below", size)
