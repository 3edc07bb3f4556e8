import pytest
from entry_rooms import EntryRoom, entry_room


@pytest.fixture
def room(tmp_path) -> EntryRoom:
    return entry_room(folder=tmp_path / "room")


@pytest.fixture
def entry_session(room):
    opened = room.open()
    yield opened
    opened.close()
