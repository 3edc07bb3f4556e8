"""What a person should read of errors that last, one line a cause."""

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from rtk_gt.campaign.outcome import RtkOutcome
from rtk_gt.lasting.errors import SHORT
from rtk_gt.lasting.jumps import SeenSizes
from rtk_gt.lasting.lasting_error import LastingError, beyond_a_base
from rtk_gt.path.common_errors import CLEARLY
from rtk_gt.path.coverage import Coverage
from rtk_gt.receivers.steps import Steps
from validation.results import Finding, Size

SUBJECT = "rtk"
MOST = 8
"""Lines of single errors; more are counted in one line."""
NORMAL_95 = 1.96
LARGEST_UNSEEN = 0.12
"""Metres of a jump of all receivers that may stay unseen without advice to record more often: a
base station that averages its coordinates anew moves by more."""
JUMP_COLUMNS = (
    *("receivers", "start", "end", "east", "north", "up"),
    *("sigma_east", "sigma_north", "sigma_up", "gain"),
)
"""Of results/rtk_jumps.csv."""
LEAST_TAU = 2.0
"""Poses worth one, above which it is said: white noise makes 1 within a few percent."""


class WithJumps(Protocol):
    """What is told of errors that last, of however many receivers."""

    @property
    def lasting(self) -> tuple[LastingError, ...]:
        """The errors."""

    @property
    def steps(self) -> Steps:
        """Of the receivers."""

    @property
    def coverage(self) -> Coverage:
        """From when on seconds are counted."""

    @property
    def seen_of_all(self) -> SeenSizes:
        """Sizes of jumps of all that are seen."""


def short_errors(outcome: WithJumps) -> int:
    """Epochs with errors of so few epochs that they are single false fixes."""
    return sum(one.epochs for one in outcome.lasting if not _told(one))


def lasting_findings(outcome: WithJumps) -> Iterator[Finding]:
    """False fixes that last, and jumps of one receiver, several or all: the largest, in time."""
    told = [one for one in outcome.lasting if _told(one)]
    largest = sorted(told, key=lambda error: -error.length)[:MOST]
    for one in sorted(largest, key=lambda error: error.start):
        yield _finding(outcome, one)
    if len(told) > MOST:
        text = (
            f"{len(told) - MOST} more errors that last, all smaller, are in "
            "results/rtk_jumps.csv: this drive is no ground truth to centimetres. Look at the "
            "base station and at what hides the sky."
        )
        size = (Size("more errors that last", len(told) - MOST, "errors"),)
        yield Finding("warning", text, SUBJECT, "many_jumps", size)


def unseen_findings(outcome: WithJumps, of_some: SeenSizes | None = None) -> Iterator[Finding]:
    """That jumps may be in the drive unseen: of all receivers, between fixes and over gaps.

    And of some, level and upwards.
    """
    of_all, found = outcome.seen_of_all, outcome.coverage
    who = "of all receivers " if len(outcome.steps.receivers) > 1 else ""
    text = (
        f"A jump {who}of {_less_than(of_all)} may stay unseen in this record, as the vehicle moves "
        f"that much by itself between its fixes{_seldom(of_all)}. "
    )
    sizes = list(_seen_sizes("jump of all", of_all))
    if of_some is not None and np.isfinite(of_some.level + of_some.up).all():
        text += (
            f"So may one of some of them, or a false fix, of {_less_than(of_some)}, unless the "
            f"whole drive tells it{_seldom(of_some)}. "
        )
        sizes += _seen_sizes("jump of some", of_some)
    gaps = [gap for gap in found.gaps if gap.duration > found.max_gap]
    if gaps:
        last = "lasts" if len(gaps) == 1 else "last"
        text += (
            f"Over a gap one of any size would not: {len(gaps)} {last} more than "
            f"{found.max_gap:g} s, and what comes after one may be off from what came before. "
        )
    if max(of_all.level[1], of_all.up[1]) > LARGEST_UNSEEN:
        text += "Record at 5 Hz or more if the base station may restart. "
    text += "Compare the base station's coordinates before and after the drive."
    sizes += [Size("gaps over which none is seen", len(gaps), "gaps")] if gaps else []
    yield Finding("note", text, SUBJECT, "jumps_unseen", tuple(sizes))


