"""The page's requests: who is let in, what is refused, and that no reading is lost."""

import concurrent.futures
import json
import re
import socket
from dataclasses import replace

import httpx
import pytest
from entry_rooms import entry_room
from entry_server import EntryServer, reading

from validation.page.access import (
    MAX_AGE,
    WINDOW,
    WRONG_CODES,
    Access,
    AccessError,
    address_of,
)
from validation.page.serving import listen


def test_of_too_many_devices_those_let_in_first_type_a_code_again(monkeypatch):
    monkeypatch.setattr("validation.page.access.MAX_DEVICES", 3)
    access = Access()
    tokens = [access.join(access.code, f"p{number}")[0] for number in range(5)]
    assert [access.device(token) is not None for token in tokens] == [False] * 2 + [True] * 3


def test_a_code_works_once():
    access = Access()
    code = access.code
    token, device = access.join(f" {code[:4].lower()}-{code[4:]}", "ann")
    assert access.device(token) is device
    with pytest.raises(AccessError, match="works once"):
        access.join(code, "bob")
    assert access.device("anything else") is None
    assert access.device(None) is None


def test_guessing_codes_is_stopped_for_a_while():
    now = [0.0]
    access = Access(clock=lambda: now[0])
    for _ in range(WRONG_CODES):
        with pytest.raises(AccessError, match="not the code"):
            access.join("WRONGWRO", "x")
    with pytest.raises(AccessError, match="too many wrong codes"):
        access.join(access.code, "ann")
    now[0] = WINDOW + 1
    access.join(access.code, "ann")


def test_a_stranger_who_guesses_locks_nobody_else_out():
    access = Access(clock=lambda: 0.0)
    for stranger in ("10.0.0.66", address_of("fd00::1")):
        for _ in range(5 * WRONG_CODES):
            with pytest.raises(AccessError):
                access.join("WRONGWRO", "x", stranger)
    with pytest.raises(AccessError, match="from this device"):
        access.join(access.code, "x", address_of("fd00::2:3"))  # the same network of one person
    _, device = access.join(access.code, "ann", "10.0.0.7")
    assert device.person.name == "ann"


def test_the_addresses_of_strangers_take_no_end_of_memory(monkeypatch):
    monkeypatch.setattr("validation.page.access.MAX_ADDRESSES", 50)
    access = Access(clock=lambda: 0.0)
    for number in range(200):
        with pytest.raises(AccessError):
            access.join("WRONGWRO", "x", f"10.0.{number // 256}.{number % 256}")
    assert len(access._wrong) == 50


def test_devices_stay_let_in_after_a_restart_and_the_file_lets_nobody_in(tmp_path):
    store = tmp_path / "journal.devices"
    before = Access(store=store)
    token, device = before.join(before.code, "ann")
    device.person = replace(device.person, second=True)
    before.keep()
    after = Access(store=store)
    assert after.device(token) == device
    assert token not in store.read_text()
    assert store.stat().st_mode & 0o077 == 0
    for key in json.loads(store.read_text()):
        assert after.device(key) is None
    _, other = after.join(after.code, "bob")
    assert other.name != device.name
    store.write_text('{"x": 1}')
    assert Access(store=store).device(token) is None  # asked for the code, no more


def test_a_device_is_let_in_for_a_week(tmp_path, monkeypatch):
    access = Access(store=tmp_path / "devices")
    token, device = access.join(access.code, "ann")
    monkeypatch.setattr("validation.page.access.time.time", lambda: device.joined + MAX_AGE + 1)
    assert access.device(token) is None


def test_without_a_code_there_is_nothing_to_see_or_do(served):
    with httpx.Client(base_url=served.url) as stranger:
        page = stranger.get("/")
        assert "Type the code" in page.text
        assert "1/O" not in page.text
        assert stranger.get("/state").status_code == 401
        assert stranger.post("/readings", json=reading("1")).status_code == 401
        assert stranger.post("/join", json={"code": "AAAAAAAA"}).status_code == 403
        stranger.cookies.set("gtval_entry", "made-up")
        assert stranger.get("/state").status_code == 401
    assert served.room.recorded() == []


def test_it_listens_on_this_machine_alone(served):
    assert served.url.startswith("http://127.0.0.1:")


def test_a_reading_is_recorded_once_however_often_it_is_sent(served, ann):
    first = ann.post("/readings", json=reading("once", text="2.501", again=False))
    again = ann.post("/readings", json=reading("once", text="2.501", again=False))
    assert first.json()["outcome"] == "recorded"
    assert again.json()["outcome"] == "repeated"
    assert [e.text for e in served.room.recorded() if e.id == "once"] == ["2.501"]


@pytest.mark.parametrize("other", [{"text": "2.502"}, {"to": "Y"}])
def test_another_reading_under_the_same_id_is_not_taken_for_it(ann, other):
    ann.post("/readings", json=reading("mine"))
    answer = ann.post("/readings", json=reading("mine", **other))
    assert answer.status_code == 409
    assert "NOT recorded" in answer.json()["error"]


def test_long_ids_are_refused_not_cut_to_the_same(served, ann):
    before = len(served.room.recorded())
    for last in "ab":
        assert ann.post("/readings", json=reading("x" * 100 + last)).status_code == 409
    assert len(served.room.recorded()) == before


def test_a_reading_that_waited_has_the_time_of_its_typing(served, ann):
    ann.post("/readings", json=reading("late", age=120))
    (entry,) = [e for e in served.room.recorded() if e.id == "late"]
    assert entry.measured < entry.time
    assert entry.by == "ann"
    assert entry.device == "page 1"


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Host": "evil.example"},
    ],
)
def test_requests_from_other_sites_are_refused(served, ann, headers):
    before = len(served.room.recorded())
    answer = ann.post("/readings", json=reading("foreign"), headers=headers)
    assert answer.status_code in (403, 421)
    assert len(served.room.recorded()) == before


