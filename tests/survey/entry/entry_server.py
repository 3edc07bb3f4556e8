"""`gtval enter --web` as a process."""

from pathlib import Path

from entry_rooms import EntryRoom
from web_server import WebServer


def reading(name: str, **values: object) -> dict[str, object]:
    """What a device sends for a reading, again and again of one pair."""
    return {"id": name, "from": "O", "to": "X", "text": "2.5", "again": True, **values}


class EntryServer(WebServer):
    """The served page of a room."""

    def __init__(self, room: EntryRoom, log: Path, *options: str, prepare=None) -> None:
        self.room = room
        super().__init__(
            log, ["enter", str(room.folder), "--web", "--port", "0", *options], prepare
        )
