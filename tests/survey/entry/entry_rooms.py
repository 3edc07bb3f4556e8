"""Simulated campaigns to enter readings in, and their true readings."""

import re
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from data_samples.rooms.campaign_files import campaign_files
from data_samples.rooms.rooms import RoomSettings, make_room
from data_samples.rooms.simulate import SimulationSettings, simulate_survey
from survey.entry.dialogue.entry_session import EntrySession
from survey.entry.record.entries import Entry
from survey.entry.room.targets import Target
from validation.campaign.folder import load_campaign
from validation.page.people import Person

ANN, BOB = Person("ann"), Person("bob")
Pair = frozenset[str]


@dataclass(frozen=True)
class EntryRoom:
    """A campaign folder without readings, and what the instrument would show."""

    folder: Path
    shown: Mapping[Pair, str]

    def open(self) -> EntrySession:
        return EntrySession.open(load_campaign(self.folder))

    def recorded(self) -> list[Entry]:
        """The readings in the journal, in their order."""
        entries = EntrySession.look(load_campaign(self.folder)).journal.entries
        return [entry for entry in entries if entry.kind == "reading"]

    @property
    def journal(self) -> Path:
        return self.folder / "survey" / "journal.jsonl"

    @property
    def readings(self) -> Path:
        return self.folder / "survey" / "readings.csv"


@cache
def _made(seed: int, stops: int) -> tuple[Mapping[str, str], Mapping[Pair, str]]:
    """Files of a campaign, and the reading of every pair."""
    rng = np.random.default_rng([20080806, seed])
    room = make_room(RoomSettings(stops=stops), rng)
    made = simulate_survey(room, SimulationSettings(), rng)
    files = campaign_files(made, seed)
    names = ", ".join(f'"{name}"' for name in room.stop_names)
    files["campaign.toml"] = re.sub(
        r"^\[survey\]$",
        f"[survey]\nentry.poses = [{names}]",
        files["campaign.toml"],
        flags=re.MULTILINE,
    )
    pairs = zip(made.readings.start, made.readings.end, made.shown, strict=True)
    shown = {frozenset((a, b)): f"{metres:.3f}" for a, b, metres in pairs}
    del files["survey/readings.csv"]
    return files, shown


def entry_room(seed: int = 1, stops: int = 1, folder: Path | None = None) -> EntryRoom:
    """A room of its own; in ``folder``, which is made, where one is given."""
    files, shown = _made(seed, stops)
    folder = folder or Path(mkdtemp())
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    (folder / "survey").mkdir(exist_ok=True)
    return EntryRoom(folder, shown)


def copy_of(room: EntryRoom, folder: Path) -> EntryRoom:
    """The same room with all that was entered in it, in another folder."""
    shutil.copytree(room.folder, folder)
    return EntryRoom(folder, room.shown)


def enter_all(entry_session: EntrySession, room: EntryRoom, most: int = 10**6) -> int:
    """Enter what the instrument shows, target by target; how many readings."""
    count = 0
    while count < most and (target := entry_session.guide.next_target(ANN)) is not None:
        shown = room.shown.get(target.pair)
        if shown is None:
            entry_session.skip(target, "not seen", ANN)
            continue
        entry_session.record(
            target, shown, ANN, again=bool(entry_session.state.counting(target.pair))
        )
        count += 1
    return count


def until(entry_session: EntrySession, room: EntryRoom, where: str) -> Target:
    """Enter readings until a target is next."""
    wanted = entry_session.guide.target(where)
    while (target := entry_session.guide.next_target(ANN)) != wanted:
        assert target is not None
        assert not entry_session.state.counting(target.pair)
        entry_session.record(target, room.shown[target.pair], ANN)
    return wanted
