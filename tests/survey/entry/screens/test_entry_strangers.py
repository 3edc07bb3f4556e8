"""Clients that behave badly on purpose: the page serves the others and loses nothing."""

import contextlib
import json
import re
import select
import socket
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import httpx
import pytest
from entry_server import reading

from validation.page.connection import MAX_SECONDS

SILENT = 300
"""More silent connections than browsers would ever open."""


def ids(served):
    return [entry.id for entry in served.room.recorded()]


def record(client, name):
    answer = client.post("/readings", json=reading(name))
    assert answer.status_code == 200, answer.text
    return name


def connect(served):
    host, port = re.fullmatch(r"http://(.+):(\d+)", served.url).groups()
    return socket.create_connection((host, int(port)), timeout=30)


def ends(connection, seconds):
    """Whether the other side closes a connection in time."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if select.select([connection], [], [], max(until - time.monotonic(), 0))[0]:
            with contextlib.suppress(ConnectionError):
                if connection.recv(65536):
                    continue
            return True
    return False


def head(client, path, *lines):
    """The head of a POST request by a device that was let in."""
    url = client.base_url
    cookie = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
    first = [f"POST {path} HTTP/1.1", f"Host: {url.host}:{url.port}", f"Cookie: {cookie}"]
    return "\r\n".join([*first, *lines, "", ""]).encode()


@pytest.mark.full
def test_connections_that_say_nothing_or_little_keep_nobody_out(served, ann):
    beginnings = (b"", b"GET / HTTP/1.1\r\nHost: 127", b"POST /readings HTTP/1.1\r\nX: ")
    unfinished = head(ann, "/readings", "Content-Type: application/json", "Content-Length: 500")
    silent = []
    try:
        for number in range(SILENT):
            one = connect(served)
            one.sendall((*beginnings, unfinished + b'{"id":')[number % 4])
            silent.append(one)
        started = time.monotonic()
        name = record(ann, "meanwhile")
        assert time.monotonic() - started < MAX_SECONDS / 2
        assert name in ids(served)
        assert all(ends(one, 3 * MAX_SECONDS) for one in silent)
    finally:
        for one in silent:
            one.close()
    assert record(ann, "afterwards") in ids(served)


@pytest.mark.full
def test_a_body_that_comes_drop_by_drop_is_given_up(served, ann):
    before = ids(served)
    with connect(served) as slow:
        slow.sendall(head(ann, "/readings", "Content-Type: application/json", "Content-Length: 99"))
        until = time.monotonic() + 3 * MAX_SECONDS
        said = b""
        while time.monotonic() < until and not said:
            with contextlib.suppress(ConnectionError):
                slow.sendall(b" ")
            if select.select([slow], [], [], 0.5)[0]:
                said = slow.recv(4096)
    assert said.startswith(b"HTTP/1.1 408 ")
    assert ids(served) == before


def test_a_body_of_ten_megabytes_in_pieces_is_refused_and_not_read(served, ann):
    before = ids(served)

    def pieces():
        for _ in range(1000):
            yield b"x" * 10_000

    with contextlib.suppress(httpx.TransportError):  # hung up on, which is a refusal too
        answer = ann.post(
            "/readings", content=pieces(), headers={"Content-Type": "application/json"}
        )
        assert answer.status_code == 413
    assert ids(served) == before
    assert record(ann, "after-ten-megabytes") in ids(served)


@pytest.mark.parametrize(
    "said",
    [
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(200),  # TLS to a port without it
        b"GET / HTTP/1.1\r\nHost: x\r\nContent-Length: -1\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: " + b"a" * 200_000 + b"\r\n\r\n",
        b"POST /readings HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\nZZZ\r\n",
        b"POST /readings HTTP/1.1\r\nContent-Length: 5\r\nContent-Length: 6\r\n\r\nabcdef",
        b"\r\n\r\n\r\n",
        b"GET /" + b"../" * 5000 + b" HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        bytes(range(256)) * 40,
        b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nHost: evil.example\r\n\r\n",
        b"POST / HTTP/1.1\r\nContent-Length: 4\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
    ],
)
def test_what_is_no_request_is_refused_and_hung_up_on(served, ann, said):
    with connect(served) as stranger:
        with contextlib.suppress(ConnectionError):
            stranger.sendall(said)
        assert ends(stranger, 3 * MAX_SECONDS)
    assert ann.get("/state").status_code == 200


def test_no_socket_is_upgraded_and_other_methods_are_refused(ann):
    upgrade = {
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
        "Sec-WebSocket-Version": "13",
    }
    assert ann.get("/state", headers=upgrade).status_code == 200
    for method in ("PUT", "DELETE", "OPTIONS", "PATCH", "TRACE"):
        assert ann.request(method, "/readings").status_code in (400, 405)
    assert ann.get("/readings").status_code == 405


@pytest.mark.parametrize("token", ["", "x" * 5000, "a; gtval_entry=b", "%00", "é"])
def test_a_missing_or_wrong_token_opens_nothing(served, token):
    with httpx.Client(base_url=served.url) as stranger:
        headers = {b"Cookie": f"gtval_entry={token}".encode()}
        for path in ("/readings", "/actions", "/person"):
            answer = stranger.post(path, json={"action": "undo"}, headers=headers)
            assert answer.status_code == 401
        assert stranger.get("/state", headers=headers).status_code == 401
        assert "Type the code" in stranger.get("/", headers=headers).text


@pytest.mark.parametrize("code", ["", "AAAAAAAA", 7, None, "x" * 1_900, "\x00", "ＡＢＣＤ"])
def test_a_code_that_is_none_lets_nobody_in(served, code):
    with httpx.Client(base_url=served.url) as stranger:
        answer = stranger.post("/join", json={"code": code, "name": "eve"})
        assert answer.status_code in (400, 403)
        assert "set-cookie" not in answer.headers


def test_a_code_that_was_used_lets_nobody_in(served):
    code = served.code
    with served.join("bob"), httpx.Client(base_url=served.url) as stranger:
        assert stranger.post("/join", json={"code": code}).status_code == 403


@pytest.mark.parametrize(
    "host", ["evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "evil:80", "[::2]"]
)
def test_a_page_called_by_a_foreign_name_is_not_served(ann, host):
    """What a foreign site gets that lets its own name stand for this machine."""
    for method, path in (("GET", "/"), ("GET", "/state"), ("POST", "/readings")):
        answer = ann.request(
            method, path, headers={"Host": host}, json={} if method == "POST" else None
        )
        assert answer.status_code == 421
        assert "2.5" not in answer.text


def test_requests_one_behind_the_other_in_one_piece_are_all_served(served, ann):
    said = json.dumps(reading("in-one-piece")).encode()
    line = f"Content-Length: {len(said)}"
    whole = head(ann, "/readings", "Content-Type: application/json", line) + said
    with connect(served) as busy:
        busy.sendall(whole * 200)
        answers = b""
        while answers.count(b"HTTP/1.1 200 ") < 200:
            got = busy.recv(65536)
            assert got, answers[-500:]
            answers += got
    assert ids(served).count("in-one-piece") == 1


def test_a_thousand_connections_at_once_are_served_or_refused_and_lose_nothing(served):
    def send(client, number):
        try:
            said = reading(f"many-{number}")
            return number, client.post("/readings", json=said, timeout=120).status_code
        except httpx.TransportError:
            return number, 0

    with served.join("burst") as client, ThreadPoolExecutor(200) as pool:
        client.headers["Connection"] = "close"  # each request by a connection of its own
        answers = dict(pool.map(partial(send, client), range(1000)))
    assert set(answers.values()) <= {0, 200, 503}
    there = ids(served)
    acknowledged = {f"many-{number}" for number, status in answers.items() if status == 200}
    assert len(acknowledged) > 900
    assert acknowledged <= set(there)
    assert len(there) == len(set(there))
