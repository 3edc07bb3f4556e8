"""Small campaigns and pose tables, made in code."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

import data_samples
import validation.run
import validation.systems
from validation.campaign import Campaign
from validation.poses import PoseTable, from_csv
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


def three_stops(system: str, shift: float = 0.0, **changes) -> PoseTable:
    poses = np.array([[0.0, 0.0, 0.1], [1.0, 0.5, 1.6], [2.0, 1.5, -3.1]])
    covariances = np.tile(np.diag([0.01**2, 0.01**2, 0.005**2]), (3, 1, 1))
    settings = {"ids": ("1", "2", "3"), "poses": poses + shift, "covariances": covariances}
    return PoseTable(system, **(settings | changes))


@pytest.fixture
def with_systems(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Puts systems in the place of the installed ones."""

    def replace(*systems: FixedSystem) -> None:
        for module in (validation.run, validation.systems):
            monkeypatch.setattr(module, "installed_systems", lambda: list(systems))

    return replace


@pytest.fixture
def campaign_folder(tmp_path: Path) -> Path:
    folder = tmp_path / "campaign"
    folder.mkdir()
    (folder / "campaign.toml").write_text(MINIMAL_TOML)
    return folder


@pytest.fixture(scope="session")
def ad23_poses() -> dict[str, PoseTable]:
    """The pose tables printed in AD2.3."""
    files = {
        "survey": "survey/published_poses.csv",
        "vision": "vision/published_poses.csv",
        "laser_genetic": "laser/published_genetic.csv",
        "laser_scanmatch": "laser/published_scanmatch.csv",
    }
    return {system: from_csv(AD23 / file, system=system) for system, file in files.items()}
