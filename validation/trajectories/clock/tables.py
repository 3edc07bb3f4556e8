"""Clocks for people and for scripts: a table, sentences, JSON."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from validation.results import Finding, Severity, Size, Table
from validation.trajectories.clock.jumps import STEADY
from validation.trajectories.clock.result import ClockEstimate, Place
from validation.trajectories.clock.telling import (
    ambiguous_by,
    largest_errors,
    named_offset,
    stamps_in_words,
    within,
)

WORDS = {
    "determined": "determined",
    "ambiguous": "ambiguous",
    "not_determinable": "cannot be told",
}
FASTEST_PPM = 1000.0
"""Drift beyond which no clock runs: twice that at which one is slewed to set it."""
AT_ONCE = 1.0
"""Seconds up to which a jump is told to be at one stamp; a judgement."""
UNSEEN = (
    "A delay that the reference and all sources have in common cannot be seen. Of stamps that are "
    "made at receipt, the delay holds the mean latency."
)
"""What no comparison of clocks can tell."""


@dataclass(frozen=True)
class Tolerance:
    """Errors that wrong stamps may cause: metres and radians."""

    length: float
    angle: float


def clock_table(estimates: Sequence[ClockEstimate]) -> Table:
    """One row a source."""
    return Table.of_columns(
        "Clocks of the sources",
        [
            ("source", "", [one.source for one in estimates]),
            ("delay [ms]", ".2f", [_shown(1e3 * one.delay_s) for one in estimates]),
            ("low [ms]", ".2f", [_shown(1e3 * one.low_s) for one in estimates]),
            ("high [ms]", ".2f", [_shown(1e3 * one.high_s) for one in estimates]),
            ("drift [ppm]", ".1f", [_shown(one.drift_ppm) for one in estimates]),
            ("low [ppm]", ".1f", [_shown(one.drift_low_ppm) for one in estimates]),
            ("high [ppm]", ".1f", [_shown(one.drift_high_ppm) for one in estimates]),
            ("jitter [ms]", ".2f", [_shown(1e3 * one.jitter_s) for one in estimates]),
            ("verdict", "", [WORDS[one.verdict] for one in estimates]),
        ],
        note="The delay is added to a source's stamps to get the reference's time, at the middle "
        f"of the common time; the drift is its change. {UNSEEN}",
    )


def parts_table(one: ClockEstimate) -> Table:
    """The delay by parts of the record."""
    return Table.of_columns(
        f"{one.source}: delay by parts of the record",
        [
            ("from [s]", ".1f", [part.first_s for part in one.parts]),
            ("to [s]", ".1f", [part.last_s for part in one.parts]),
            ("delay [ms]", ".2f", [1e3 * part.delay_s for part in one.parts]),
            ("low [ms]", ".2f", [1e3 * part.low_s for part in one.parts]),
            ("high [ms]", ".2f", [1e3 * part.high_s for part in one.parts]),
        ],
    )


def _shown(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def clock_findings(one: ClockEstimate, tolerance: Tolerance) -> list[Finding]:
    """What a reader should know of a source's clock, and what to do about it."""
    if one.verdict == "not_determinable":
        text = (
            f"How late its stamps are cannot be told: {one.reason}. Drive again with changing "
            "speeds and turns, with the start and the end in view."
        )
        return [Finding("warning", text, one.source, "clock_not_determinable")]
    findings = [_delay(one, tolerance)]
    if one.verdict == "ambiguous":
        text = (
            f"Its delay of {1e3 * one.delay_s:.1f} ms is one of several that fit: {one.reason}. "
            "Give a smaller --window if you know better, or drive a way that does not repeat."
        )
        findings = [Finding("warning", text, one.source, "clock_ambiguous", (_delay_size(one),))]
    findings += jump_findings(one)
    if name := named_offset(one.delay_s):
        text = f"Its delay of {one.delay_s:.3f} s is next to an offset that has a name: {name}."
        size = (_delay_size(one),)
        findings.append(Finding("warning", text, one.source, "clock_named_offset", size))
    unsteady = any(finding.code == "clock_unsteady" for finding in findings)
    if not unsteady and (one.drift_low_ppm > 0 or one.drift_high_ppm < 0):
        text = (
            f"Its clock runs away by {one.drift_ppm:.1f} ppm ({one.drift_low_ppm:.1f} to "
            f"{one.drift_high_ppm:.1f}): the delay holds for {one.at_s + one.epoch:.1f} s, and "
            f"changes by {60e-3 * abs(one.drift_ppm):.2g} ms a minute."
        )
        ends = one.drift_low_ppm, one.drift_high_ppm
        size = (Size("drift of the clock", one.drift_ppm, "ppm", *ends, one.confidence),)
        odd = min(abs(end) for end in ends) > 1e6 * STEADY
        if odd:
            text += (
                " Hardly a clock runs so wrong by itself: one that is being set, or one that "
                "jumps where there are no poses, looks like this."
            )
        found = Finding("warning" if odd else "note", text, one.source, "clock_drift", size)
        findings.append(found)
    return findings


