"""Markers in all frames of a camera, kept from run to run."""

import itertools
import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from validation.processes import in_processes
from vision_gt.drive_campaign.frames import CameraFrames
from vision_gt.drive_campaign.kept import KeptDetections, key_of, settings_key
from vision_gt.images.files import MAX_BYTES
from vision_gt.images.jobs import Found, MarkerJob, detect_in, detect_one
from vision_gt.images.pictures import video_frames

FEW = 12
"""Frames below which one process does it all: others take a second each to start."""
ALL = 10**9


def frames_seen(
    frames: CameraFrames,
    job: MarkerJob,
    kept: KeptDetections,
    workers: int | None = None,
    progress: Callable[[float], None] = lambda _share: None,
) -> list[Found]:
    """What each frame shows, in the order of time; what is kept is not looked at again.

    Parameters
    ----------
    frames : CameraFrames
        Of one camera.
    job : MarkerJob
        How to look; its path is not used.
    kept : KeptDetections
        What earlier runs found; what is new is added as it is found.
    workers : int, optional
        Processes; by default one for each processor. A video is read by one.
    progress : callable
        Told the share done.
    """
    settings = settings_key(job)
    if frames.video is not None:
        found = _in_video(frames, job, kept, settings)
        return list(_counted(found, len(frames), progress))
    keys = [key_of(_content(path), settings) for path in frames.paths]
    new = {key: path for key, path in zip(keys, frames.paths, strict=True) if key not in kept.found}
    jobs = [_for(job, path) for path in new.values()]
    count = (workers or os.cpu_count() or 1) if len(jobs) >= FEW else 1
    for key, one in zip(new, in_processes(detect_one, jobs, count, progress), strict=True):
        kept.add(key, one)
    return [kept.found[key] for key in keys]


def _for(job: MarkerJob, path: Path) -> MarkerJob:
    return MarkerJob(path, job.family, job.wanted, job.camera, job.fitted)


def _content(path: Path) -> bytes:
    """The bytes of a file; none where it cannot be read, which detection then says."""
    try:
        with path.open("rb") as stream:
            return stream.read(MAX_BYTES)
    except OSError:
        return b""


def _in_video(
    frames: CameraFrames, job: MarkerJob, kept: KeptDetections, settings: str
) -> Iterator[Found]:
    """What the frames of a video show."""
    assert frames.video is not None
    for number, (name, image) in enumerate(video_frames(frames.video, ALL)):
        key = key_of(image.tobytes(), settings, number)
        known = kept.found.get(key)
        if known is None:
            known = detect_in(image, _for(job, frames.video.with_name(name)))
            kept.add(key, known)
        yield known


def _counted(
    found: Iterable[Found], total: int, progress: Callable[[float], None]
) -> Iterator[Found]:
    for number, one in enumerate(itertools.islice(found, total + 1), 1):
        progress(min(number / max(total, 1), 1.0))
        yield one
