"""What a person should read of one receiver's record, in sentences."""

from collections.abc import Iterator

import numpy as np

from rtk_gt.campaign.digits import coarse_positions, too_coarse
from rtk_gt.campaign.findings import BACKWARDS, record_findings
from rtk_gt.campaign.lasting_findings import lasting_findings, unseen_findings
from rtk_gt.positions.outcome import PositionsOutcome
from validation.results import Finding, Severity, Size
from validation.trajectories.clock.tables import Tolerance, clock_findings

SUBJECT = "rtk"
LATE = 0.5
"""Seconds beyond which a computer's clock is said to be wrong, not the way of its messages long: a
judgement; serial lines and queues delay by some tenths."""


def positions_findings(outcome: PositionsOutcome) -> list[Finding]:
    """All findings, in reading order."""
    looked_for = outcome.record.fixed.any() and not too_coarse(outcome.records)
    return [
        *_coverage(outcome),
        *_heading(outcome),
        *lasting_findings(outcome),
        *(unseen_findings(outcome) if looked_for else ()),
        *_errors(outcome),
        *_clock(outcome),
        *_odometry(outcome),
        *record_findings(outcome.record),
        *coarse_positions(outcome.records),
    ]


def _coverage(outcome: PositionsOutcome) -> Iterator[Finding]:
    found, record, share = outcome.coverage, outcome.record, outcome.fixed_share
    count = int(record.fixed.sum())
    false = count - int(outcome.fixed.sum())
    without = f", {false} of them left out as false or beside a jump" if false else ""
    text = (
        f"{count} of {record.epochs} epochs are RTK-fixed ({100 * share:.1f} %{without}). Between "
        "the first and the last position there is ground truth for "
        f"{100 * found.share_of_time:.0f} % of the "
        f"time and {100 * found.share_of_length:.0f} % of the {found.length:.0f} m. "
    )
    if count == 0:
        said = ", ".join(f"{one.kind}: {one.epochs}" for one in outcome.kinds)
        text += (
            f"The receiver never resolved its ambiguities ({said}), so that nothing of this record "
            "is ground truth. Look at the link to the base station, the distance to it, and the "
            "number of common satellites."
        )
    elif found.gaps and found.gaps[0].duration > found.max_gap:
        gap = found.gaps[0]
        text += (
            f"The longest gap lasts {gap.duration:.1f} s ({gap.length:.0f} m), from second "
            f"{gap.start - found.start:.1f} on; nothing is interpolated across it."
        )
    size = (Size("share of the epochs that are RTK-fixed", share),)
    # A judgement, as for a path: less than half of a record may not stand for the whole of it.
    yield Finding("note" if share > 0.5 else "warning", text, SUBJECT, "positions_fixed", size)


def _heading(outcome: PositionsOutcome) -> Iterator[Finding]:
    """What two receivers say of the heading."""
    if outcome.without_heading:
        text = f"Two receivers, but no heading: {outcome.without_heading}."
        yield Finding("warning", text, SUBJECT, "heading_open")
        return
    found = outcome.headings
    if found is None:
        return
    sigma = float(np.sqrt(np.median(found.covariances[:, 3, 3])))
    text = (
        f"{len(found.times)} poses with a heading, good to {np.degrees(sigma):.2f} degrees "
        f"(median); the antennas are {found.offsets.distances[0]:.3f} m apart. Pitch and roll need "
        "a third receiver."
    )
    if found.left:
        text += (
            " Half a turn fits as well; the heading along which the vehicle drives was taken, "
            "which is wrong if it drove in reverse all the way."
        )
    yield Finding("note", text, SUBJECT, "heading", (Size("sigma of the heading", sigma, "rad"),))
    if found.off_motion is not None and abs(found.off_motion) > BACKWARDS:
        text = (
            f"The heading points {np.degrees(abs(found.off_motion)):.0f} degrees off the direction "
            "of motion. Either the vehicle drove so all the way, or the two receivers are "
            "exchanged, or their positions on the vehicle are stated otherwise than they are."
        )
        size = (Size("angle of the nose to the motion", abs(found.off_motion), "rad"),)
        yield Finding("error", text, SUBJECT, "nose_against_motion", size)


