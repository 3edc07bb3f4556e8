"""Field entry: how long a reading takes to be acknowledged, and how soon one can begin.

A campaign of 5,000 readings is entered, in the room's order, as far as that; then the time from
a typed number to its acknowledgement is measured for the next ones, fsync and check included,
beside the bare peer that it must not lose to: a line appended to a CSV file with fsync. The same
for what else people do, and for the page with its requests. Starting is measured as whole
processes, in turn with Python and `gtval --help`: by the clock, which a busy machine stretches for
all of them alike, and as their own processor time.
"""

import os
import pty
import select
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "survey" / "entry"))

import numpy as np
from entry_rooms import EntryRoom
from entry_server import EntryServer

from data_samples.rooms.campaign_files import campaign_files
from data_samples.rooms.rooms import RoomSettings, make_room
from data_samples.rooms.simulate import SimulationSettings, simulate_survey
from survey.entry.dialogue.entry_session import EntrySession
from survey.entry.record.entries import Entry
from survey.entry.record.journal import Journal
from survey.entry.room.targets import Target
from validation.campaign.folder import load_campaign
from validation.page.people import Person
from validation.text_files.writing import write_files

READINGS = 5000
TIMED = 200
STOPS = 120
ROUNDS = 7
PAGES = 3
GTVAL = str(Path(sys.executable).with_name("gtval"))
ANN = Person("ann")
Times = tuple[float, float]


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


def acknowledged(folder: Path, shown: dict[frozenset[str], str]) -> list[Times]:
    """Times from a number to its answer, one after the other."""
    entry_session = begun(folder)
    taken = []
    while len(taken) < TIMED and (target := entry_session.guide.next_target(ANN)):
        if target.pair not in shown:
            entry_session.skip(target, "not seen", ANN)
            continue
        taken.append(timed(partial(enter, entry_session, target, shown[target.pair])))
    entry_session.close()
    return taken


def begun(folder: Path) -> EntrySession:
    """An entry session as a person finds it who types the first number: with the checks made."""
    entry_session = EntrySession.open(load_campaign(folder))
    entry_session.prepare().join()
    return entry_session


def enter(entry_session: EntrySession, target: Target, text: str) -> None:
    """Record a number, and find out what is next."""
    entry_session.record(target, text, ANN)
    entry_session.guide.next_target(ANN)


def bare_append(folder: Path) -> list[Times]:
    """The same for a line appended to a CSV file, flushed to the disk."""
    with (folder / "bare.csv").open("ab") as stream:

        def append() -> None:
            stream.write(b"2024-03-04T09:00,O,1,2.500\n")
            stream.flush()
            os.fsync(stream.fileno())

        return [timed(append) for _ in range(TIMED)]


