"""kill -9 at random moments, a full disk, a read-only folder: no acknowledged reading is lost."""

import ctypes
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import threading
import time
from collections import Counter
from pathlib import Path

import httpx
import pytest
from entry_rooms import ANN, EntryRoom, enter_all, entry_room
from entry_server import EntryServer

from survey.entry.dialogue.entry_session import EntrySession
from survey.readings.readings import load_readings
from survey.settings import SurveySettings
from validation.campaign.folder import load_campaign

GTVAL = str(Path(sys.executable).with_name("gtval"))
ACKNOWLEDGED = re.compile(r"^(?:ok|!!) (\S+)–(\S+) ", re.MULTILINE)


FEW_LEFT = 60
"""Readings that a run of the page may find too few."""


@pytest.fixture(scope="module")
def big_room(tmp_path_factory) -> EntryRoom:
    """A room with more pairs than most runs of a test enter."""
    return entry_room(8, 6, tmp_path_factory.mktemp("accidents") / "room")


def fresh(big_room, folder):
    shutil.copytree(big_room.folder, folder)
    return EntryRoom(folder, big_room.shown)


def check(room: EntryRoom, acknowledged: list[frozenset[str]]) -> None:
    """Everything acknowledged is there, nothing twice, and the files can be read."""
    campaign = load_campaign(room.folder)
    entry_session = EntrySession.look(campaign)
    recorded = [e.pair for e in entry_session.journal.entries if e.kind == "reading"]
    assert set(acknowledged) <= set(recorded)
    assert max(Counter(recorded).values(), default=1) == 1
    ids = [e.id for e in entry_session.journal.entries if e.id]
    assert len(set(ids)) == len(ids)
    for pair in acknowledged:
        assert len(entry_session.state.counting(pair)) == 1
    settings = campaign.section("survey", SurveySettings)
    if room.readings.exists() and room.readings.read_text().count("\n") > 1:
        load_readings(campaign, settings)


