"""Cameras that are not synchronised, brought to one clock and fused into one trajectory."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.poses.trajectory import Trajectory
from validation.results import Finding
from validation.shown import Shown
from validation.trajectories.clock.estimate import sync
from validation.trajectories.clock.result import ClockEstimate
from validation.trajectories.smoothing.fusion import fuse
from validation.trajectories.smoothing.source import Fused, Source
from vision_gt.driving.stream import Mask, Stream

SYSTEM = "vision_drive"
SPURIOUS = 0.5
"""Probability of being right below which a frame is spurious: more likely wrong than right."""
REACH_S = 0.5
"""Seconds within which the frames of a camera share in a fused pose: the memory of a trajectory
that is seen ten times a second by some millimetres and driven at 0.5 m/s. A judgement."""
FARTHEST = 300.0
"""Of these times, beyond which it does not matter by how much a frame is too far."""


@dataclass(frozen=True, repr=False)
class DriveOutcome(Shown):
    """A drive as the cameras saw it.

    Parameters
    ----------
    streams : tuple of Stream
        One a camera, spurious frames named.
    clocks : mapping of str to ClockEstimate
        By camera, against the odometry; without it against the camera with most poses.
    assumed : tuple of str
        Without odometry: cameras whose delay is not told, and whose stamps are taken as those of
        that camera's clock.
    left_out : mapping of str to str
        Cameras that are not in the fused trajectory, and why.
    trajectory : Trajectory, optional
        Fused, on the clock of the odometry (of the cameras where there is none), with all of its
        covariance; None where no camera saw enough.
    supported : (n,) array of bool
        Whether frames stand on both sides of a pose.
    findings : tuple of Finding
        Of the fusion.
    """

    streams: tuple[Stream, ...]
    clocks: Mapping[str, ClockEstimate] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    left_out: Mapping[str, str] = field(default_factory=dict)
    trajectory: Trajectory | None = None
    supported: Mask = field(default_factory=lambda: np.zeros(0, dtype=bool))
    findings: tuple[Finding, ...] = ()


def solve_drive(
    streams: Sequence[Stream],
    odometry: Trajectory | None = None,
    *,
    window: float = 5.0,
    progress: Callable[[str, float], None] = lambda _what, _share: None,
) -> DriveOutcome:
    """One trajectory from the streams of all cameras.

    Parameters
    ----------
    streams : sequence of Stream
        Each on a clock of its own.
    odometry : Trajectory, optional
        In a frame of its own; its stamps are the common time. Without it those of the camera with
        most poses are; what others see together with it tells their delay, and where it does not,
        their stamps are taken as those of one clock.
    window : float
        Seconds to both sides in which the delay of a camera is looked for.
    progress : callable
        Told what is being done.

    Notes
    -----
    Frames are fused by the noise that each has of its own. What cameras, lenses and markers are off
    by does not get less by many frames; it is added afterwards, as the frames near a pose have it.
    """
    seen = {s.camera: t for s in streams if (t := s.trajectory(whole=False)) is not None}
    left_out = {s.camera: "too few poses" for s in streams if s.camera not in seen}
    clocks: Mapping[str, ClockEstimate] = {}
    if seen:
        most = max(seen, key=lambda name: len(seen[name]))
        judged_by = seen[most] if odometry is None else odometry
        others = {name: one for name, one in seen.items() if one is not judged_by}
        told = sync(judged_by, list(others.values()), window=window, progress=progress)
        clocks = {name: told[trajectory.system] for name, trajectory in others.items()}
    known = {name: clock for name, clock in clocks.items() if clock.verdict == "determined"}
    assumed = tuple(name for name in clocks if name not in known) if odometry is None else ()
    if odometry is not None:
        left_out |= {name: _why(clock) for name, clock in clocks.items() if name not in known}
    used = [name for name in seen if name not in left_out]
    if not used:
        return DriveOutcome(tuple(streams), clocks, assumed, left_out)
    progress("fusing the cameras", 0.8)
    sources = [_source(seen[name], known.get(name)) for name in used]
    fused = fuse(sources, odometry=odometry)
    by_camera = dict(zip(used, fused.weights, strict=True))
    judged = tuple(
        s.judged(by_camera[s.camera] < SPURIOUS) if s.camera in by_camera else s for s in streams
    )
    trusted = [one for one in judged if one.camera in by_camera]
    trajectory = _with_shared(fused, trusted, sources)
    return DriveOutcome(
        *(judged, clocks, assumed, left_out, trajectory, fused.supported, fused.findings)
    )


def _why(clock: ClockEstimate) -> str:
    """Why a camera without a delay is left out."""
    if clock.verdict == "ambiguous":
        return "several delays fit its poses equally well"
    return clock.reason or "its poses do not tell its delay"


def _source(trajectory: Trajectory, clock: ClockEstimate | None) -> Source:
    """A camera's poses with what is known of its clock."""
    if clock is None:
        return Source(trajectory)
    drift = (clock.drift_low_ppm, clock.drift_high_ppm)
    known = bool(np.isfinite(drift).all())
    return Source.late(
        trajectory,
        clock.delay_s,
        (clock.low_s, clock.high_s),
        clock.drift_ppm if known else 0.0,
        drift if known else None,
        clock.at_s + clock.epoch,
    )


def _with_shared(fused: Fused, streams: Sequence[Stream], sources: Sequence[Source]) -> Trajectory:
    """The fused trajectory with what the frames near each pose share.

    A pose weighs the cameras by the noise of their frames, and so it weighs the errors that frames
    share.
    """
    own = fused.trajectory
    common = np.zeros((len(own), 3, streams[0].common.shape[2]))
    whole = np.zeros((len(own), 3, 3))
    for stream, source in zip(streams, sources, strict=True):
        kept = np.flatnonzero(stream.kept)
        if not len(kept):
            continue
        since = stream.times[kept] - (source.at_s or 0.0)
        times = stream.times[kept] + (stream.epoch - own.epoch) + source.delay_s
        near, share = _near(own.times, times + 1e-6 * source.drift_ppm * since)
        information = np.linalg.inv(stream.own[kept])[near] * share[:, None, None]
        common += information @ stream.common[kept][near]
        whole += information
    by = np.linalg.solve(whole, common)
    shared = np.einsum("niu,nju->nij", by, by)
    return replace(own, system=SYSTEM, covariances=own.covariances + shared)


def _near(times: Array, frames: Array) -> tuple[npt.NDArray[np.intp], Array]:
    """The frame nearest to each time, and how much it counts: less the farther away it is."""
    right = np.clip(np.searchsorted(frames, times), 0, len(frames) - 1)
    left = np.maximum(right - 1, 0)
    nearer = np.abs(times - frames[left]) < np.abs(frames[right] - times)
    nearest = np.where(nearer, left, right).astype(np.intp)
    # Far from all frames the nearest counts alone; no weight may vanish.
    far = np.minimum(np.abs(times - frames[nearest]) / REACH_S, FARTHEST)
    return nearest, np.exp(-far)