def _less_than(seen: SeenSizes) -> str:
    """Sizes below which a jump may stay unseen: 95 in 100 are seen of them."""
    if not np.isfinite(seen.level + seen.up).all():
        return "any size"
    return f"less than some {_metres(seen.level[1])} level or {_metres(seen.up[1])} upwards"


def _seldom(seen: SeenSizes) -> str:
    """Sizes of which few are seen."""
    if not np.isfinite(seen.level + seen.up).all():
        return ""
    level, up = _metres(seen.level[0]), _metres(seen.up[0])
    return f" (95 in 100 of that size are seen; of {level} and {up} 5 in 100)"


def _metres(size: float) -> str:
    return f"{100 * size:.0f} cm" if size < 1 else "1 m and more"


def _seen_sizes(what: str, seen: SeenSizes) -> Iterator[Size]:
    """What 95 and 5 in 100 are seen of, level and upwards."""
    for way, (low, high) in (("level", seen.level), ("upwards", seen.up)):
        if np.isfinite(high):
            yield Size(f"{what}, {way}, of which 95 in 100 are seen", high, "m")
            yield Size(f"{what}, {way}, of which 5 in 100 are seen", low, "m")


def _told(error: LastingError) -> bool:
    return error.stays or error.epochs >= SHORT


UNSURE_START = 2.0
"""Seconds up to which the beginning of a jump is told as one; a judgement."""


def who_jumps(outcome: WithJumps, receivers: tuple[int, ...]) -> str:
    """The receivers of a jump in words."""
    names = outcome.steps.receivers
    if len(receivers) == len(names) > 1:
        return "all receivers"
    return " and ".join(names[k] for k in receivers)


def _finding(outcome: WithJumps, error: LastingError) -> Finding:
    half = NORMAL_95 * error.length_sigma
    who = who_jumps(outcome, error.receivers)
    axes = ", ".join(
        f"{100 * part:+.1f} cm {axis}"
        for part, axis in zip(error.size, ("east", "north", "up"), strict=True)
    )
    begin = error.start - outcome.coverage.start
    sizes = (
        Size.normal("jump", error.length, error.length_sigma, "m"),
        Size("second at which it begins", float(begin), "s"),
    )
    what = f"by {100 * error.length:.1f} cm (95 %: \u00b1 {100 * half:.1f} cm; {axes})"
    doubt = "".join(_or_who(outcome, error, other) for other in error.alike[:1])
    if not error.stays:
        text = (
            f"A false fix that lasts: {who}{doubt} is off {what} from second {begin:.1f} to "
            f"{error.end - outcome.coverage.start:.1f}. These fixes were left out; there are no "
            "poses. Their kind says RTK fixed: watch for reflections and few satellites there."
        )
        return Finding("warning", text, SUBJECT, "lasting_false_fix", sizes)
    if len(error.receivers) == len(outcome.steps.receivers) and beyond_a_base(error):
        text = (
            f"A leap that no restart of a base station makes: {who}{doubt} is off {what} from "
            f"second {begin:.1f} on. The receiver hung, its clock leapt while the vehicle drove, "
            "or two records were put together. The leap was taken out of what follows, which must "
            "not be used before that is known."
        )
        return Finding("error", text, SUBJECT, "jump", sizes)
    cause = (
        "their base station restarted with other coordinates"
        if len(error.receivers) > 1
        else "its base station restarted with other coordinates, or its antenna was moved"
    )
    first, last = (time - outcome.coverage.start for time in error.window)
    unsure = (
        f" It may have begun from second {first:.1f} to {last:.1f}, as nothing tells it nearer: "
        "there are no poses in between."
        if last - first > UNSURE_START
        else ""
    )
    text = (
        f"A jump: {who}{doubt} {'are' if len(error.receivers) > 1 else 'is'} off {what} from "
        f"second {begin:.1f} on: {cause}. The jump was taken out of what "
        "follows, and its uncertainty is in the covariance of these poses. Compare the base "
        f"station's coordinates before and after.{unsure}"
    )
    return Finding("warning", text, SUBJECT, "jump", sizes)


def _or_who(outcome: WithJumps, error: LastingError, other: tuple[int, ...]) -> str:
    """Who else it may have been: all the others would have jumped the other way."""
    others = set(range(len(outcome.steps.receivers))) - set(error.receivers)
    return f", or {who_jumps(outcome, other)}{' the other way' if set(other) == others else ''}"


