"""A campaign's drive: from the frames of its cameras to one trajectory."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from validation.campaign.folder import Campaign
from validation.errors import InputError, Problem
from validation.pieces.store import FOLDER
from validation.poses.angles import Array
from validation.poses.trajectory import Clock, Trajectory
from validation.systems import Progress, no_progress
from validation.trajectories.formats import read_trajectory
from vision_gt.campaign.outcome import VisionOutcome
from vision_gt.drive_campaign.detecting import ALL, frames_seen
from vision_gt.drive_campaign.exchanged import Exchange, Views, exchanges
from vision_gt.drive_campaign.frames import CameraFrames, drive_frames, each_once
from vision_gt.driving.drive import DriveOutcome, solve_drive
from vision_gt.driving.set_back import SetBack, set_back
from vision_gt.driving.stream import Stream, camera_stream
from vision_gt.images.jobs import MarkerJob
from vision_gt.images.kept import KeptDetections
from vision_gt.images.pictures import video_frames
from vision_gt.patterns.dictionaries import Family
from vision_gt.robot.robot_pose import Floor
from vision_gt.settings import VisionSettings
from vision_gt.stages.decided import decided_about
from vision_gt.stages.inputs import DRIVE, sides_of

Report = Callable[[float], None]
MOST_TOLD = 5
"""Frames that are named where they cannot be read; the others are counted."""


@dataclass(frozen=True)
class CampaignDrive:
    """A drive, with what its frames were.

    Parameters
    ----------
    outcome : DriveOutcome
        Streams, clocks, trajectory.
    odometry : Trajectory or None
        As its file has it.
    unread : mapping of str to int
        Frames of a camera that could not be read.
    strangers : tuple of str
        Cameras with frames that the network does not have.
    repeated : mapping of str to int
        Frames of a camera that are copies of earlier ones, and count once.
    exchanged : tuple of Exchange
        Cameras that have the frames of each other.
    set_back : mapping of str to SetBack
        Clocks that were set back, by camera.
    """

    outcome: DriveOutcome
    odometry: Trajectory | None
    unread: Mapping[str, int]
    strangers: tuple[str, ...]
    repeated: Mapping[str, int] = field(default_factory=dict)
    exchanged: tuple[Exchange, ...] = ()
    set_back: Mapping[str, SetBack] = field(default_factory=dict)


def check_frames(campaign: Campaign) -> None:
    """Look at the names and times of the frames, before anything is worked out.

    Raises
    ------
    InputError
        If a name is no time, or the odometry is bad.
    """
    settings = campaign.section("vision", VisionSettings)
    if _frames(campaign, settings):
        _odometry(campaign, settings.drive.odometry)


def _frames(campaign: Campaign, settings: VisionSettings) -> list[CameraFrames]:
    """All frames but those left out."""
    left_out = decided_about(campaign, settings).paths(campaign.folder)
    return drive_frames(campaign.folder / settings.images / DRIVE, settings.drive.unit, left_out)


def solve_campaign_drive(
    campaign: Campaign,
    vision: VisionOutcome,
    progress: Progress = no_progress,
    workers: int | None = None,
) -> CampaignDrive | None:
    """The drive of a campaign; None where there is none.

    Parameters
    ----------
    campaign : Campaign
        With frames below its [vision] folder.
    vision : VisionOutcome
        Cameras and markers, from the same campaign.
    progress : callable
        Told what is being done.
    workers : int, optional
        Processes; by default one for each processor.

    Raises
    ------
    InputError
        If names are no times, no frame of a camera can be read, or the odometry is bad.
    """
    settings = vision.settings.drive
    every = _frames(campaign, vision.settings)
    names = [camera.name for camera in vision.network.network.cameras]
    frames = [each_once(one) for one in every if one.camera in names]
    if not every:
        return None
    odometry = _odometry(campaign, settings.odometry)
    unread: dict[str, int] = {}
    streams: list[Stream] = []
    seen: dict[str, Views] = {}
    total, done = sum(map(len, frames)), 0
    for one in frames:
        start, share = done / total, len(one) / total

        def report(part: float, start: float = start, share: float = share) -> None:
            progress("looking for the robot", 0.9 * (start + share * part))

        seen[one.camera] = _seen(campaign, vision, one, unread, workers, report)
        streams.append(_stream(vision, one.camera, one.times, seen[one.camera], one.epoch))
        done += len(one)
    progress("clocks and trajectory", 0.9)
    outcome = solve_drive(streams, odometry, window=settings.window, one_clock=settings.one_clock)
    strangers = tuple(one.camera for one in every if one.camera not in names)
    repeated = {one.camera: one.repeated for one in frames}

    def pose(camera: str, views: Views) -> Stream:
        return _stream(vision, camera, np.arange(float(len(views))), views)

    exchanged = exchanges(streams, seen, pose)
    back = _set_back(outcome, settings.window)
    return CampaignDrive(outcome, odometry, unread, strangers, repeated, exchanged, back)


def _set_back(outcome: DriveOutcome, window: float) -> dict[str, SetBack]:
    """Clocks of cameras that were set back."""
    if outcome.trajectory is None:
        return {}
    found = {
        one.camera: set_back(one, outcome.clocks[one.camera], outcome.trajectory, window)
        for one in outcome.streams
        if one.camera in outcome.clocks and one.camera not in outcome.left_out
    }
    return {name: back for name, back in found.items() if back is not None}


def _seen(
    campaign: Campaign,
    vision: VisionOutcome,
    frames: CameraFrames,
    unread: dict[str, int],
    workers: int | None,
    report: Report,
) -> Views:
    """The markers of each frame of a camera."""
    settings, network = vision.settings, vision.network.network
    camera = network.cameras[network.index(frames.camera)]
    markers = settings.markers
    family = Family(markers.family, markers.border)
    job = MarkerJob(campaign.folder, family, tuple(sides_of(settings)), camera)
    path = campaign.folder / FOLDER / f"vision_drive_{frames.camera}.jsonl"
    kept = KeptDetections(path, whole=False)
    found = frames_seen(frames, job, kept, workers, report)
    if len(found) != len(frames):
        raise InputError([other_count(frames)])
    bad = [one for one in found if one.fault]
    if len(bad) == len(found):
        raise InputError([Problem(one.path, one.fault) for one in bad[:MOST_TOLD]])
    unread[frames.camera] = len(bad)
    return [one.markers.views for one in found]


def _stream(
    vision: VisionOutcome, camera: str, times: Array, seen: Views, epoch: int = 0
) -> Stream:
    """Poses from the frames of a camera."""
    settings = vision.settings
    return camera_stream(
        camera,
        times,
        seen,
        vision.network.network,
        vision.layout.layout,
        Floor(settings.floor.height, settings.floor.tilt),
        epoch=epoch,
        clock=Clock(settings.drive.stamps),
        on_floor=settings.drive.on_floor,
    )


def other_count(frames: CameraFrames) -> Problem:
    """A video with another number of frames than of times."""
    assert frames.video is not None  # images are as many as their names
    count = sum(1 for _ in video_frames(frames.video, ALL))
    said = (
        f"{len(frames)} times, but {frames.video.name} has {count} frames; write a row for each "
        "frame, as which of them have none is not known"
    )
    return Problem(frames.video.with_suffix(".csv"), said)


def _odometry(campaign: Campaign, name: str) -> Trajectory | None:
    """The odometry, with headings."""
    if not name:
        return None
    path = campaign.folder / name
    found = read_trajectory(path, system="odometry").planar()
    if not found.has_orientation:
        raise InputError([Problem(path, "odometry needs headings; these are positions only")])
    return found