def jump_findings(one: ClockEstimate) -> list[Finding]:
    """A finding for each jump of a clock, and one where it runs as no clock does."""
    found = []
    if one.drift_low_ppm > FASTEST_PPM or one.drift_high_ppm < -FASTEST_PPM:
        text = (
            f"Its clock would run away by {one.drift_ppm:.0f} ppm, as no clock does. It has "
            "jumped, where the motion does not tell when, or its stamps are those of something "
            "else."
        )
        ends = one.drift_low_ppm, one.drift_high_ppm
        size = (Size("drift of the clock", one.drift_ppm, "ppm", *ends, one.confidence),)
        found.append(Finding("warning", text, one.source, "clock_unsteady", size))
    for jump in one.jumps:
        more, low, high = 1e3 * jump.size_s, 1e3 * jump.low_s, 1e3 * jump.high_s
        text = (
            f"Its clock jumps {_where(jump.place, one.epoch)}: the delay there is "
            f"{1e3 * jump.before_s:+.1f} ms before and {1e3 * jump.after_s:+.1f} ms after, "
            f"{more:+.1f} ms more ({low:+.1f} to {high:+.1f}). Each part has its own delay. Look "
            "for a clock that was set, or a computer that was busy."
        )
        change = Size(
            *("change of the delay", jump.size_s, "s", jump.low_s, jump.high_s, one.confidence)
        )
        found.append(Finding("warning", text, one.source, "clock_jump", (change,)))
    return found


def _where(place: Place, epoch: int) -> str:
    """Where a jump is, in words."""
    first, last = place.first_s + epoch, place.last_s + epoch
    if last - first < AT_ONCE:
        return f"at the stamp {place.stamp_s + epoch:.2f} s"
    return (
        f"between the stamps {first:.2f} and {last:.2f} s, in which there are no poses or they fit "
        "both delays"
    )


def _delay_size(one: ClockEstimate) -> Size:
    return Size("delay", one.delay_s, "s", one.low_s, one.high_s, one.confidence)


def _delay(one: ClockEstimate, tolerance: Tolerance) -> Finding:
    """The delay, what it spoils, and whether that is within the tolerance."""
    errors = largest_errors(one)
    answers = {
        within(least, most, limit)
        for (least, most), limit in zip(errors.tolist(), _limits(tolerance), strict=True)
    }
    answer = next(one for one in ("over", "open", "within") if one in answers)
    percent = f"{100 * one.confidence:g} %"
    low, high = 1e3 * one.low_s, 1e3 * one.high_s
    speed, turning = one.speeds[1], one.turn_rates[1]
    text = (
        f"{stamps_in_words(one.delay_s).capitalize()} (delay {1e3 * one.delay_s:+.2f} ms, "
        f"{percent} interval {low:+.2f} to {high:+.2f} ms). At "
    )
    asked, turned = f"{1e3 * tolerance.angle:g} mrad", f"{1e3 * errors[1, 1]:.1f} mrad"
    below = f"{turning:.2g} rad/s, which 95 % of the motion is below, that is up to "
    if speed > 0:
        asked = f"{1e3 * tolerance.length:g} mm and {asked}"
        text += f"{speed:.2g} m/s and {below}{1e3 * errors[0, 1]:.1f} mm and {turned}"
    else:  # a source with headings only
        text += below + turned
    severity: Severity = "good"
    if answer == "within":
        text += f": within {asked}."
    elif answer == "over":
        severity = "warning"
        text += f": over {asked}. Add the delay to its stamps."
    else:
        severity = "note"
        text += f": whether that keeps {asked} is open."
    if np.isfinite(period := one.interval_s):
        less = max(abs(one.low_s), abs(one.high_s)) < period
        text += f" It is {'' if less else 'not '}below the interval of its frames, {period:.3g} s."
    return Finding(
        severity,
        text,
        one.source,
        {"over": "clock_over", "open": "clock_open"}.get(answer, "clock_within"),
        (_delay_size(one),),
    )


def _limits(tolerance: Tolerance) -> tuple[float, float]:
    return tolerance.length, tolerance.angle


def clock_json(one: ClockEstimate, tolerance: Tolerance) -> dict[str, object]:
    """Everything known of a clock: seconds, parts in a million; ``at_s`` with its epoch."""
    errors = largest_errors(one)
    position, heading = (
        within(least, most, limit)
        for (least, most), limit in zip(errors.tolist(), _limits(tolerance), strict=True)
    )
    return {
        "delay_s": one.delay_s,
        "low_s": one.low_s,
        "high_s": one.high_s,
        "at_s": one.at_s + one.epoch,
        "drift_ppm": one.drift_ppm,
        "drift_low_ppm": one.drift_low_ppm,
        "drift_high_ppm": one.drift_high_ppm,
        "jitter_s": one.jitter_s,
        "verdict": one.verdict,
        "reason": one.reason,
        "confidence": one.confidence,
        "words": stamps_in_words(one.delay_s) if np.isfinite(one.delay_s) else "",
        "named_offset": named_offset(one.delay_s) if np.isfinite(one.delay_s) else "",
        "frame_period_s": one.period_s,
        "ambiguous_by_s": ambiguous_by(one),
        "tolerance": {
            "length_m": tolerance.length,
            "angle_rad": tolerance.angle,
            "largest_position_error_m": errors[0, 1],
            "largest_heading_error_rad": errors[1, 1],
            "position": position,
            "heading": heading,
            "below_frame_interval": bool(max(abs(one.low_s), abs(one.high_s)) < one.interval_s),
        },
        "rivals_s": [delay for delay, _ in one.rivals],
        "parts": [
            {
                "first_s": part.first_s + one.epoch,
                "last_s": part.last_s + one.epoch,
                "delay_s": part.delay_s,
                "low_s": part.low_s,
                "high_s": part.high_s,
            }
            for part in one.parts
        ],
        "jumps": [
            {
                "stamp_s": jump.stamp_s + one.epoch,
                "between_s": [jump.place.first_s + one.epoch, jump.place.last_s + one.epoch],
                "size_s": jump.size_s,
                "low_s": jump.low_s,
                "high_s": jump.high_s,
            }
            for jump in one.jumps
        ],
        "pieces": [clock_json(piece, tolerance) for piece in one.pieces],
        "frame": one.frame,
        "mount": one.mount,
        "mount_covariance": one.mount_covariance,
        "noise": one.noise,
        "poses": one.poses,
    }
