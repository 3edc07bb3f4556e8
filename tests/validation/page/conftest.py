"""Small campaigns behind a served page, and a browser."""

import pytest
from page_rooms import written
from page_server import PageServer
from web_browser import open_browser


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """The page of a small campaign; whatever a module's tests do, it neither ends nor stumbles."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "room").mkdir()
    with PageServer(written(folder / "room"), folder / "log") as server:
        yield server
        server.check_sound()


@pytest.fixture(scope="module")
def ann(served):
    """A device that was let in."""
    with served.join("ann") as client:
        yield client


@pytest.fixture(scope="session")
def browser():
    """A browser; skipped where there is none."""
    with open_browser() as opened:
        yield opened
