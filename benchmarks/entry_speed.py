"""Field entry: how long a reading takes to be acknowledged, and how soon one can begin.

A campaign of 5,000 readings is entered, in the room's order, as far as that; then the time from
a typed number to its acknowledgement is measured for the next ones, fsync and check included,
beside the bare peer that it must not lose to: a line appended to a CSV file with fsync. Starting
is measured as whole processes, in turn with Python and `gtval --help`.
"""

import os
import pty
import select
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np

from data_samples.campaign_files import campaign_files
from data_samples.rooms import RoomSettings, make_room
from data_samples.simulate import SimulationSettings, simulate_survey
from survey.entry.entries import Entry, Person
from survey.entry.entry_session import EntrySession
from survey.entry.journal import Journal
from validation.campaign import load_campaign
from validation.files import write_files

READINGS = 5000
TIMED = 300
STOPS = 120
ROUNDS = 9
GTVAL = str(Path(sys.executable).with_name("gtval"))
ANN = Person("ann")


def campaign(folder: Path) -> dict[frozenset[str], str]:
    """Write a campaign to enter; what the instrument shows for each pair."""
    rng = np.random.default_rng(20080806)
    room = make_room(RoomSettings(stops=STOPS, clearance=0.7), rng)
    made = simulate_survey(room, SimulationSettings(), rng)
    files = campaign_files(made)
    del files["survey/readings.csv"]
    stops = ", ".join(f'"{name}"' for name in room.stop_names)
    files["campaign.toml"] = files["campaign.toml"].replace(
        "\n[survey]\n", f"\n[survey]\nentry.poses = [{stops}]\n"
    )
    write_files(folder, files)
    pairs = zip(made.readings.start, made.readings.end, made.shown, strict=True)
    return {frozenset((a, b)): f"{metres:.3f}" for a, b, metres in pairs}


def fill(folder: Path, shown: dict[frozenset[str], str]) -> None:
    """A journal of so many readings, written without the checks."""
    plan = EntrySession.look(load_campaign(folder)).guide.plan
    targets = [t for station in plan for t in station.targets if t.pair in shown]
    journal = Journal.open(folder / "survey/journal.jsonl")
    for number, target in enumerate(targets[:READINGS]):
        text = shown[target.pair]
        journal.append(
            Entry(
                "reading",
                id=str(number),
                by="ann",
                start=target.start,
                end=target.end,
                text=text,
                metres=float(text),
            )
        )
    journal.close()


def acknowledged(folder: Path, shown: dict[frozenset[str], str]) -> list[float]:
    """Seconds from a number to its answer, one after the other."""
    entry_session = EntrySession.open(load_campaign(folder))
    taken = []
    while len(taken) < TIMED and (target := entry_session.guide.next_target(ANN)):
        if target.pair not in shown:
            entry_session.skip(target, "not seen", ANN)
            continue
        started = time.perf_counter()
        entry_session.record(target, shown[target.pair], ANN)
        entry_session.guide.next_target(ANN)
        taken.append(time.perf_counter() - started)
    entry_session.close()
    return taken


def bare_append(folder: Path) -> list[float]:
    """The same for a line appended to a CSV file, flushed to the disk."""
    taken = []
    with (folder / "bare.csv").open("ab") as stream:
        for number in range(TIMED):
            started = time.perf_counter()
            stream.write(b"2024-03-04T09:00,O,1,%d\n" % number)
            stream.flush()
            os.fsync(stream.fileno())
            taken.append(time.perf_counter() - started)
    return taken


def until_prompt(folder: Path) -> float:
    """Seconds from `gtval enter` to its first question."""
    started = time.perf_counter()
    child, master = pty.fork()
    if child == 0:
        os.execv(GTVAL, [GTVAL, "enter", str(folder)])
    seen = b""
    while "→".encode() not in seen:
        select.select([master], [], [], 30)
        seen += os.read(master, 4096)
    taken = time.perf_counter() - started
    os.kill(child, 9)
    os.waitpid(child, 0)
    os.close(master)
    return taken


def whole(command: list[str]) -> float:
    """Seconds of a whole process."""
    started = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - started


def line(name: str, seconds: list[float]) -> None:
    """Median, 99th percentile and worst in milliseconds."""
    ordered = sorted(seconds)
    late = ordered[int(0.99 * (len(ordered) - 1))]
    print(f"{name:44} {1e3 * median(ordered):8.1f} {1e3 * late:8.1f} {1e3 * ordered[-1]:8.1f}")


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "room"
        shown = campaign(folder)
        fresh = Path(name) / "fresh"
        campaign(fresh)
        fill(folder, shown)
        print(f"{'milliseconds':44} {'median':>8} {'99 %':>8} {'worst':>8}")
        line("bare line with fsync", bare_append(folder))
        taken = acknowledged(folder, shown)
        line(f"first reading after the start, of {READINGS:,}", taken[:1])
        line(f"reading acknowledged, {READINGS:,} in the journal", taken[1:])
        starts: dict[str, list[float]] = {}
        for _ in range(ROUNDS):
            for what, run in (
                ("python -c pass", lambda: whole([sys.executable, "-c", "pass"])),
                ("gtval --help", lambda: whole([GTVAL, "--help"])),
                ("gtval enter asks, new campaign", lambda: until_prompt(fresh)),
                (f"gtval enter asks, {READINGS:,} readings", lambda: until_prompt(folder)),
            ):
                starts.setdefault(what, []).append(run())
        for what, times in starts.items():
            line(what, times)


if __name__ == "__main__":
    main()