def other_actions(folder: Path, shown: dict[frozenset[str], str]) -> dict[str, list[Times]]:
    """Times of all else that people do: the same measured again, undone, remarked on, kept."""
    entry_session = begun(folder)
    guide = entry_session.guide
    stop, wall = guide.target("3/X 5"), guide.target("X 5")

    def again(target: Target) -> Callable[[], object]:
        return lambda: entry_session.record(target, shown[target.pair], ANN, again=True)

    def last(target: Target) -> int:
        return entry_session.state.counting(target.pair)[-1]

    actions: dict[str, Callable[[], object]] = {
        "reading of a stop measured again": again(stop),
        "undone": lambda: entry_session.undo(ANN),
        "remark": lambda: entry_session.note(last(stop), "seen well", ANN),
        "kept": lambda: entry_session.keep(last(stop), ANN),
        "reading of a world point measured again": again(wall),
    }
    taken = {name: [timed(action) for _ in range(TIMED // 10)] for name, action in actions.items()}
    entry_session.close()
    return taken


def doubtful_listed(folder: Path) -> dict[str, list[Times]]:
    """Times of a list of all that is doubtful, as at the end: found anew, and remembered."""
    taken: dict[str, list[Times]] = {"found anew": [], "remembered": []}
    for _ in range(PAGES):
        (folder / "survey/journal.doubts").unlink(missing_ok=True)
        for times in taken.values():
            entry_session = begun(folder)
            times.append(timed(entry_session.doubtful))
            entry_session.close()
    return taken


def timed(action: Callable[[], object]) -> Times:
    """Seconds, and processor seconds of this process, that it takes."""
    started, used = time.perf_counter(), time.process_time()
    action()
    return time.perf_counter() - started, time.process_time() - used


def page(folder: Path, shown: dict[frozenset[str], str]) -> dict[str, list[Times]]:
    """Times until the page is there, just after a start and later, and of its readings.

    Processor seconds are those of the server.
    """
    taken: dict[str, list[Times]] = {"joined": [], "first": [], "later": [], "reading": []}
    for _ in range(PAGES):
        started = time.perf_counter()
        with (
            EntryServer(EntryRoom(folder, shown), folder.parent / "log") as server,
            server.join() as client,
        ):
            own = server.process.pid
            taken["joined"].append((time.perf_counter() - started, processor_seconds(own)))
            taken["first"].append(served(own, partial(client.get, "/")))
            while client.get("/state").json()["unexamined"]:
                time.sleep(0.2)
            taken["later"] += [served(own, partial(client.get, "/")) for _ in range(9)]
            for number in range(TIMED // 10):
                target = client.get("/state").json()["targets"][0]
                pair = frozenset((target["from"], target["to"]))
                said = {"from": target["from"], "to": target["to"], "text": shown.get(pair, "5.0")}
                said["id"] = f"{number}-{started}"
                taken["reading"].append(served(own, partial(client.post, "/readings", json=said)))
    return taken


def served(server: int, request: Callable[[], object]) -> Times:
    """Seconds, and processor seconds of the server, that a request takes."""
    used = processor_seconds(server)
    taken, _ = timed(request)
    return taken, processor_seconds(server) - used


def processor_seconds(process: int) -> float:
    """Processor time of a running process so far, to a hundredth."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def until_prompt(folder: Path) -> Times:
    """Seconds, and processor seconds, from `gtval enter` to its first question."""
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
    used = os.wait4(child, 0)[2]
    os.close(master)
    return taken, used.ru_utime + used.ru_stime


def whole(command: list[str]) -> Times:
    """Seconds, and processor seconds, of a whole process."""
    started = time.perf_counter()
    child = os.fork()
    if child == 0:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.execv(command[0], command)
    used = os.wait4(child, 0)[2]
    return time.perf_counter() - started, used.ru_utime + used.ru_stime


def line(name: str, times: list[Times], asked: str = "") -> None:
    """By the clock, and in processor time: least, median and worst, in milliseconds."""
    figures = ""
    for column in zip(*times, strict=True):
        figures += "".join(
            f"{1e3 * one:8.1f}" for one in (min(column), median(column), max(column))
        )
    print(f"{name:44}{figures}  {asked}", flush=True)


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "room"
        shown = campaign(folder)
        fresh = Path(name) / "fresh"
        campaign(fresh)
        fill(folder, shown)
        columns = f"{'least':>8}{'median':>8}{'worst':>8}"
        print(f"{'milliseconds':44}{columns}{columns}  asked")
        print(f"{'':44}{'by the clock':>24}{'processor time':>24}")
        line("bare line with fsync", bare_append(folder))
        taken = acknowledged(folder, shown)
        line("first reading after the start", taken[:1], "50")
        line(f"reading acknowledged, {READINGS:,} in the journal", taken[1:], "50")
        for what, times in other_actions(folder, shown).items():
            line(what, times, "50")
        for what, times in doubtful_listed(folder).items():
            line(f"list of the doubtful, {what}", times)
        of_page = page(folder, shown)
        line("gtval enter --web serves, a device joined", of_page["joined"])
        line(f"page just after that, {READINGS:,} readings", of_page["first"], "1000")
        line("page later", of_page["later"], "1000")
        line("reading acknowledged by request", of_page["reading"], "50")
        starts: dict[str, list[Times]] = {}
        for _ in range(ROUNDS):
            for what, run in (
                ("python -c pass", lambda: whole([sys.executable, "-c", "pass"])),
                ("gtval --help", lambda: whole([GTVAL, "--help"])),
                ("gtval enter asks, new campaign", lambda: until_prompt(fresh)),
                (f"gtval enter asks, {READINGS:,} readings", lambda: until_prompt(folder)),
            ):
                starts.setdefault(what, []).append(run())
        for what, times in starts.items():
            line(what, times, "500" if "asks" in what else "")


if __name__ == "__main__":
    main()
