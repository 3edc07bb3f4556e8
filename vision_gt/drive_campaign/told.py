"""What a person should read about a drive that cameras saw: findings, facts, tables, files."""

from collections.abc import Iterator
from types import ModuleType

import numpy as np

from validation.results import Figure, Finding, Section, Severity, Size, Table, Text
from validation.text_files.csv_text import csv_text
from validation.trajectories.clock.tables import jump_findings
from validation.trajectories.correlation_telling import correlation_section
from validation.trajectories.formats import trajectory_text
from vision_gt.drive_campaign.exchanged import Exchange, many_off, off_the_floor
from vision_gt.drive_campaign.solve import CampaignDrive
from vision_gt.driving.drive import SYSTEM, DriveOutcome
from vision_gt.driving.set_back import SetBack
from vision_gt.driving.stream import FEWEST, Stream, Verdict

FEW_SUPPORTED = 0.95
"""Share of the trajectory with frames on both sides, below which it is a warning: cameras that are
hung for a drive see nearly all of it. A judgement."""
MANY_SPURIOUS = 0.1
"""Share of a camera's poses that the others contradict, from which on it is a warning."""
WHY_NOT: tuple[Verdict, ...] = (
    *("nothing seen", "no pose", "ambiguous", "off the floor", "spurious", "clock unknown"),
)
"""Verdicts of frames that are not in the trajectory."""
TEXT = (
    "Every frame of every camera gives a pose of its own, or a reason. Each camera has its own "
    "clock, which the motion tells against the odometry, or against cameras that see the robot at "
    "the same time; poses that those before and after contradict are spurious. The trajectory is "
    "what all cameras together say. Its covariance has "
    "the noise of the frames, which many frames make small, and what cameras, lenses and markers "
    "are off by, which they do not."
)


def drive_findings(drive: CampaignDrive) -> Iterator[Finding]:
    """Findings, the most important first."""
    for pair in drive.exchanged:
        yield _exchanged(pair)
    yield from _of_trajectory(drive)
    yield from _of_clocks(drive)
    named = {name for pair in drive.exchanged for name in pair.cameras}
    for one in drive.outcome.streams:
        yield from _of_camera(one, drive.unread.get(one.camera, 0), drive.set_back.get(one.camera))
        if many_off(one) and one.camera not in named:
            yield _off_the_floor(one)
        if drive.repeated.get(one.camera):
            yield _repeated(one.camera, drive.repeated[one.camera])
    for name in drive.strangers:
        text = f"The frames of camera {name} are not used: the network has no such camera."
        yield Finding("warning", text, f"vision_{name}", "unknown_camera")


def _of_trajectory(drive: CampaignDrive) -> Iterator[Finding]:
    """Whether there is one, of what, and without whom."""
    outcome = drive.outcome
    kept = sum(int(one.kept.sum()) for one in outcome.streams)
    if outcome.trajectory is None:
        why = "; ".join(f"camera {name}: {said}" for name, said in outcome.left_out.items())
        text = f"No trajectory of the drive: {why or 'no camera has frames'}."
        size = (Size("frames with a pose", kept, "frames"),)
        yield Finding("error", text, SYSTEM, "no_drive", size)
        return
    share = float(np.mean(outcome.supported))
    frames = sum(map(len, outcome.streams))
    text = (
        f"{kept} of {frames} frames give a pose of the robot; {100 * share:.0f} % of the "
        "trajectory has frames on both sides."
    )
    severity: Severity = "good" if share >= FEW_SUPPORTED else "warning"
    size = (Size("share of the trajectory with frames on both sides", share),)
    yield Finding(severity, text, SYSTEM, "drive_seen", size)
    if outcome.without_odometry:
        yield _without_odometry(outcome)
    yield from _left_out(drive)