@pytest.mark.parametrize(
    ("content", "kind", "status"),
    [
        (b"x" * 10_000_000, "application/json", {413}),
        (b"from=O&to=X", "application/x-www-form-urlencoded", {415}),
        (b"{}", "text/plain", {415}),
        (b"not json", "application/json", {400}),
        (b"[" * 60_000, "application/json", {400}),
        (b"[]", "application/json", {400}),
        (b"{}", "application/json", {400}),
        (b'{"id":1,"from":"O","to":"X","text":"1"}', "application/json", {400}),
        (b'{"id":"a","from":"O","to":"X","text":{}}', "application/json", {400}),
        (b'{"id":"a","from":"O","to":"X","text":"1","age":-1}', "application/json", {400}),
        (b'{"id":"a","from":"../../etc","to":"X","text":"1"}', "application/json", {409}),
        (b'{"id":"a","from":"O","to":"X\\ud800","text":"1"}', "application/json", {400}),
        (b"\xff\xfe", "application/json", {400}),
    ],
)
def test_hostile_bodies_are_refused_and_record_nothing(served, ann, content, kind, status):
    before = len(served.room.recorded())
    try:
        answer = ann.post("/readings", content=content, headers={"Content-Type": kind})
    except (httpx.WriteError, httpx.ReadError, httpx.RemoteProtocolError):
        pass  # the server hung up on the body, which is a refusal too
    else:
        assert answer.status_code in status, answer.text
    assert len(served.room.recorded()) == before
    assert ann.get("/state").status_code == 200


@pytest.mark.parametrize(
    "path",
    [
        "/static/../app.py",
        "/static/%2e%2e/app.py",
        "/static/..%2fapp.py",
        "/static/%00",
        "/../../etc/passwd",
        "/survey/journal.jsonl",
        "/static/page.html.j2",
    ],
)
def test_no_path_leads_to_another_file(served, path):
    with httpx.Client(base_url=served.url) as stranger:
        assert stranger.get(path).status_code in (400, 404)


@pytest.mark.parametrize("name", ["../x", "a/b", "<script>", "x" * 3000, "\x00"])
def test_names_of_stops_are_names(ann, name):
    answer = ann.post("/actions", json={"action": "stop", "text": name})
    if answer.status_code == 200:
        assert name == "<script>"  # harmless: it is always shown as text
        ann.post("/actions", json={"action": "undo"})
    else:
        assert answer.status_code in (400, 409)


def test_script_in_a_note_or_name_is_text_on_the_page(ann):
    hostile = "</script><script>alert(1)</script><img src=x onerror=alert(1)>"
    ann.post("/person", json={"name": hostile[:60]})
    number = ann.post("/readings", json=reading("note")).json()["number"]
    noted = ann.post("/actions", json={"action": "note", "number": number, "text": hostile})
    assert noted.status_code == 200
    page = ann.get("/")
    assert "<script>alert" not in page.text
    assert "<img" not in page.text
    assert len(re.findall(r"<script", page.text)) == 2
    policy = page.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    ann.post("/person", json={"name": "ann"})


def test_a_blind_person_gets_no_value(served, ann):
    ann.post("/readings", json=reading("seen", text="2.503"))
    with served.join("bob") as bob:
        bob.post("/person", json={"name": "bob", "second": True})
        page = bob.get("/")
        assert "2.503" not in page.text
        assert "2.503" not in bob.get("/state").text
        answer = bob.post(
            "/readings",
            json={"id": "b1", "from": "X", "to": "O", "text": "2.7", "second": True},
        ).json()
        assert answer["outcome"] == "disagrees"
        assert "2.503" not in answer["lines"][0]
        assert "2.7" not in answer["lines"][0]
        bob.post("/actions", json={"action": "undo"})


@pytest.mark.full
def test_a_thousand_requests_in_a_burst_lose_nothing(served, ann):
    before = len(served.room.recorded())

    def send(number):
        answer = ann.post("/readings", json=reading(f"burst-{number}"), timeout=60)
        return answer.status_code, answer.json()["outcome"]

    with concurrent.futures.ThreadPoolExecutor(32) as pool:
        answers = list(pool.map(send, range(1000)))
    assert set(answers) == {(200, "recorded")}
    ids = [e.id for e in served.room.recorded()[before:]]
    assert sorted(ids) == sorted(f"burst-{n}" for n in range(1000))


def test_a_port_that_is_taken_is_a_plain_error(served, tmp_path):
    import subprocess

    from web_server import GTVAL

    room = entry_room(6, 1, tmp_path / "room")
    port = served.url.rpartition(":")[2]
    done = subprocess.run(
        [GTVAL, "enter", str(room.folder), "--web", "--port", port],
        check=False,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 2
    assert "--port" in done.stderr
    assert "Traceback" not in done.stderr


def test_it_ends_orderly_and_notes_that(tmp_path):
    room = entry_room(6, 1, tmp_path / "room")
    with EntryServer(room, tmp_path / "log") as server:
        with server.join() as client:
            client.post("/readings", json=reading("1"))
        assert server.stop() == 0
    assert room.readings.read_text().count("\n") == 2


def test_small_answers_are_sent_at_once():
    """asyncio turns Nagle's algorithm off only where the listening socket names TCP."""
    with listen("127.0.0.1", 0) as listening:
        assert listening.proto == socket.IPPROTO_TCP