def _errors(outcome: PositionsOutcome) -> Iterator[Finding]:
    """What the receiver states of its errors; it is not checked by this record."""
    (best, *_) = outcome.kinds
    if best.horizontal is None:
        text = (
            "The receiver states no errors (no GST, no sigmas): its positions have no covariance. "
            "Let it write GST, or state sigmas in the table."
        )
        yield Finding("warning", text, SUBJECT, "errors_not_stated")
        return
    text = (
        f"Of {best.kind} positions the receiver states {1000 * best.horizontal[0]:.0f} mm along "
        "the longer axis of the ellipse"
    )
    if best.vertical is not None:
        text += f" and {1000 * best.vertical[0]:.0f} mm in height"
    text += (
        " (medians). One receiver cannot check that: errors of the base station, false fixes and "
        "reflected signals last for minutes and are not in it; only where they begin with a jump "
        "does the motion show them."
    )
    size = (Size(f"stated sigma of {best.kind}", best.horizontal[0], "m"),)
    yield Finding("note", text, SUBJECT, "errors_stated", size)
    yield from _scatter(outcome)


def _scatter(outcome: PositionsOutcome) -> Iterator[Finding]:
    """That a receiver that stands scatters by more than it states."""
    found = outcome.scatter
    if found is None or found.factors.max() == 1:
        return
    worst = int(found.factors.argmax())
    text = (
        f"Where it stands, the receiver scatters by {1000 * found.seen[0]:.1f} mm in a level "
        f"coordinate and {1000 * found.seen[1]:.1f} mm up ({found.fixes} fixes), but states "
        f"{1000 * found.stated[0]:.1f} and {1000 * found.stated[1]:.1f} mm: that is too small. The "
        "larger ones are in the covariances of all RTK-fixed positions."
    )
    size = (Size("found over stated", float(found.factors[worst])),)
    yield Finding("warning", text, SUBJECT, "stated_too_small", size)


def _odometry(outcome: PositionsOutcome) -> Iterator[Finding]:
    """Odometry laid over the positions, and its clock."""
    if outcome.without_overlay:
        text = f"Odometry is not laid over the positions: {outcome.without_overlay}."
        yield Finding("warning", text, "odometry", "odometry_not_laid")
        return
    found = outcome.overlay
    if found is None:
        return
    own, other = found.lengths
    text = (
        f"Odometry laid over {found.matched} RTK-fixed positions differs from them by "
        f"{found.rms:.2f} m (rms) and calls {own:.0f} m {other:.0f} m. Its drift, and where the "
        "antenna is on the robot, are in that."
    )
    yield Finding(
        "note", text, "odometry", "odometry_overlay", (Size("rms distance", found.rms, "m"),)
    )
    yield from clock_findings(found.clock, Tolerance(0.05, 0.05))


def _clock(outcome: PositionsOutcome) -> Iterator[Finding]:
    """The clock of the computer that wrote the log."""
    clock = outcome.clock
    if clock is None:
        return
    side = "ahead of" if clock.ahead > 0 else "behind"
    text = (
        f"The computer's clock is {abs(clock.ahead):.3f} s {side} the satellites' time in the "
        "middle of the log"
    )
    if not np.isnan(clock.drift):
        text += f" and gains {1e6 * clock.drift:.0f} ± {1e6 * clock.drift_sigma:.0f} us a second"
    text += (
        f" ({clock.stamps} stamps, scatter {1000 * clock.jitter:.0f} ms). The positions have the "
        "satellites' time; whatever else this computer stamped needs "
        f"{-clock.ahead:+.3f} s to be compared with them. The way of the messages is in it."
    )
    size = (Size.normal("computer's clock ahead of UTC", clock.ahead, clock.ahead_sigma, "s"),)
    severity: Severity = "warning" if abs(clock.ahead) > LATE else "note"
    yield Finding(severity, text, SUBJECT, "host_clock", size)
