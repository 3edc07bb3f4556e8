"""Small pose tables and systems, made in code."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import data_samples
from validation.campaign.folder import Campaign
from validation.poses.pose_table import PoseTable
from validation.results import SystemResult
from validation.systems import Progress

AD23 = Path(data_samples.__file__).parent / "ad23"

MINIMAL_TOML = 'name = "three stops"\n'


@dataclass
class FixedSystem:
    """A system that always gives the same result."""

    name: str
    result: SystemResult = field(default_factory=SystemResult)
    fails_with: Exception | None = None

    def has_data(self, campaign: Campaign) -> bool:
        return campaign.toml.exists()

    def solve(self, campaign: Campaign, progress: Progress) -> SystemResult:
        progress(f"{self.name} in {campaign.folder.name}", 0.5)
        if self.fails_with:
            raise self.fails_with
        return self.result


def three_stops(system: str, shift: float | np.ndarray = 0.0, **changes) -> PoseTable:
    poses = np.array([[0.0, 0.0, 0.1], [1.0, 0.5, 1.6], [2.0, 1.5, -3.1]])
    covariances = np.tile(np.diag([0.01**2, 0.01**2, 0.005**2]), (3, 1, 1))
    settings = {"ids": ("1", "2", "3"), "poses": poses + shift, "covariances": covariances}
    return PoseTable(system, **(settings | changes))
