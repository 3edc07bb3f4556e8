"""Doubts are about pairs: told with what would fit, open until they are settled; nothing twice."""

import io
import re

import pytest
from entry_rooms import ANN, BOB, enter_all, entry_room, until

from survey.entry.dialogue.words import answer_lines, doubts_text, unchecked_text
from survey.entry.screens.terminal import TerminalEntry
from validation.errors import GtvalError
from validation.page.people import Person


def test_a_wrong_first_reading_of_a_mark_is_named_with_what_would_fit(entry_session, room):
    target = until(entry_session, room, "1/O 1")
    shown = room.shown[target.pair]
    typed = f"{float(shown) + 0.2:.3f}"
    entry_session.record(target, typed, ANN)
    said = []
    while (following := entry_session.guide.next_target(ANN)).start == "1/O" and not said:
        if following == target:
            break
        answer = entry_session.record(following, room.shown[following.pair], ANN)
        said = [one for one in answer_lines(entry_session, answer) if f"1/O–1 {typed}" in one]
    number = entry_session.state.counting(target.pair)[0]
    while following != target:
        entry_session.record(following, room.shown[following.pair], ANN)
        following = entry_session.guide.next_target(ANN)
        assert following.start == "1/O"
    assert said  # as soon as others contradict it, before all of the mark is read
    assert entry_session.doubtful() == [number]
    before = entry_session.checks.knowledge.groups()
    doubts_text(entry_session, [number])
    assert entry_session.checks.knowledge.groups() == before  # to suppose changes nothing
    assert entry_session.doubtful_so_far() == [number]
    fitting = float(re.search(r"would fit (\S+)", doubts_text(entry_session, [number]))[1])
    assert fitting == pytest.approx(float(shown), abs=0.03)


def test_doubts_about_earlier_marks_come_back_before_the_stop_is_left(tmp_path):
    room = entry_room(3, 2, tmp_path / "room")
    entry_session = room.open()
    target = until(entry_session, room, "1/O 1")
    typed = f"{float(room.shown[target.pair]) + 0.2:.3f}"
    entry_session.record(target, typed, ANN)
    entry_session.jump(entry_session.guide.target("1/X 1"), ANN)
    seen = set()
    while (following := entry_session.guide.next_target(ANN)).start.startswith("1/"):
        if following == target and entry_session.state.counting(target.pair):
            break
        seen.add(following.start)
        entry_session.record(following, room.shown[following.pair], ANN)
    assert following == target
    assert seen == {"1/X", "1/Y"}
    entry_session.record(target, room.shown[target.pair], ANN, again=True)
    # Settled: the rest of the mark comes, which was left out by the jump.
    assert entry_session.guide.next_target(ANN).start == "1/O"
    entry_session.close()


def test_all_done_is_not_said_while_a_doubt_is_open(entry_session, room, capsys):
    until(entry_session, room, "1/Y 9")
    target = entry_session.guide.target("1/Y 9")
    entry_session.record(target, f"{float(room.shown[target.pair]) + 0.2:.3f}", ANN)
    terminal = TerminalEntry(entry_session, ANN, io.StringIO())
    for one in entry_session.guide.targets_from("1/Y"):
        if not entry_session.state.counting(one.pair):
            entry_session.record(one, room.shown[one.pair], ANN)
    assert entry_session.guide.next_target(ANN) == target
    assert "1 doubtful still" in terminal._end_text()
    entry_session.keep(entry_session.doubtful()[0], ANN)
    assert entry_session.guide.next_target(ANN) is None
    assert "all done" in terminal._end_text()
    capsys.readouterr()


def test_readings_that_nothing_checks_yet_are_counted(entry_session, room):
    assert entry_session.unchecked() == []
    until(entry_session, room, "X 1")
    # One reading of each world point: nothing could say that it is wrong.
    assert len(entry_session.unchecked()) == 16
    assert "16 readings nothing can check yet: of 1, 2, 3, 4, 5, 6 and others" in unchecked_text(
        entry_session
    )
    until(entry_session, room, "1/O 1")
    assert entry_session.unchecked() == []
    until(entry_session, room, "1/O 11")
    assert len(entry_session.unchecked()) == 2
    assert unchecked_text(entry_session).endswith("of 1/O")
    enter_all(entry_session, room)
    assert entry_session.unchecked() == []


def test_a_value_that_comes_twice_for_two_targets_is_asked_about_once(entry_session):
    first, second = entry_session.guide.following(ANN, 2)
    assert entry_session.record(first, "2.500", ANN).outcome == "recorded"
    asked = entry_session.record(second, "2.500", ANN)
    assert asked.outcome == "refused"
    assert "sent twice" in asked.text
    assert f"{first.start}–{first.end}" in asked.text
    assert entry_session.state.counting(second.pair) == []
    assert entry_session.guide.next_target(ANN) == second
    assert entry_session.record(second, "2,5", ANN).outcome == "recorded"  # meant


def test_the_same_value_is_not_asked_about_of_others_or_of_the_same_pair(entry_session):
    first, second, third = entry_session.guide.following(ANN, 3)
    entry_session.record(first, "2.500", ANN)
    assert entry_session.record(first, "2.500", ANN, again=True).outcome == "recorded"
    phone = Person("bob", "page 2")
    assert entry_session.record(second, "2.500", phone).outcome == "recorded"
    assert entry_session.record(third, "2.500", BOB, sure=True).outcome == "recorded"


def test_a_mark_is_added_in_the_room_and_nothing_else_is_changed(room):
    toml = room.folder / "campaign.toml"
    before = toml.read_text()
    entry_session = room.open()
    until(entry_session, room, "X 1")
    target = entry_session.add_world_point("17b", ANN)
    assert (target.start, target.end) == ("O", "17b")
    assert entry_session.record(target, "4.321", ANN).outcome == "recorded"
    with pytest.raises(GtvalError, match="there already"):
        entry_session.add_world_point("17b", ANN)
    for name in ("a/b", "", "a b", 'x"y', "x,y"):
        with pytest.raises(GtvalError, match="cannot be the name"):
            entry_session.add_world_point(name, ANN)
    entry_session.close()
    after = toml.read_text()
    assert after.replace(', "17b"', "") == before
    again = room.open()
    assert "17b" in again.guide.names.world
    again.close()


def test_a_list_of_marks_that_is_written_unusually_is_left_to_the_person(room):
    toml = room.folder / "campaign.toml"
    text = re.sub(
        r"world_points = \[.*?\]", 'world_points = ["a]", "b"]', toml.read_text(), flags=re.DOTALL
    )
    toml.write_text(text)
    entry_session = room.open()
    with pytest.raises(GtvalError, match='add "c" to world_points'):
        entry_session.add_world_point("c", ANN)
    assert toml.read_text() == text
    entry_session.close()
