"""Cameras that are not synchronised, brought to one clock and fused into one trajectory."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from validation.pieces.results import kept_result
from validation.poses.trajectory import Trajectory
from validation.results import Finding
from validation.shown import Shown
from validation.trajectories.clock.estimate import sync
from validation.trajectories.clock.jumps import parted
from validation.trajectories.clock.result import ClockEstimate
from validation.trajectories.smoothing.clocked import clocked
from validation.trajectories.smoothing.fusion import fuse
from validation.trajectories.smoothing.source import Source
from vision_gt.driving.links import Clock, Links
from vision_gt.driving.stream import Mask, Stream

SYSTEM = "vision_drive"
SPURIOUS = 0.5
"""Probability of being right below which a frame is spurious: more likely wrong than right."""


@dataclass(frozen=True, repr=False)
class DriveOutcome(Shown):
    """A drive as the cameras saw it.

    Parameters
    ----------
    streams : tuple of Stream
        One a camera, spurious frames named.
    clocks : mapping of str to ClockEstimate
        By camera, against the odometry; without it against one of the cameras.
    assumed : tuple of str
        Cameras whose delay is not told, and whose stamps are taken as those of the others' clock,
        as was stated.
    left_out : mapping of str to str
        Cameras that are not in the fused trajectory, and why.
    trajectory : Trajectory, optional
        Fused, on the clock of the odometry (of the cameras where there is none), with all of its
        covariance; None where no camera saw enough.
    supported : (n,) array of bool
        Whether frames stand on both sides of a pose.
    findings : tuple of Finding
        Of the fusion.
    without_odometry : str
        Why the odometry has no part in the trajectory: why it tells no camera's delay. Empty where
        it has a part, or there is none.
    reference : str
        The camera whose clock that of the trajectory is; empty where it is that of the odometry.
    """

    streams: tuple[Stream, ...]
    clocks: Mapping[str, ClockEstimate] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    left_out: Mapping[str, str] = field(default_factory=dict)
    trajectory: Trajectory | None = None
    supported: Mask = field(default_factory=lambda: np.zeros(0, dtype=bool))
    findings: tuple[Finding, ...] = ()
    without_odometry: str = ""
    reference: str = ""


@kept_result("progress")
def solve_drive(
    streams: Sequence[Stream],
    odometry: Trajectory | None = None,
    *,
    window: float = 5.0,
    one_clock: bool = False,
    progress: Callable[[str, float], None] = lambda _what, _share: None,
) -> DriveOutcome:
    """One trajectory from the streams of all cameras.

    Parameters
    ----------
    streams : sequence of Stream
        Each on a clock of its own.
    odometry : Trajectory, optional
        In a frame of its own; its stamps are the common time. Without it those of a camera are,
        see `Links.reference`.
    window : float
        Seconds to both sides in which the delay of a camera is looked for.
    one_clock : bool
        Stamps of cameras whose delay is not told are of the same clock as those of the others.
    progress : callable
        Told what is being done.

    Notes
    -----
    What the odometry does not tell, and all where there is none, is told by cameras that see the
    robot at the same time, from one to the next. Odometry that tells the delay of no camera at all
    (the robot drove straight at one speed) cannot be fused, as nothing says which of its samples
    are of the time of a frame: the trajectory is then that of the cameras. A camera whose delay is
    not told has no place in the trajectory: its poses contradict nothing, and are 'clock unknown'.

    Frames are fused by the noise that each has of its own. What cameras, lenses and markers are off
    by does not get less by many frames; how much each of these errors moves each fused pose follows
    from the equations of the fusion, and is added to the covariances.
    """
    seen = {s.camera: t for s in streams if (t := s.trajectory(whole=False)) is not None}
    left_out = {s.camera: "too few poses" for s in streams if s.camera not in seen}
    judged = {
        s.camera: s if s.camera in seen else s.judged(np.ones(s.posed.sum(), bool), "clock unknown")
        for s in streams
    }
    if not seen:
        return DriveOutcome(tuple(judged.values()), left_out=left_out)
    clocks, reference, without = _clocks(streams, seen, odometry, window, progress)
    odometry = None if without else odometry
    known = {name: clock for name, clock in clocks.items() if clock.verdict == "determined"}
    untold = [name for name in seen if name not in known and name != reference]
    assumed: tuple[str, ...] = ()
    if one_clock and (known or reference):
        assumed, untold = tuple(untold), []
        best = min(known.values(), key=lambda one: one.high_s - one.low_s, default=None)
        if odometry is not None and best is not None:
            known |= dict.fromkeys(assumed, best)
    left_out |= {name: _why(clocks[name]) for name in untold}
    for name in untold:
        judged[name] = judged[name].judged(np.ones(len(seen[name]), dtype=bool), "clock unknown")
    used = [name for name in seen if name not in left_out]
    if not used:
        return DriveOutcome(
            *(tuple(judged.values()), clocks, assumed, left_out), without_odometry=without
        )
    progress("fusing the cameras", 0.8)
    parts = [part for name in used for part in _pieces(judged[name], known.get(name))]
    sources = [_source(part, clock) for part, clock in parts]
    common = [part.common[part.posed] for part, _ in parts]
    fused = fuse(sources, odometry=odometry, common=common)
    good = [
        part.judged(weights < SPURIOUS)
        for (part, _), weights in zip(parts, fused.weights, strict=True)
    ]
    for name in used:
        verdicts = [verdict for one in good if one.camera == name for verdict in one.verdicts]
        judged[name] = replace(judged[name], verdicts=tuple(verdicts))
    assert fused.shared is not None  # as common errors are given
    covariances = fused.trajectory.covariances + fused.shared
    trajectory = replace(fused.trajectory, system=SYSTEM, covariances=covariances)
    return DriveOutcome(
        *(tuple(judged.values()), clocks, assumed, left_out),
        *(trajectory, fused.supported, fused.findings),
        without_odometry=without,
        reference=reference or "",
    )


def _clocks(
    streams: Sequence[Stream],
    seen: Mapping[str, Trajectory],
    odometry: Trajectory | None,
    window: float,
    progress: Callable[[str, float], None],
) -> tuple[dict[str, ClockEstimate], str | None, str]:
    """The clock of each camera; without odometry that camera whose clock it is; why without."""
    clocks: dict[str, ClockEstimate] = {}
    without, reference = "", None
    if odometry is not None:
        told = sync(odometry, list(seen.values()), window=window, progress=progress)
        clocks = {name: told[trajectory.system] for name, trajectory in seen.items()}
        without = "; ".join(dict.fromkeys(_why(one).partition(":")[0] for one in clocks.values()))
        told_of = {n: c for n, c in clocks.items() if c.verdict == "determined"}
        known = {n: Clock.of(c) for n, c in told_of.items() if not c.jumps}
        if told_of and (not known or len(told_of) == len(clocks)):
            return clocks, None, ""
    if odometry is not None and told_of:
        steady = [one for one in streams if one.camera in known or one.camera not in told_of]
        links, without = Links(steady, odometry.epoch, window), ""
    else:
        progress("clocks of the cameras", 0.5)
        links, clocks = Links(streams, next(iter(seen.values())).epoch, window), {}
        reference = links.reference()
        known = {reference: links.own((reference, 0))}
    for name, clock in links.estimates(known).items():
        if clock.verdict == "determined" or name not in clocks:
            clocks[name] = clock
    return clocks, reference, without


def _why(clock: ClockEstimate) -> str:
    """Why a camera without a delay is left out."""
    if clock.verdict == "ambiguous":
        return "several delays fit its poses equally well"
    return clock.reason or "its poses do not tell its delay"


def _pieces(
    stream: Stream, clock: ClockEstimate | None
) -> list[tuple[Stream, ClockEstimate | None]]:
    """The frames of a camera between the jumps of its clock, each part with its delay."""
    if clock is None or not clock.pieces:
        return [(stream, clock)]
    stamps = stream.times + (stream.epoch - clock.epoch)
    between = parted(stamps, [jump.stamp_s for jump in clock.jumps])
    return [(stream.part(rows), piece) for rows, piece in zip(between, clock.pieces, strict=True)]


def _source(stream: Stream, clock: ClockEstimate | None) -> Source:
    """A camera's poses with what is known of its clock."""
    trajectory = stream.trajectory(whole=False)
    assert trajectory is not None  # a stream without one has no clock
    return clocked(trajectory, clock)[0]
