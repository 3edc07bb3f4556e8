"""Rooms with cameras and stops, rendered and solved: what is then spoilt by people's mistakes."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from data_samples.rendering.files import make_room_with_cameras, vision_texts, write_images
from data_samples.rooms.cameras import VisionSettings, VisionTruth
from data_samples.rooms.campaign_files import write_campaign
from data_samples.rooms.rooms import RoomSettings
from data_samples.rooms.simulate import SimulationSettings, simulate_survey
from validation.campaign.folder import load_campaign
from validation.poses.angles import wrap
from validation.solving import solve_validation
from validation.systems import installed_systems
from vision_gt.campaign.outcome import VisionOutcome
from vision_gt.campaign.solve import solve_campaign
from vision_gt.causes.evidence import Seen
from vision_gt.optics.transforms import planar_pose

CAMERAS = VisionSettings(
    cameras=2, calibration=8, snapshots=8, both=2, movie=10, blades=0.1, occlusions=0.1
)
ROOM = RoomSettings(stops=8, runs=1, clearance=2.3, world_points=8)


@dataclass(frozen=True)
class Room:
    """A campaign on disk, its truth, and what a good one is solved to."""

    folder: Path
    truth: VisionTruth
    good: VisionOutcome

    @property
    def seen(self) -> Seen:
        """All that was seen in the good one."""
        assert self.good.diagnosis is not None
        return self.good.diagnosis.seen

    def stops_of(self, camera: str) -> list[str]:
        """Stops at which a camera read a marker."""
        seen = self.seen.stops
        return [s for s, found in seen.items() if any(o.camera == camera for o in found)]

    def stops_with(self, marker: int) -> list[str]:
        """Stops at which a marker was read."""
        views = {s: [v for o in found for v in o.views] for s, found in self.seen.stops.items()}
        return [s for s, own in views.items() if any(v.number == marker for v in own)]


def solve(folder: Path, workers: int) -> VisionOutcome:
    """What the program makes of a campaign."""
    return solve_campaign(
        solve_validation(load_campaign(folder), installed_systems()), workers=workers
    )


def made(folder: Path, seed: int, cameras: int, workers: int) -> Room:
    """A good campaign, rendered and solved."""
    rng = np.random.default_rng(seed)
    room, truth = make_room_with_cameras(ROOM, replace(CAMERAS, cameras=cameras), rng)
    survey = simulate_survey(room, SimulationSettings(), rng)
    write_campaign(folder, survey, seed, vision_texts(truth, rng))
    write_images(folder, truth, rng, workers)
    edit(folder, "as_published = true", "as_published = false")
    return Room(folder, truth, solve(folder, workers))


def score(room: Room) -> tuple[float, float]:
    """Rms of a good campaign's positions, metres, and mean squared error over its covariance."""
    offs, squares = [], []
    for stop in room.good.stops:
        if stop.chosen is not None:
            pose, covariance = stop.chosen.planar
            off = pose - planar_pose(room.truth.T_gtv_robot[int(stop.pose) - 1])
            off[2] = wrap(off[2])
            offs.append(off)
            squares.append(off @ np.linalg.solve(covariance, off))
    return float(np.sqrt(np.square(np.array(offs)[:, :2]).sum(1).mean())), float(np.mean(squares))


def edit(folder: Path, pattern: str, by: str | Callable[[re.Match[str]], str]) -> None:
    """Other words in campaign.toml."""
    toml = folder / "campaign.toml"
    text, times = re.subn(pattern, by, toml.read_text())
    assert times, pattern
    toml.write_text(text)
