"""`gtval enter` as people run it: from a pipe, and in a pseudo-terminal."""

import codecs
import contextlib
import json
import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from entry_rooms import enter_all, entry_room

from survey.entry.dialogue.entry_session import EntrySession
from validation.campaign.folder import load_campaign

GTVAL = str(Path(sys.executable).with_name("gtval"))


def piped(room, text, *options):
    return subprocess.run(
        [GTVAL, "enter", str(room.folder), *options],
        check=False,
        input=text,
        capture_output=True,
        text=True,
        timeout=60,
    )


def readings(room):
    entry_session = EntrySession.look(load_campaign(room.folder))
    return [(e.start, e.end, e.text) for e in entry_session.journal.entries if e.kind == "reading"]


class Terminal:
    """A command in a pseudo-terminal."""

    def __init__(self, *command: str) -> None:
        self.started = time.monotonic()
        child, self.master = pty.fork()
        if child == 0:
            # Shells start what runs in the background with this signal ignored.
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            os.execv(command[0], command)  # the child becomes the command
        self.child = child
        self.seen = ""
        self.decoder = codecs.getincrementaldecoder("utf-8")()

    def wait_for(self, pattern: str, seconds: float = 30) -> str:
        """What came up to the first match, which is taken off."""
        until = time.monotonic() + seconds
        while not (found := re.search(pattern, self.seen)):
            left = until - time.monotonic()
            assert left > 0, f"{pattern!r} did not come; there was {self.seen!r}"
            if select.select([self.master], [], [], left)[0]:
                try:
                    self.seen += self.decoder.decode(os.read(self.master, 4096))
                except OSError:  # the terminal was closed
                    raise AssertionError(self.seen) from None
        said, self.seen = self.seen[: found.end()], self.seen[found.end() :]
        return said

    def type(self, text: str) -> None:
        os.write(self.master, text.encode())

    def press(self, key: str) -> None:
        """Type a control key, once the line editor has surely taken the terminal over."""
        time.sleep(0.3)
        self.type(key)

    def status(self, again: str = "") -> int:
        """Its exit status; killed if it does not end.

        ``again`` is a key that is pressed once more after five seconds: on a loaded machine the
        signal of the first may have come before the line editor was there to take it.
        """
        until = time.monotonic() + 20
        once_more = until - 15
        while (ended := os.waitpid(self.child, os.WNOHANG))[0] == 0:
            if time.monotonic() > until:
                os.kill(self.child, signal.SIGKILL)
                os.waitpid(self.child, 0)
                raise AssertionError(f"it did not end; there was {self.seen!r}")
            if again and time.monotonic() > once_more:
                self.type(again)
                again = ""
            if select.select([self.master], [], [], 0.05)[0]:
                with contextlib.suppress(OSError):
                    self.seen += self.decoder.decode(os.read(self.master, 4096))
        os.close(self.master)
        return os.waitstatus_to_exitcode(ended[1])


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A room whose world points are measured; the first mark is next."""
    room = entry_room(4, 1, tmp_path_factory.mktemp("terminal") / "room")
    entry_session = room.open()
    enter_all(entry_session, room, 70)
    entry_session.close()
    return room


@pytest.fixture
def half(measured, tmp_path):
    from entry_rooms import copy_of

    return copy_of(measured, tmp_path / "half")


def test_a_list_is_taken_from_a_pipe_and_every_line_acknowledged(room):
    done = piped(room, "2.498\n2503 mm\n3,530\n", "--by", "ann")
    assert done.returncode == 0, done.stderr
    assert "ok O–X 2.498 m = 2498 mm" in done.stdout
    assert readings(room) == [("O", "X", "2.498"), ("O", "Y", "2503 mm"), ("O", "XY", "3,530")]


def test_lines_that_name_their_pair_go_there(room):
    done = piped(room, "O 3 4.123\nX O 2.498\n")
    assert done.returncode == 0, done.stdout
    assert [(a, b) for a, b, _ in readings(room)] == [("O", "3"), ("O", "X")]


def test_a_doubtful_reading_never_shifts_the_rest_of_a_list(half):
    ends = ["1", "6", "11", *(str(n) for n in range(1, 17) if n not in (1, 6, 11))]
    typed = [half.shown[frozenset((mark, end))] for mark in ("1/O", "1/X") for end in ends]
    typed[8] = f"{float(typed[8]) + 0.2:.3f}"
    before = len(readings(half))
    done = piped(half, "".join(f"{text}\n" for text in typed))
    assert done.returncode == 0
    assert "DOUBTFUL" in done.stdout
    asked = [(mark, end) for mark in ("1/O", "1/X") for end in ends]
    assert [(a, b) for a, b, _ in readings(half)[before:]] == asked
    # At a keyboard it comes back, once the station is done.
    terminal = Terminal(GTVAL, "enter", str(half.folder))
    terminal.type("j 1/O 1\n")
    terminal.wait_for(f"1/O → {ends[8]} ")
    terminal.type(half.shown[frozenset(("1/O", ends[8]))] + "\n")
    terminal.wait_for("ok ")
    terminal.wait_for("1/Y → 1 ")
    terminal.type("q\n")
    assert terminal.status() == 0


def test_a_reading_that_is_named_is_measured_again(room):
    done = piped(room, "2.498\n2.503\nr O X 2.499\nr O Y\n2.504\n3.53\n")
    assert done.returncode == 0, done.stdout
    assert [line.split(",")[3] for line in room.readings.read_text().splitlines()[1:]] == [
        "2.499",
        "2.504",
        "3.530",
    ]


def test_nothing_after_a_bad_line_of_a_pipe_is_recorded(room):
    done = piped(room, "2.498\nfour\n3.530\n")
    assert done.returncode == 2
    assert "line 2" in done.stdout
    assert len(readings(room)) == 1


def test_the_status_only_looks(half):
    before = half.journal.read_bytes()
    said = json.loads(piped(half, "", "--json").stdout)
    assert (said["done"], said["left"], said["next"]) == (70, 48, {"from": "1/O", "to": "1"})
    assert said["doubtful"] == []
    assert half.journal.read_bytes() == before


def test_a_stop_at_the_keyboard(half):
    terminal = Terminal(GTVAL, "enter", str(half.folder), "--by", "ann")
    for _ in range(8):
        asked = terminal.wait_for(r"1/O → \d+ ")
        end = re.search(r"→ (\d+) ", asked)[1]
        terminal.type(half.shown[frozenset(("1/O", end))] + "\n")
        terminal.wait_for("ok ")
        terminal.wait_for(r"stop 1: \d+ readings?, \d+ to spare")
    end = re.search(r"→ (\d+) ", terminal.wait_for(r"1/O → \d+ "))[1]
    shown = half.shown[frozenset(("1/O", end))]
    terminal.type(f"{float(shown) + 0.1:.3f}\n")
    said = terminal.wait_for("DOUBTFUL")
    assert "\a" in said
    terminal.wait_for(r"1/O → \d+ ")
    terminal.type(f"r {shown}\n")
    terminal.wait_for("ok ")
    for command, answer in (
        ("n seen well", "noted"),
        ("d", "no reading is doubtful"),
        ("l", r"1/O–16"),
        ("i", "79 of 118 readings done"),
        ("s heater", "skipped"),
        ("u", "undone: skip"),
        ("j 1/Y 5", r"1/Y → 5 "),
        ("p 9", r"9/O → 1 "),
        ("u", "undone"),
        ("?", "undo what was done last"),
        ("x", "no command"),
        ("u", "undone"),
    ):
        terminal.type(f"{command}\n")
        terminal.wait_for(answer)
    terminal.type("q\n")
    terminal.wait_for("done")
    assert terminal.status() == 0
    assert half.readings.read_text().count("\n") == 1 + 79


def test_the_end_of_the_keyboard_ends_it_and_the_next_start_goes_on_there(half):
    terminal = Terminal(GTVAL, "enter", str(half.folder))
    terminal.wait_for(r"1/O → 1 ")
    terminal.type(half.shown[frozenset(("1/O", "1"))] + "\n")
    terminal.wait_for(r"1/O → 6 ")
    terminal.press("\x04")
    assert terminal.status() == 0
    again = Terminal(GTVAL, "enter", str(half.folder))
    again.wait_for(r"1/O → 6 ")
    time.sleep(0.3)  # readline misses the signal in the moment after it has shown the prompt
    again.press("\x03")
    assert again.status("\x03") == 0


def test_the_rest_of_a_paste_after_a_bad_line_goes_nowhere(half):
    terminal = Terminal(GTVAL, "enter", str(half.folder))
    terminal.wait_for(r"1/O → 1 ")
    before = len(readings(half))
    first, third = (half.shown[frozenset(("1/O", end))] for end in ("1", "11"))
    terminal.type(f"{first}\n4.O12\n{third}\n{third}\n")
    terminal.wait_for("not a distance")
    time.sleep(0.5)
    terminal.type("q\n")
    assert terminal.status() == 0
    assert len(readings(half)) == before + 1


def test_readings_from_before_are_announced(tmp_path):
    room = entry_room(3, 1, tmp_path / "room")
    room.readings.write_text("from,to,distance\nO,X,2.5\nO,Y,2.5\n")
    said = piped(room, "", "--status").stdout
    assert "readings.csv has 2 reading(s) that the journal does not have yet" in said
    assert "2 reading(s) of readings.csv were taken over" in piped(room, "").stdout
    assert "taken over" not in piped(room, "").stdout


def test_no_sign_ends_it_in_a_traceback(half):
    """A terminal without arrows and dashes, bytes that are no text, a name that is none."""
    shown = half.shown[frozenset(("1/O", "1"))]
    plain = {**os.environ, "PYTHONIOENCODING": "ascii:strict", "PYTHONUTF8": "0"}
    for text in (f"{shown}\nl\n".encode(), b"\xff\xfe\n"):
        done = subprocess.run(
            [GTVAL, "enter", str(half.folder), "--by", b"\xff\xfe"],
            check=False,
            input=text,
            capture_output=True,
            env=plain,
            timeout=60,
        )
        assert done.returncode == (0 if text.startswith(shown.encode()) else 2)
        assert b"Traceback" not in done.stderr
    assert half.recorded()[-1].text == shown


def test_a_terminal_without_arrows_and_dashes_shows_what_looks_like_them(half):
    shown = half.shown[frozenset(("1/O", "1"))]
    plain = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    for options, text, expected in (
        (["--status"], "", b"next: 1/O -> 1"),
        ([], f"{shown}\nl\n", b"ok 1/O-1 "),
    ):
        done = subprocess.run(
            [GTVAL, "enter", str(half.folder), *options],
            check=True,
            input=text.encode(),
            capture_output=True,
            env=plain,
            timeout=60,
        )
        assert expected in done.stdout
        assert not re.search(rb"\w *\?\??[ \w]", done.stdout)


def test_a_list_may_begin_with_a_mark_and_name_pairs_as_the_screen_does(half):
    shown = [half.shown[frozenset(("1/O", end))] for end in ("1", "9")]
    done = piped(half, f"\ufeff{shown[0]}\n1/O–9 {shown[1]}\n")
    assert done.returncode == 0
    assert [(e.end, e.text) for e in half.recorded()[-2:]] == [("1", shown[0]), ("9", shown[1])]


def test_people_take_turns_at_the_laser(half):
    shown = [half.shown[frozenset(("1/O", end))] for end in ("1", "6")]
    done = piped(half, f"{shown[0]}\nb bob\n{shown[1]}\nb\n", "--by", "ann")
    assert "at the laser: bob" in done.stdout
    assert "say who" in done.stdout
    assert [entry.by for entry in half.recorded()[-2:]] == ["ann", "bob"]


def test_a_word_that_is_no_command_and_a_jump_to_what_is_measured_are_said(half):
    said = piped(half, "j O X\n").stdout
    value = half.shown[frozenset("OX")]
    assert f"O–X has {value} already; r O X measures it again" in said
    done = piped(half, "zzz\n")
    assert done.returncode == 2
    assert "there is no command 'zzz'; ? lists the commands" in done.stdout


def test_what_two_people_disagree_on_is_listed_without_values(half):
    other = f"{float(half.shown[frozenset('OX')]) + 0.2:.3f}"
    piped(half, f"O X {other}\n", "--second", "--by", "bob")
    said = piped(half, "d\n", "--by", "ann").stdout
    assert said.count("two entries disagree, measure again: O–X") == 2  # listed, and at the end
    assert other not in said


def test_a_blind_second_entry_shows_no_value(half):
    entry_session = EntrySession.look(load_campaign(half.folder))
    first = entry_session.journal.entries[0]
    done = piped(half, f"O X {first.text}\nl\ni\nd\n", "--second", "--by", "bob")
    assert done.returncode == 0
    assert done.stdout.count(first.text) == 1  # its own echo: both agree
    assert "Y–O  –" in done.stdout
    assert f"second entries: 1 of {len(half.recorded()) - 1} readings done" in done.stdout
    assert piped(half, "", "--second").returncode == 2


def test_a_second_command_on_the_campaign_is_refused_with_the_reason(half):
    terminal = Terminal(GTVAL, "enter", str(half.folder), "--by", "ann")
    terminal.wait_for(r"1/O → 1 ")
    refused = piped(half, "1.0\n", "--by", "bob")
    assert refused.returncode == 2
    assert "another entry session" in refused.stderr
    assert "ann" in refused.stderr
    terminal.type("q\n")
    assert terminal.status() == 0


def test_a_folder_without_a_campaign_is_a_plain_error(tmp_path):
    done = subprocess.run(
        [GTVAL, "enter", str(tmp_path)],
        check=False,
        capture_output=True,
        text=True,
        input="",
        timeout=60,
    )
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "survey").exists()
