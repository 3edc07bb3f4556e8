"""The published campaign, and folders and systems to run."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from small_campaigns import AD23, MINIMAL_TOML, FixedSystem

import validation.run
import validation.run_files
import validation.solving
import validation.systems
from validation.cli import main
from validation.poses.pose_table import PoseTable, from_csv


@pytest.fixture
def with_systems(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Puts systems in the place of the installed ones."""

    def replace(*systems: FixedSystem) -> None:
        for module in (
            validation.run,
            validation.run_files,
            validation.solving,
            validation.systems,
        ):
            monkeypatch.setattr(module, "installed_systems", lambda: list(systems))

    return replace


@pytest.fixture
def campaign_folder(tmp_path: Path) -> Path:
    folder = tmp_path / "campaign"
    folder.mkdir()
    (folder / "campaign.toml").write_text(MINIMAL_TOML)
    return folder


@pytest.fixture(scope="session")
def ad23_folder() -> Path:
    """The published campaign as it is installed: not to be written to."""
    return AD23


@pytest.fixture(scope="session")
def ad23_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """A copy of the published campaign after `gtval run`, and what that printed as JSON."""
    folder = tmp_path_factory.mktemp("published") / "ad23"
    shutil.copytree(AD23, folder)
    return folder, CliRunner().invoke(main, ["run", str(folder), "--json"])


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


@pytest.fixture(scope="session")
def room_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """A simulated room, whose surveyed poses have a joint covariance, after `gtval run --json`."""
    folder = tmp_path_factory.mktemp("simulated") / "room"
    made = CliRunner().invoke(main, ["simulate", str(folder), "--seed", "77", "--stops", "8"])
    assert made.exit_code == 0, made.output
    return folder, CliRunner().invoke(main, ["run", str(folder), "--json"])
