"""A small vision campaign, rendered once for all tests of a run."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from data_samples.rendering.files import make_room_with_cameras, vision_texts, write_images
from data_samples.rooms.cameras import VisionSettings
from data_samples.rooms.campaign_files import write_campaign
from data_samples.rooms.rooms import RoomSettings
from data_samples.rooms.simulate import SimulationSettings, simulate_survey
from validation.campaign.folder import load_campaign
from validation.solving import solve_validation
from validation.systems import installed_systems
from vision_gt.campaign.solve import solve_campaign

SMALL = VisionSettings(
    cameras=2, calibration=5, snapshots=5, both=2, movie=10, blades=0.1, occlusions=0.1
)


@pytest.fixture(scope="session")
def rendered(tmp_path_factory) -> Path:
    """The folder of a campaign of two cameras and six stops, not to be written to."""
    folder = tmp_path_factory.mktemp("vision") / "campaign"
    rng = np.random.default_rng(11)
    # A small area in the middle of the room, so that two cameras see all of it.
    room_settings = RoomSettings(stops=6, runs=1, clearance=2.3, world_points=8)
    room, cameras = make_room_with_cameras(room_settings, SMALL, rng)
    simulated = simulate_survey(room, SimulationSettings(), rng)
    write_campaign(folder, simulated, 11, vision_texts(cameras, rng))
    write_images(folder, cameras, rng, 1)
    return folder


@pytest.fixture(scope="session")
def outcome(rendered):
    """What the vision system makes of it, after the survey."""
    loaded = solve_validation(load_campaign(rendered), installed_systems())
    return solve_campaign(loaded, workers=1)


@pytest.fixture
def campaign(rendered, outcome, tmp_path) -> Path:
    """A copy that a test may spoil; what its images show is kept, as by an earlier run."""
    assert outcome.stops
    folder = tmp_path / "campaign"
    shutil.copytree(rendered, folder)
    return folder