def _of_clocks(drive: CampaignDrive) -> Iterator[Finding]:
    """Clocks that were stated, and those that jump."""
    outcome = drive.outcome
    if outcome.assumed:
        text = (
            f"What cameras {', '.join(outcome.assumed)} saw does not tell their delays: their "
            "stamps are taken as those of one clock with the others, as [vision.drive] one_clock "
            "states."
        )
        yield Finding("note", text, SYSTEM, "one_clock")
    for clock in outcome.clocks.values():
        yield from jump_findings(clock)
        if clock.jumps and outcome.reference and len(outcome.clocks) == 1:
            text = "Two cameras do not tell whose clock jumped: it may be that of the other one."
            size = (Size("jumps of the clock", len(clock.jumps)),)
            yield Finding("note", text, clock.source, "jump_of_either", size)


def _without_odometry(outcome: DriveOutcome) -> Finding:
    """A trajectory of the cameras alone, though there is odometry."""
    text = (
        f"The odometry is not used: it tells the delay of no camera ({outcome.without_odometry}). "
        "The trajectory is what the cameras alone tell; the place of the robot tells their delays "
        f"against each other. Its time is that of the stamps of camera {outcome.reference}; how "
        "late these are is not told, and all poses may be late or early together. Let the robot "
        "turn in view of a camera, and start or stop."
    )
    size = (Size("cameras whose delay the odometry tells", 0, "cameras"),)
    return Finding("warning", text, SYSTEM, "odometry_unused", size)


def _left_out(drive: CampaignDrive) -> Iterator[Finding]:
    """Cameras that are not in the trajectory, with the number of their poses."""
    outcome, stated = drive.outcome, drive.odometry is not None
    posed = {one.camera: int(one.posed.sum()) for one in outcome.streams}
    named = {name for pair in drive.exchanged for name in pair.cameras}
    for name, said in outcome.left_out.items():
        if name in named:
            continue
        text, count = f"Camera {name} is not in the trajectory: {said}.", posed.get(name, 0)
        if name not in outcome.clocks:
            text += f" {count} of its frames have one, and {FEWEST} are the fewest."
        elif count:
            text += (
                f" Its {count} poses are kept, on its own clock ('clock unknown'). State "
                f"[vision.drive] {'' if stated else 'odometry; or '}one_clock = true, if "
                "its stamps are of one clock with those of the others."
            )
        size = (Size("frames with a pose", count, "frames"),)
        yield Finding("warning", text, f"vision_{name}", "camera_left_out", size)


def _of_camera(stream: Stream, unread: int, back: SetBack | None) -> Iterator[Finding]:
    """What is odd about the frames of a camera."""
    subject = f"vision_{stream.camera}"
    spurious, posed = stream.count("spurious"), int(stream.posed.sum()) + stream.count("spurious")
    if back is not None:
        at = f"{back.stamp + back.epoch:.2f}"
        text = (
            f"Its clock was set back by {back.size:.2f} s, when its stamps were at {at}: "
            f"{back.poses} of {spurious} poses that the others contradict agree with them by "
            f"stamps {back.size:.2f} s apart. Stamps of {back.size:.2f} s come twice, and of one "
            "part the poses are lost. Add that to the times of all frames that were recorded later."
        )
        size = (Size("clock set back by", back.size, "s"),)
        yield Finding("warning", text, subject, "clock_set_back", size)
    elif posed and spurious > MANY_SPURIOUS * posed:
        text = (
            f"{spurious} of {posed} poses are contradicted by those before and after. Look for "
            "wrong markers, a camera that moved, or wrong times."
        )
        size = (Size("share of spurious poses", spurious / posed),)
        yield Finding("warning", text, subject, "many_spurious", size)
    if unread:
        text = f"{unread} of {len(stream)} frames could not be read, and are left out."
        yield Finding("warning", text, subject, "frames_unread", (Size("frames", unread),))


def _exchanged(pair: Exchange) -> Finding:
    """Two cameras that have each other's frames."""
    (one, other), (first, second), (good, better) = pair.cameras, pair.tried, pair.agree
    text = (
        f"The frames of cameras {one} and {other} are exchanged: of frames that have the robot off "
        f"the floor, {good} of {first} have it on the floor with the place and lens of camera "
        f"{other}, and {better} of {second} with those of camera {one}. Exchange the two folders, "
        "or videos, of the drive."
    )
    size = (Size("frames that agree with the other camera", good + better, "frames"),)
    return Finding("error", text, SYSTEM, "drive_exchanged", size)


