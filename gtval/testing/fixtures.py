"""pytest fixtures: samples whose truth is known, for testing a system of one's own.

A test may choose options, those of the function in `gtval.testing` of the same name::

    @pytest.mark.parametrize("gtval_room", [{"stops": 6, "laser": True}], indirect=True)
    def test_my_system(gtval_room): ...

The seed is 1, or that of ``pytest --gtval-seed``.
"""

from pathlib import Path
from typing import Any

import pytest

from gtval import testing


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option --gtval-seed."""
    group = parser.getgroup("gtval")
    group.addoption("--gtval-seed", type=int, default=1, help="Seed of gtval's samples.")


def _options(request: pytest.FixtureRequest) -> dict[str, Any]:
    """What the test chose, with the seed."""
    seed = request.config.getoption("--gtval-seed")
    return {"seed": seed, **getattr(request, "param", {})}


@pytest.fixture
def gtval_room(request: pytest.FixtureRequest, tmp_path: Path) -> testing.SampleRoom:
    """Campaign folder of a synthetic room with its survey; the truth beside it."""
    return testing.make_room(tmp_path / "gtval_room", **_options(request))


@pytest.fixture(scope="session")
def gtval_survey(request: pytest.FixtureRequest) -> testing.SampleSurvey:
    """Readings of a hand-laser survey in arrays; true poses and world points beside them."""
    return testing.make_survey(**_options(request))


@pytest.fixture(scope="session")
def gtval_scans(request: pytest.FixtureRequest) -> testing.SampleScans:
    """Laser scans at neighbouring stops of a room; true poses and guesses beside them."""
    return testing.make_scans(**_options(request))


@pytest.fixture(scope="session")
def gtval_images(request: pytest.FixtureRequest) -> testing.SampleImages:
    """Images of a robot with markers; the true place of each marker beside them."""
    return testing.make_images(**_options(request))


@pytest.fixture
def gtval_drive(request: pytest.FixtureRequest, tmp_path: Path) -> testing.SampleDrive:
    """Campaign folder of a drive with three RTK-GPS receivers; the true path beside it."""
    return testing.make_drive(tmp_path / "gtval_drive", **_options(request))