def clock_findings(outcome: RtkOutcome) -> Iterator[Finding]:
    """Clocks of receivers that are off."""
    if outcome.clocks is None:
        return
    names = outcome.steps.receivers
    for k in np.flatnonzero(outcome.clocks.late):
        late, sigma = outcome.clocks.late[k], outcome.clocks.sigmas[k]
        text = (
            f"The stamps of {names[k]} are {abs(late):.3f} s {'late' if late > 0 else 'early'} by "
            f"those of {names[0]} (95 %: \u00b1 {NORMAL_95 * sigma:.3f} s): its positions were "
            "taken at the other times, between its fixes. Which of the two clocks is right the "
            "receivers cannot say; set both by the satellites' time."
        )
        size = (Size.normal("lateness of the stamps", late, sigma, "s"),)
        yield Finding("warning", text, str(names[k]), "receiver_clock", size)


def slow_findings(outcome: RtkOutcome) -> Iterator[Finding]:
    """That errors are correlated, and what is known of those that all receivers share."""
    model, found = outcome.model, outcome.consistency
    if model is not None:
        text = (
            f"The receivers' errors are correlated: beside white noise of {1000 * model.white:.1f} "
            f"mm each has slow errors of {1000 * model.slow_sigma:.1f} mm that last some "
            f"{model.lasting:.0f} s (horizontally). All intervals allow for it; averages over "
            "neighbours gain nothing in that time."
        )
        sizes = (
            Size("slow errors of a receiver", model.slow_sigma, "m"),
            Size("their duration", model.lasting, "s"),
        )
        yield Finding("note", text, SUBJECT, "correlated", sizes)
    elif found.correlation_time > LEAST_TAU:
        text = (
            f"Neighbouring poses have similar errors: {found.correlation_time:.1f} poses are worth "
            "one independent one. Averages over neighbours gain less than their number says."
        )
        tau = Size("poses worth one", float(found.correlation_time), "poses")
        yield Finding("note", text, SUBJECT, "correlated", (tau,))
    yield from _common(outcome)


def _common(outcome: RtkOutcome) -> Iterator[Finding]:
    common = outcome.common
    own = f"the distances of the antennas show {1000 * outcome.noise.sigma:.1f} mm"
    bases = sorted({one.base for one in outcome.settings.receivers} - {""})
    if common.source == "none" and bases:
        text = (
            f"Other receivers are told from {', '.join(bases)}, a moving base that states no "
            "errors: its own noise is in all positions alike, no distance shows it, and it is not "
            "in the poses. Let it write GST (or sigmas), or state `common_sigma` and `common_time` "
            "in [rtk]; 0.01 m is usual for fixed ambiguities."
        )
        yield Finding("warning", text, SUBJECT, "base_noise_open")
    elif common.source == "none":
        text = (
            "Errors that all receivers share, of the base station and of the air above, cannot be "
            "told from motion: they are not included. Where their size is known, state "
            "`common_sigma` and `common_time` in [rtk]."
        )
        yield Finding("note", text, SUBJECT, "common_errors_open")
    else:
        lasts = outcome.settings.common_time
        who = {"setting": "campaign.toml states", "base": "the moving base states"}.get(
            common.source,
            f"The receivers state {1000 * common.stated:.1f} mm of themselves, {own}; the rest is "
            "taken as",
        )  # fmt: skip
        duration = f", for {lasts:g} s" if lasts else ", for an unknown time"
        text = (
            f"{who} an error of {1000 * common.sigma:.1f} mm that all receivers share{duration}: "
            "it is in the covariance of the positions, and no average over neighbours lessens it."
        )
        size = (Size("error that all share", common.sigma, "m"),)
        yield Finding("note", text[0].upper() + text[1:], SUBJECT, "common_errors", size)
    if common.source != "base" and common.stated * CLEARLY < outcome.noise.sigma:
        text = (
            f"The receivers state {1000 * common.stated:.1f} mm of themselves, but {own}: what "
            "they state is too small. The larger one was used."
        )
        size = (Size("found over stated", outcome.noise.sigma / common.stated),)
        yield Finding("warning", text, SUBJECT, "stated_too_small", size)


def jump_rows(outcome: WithJumps) -> list[list[object]]:
    """A row for each error that lasts, for the table of results."""
    return [
        [
            who_jumps(outcome, one.receivers), one.start, "" if one.stays else one.end, *one.size,
            *np.sqrt(np.diagonal(one.covariance)), one.gain,
        ]
        for one in outcome.lasting if _told(one)
    ]  # fmt: skip