def _off_the_floor(stream: Stream) -> Finding:
    """A camera that is not where the network has it."""
    off, posed = off_the_floor(stream)
    text = (
        f"{off} of {posed} poses have the robot off the floor. Look for a camera that moved since "
        "the network was calibrated, frames of another camera, or a [vision.floor] that is more "
        "even than the floor."
    )
    size = (Size("share of poses off the floor", off / posed),)
    return Finding("warning", text, f"vision_{stream.camera}", "many_off_the_floor", size)


def _repeated(camera: str, count: int) -> Finding:
    """Frames that were written more than once."""
    text = (
        f"{count} frames are copies of an earlier one, byte for byte, with a later time: each "
        "counts once, at the first of its times. See why the recorder writes frames twice; the "
        "times of the others may be late as well."
    )
    size = (Size("copies", count, "frames"),)
    return Finding("warning", text, f"vision_{camera}", "frames_repeated", size)


def drive_table(drive: CampaignDrive) -> Table:
    """A row for each camera."""
    rows: list[list[str | int | float | None]] = []
    for one in drive.outcome.streams:
        whole = one.own[one.posed] + one.shared[one.posed]
        sigmas = np.sqrt(np.diagonal(whole, axis1=1, axis2=2))
        clock = drive.outcome.clocks.get(one.camera)
        told = () if clock is None or clock.verdict != "determined" else clock.pieces or (clock,)
        delay = ", ".join(f"{1e3 * piece.delay_s:+.1f}" for piece in told)
        half = ", ".join(f"{500 * (piece.high_s - piece.low_s):.1f}" for piece in told)
        rows.append(
            [
                one.camera,
                len(one),
                int(one.kept.sum()),
                *(one.count(verdict) for verdict in WHY_NOT),
                round(float(np.median(sigmas[:, :2])) * 1e3, 1) if len(sigmas) else None,
                round(float(np.median(sigmas[:, 2])) * 1e3, 1) if len(sigmas) else None,
                delay or None,
                half or None,
            ]
        )
    heads = ["camera", "frames", "kept", *WHY_NOT]
    heads += ["position sd [mm]", "heading sd [mrad]", "delay [ms]", "+- [ms]"]
    outcome = drive.outcome
    note = "A delay is what is added to a camera's stamps: one that stamps late has a negative one."
    if outcome.reference:
        note += f" Against camera {outcome.reference}, whose own is not told."
    return Table("Cameras in the drive", heads, rows, note=note)


def parts_of_delays(drive: CampaignDrive) -> Table:
    """The delays of all cameras by parts of the drive."""
    fused = drive.outcome.trajectory
    begin = 0 if fused is None else fused.epoch
    reference = drive.outcome.reference
    against = f"Against camera {reference}" if reference else "Against the odometry"
    parts = [
        (name, clock.epoch - begin, part)
        for name, clock in drive.outcome.clocks.items()
        if clock.verdict == "determined"
        for piece in clock.pieces or (clock,)
        for part in piece.parts
    ]
    return Table.of_columns(
        "Delays by parts of the drive",
        [
            ("camera", "", [name for name, _, _ in parts]),
            ("from [s]", ".1f", [part.first_s + after for _, after, part in parts]),
            ("to [s]", ".1f", [part.last_s + after for _, after, part in parts]),
            ("delay [ms]", "+.1f", [1e3 * part.delay_s for _, _, part in parts]),
            ("low [ms]", "+.1f", [1e3 * part.low_s for _, _, part in parts]),
            ("high [ms]", "+.1f", [1e3 * part.high_s for _, _, part in parts]),
        ],
        note=f"{against}; seconds after {begin}, as in the figure below. What the "
        "odometry is off by lasts for seconds, and makes parts differ by some milliseconds more "
        "than their intervals say.",
    )


