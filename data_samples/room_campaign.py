"""A synthetic room as a campaign folder: survey, scans and images of one room together."""

from collections.abc import Callable
from itertools import islice
from pathlib import Path

import numpy as np

from data_samples.rendering.campaign import render_all
from data_samples.rendering.drive import DriveSettings, FilmedDrive, film
from data_samples.rendering.files import make_room_with_cameras, vision_texts, write_images
from data_samples.rendering.planned import planned_cameras
from data_samples.rooms.cameras import VisionSettings
from data_samples.rooms.campaign_files import write_campaign
from data_samples.rooms.checks import check_files
from data_samples.rooms.laser_campaign import LaserSimulation, laser_files
from data_samples.rooms.rooms import RoomSettings, make_room
from data_samples.rooms.simulate import SimulatedCampaign, SimulationSettings, simulate_survey
from validation.text_files.writing import write_files

_TOGETHER = 100
"""Frames that are rendered before they are written: some 60 MB."""


def write_room(
    folder: Path,
    seed: int,
    room_settings: RoomSettings,
    settings: SimulationSettings,
    laser: LaserSimulation | None = None,
    vision: VisionSettings | None = None,
    drive: DriveSettings | None = None,
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> SimulatedCampaign:
    """A synthetic room with its survey, written as a campaign with its truth in truth/.

    A room with scans or images has what is measured beside a survey, too: known lengths, the
    distance of two walls, a known motion.

    Parameters
    ----------
    folder : Path
        Made if missing. Files of an earlier simulation are replaced.
    seed : int
        Of all that is drawn.
    room_settings, settings : RoomSettings, SimulationSettings
        The room, and the survey with what goes wrong.
    laser : LaserSimulation, optional
        Scanners on the robot; none by default.
    vision : VisionSettings, optional
        Cameras, boards and markers, whose images are rendered; none by default.
    drive : DriveSettings, optional
        A drive that the cameras film; none by default.
    workers : int
        Processes for rendering.
    progress : callable, optional
        Told the share of the images that is done.

    Raises
    ------
    GtvalError
        If the room is too small for what should be in it, or the folder cannot be written.
    """
    rng = np.random.default_rng(seed)
    if vision is None:
        room, cameras = make_room(room_settings, rng), None
    else:
        room, cameras = make_room_with_cameras(room_settings, vision, rng)
    simulated = simulate_survey(room, settings, rng)
    more = {} if laser is None else dict(laser_files(room, laser, rng))
    if cameras is not None:
        for name, text in vision_texts(cameras, rng).items():
            more[name] = more.get(name, "") + text
        more["campaign.toml"] += planned_cameras(cameras, room.stops)
    filmed = None
    if cameras is not None and drive is not None:
        filmed = film(cameras, drive, np.random.default_rng([seed, 2]))
        for name, text in filmed.files.items():
            more[name] = more.get(name, "") + text
    if laser is not None or vision is not None:
        for name, text in check_files(simulated, np.random.default_rng([seed, 1])).items():
            more[name] = more.get(name, "") + text
    write_campaign(folder, simulated, seed, more)
    if cameras is not None:
        write_images(folder, cameras, rng, workers, progress)
    if filmed is not None:
        _write_frames(folder, filmed, seed, workers, progress)
    return simulated


def _write_frames(
    folder: Path,
    filmed: FilmedDrive,
    seed: int,
    workers: int,
    progress: Callable[[float], None] | None,
) -> None:
    """The frames of a drive, some at a time: those of minutes do not fit in memory."""
    frames = render_all(filmed.photographs, seed, workers, progress)
    while some := dict(islice(frames, _TOGETHER)):
        write_files(folder, some)
