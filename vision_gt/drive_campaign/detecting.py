"""Markers in all frames of a camera, kept from run to run."""

import itertools
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from validation.pieces.work import taken_over
from vision_gt.drive_campaign.frames import CameraFrames
from vision_gt.images.jobs import Found, MarkerJob, detect_in
from vision_gt.images.kept import KeptDetections, detect_new, image_key, settings_key
from vision_gt.images.pictures import video_frames

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
    if frames.video is not None:
        found = _in_video(frames, job, kept)
        return list(_counted(found, len(frames), progress))
    jobs = [_for(job, path) for path in frames.paths]
    return detect_new(jobs, kept, workers, progress)


def _for(job: MarkerJob, path: Path) -> MarkerJob:
    return MarkerJob(path, job.family, job.wanted, job.camera, job.fitted)


def _in_video(frames: CameraFrames, job: MarkerJob, kept: KeptDetections) -> Iterator[Found]:
    """What the frames of a video show."""
    assert frames.video is not None
    settings = settings_key(job)
    for number, (name, image) in enumerate(video_frames(frames.video, ALL)):
        key = image_key(image.tobytes(), settings, number)
        own = _for(job, frames.video.with_name(name))
        known = taken_over(key, own, kept, kept)
        kept.count(taken=known is not None, done=known is None)
        if known is None:
            known = detect_in(image, own)
            told = kept.written(known, own)
            if told is not None:
                kept.add(key, told)
        yield known


def _counted(
    found: Iterable[Found], total: int, progress: Callable[[float], None]
) -> Iterator[Found]:
    for number, one in enumerate(itertools.islice(found, total + 1), 1):
        progress(min(number / max(total, 1), 1.0))
        yield one