def drive_sections(drive: CampaignDrive) -> list[Section]:
    """Tables and figures, and the document's way of finding delays beside them."""
    blocks: list[Text | Table | Figure] = [Text(TEXT), drive_table(drive)]
    if any(clock.parts for clock in drive.outcome.clocks.values()):
        blocks.append(parts_of_delays(drive))
    if drive.outcome.trajectory is not None:
        blocks += [
            Figure(
                "vision_drive_map",
                "The fused way of the robot, and the frames of each camera.",
                "A map of the way, with dots where cameras saw the robot.",
                lambda: _figures().drive_map(drive.outcome),
            ),
            Figure(
                "vision_drive_time",
                "Which camera saw the robot when, spurious frames crossed, and the standard "
                "deviation of the fused position.",
                "Rows of dots by camera over time, and a curve below.",
                lambda: _figures().drive_time(drive.outcome),
            ),
        ]
    sections = [Section("Vision GT: drive", blocks)]
    moving = [t for one in drive.outcome.streams if (t := one.trajectory()) is not None]
    if drive.odometry is not None and moving:
        told = correlation_section(drive.odometry, moving)
        sections.append(Section(f"Vision GT: {told.title}", told.blocks))
    return sections


def _figures() -> ModuleType:
    """The drawing module, loaded when something is drawn."""
    from vision_gt.drive_campaign import figures  # noqa: PLC0415  (matplotlib is slow to load)

    return figures


def drive_files(drive: CampaignDrive) -> dict[str, str | bytes]:
    """Trajectories, and a row for every frame, by their names relative to results/."""
    outcome = drive.outcome
    files: dict[str, str | bytes] = {"vision_drive_frames.csv": _frames_csv(outcome.streams)}
    if outcome.trajectory is not None:
        files[f"trajectory_{SYSTEM}.csv"] = trajectory_text(outcome.trajectory)
    for one in outcome.streams:
        own = one.trajectory()
        if own is not None:
            files[f"trajectory_{own.system}.csv"] = trajectory_text(own)
    return files


def _frames_csv(streams: tuple[Stream, ...]) -> str:
    """Every frame with its verdict."""
    rows = []
    for one in streams:
        sigmas = np.sqrt(np.diagonal(one.own + one.shared, axis1=1, axis2=2))
        for row, verdict in enumerate(one.verdicts):
            numbers = " ".join(map(str, one.numbers[row]))
            time = float(one.times[row] + one.epoch)
            poses, spread = one.poses[row].tolist(), sigmas[row].tolist()
            rows.append([one.camera, time, verdict, numbers, *poses, *spread])
    heads = ["camera", "time", "verdict", "markers", "x", "y", "theta"]
    return csv_text([*heads, "sigma_x", "sigma_y", "sigma_theta"], rows)


def drive_facts(drive: CampaignDrive) -> dict[str, object]:
    """Numbers for ``--json`` and results/run.json."""
    outcome = drive.outcome
    return {
        "frames": {one.camera: len(one) for one in outcome.streams},
        "kept": {one.camera: int(one.kept.sum()) for one in outcome.streams},
        "repeated": dict(drive.repeated),
        "spurious": {one.camera: one.count("spurious") for one in outcome.streams},
        "clock_unknown": {one.camera: one.count("clock unknown") for one in outcome.streams},
        "left_out": dict(outcome.left_out),
        "supported": float(np.mean(outcome.supported)) if len(outcome.supported) else 0.0,
        "without_odometry": outcome.without_odometry,
        "reference_camera": outcome.reference,
        "delays": {
            name: None
            if clock.verdict != "determined"
            else {"delay_s": clock.delay_s, "low_s": clock.low_s, "high_s": clock.high_s}
            for name, clock in outcome.clocks.items()
        },
        "clock_jumps": {
            name: [
                {
                    "stamp_s": one.stamp_s + clock.epoch,
                    "between_s": [t + clock.epoch for t in (one.place.first_s, one.place.last_s)],
                    "size_s": one.size_s,
                }
                for one in clock.jumps
            ]
            for name, clock in outcome.clocks.items()
            if clock.jumps
        },
    }
