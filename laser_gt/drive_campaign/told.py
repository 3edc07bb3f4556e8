"""What a person should read about a drive: findings, facts, sections."""

from collections.abc import Iterator, Sequence
from types import ModuleType

import numpy as np

from laser_gt.driving.log import DriveOutcome
from laser_gt.driving.mount_check import contradicts
from laser_gt.placing.mounts import mount_hint
from laser_gt.placing.survey_check import doubt_sizes, doubt_text, off_text
from laser_gt.scans.planar import compose, inverse
from validation.results import Figure, Finding, Section, Size, Table, Text

SYSTEM = "laser_drive"
FEW_PLACED = 0.95
"""Share of the scans below which a warning says that they were not placed. A judgement: in rooms
with walls all are; one in twenty is what people in front of the scanner hide."""
MISFIT = 2.0
"""Mean square of the links' residuals over its expectation, from which on it is told: the stated
covariances are then widened by it. A judgement: 1.4 in standard deviations."""


def drive_findings(outcome: DriveOutcome) -> Iterator[Finding]:
    """Findings in the order in which they should be read."""
    if outcome.doubt is not None:
        text = doubt_text(outcome.doubt, "to the drive")
        left = [stop for stop in outcome.doubt.stops if stop not in outcome.anchors]
        if left:
            many = "were" if len(left) > 1 else "was"
            text += f". Until then {' and '.join(left)} {many} left out"
        else:
            text += ". The drive is bent by it"
        sizes = doubt_sizes(outcome.doubt)
        yield Finding(outcome.doubt.severity, text, SYSTEM, "survey_contradicts", sizes)
    yield from _mount(outcome)
    placed = int(outcome.matched.sum())
    share = placed / outcome.scans
    text = f"{placed} of {outcome.scans} scans are placed by what they saw ({share:.1%})"
    if share < FEW_PLACED:
        text += (
            ". The others are carried on by odometry, or left out where they have hardly any "
            "return; their covariances say how far they can be trusted"
        )
    size = (Size("share of scans placed", share),)
    yield Finding("good" if share >= FEW_PLACED else "warning", text, SYSTEM, "drive_placed", size)
    if outcome.loops == 0:
        text = (
            "no place was passed twice, so nothing holds the drift of the trajectory but the "
            "surveyed stops"
        )
        yield Finding("note", text, SYSTEM, "drive_no_loops")
    if outcome.switched_off:
        text = (
            f"{outcome.switched_off} of {outcome.links + outcome.switched_off} matches contradict "
            "the others and are switched off"
        )
        size = (Size("matches switched off", outcome.switched_off, "matches"),)
        yield Finding("note", text, SYSTEM, "drive_switched_off", size)
    if outcome.slips:
        first = ", ".join(f"{time + outcome.trajectory.epoch:.1f}" for time in outcome.slips[:5])
        more = f" and {len(outcome.slips) - 5} more" if len(outcome.slips) > 5 else ""
        text = (
            f"the odometry slipped, or the robot was pushed: at {first}{more} (seconds) it is far "
            "from what the scans say, and is not used there"
        )
        size = (Size("steps that slipped", len(outcome.slips), "steps"),)
        yield Finding("note", text, SYSTEM, "drive_slips", size)
    if outcome.misfit > MISFIT:
        text = (
            f"the matches contradict each other {np.sqrt(outcome.misfit):.1f} times more than "
            "their noise allows: a wrong time of the beams, floors that are not flat, or things "
            "that move. The covariances are widened by that"
        )
        size = (Size("misfit over the stated one", float(np.sqrt(outcome.misfit))),)
        yield Finding("warning", text, SYSTEM, "drive_misfit", size)
    yield from _clock(outcome)
    if not outcome.anchors:
        text = (
            "no surveyed stop holds the drive: its frame is that of its first pose, whose "
            "covariance is none by definition (1 um, 1 urad). Say when the "
            "robot stood at surveyed stops, in a file with the columns pose, from, to "
            "([laser_drive] stops)"
        )
        yield Finding("note", text, SYSTEM, "drive_frame")
    else:
        text = (
            f"{len(outcome.anchors)} surveyed stops hold the drive. Errors at these say nothing "
            "about a bias; name some of them ([laser_drive] reference) and judge it by the others"
        )
        size = (Size("surveyed stops", len(outcome.anchors), "stops"),)
        yield Finding("note", text, SYSTEM, "drive_anchors", size)
    if outcome.corrected < outcome.scans:
        missing = outcome.scans - outcome.corrected
        text = f"{missing} scans are not corrected for the motion of the robot: it is not known"
        size = (Size("scans not corrected", missing, "scans"),)
        yield Finding("note", text, SYSTEM, "drive_motion_unknown", size)


