import pytest
from entry_rooms import EntryRoom, entry_room
from entry_server import EntryServer


@pytest.fixture
def room(tmp_path) -> EntryRoom:
    return entry_room(folder=tmp_path / "room")


@pytest.fixture
def entry_session(room):
    opened = room.open()
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """The page of a new campaign; whatever a module's tests do, it neither ends nor stumbles."""
    folder = tmp_path_factory.mktemp("served")
    with EntryServer(entry_room(5, 1, folder / "room"), folder / "log") as server:
        yield server
        server.check_sound()


@pytest.fixture(scope="module")
def ann(served):
    """A device that was let in."""
    with served.join("ann") as client:
        yield client
