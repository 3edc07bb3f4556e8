"""pytest fixtures: samples whose truth is known, for testing a system of one's own.

A test may choose options, those of the function in `gtval.testing`::

    @pytest.mark.parametrize("gtval_room", [{"stops": 6, "laser": True}], indirect=True)
    def test_my_system(gtval_room): ...

The seed is 1, or that of ``pytest --gtval-seed``. pytest loads this module at every start, so the
samples are imported when one is asked for.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from gtval.testing import (
        SampleDrive,
        SampleFixes,
        SampleImages,
        SampleMotion,
        SampleRoom,
        SampleScans,
        SampleSurvey,
    )


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option --gtval-seed."""
    group = parser.getgroup("gtval")
    group.addoption("--gtval-seed", type=int, default=1, help="Seed of gtval's samples.")


def _options(request: pytest.FixtureRequest) -> dict[str, Any]:
    """The seed, and what the test chose."""
    return {"seed": request.config.getoption("--gtval-seed"), **getattr(request, "param", {})}


@pytest.fixture
def gtval_room(request: pytest.FixtureRequest, tmp_path: Path) -> "SampleRoom":
    """Campaign folder of a synthetic room with its survey; the truth beside it."""
    from gtval.testing import make_room

    return make_room(tmp_path / "gtval_room", **_options(request))


@pytest.fixture(scope="session")
def gtval_survey(request: pytest.FixtureRequest) -> "SampleSurvey":
    """Readings of a hand-laser survey in arrays; true poses and world points beside them."""
    from gtval.testing import make_survey

    return make_survey(**_options(request))


@pytest.fixture(scope="session")
def gtval_scans(request: pytest.FixtureRequest) -> "SampleScans":
    """Laser scans at neighbouring stops of a room; true poses and guesses beside them."""
    from gtval.testing import make_scans

    return make_scans(**_options(request))


@pytest.fixture(scope="session")
def gtval_images(request: pytest.FixtureRequest) -> "SampleImages":
    """Images of a robot with markers; the true place of each marker beside them."""
    from gtval.testing import make_images

    return make_images(**_options(request))


@pytest.fixture
def gtval_drive(request: pytest.FixtureRequest, tmp_path: Path) -> "SampleDrive":
    """Campaign folder of a drive with three RTK-GPS receivers; the true path beside it."""
    from gtval.testing import make_drive

    return make_drive(tmp_path / "gtval_drive", **_options(request))


@pytest.fixture(scope="session")
def gtval_fixes(request: pytest.FixtureRequest) -> "SampleFixes":
    """Records of three RTK-GPS receivers in arrays; the true path beside them."""
    from gtval.testing import make_fixes

    return make_fixes(**_options(request))


@pytest.fixture(scope="session")
def gtval_motion(request: pytest.FixtureRequest) -> "SampleMotion":
    """Trajectories of a driving robot on several clocks; the true path and clocks beside them."""
    from gtval.testing import make_motion

    return make_motion(**_options(request))
