"""What a person should read of errors that last, one line a cause."""

from collections.abc import Iterator

import numpy as np

from rtk_gt.campaign.outcome import RtkOutcome
from rtk_gt.offsets.lasting import SHORT, LastingError
from validation.results import Finding, Size

SUBJECT = "rtk"
MOST = 8
"""Lines of single errors; more are counted in one line."""
NORMAL_95 = 1.96


def short_errors(outcome: RtkOutcome) -> int:
    """Epochs with errors of so few epochs that they are single false fixes."""
    return sum(one.epochs for one in outcome.lasting if not _told(one))


def lasting_findings(outcome: RtkOutcome) -> Iterator[Finding]:
    """False fixes that last, and jumps of one receiver, several or all."""
    told = [one for one in outcome.lasting if _told(one)]
    for one in sorted(told, key=lambda error: -error.length)[:MOST]:
        yield _finding(outcome, one)
    if len(told) > MOST:
        text = (
            f"{len(told) - MOST} more errors that last, all smaller, are in "
            "results/rtk_jumps.csv: this drive is no ground truth to centimetres. Look at the "
            "base station and at what hides the sky."
        )
        size = (Size("more errors that last", len(told) - MOST, "errors"),)
        yield Finding("warning", text, SUBJECT, "many_jumps", size)


def _told(error: LastingError) -> bool:
    return error.stays or error.epochs >= SHORT


def who_jumps(outcome: RtkOutcome, receivers: tuple[int, ...]) -> str:
    """The receivers of a jump in words."""
    names = outcome.steps.receivers
    if len(receivers) == len(names):
        return "all receivers"
    return " and ".join(names[k] for k in receivers)


def _finding(outcome: RtkOutcome, error: LastingError) -> Finding:
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
    doubt = "".join(f", or {who_jumps(outcome, other)} the other way" for other in error.alike[:1])
    if not error.stays:
        text = (
            f"A false fix that lasts: {who}{doubt} is off {what} from second {begin:.1f} to "
            f"{error.end - outcome.coverage.start:.1f}. These fixes were left out; there are no "
            "poses. Their kind says RTK fixed: watch for reflections and few satellites there."
        )
        return Finding("warning", text, SUBJECT, "lasting_false_fix", sizes)
    cause = (
        "its base station restarted with other coordinates"
        if len(error.receivers) > 1
        else "its base station restarted with other coordinates, or its antenna was moved"
    )
    text = (
        f"{who[0].upper()}{who[1:]} {'jump' if len(error.receivers) > 1 else 'jumps'}{doubt} "
        f"{what} at second {begin:.1f} and stay so: {cause}. The jump was taken out of what "
        "follows, and its uncertainty is in the covariance of these poses. Compare the base "
        "station's coordinates before and after."
    )
    return Finding("warning", text, SUBJECT, "jump", sizes)


def jump_rows(outcome: RtkOutcome) -> list[list[object]]:
    """A row for each error that lasts, for the table of results."""
    return [
        [
            who_jumps(outcome, one.receivers), one.start, "" if one.stays else one.end, *one.size,
            *np.sqrt(np.diagonal(one.covariance)), one.gain,
        ]
        for one in outcome.lasting if _told(one)
    ]  # fmt: skip