def _mount(outcome: DriveOutcome) -> Iterator[Finding]:
    """A stated mount that matches and odometry contradict."""
    check = outcome.mount_check
    if check is None or not contradicts(check):
        return
    values = off_text(check.difference, check.sigmas)
    numbers = zip(("x", "y", "theta"), check.difference.tolist(), ("m", "m", "rad"), strict=True)
    sizes = tuple(Size(f"off in {name}", size, unit) for name, size, unit in numbers)
    if check.of_point:
        point = compose(check.stated, inverse(check.found.mount))
        text = (
            "the odometry is not of the robot frame: it is of a point that lies at "
            f"{off_text(point, check.sigmas)} in it. The surveyed stops say that the stated laser "
            "mount is right, so the odometry is moved by that"
        )
        yield Finding("warning", text, SYSTEM, "drive_odometry_point", sizes)
        return
    hint = mount_hint(check.stated, check.found.mount)
    text = (
        f"the stated laser mount does not fit the odometry: stated less found {values}. {hint}"
        "The drive goes on with the one found. Measure the mount anew; if it is right, the "
        "odometry is not that of the robot frame"
    )
    yield Finding("error", text, SYSTEM, "drive_mount", sizes)


def _clock(outcome: DriveOutcome) -> Iterator[Finding]:
    """The delay of the scanner against the odometry."""
    clock = outcome.clock
    if clock is None:
        return
    if clock.verdict != "determined":
        text = (
            f"how late the scanner's stamps are against the odometry's cannot be told: "
            f"{clock.reason}. They are taken as {outcome.delay_s * 1e3:+.0f} ms off, by their turns"
        )
        size = (Size("delay", outcome.delay_s, "s"),)
        yield Finding("warning", text, SYSTEM, "drive_clock", size)
        return
    half = (clock.high_s - clock.low_s) / 2
    text = (
        f"the scanner's stamps need {outcome.delay_s * 1e3:+.1f} ms to be the odometry's "
        f"(+- {half * 1e3:.1f} ms); the trajectory is on the clock of the odometry"
    )
    size = (Size("delay", outcome.delay_s, "s", outcome.delay_s - half, outcome.delay_s + half),)
    yield Finding("note", text, SYSTEM, "drive_clock", size)


def drive_facts(outcome: DriveOutcome) -> dict[str, object]:
    """Numbers for ``--json`` and results/run.json."""
    times = outcome.trajectory.times
    clock = outcome.clock
    length, angle = outcome.odometry_noise
    return {
        "scans": outcome.scans,
        "poses": len(times),
        "placed": int(outcome.matched.sum()),
        "corrected": outcome.corrected,
        "seconds": float(times[-1] - times[0]),
        "keyframes": len(outcome.keyframes),
        "links": outcome.links,
        "loops": outcome.loops,
        "switched_off": outcome.switched_off,
        "slips": list(outcome.slips),
        "misfit": outcome.misfit,
        "anchors": list(outcome.anchors),
        "mount": outcome.mount.tolist(),
        "mount_contradicted": contradicts(outcome.mount_check),
        "odometry_of_other_point": outcome.mount_check is not None and outcome.mount_check.of_point,
        "odometry_noise": {"length_m": length, "angle_rad": angle},
        "delay_s": None if clock is None else outcome.delay_s,
        "clock": None if clock is None else clock.verdict,
    }


def drive_table(outcome: DriveOutcome) -> Table:
    """The drive in one table."""
    sigmas = np.sqrt(np.diagonal(outcome.trajectory.covariances, axis1=1, axis2=2))
    length = np.hypot(sigmas[:, 0], sigmas[:, 1]) / np.sqrt(2)
    way = float(np.hypot(*np.diff(outcome.trajectory.positions, axis=0).T).sum())
    rows: list[list[str | int | float | None]] = [
        ["poses", len(outcome.trajectory), ""],
        ["way", round(way, 1), "m"],
        ["keyframes", len(outcome.keyframes), ""],
        ["matches between keyframes", outcome.links, ""],
        ["of them loops", outcome.loops, ""],
        ["switched off", outcome.switched_off, ""],
        ["median standard deviation of position", round(float(np.median(length)) * 1e3, 2), "mm"],
        ["largest", round(float(length.max()) * 1e3, 2), "mm"],
        ["median standard deviation of heading",
         round(float(np.median(sigmas[:, 2])) * 1e3, 2), "mrad"],
    ]  # fmt: skip
    if outcome.clock is not None and outcome.clock.verdict == "determined":
        rows.append(["delay of the scanner", round(outcome.delay_s * 1e3, 2), "ms"])
    return Table("Drive by the laser scanner", ["", "value", "unit"], rows)


def drive_section(outcome: DriveOutcome, more: Sequence[Table]) -> Section:
    """Map, uncertainty along the way, numbers."""
    return Section(
        "Laser GT: drive",
        [
            Text(
                "Every scan is matched to the submap of the scans before it, loops are found by "
                "place and judged both ways, a robust graph with the surveyed stops places the "
                "keyframes, and every scan is placed in their map. Not to be used as ground truth "
                "for methods that use the same laser."
            ),
            drive_table(outcome),
            Figure(
                "laser_drive_map",
                "What the scanner saw, each scan at its pose, and the way of the robot.",
                "Map drawn by the scans. Walls that are double or thick are a drive gone wrong.",
                lambda: _figures().drive_map(outcome),
            ),
            Figure(
                "laser_drive_sigmas",
                "Standard deviations along the way.",
                "Curves of the standard deviation of position and heading over time.",
                lambda: _figures().drive_sigmas(outcome),
            ),
            *more,
        ],
    )


def _figures() -> ModuleType:
    """The drawing module, loaded when something is drawn."""
    from laser_gt.drive_campaign import figures  # noqa: PLC0415  (matplotlib is slow to load)

    return figures