def run_at_terminal(room: EntryRoom, rng: random.Random) -> list[frozenset[str]]:
    """One run from a pipe, killed at a random moment; the pairs acknowledged in it."""
    entry_session = EntrySession.look(load_campaign(room.folder))
    targets = entry_session.guide.following(ANN, 60)
    lines = "".join(f"{room.shown[t.pair]}\n" for t in targets if t.pair in room.shown)
    process = subprocess.Popen(
        [GTVAL, "enter", str(room.folder), "--by", "ann"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    process.stdin.write(lines)
    process.stdin.flush()
    if rng.random() < 0.8:
        process.stdout.readline()
        time.sleep(rng.random() * 0.25)
    else:
        time.sleep(rng.random())
    process.kill()
    said, _ = process.communicate()
    return [frozenset(pair) for pair in ACKNOWLEDGED.findall(said)]


def all_readable(room):
    """Pairs that can be read, all of them: in rooms without pillars nothing is hidden."""
    entry_session = EntrySession.look(load_campaign(room.folder))
    return [
        t for station in entry_session.guide.plan for t in station.targets if t.pair in room.shown
    ]


def kill_terminals(big_room, folder, runs, seed):
    room = fresh(big_room, folder)
    rng = random.Random(seed)
    acknowledged: list[frozenset[str]] = []
    for _ in range(runs):
        acknowledged += run_at_terminal(room, rng)
        check(room, acknowledged)
    entry_session = room.open()
    assert len(entry_session.state.rows_of_file()) >= len(acknowledged)
    entry_session.close()
    assert room.readings.read_text().count("\n") == 1 + len(entry_session.state.rows_of_file())


def kill_servers(big_room, folder, runs, seed):
    """The same with the page: what got no answer is sent again, with the same id."""
    room = fresh(big_room, folder)
    rng = random.Random(seed)
    waiting = all_readable(room)
    acknowledged: list[frozenset[str]] = []
    number = {t.pair: f"id{n}" for n, t in enumerate(waiting)}
    for run in range(runs):
        if len(waiting) < FEW_LEFT:  # a fast machine fills a room before the runs are over
            room = fresh(big_room, folder.with_name(f"{folder.name}{run}"))
            waiting, acknowledged = all_readable(room), []
        with EntryServer(room, folder / "log") as server, server.join() as client:
            end = time.monotonic() + rng.random() * 0.6
            sent = 0
            while time.monotonic() < end and sent < len(waiting) - 1:
                answer = send(client, room, waiting[sent], number)
                assert answer is not None
                sent += 1
            # One more is under way when the battery dies, before or after its answer.
            dying = threading.Timer(rng.random() * 0.02, server.process.kill)
            dying.start()
            if send(client, room, waiting[sent], number) is not None:
                sent += 1
            dying.join()
            server.kill()
        acknowledged += [target.pair for target in waiting[:sent]]
        waiting = waiting[sent:]
        check(room, acknowledged)


def send(client, room, target, number):
    """The outcome of a reading; None where no answer came."""
    said = {"from": target.start, "to": target.end, "text": room.shown[target.pair]}
    try:
        answer = client.post("/readings", json={**said, "id": number[target.pair]})
    except httpx.HTTPError:
        return None
    assert answer.status_code == 200
    return answer.json()["outcome"]


def test_no_run_at_the_terminal_that_is_killed_loses_a_reading(big_room, tmp_path):
    kill_terminals(big_room, tmp_path / "room", 5, 1)


def test_no_page_that_is_killed_loses_a_reading(big_room, tmp_path):
    kill_servers(big_room, tmp_path / "room", 3, 2)


@pytest.mark.full
@pytest.mark.parametrize("part", range(10))
def test_two_hundred_kills_lose_no_reading(big_room, tmp_path, part):
    seed = int(os.environ.get("GTVAL_TEST_SEED", "100"))
    kill_terminals(big_room, tmp_path / "terminal", 10, seed + part)
    kill_servers(big_room, tmp_path / "page", 10, seed + 100 + part)


def limit_files_to(size):
    """No file of a process may grow beyond so many bytes: what a full disk is to it."""
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def test_a_full_disk_ends_the_terminal_with_all_that_was_acknowledged(big_room, tmp_path):
    room = fresh(big_room, tmp_path / "room")
    targets = all_readable(room)
    lines = "".join(f"{t.start} {t.end} {room.shown[t.pair]}\n" for t in targets[:60])
    done = subprocess.run(
        [GTVAL, "enter", str(room.folder)],
        input=lines,
        check=False,
        capture_output=True,
        text=True,
        preexec_fn=limit_files_to(5000),
        timeout=60,
    )
    assert done.returncode == 2
    assert "NOT recorded" in done.stdout
    assert "Traceback" not in done.stderr
    acknowledged = [frozenset(pair) for pair in ACKNOWLEDGED.findall(done.stdout)]
    assert 5 < len(acknowledged) < 60
    check(room, acknowledged)
    recorded = EntrySession.look(load_campaign(room.folder)).state.rows_of_file()
    assert [e.pair for e in recorded] == acknowledged
    room.open().close()  # once there is space again, the readings file is made good
    assert room.readings.read_text().count("\n") == 1 + len(acknowledged)


def test_a_full_disk_is_told_to_the_page_which_keeps_the_reading(big_room, tmp_path):
    room = fresh(big_room, tmp_path / "room")
    acknowledged = []
    limit = limit_files_to(5000)
    server = EntryServer(room, tmp_path / "log", prepare=limit)
    with server, server.join() as client:
        for number, target in enumerate(all_readable(room)[:60]):
            said = {"from": target.start, "to": target.end, "text": room.shown[target.pair]}
            answer = client.post("/readings", json={**said, "id": f"id{number}"})
            if answer.status_code != 200:
                break
            acknowledged.append(target.pair)
        assert answer.status_code == 503
        assert "NOT recorded" in answer.json()["error"]
        assert client.get("/state").status_code == 200
    assert 5 < len(acknowledged) < 60
    check(room, acknowledged)


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 64 kB; only where one may be mounted."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = shutil.which("mount")
    if mount is None or os.geteuid() != 0:
        pytest.skip("mounting needs root")
    if subprocess.run(
        [mount, "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(place)], check=False
    ).returncode:
        pytest.skip("nothing can be mounted here")
    yield place
    subprocess.run([shutil.which("umount"), "-l", str(place)], check=True)


def test_a_disk_that_is_really_full_loses_nothing(big_room, small_disk):
    room = fresh(big_room, small_disk / "room")
    lines = "".join(f"{t.start} {t.end} {room.shown[t.pair]}\n" for t in all_readable(room))
    done = subprocess.run(
        [GTVAL, "enter", str(room.folder)],
        input=lines,
        check=False,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 2
    assert "No space left" in done.stdout
    acknowledged = [frozenset(pair) for pair in ACKNOWLEDGED.findall(done.stdout)]
    assert len(acknowledged) > 20
    check(room, acknowledged)


def test_a_read_only_disk_is_a_plain_error(big_room, small_disk):
    room = fresh(big_room, small_disk / "room")
    subprocess.run([shutil.which("mount"), "-o", "remount,ro", str(small_disk)], check=True)
    refused_plainly(room)


def as_owner_only():
    """Give up root's right to write everywhere, for this process and what it becomes."""
    if os.geteuid() == 0:
        drop_from_bounding_set, dac_override = 24, 1  # linux/prctl.h, linux/capability.h
        ctypes.CDLL(None).prctl(drop_from_bounding_set, dac_override, 0, 0, 0)


def test_a_read_only_folder_is_a_plain_error(big_room, tmp_path):
    room = fresh(big_room, tmp_path / "room")
    survey = room.folder / "survey"
    survey.chmod(0o555)
    refused_plainly(room, as_owner_only)
    assert not room.journal.exists()
    survey.chmod(0o755)


def test_a_read_only_journal_is_a_plain_error_and_stays_as_it_is(big_room, tmp_path):
    room = fresh(big_room, tmp_path / "room")
    entry_session = room.open()
    enter_all(entry_session, room, 3)
    entry_session.close()
    before = room.journal.read_bytes()
    room.journal.chmod(0o444)
    refused_plainly(room, as_owner_only)
    assert room.journal.read_bytes() == before


def refused_plainly(room, prepare=None):
    for options in ((), ("--web", "--port", "0")):
        done = subprocess.run(
            [GTVAL, "enter", str(room.folder), *options],
            input="2.5\n",
            check=False,
            capture_output=True,
            text=True,
            timeout=60,
            preexec_fn=prepare,
        )
        assert done.returncode == 2, done.stderr
        assert "cannot write" in done.stderr
        assert "Traceback" not in done.stderr
