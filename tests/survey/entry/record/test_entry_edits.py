"""Edits by hand and second writers while the entry runs: noticed, and nothing lost."""

import random
import re
import subprocess
import sys
import threading
import time
from collections import Counter
from pathlib import Path

import pytest
from click.testing import CliRunner
from entry_rooms import ANN, BOB, copy_of, enter_all, entry_room

from survey.entry.dialogue.entry_session import EntrySession
from survey.entry.dialogue.file_changes import (
    put_edited_file_aside,
    take_edited_file,
    warnings,
)
from survey.entry.dialogue.journal_merge import merge
from survey.entry.record import readings_file
from survey.entry.record.journal import NotRecordedError, read_journal
from survey.readings.readings import load_readings
from survey.settings import SurveySettings
from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.errors import InputError

GTVAL = str(Path(sys.executable).with_name("gtval"))
ACKNOWLEDGED = re.compile(r"^(?:ok|!!) (\S+)–(\S+) ", re.MULTILINE)
BY_HAND = "2026-03-04T10:00,{},{},{},carl,,,\n"


def enter(entry_session, room, most):
    """The pairs of so many readings entered."""
    before = set(entry_session.state.pairs)
    enter_all(entry_session, room, most)
    return [pair for pair in entry_session.state.pairs if pair not in before]


def rows(room):
    """Pairs in the readings file, as the survey reads it."""
    campaign = load_campaign(room.folder)
    file = load_readings(campaign, campaign.section("survey", SurveySettings))
    return Counter(map(frozenset, zip(file.used.start, file.used.end, strict=True)))


def hand_row(room, where):
    start, end = where.split()
    return BY_HAND.format(start, end, room.shown[frozenset((start, end))])


def test_a_row_added_by_hand_meanwhile_stays_and_the_person_is_asked(entry_session, room):
    first = enter(entry_session, room, 3)
    with room.readings.open("a") as stream:
        stream.write(hand_row(room, "1/Y 7"))
    then = enter(entry_session, room, 4)
    assert rows(room) == Counter([*first, *then, frozenset(("1/Y", "7"))])
    (asked,) = warnings(entry_session)
    assert "changed by hand" in asked
    assert "f take" in asked
    said = take_edited_file(entry_session)
    assert "1 row(s) more, 0 less" in said
    assert warnings(entry_session) == []
    assert entry_session.state.counting(frozenset(("1/Y", "7")))
    assert rows(room) == Counter([*first, *then, frozenset(("1/Y", "7"))])


def test_a_row_changed_and_one_deleted_by_hand_meanwhile_stay_so(entry_session, room):
    enter(entry_session, room, 5)
    lines = room.readings.read_text().splitlines(keepends=True)
    changed = lines[2].replace(lines[2].split(",")[3], "9.999")
    room.readings.write_text("".join([lines[0], lines[1], changed, *lines[4:]]))
    enter(entry_session, room, 2)
    entry_session.undo(ANN)  # takes away its own line, and no other
    text = room.readings.read_text()
    assert "9.999" in text
    assert lines[3] not in text
    assert text.count("\n") == 1 + 5 - 1 + 1
    take_edited_file(entry_session)
    assert room.readings.read_text().count("9.999") == 1
    assert sum(rows(room).values()) == 5


def test_an_editor_that_saves_what_it_read_before_takes_no_reading_away(entry_session, room):
    first = enter(entry_session, room, 3)
    read_before = room.readings.read_text()
    then = enter(entry_session, room, 3)
    room.readings.write_text(read_before + hand_row(room, "1/Y 7"))
    last = enter(entry_session, room, 1)
    expected = Counter([*first, *then, *last, frozenset(("1/Y", "7"))])
    assert rows(room) == expected
    take_edited_file(entry_session)
    assert rows(room) == expected


def test_an_edited_file_may_be_put_aside(entry_session, room):
    first = enter(entry_session, room, 3)
    with room.readings.open("a") as stream:
        stream.write("a line that is nothing\n")
    then = enter(entry_session, room, 1)
    assert "a line that is nothing" in room.readings.read_text()
    with pytest.raises(InputError):
        take_edited_file(entry_session)
    said = put_edited_file_aside(entry_session)
    (aside,) = room.readings.parent.glob("readings.edited-*.csv")
    assert aside.name in said
    assert "a line that is nothing" in aside.read_text()
    assert rows(room) == Counter([*first, *then])


def test_a_file_saved_in_another_form_is_left_alone_until_it_is_taken_over(entry_session, room):
    first = enter(entry_session, room, 3)
    edited = (room.readings.read_text() + hand_row(room, "1/Y 7")).replace(",", ";")
    room.readings.write_bytes(b"sep=;\r\n" + edited.replace("\n", "\r\n").encode("utf-8"))
    then = enter(entry_session, room, 2)
    assert b"sep=;" in room.readings.read_bytes()
    assert "saved in another form" in " ".join(warnings(entry_session))
    take_edited_file(entry_session)
    assert rows(room) == Counter([*first, *then, frozenset(("1/Y", "7"))])


def test_readings_entered_while_the_file_had_another_form_are_in_it_again_afterwards(
    entry_session, room
):
    enter(entry_session, room, 4)
    plain = room.readings.read_text()
    room.readings.write_text("sep=;\n" + plain.replace(",", ";"))
    enter(entry_session, room, 3)
    entry_session.undo(ANN)
    room.readings.write_text(plain + hand_row(room, "1/Y 7"))
    enter(entry_session, room, 2)  # what was taken back is asked for once more
    state = entry_session.state
    entered = Counter(pair for pair in state.pairs for _ in state.counting(pair))
    assert sum(entered.values()) == 4 + 3 - 1 + 2
    there = entered + Counter([frozenset(("1/Y", "7"))])
    assert rows(room) == there
    take_edited_file(entry_session)
    assert rows(room) == there
    assert all(len(entry_session.state.counting(pair)) == 1 for pair in there)


@pytest.mark.parametrize("moment", ["while it is taken over", "just before the new file"])
def test_a_row_saved_at_the_very_moment_stays(entry_session, room, monkeypatch, moment):
    first = enter(entry_session, room, 3)
    with room.readings.open("a") as stream:
        stream.write(hand_row(room, "1/Y 7"))
    late = hand_row(room, "1/O 7")
    done = []

    def save():
        if not done:
            done.append(True)
            with room.readings.open("a") as stream:  # an editor that keeps the file itself
                stream.write(late)

    if moment == "while it is taken over":
        append = entry_session.append_only
        monkeypatch.setattr(entry_session, "append_only", lambda e: (save(), append(e))[1])
    else:
        written = readings_file.write_files

        def write(*args, before=lambda: None, **more):
            return written(*args, before=lambda: (before(), save()), **more)

        monkeypatch.setattr(readings_file, "write_files", write)
    take_edited_file(entry_session)
    take_edited_file(entry_session)
    expected = Counter([*first, frozenset(("1/Y", "7")), frozenset(("1/O", "7"))])
    assert rows(room) == expected
    assert warnings(entry_session) == []
    assert not list(room.readings.parent.glob(".*tmp"))


def test_a_deleted_file_is_written_anew(entry_session, room):
    first = enter(entry_session, room, 3)
    room.readings.unlink()
    then = enter(entry_session, room, 1)
    assert rows(room) == Counter([*first, *then])


def test_a_note_added_by_hand_is_kept_and_no_reading_doubled(room):
    opened = room.open()
    first = enter(opened, room, 3)
    opened.close()
    lines = room.readings.read_text().splitlines()
    cells = lines[2].split(",")
    cells[6] = "on the left"
    room.readings.write_text("\n".join([lines[0], lines[1], ",".join(cells), *lines[3:]]) + "\n")
    opened = EntrySession.open(load_campaign(room.folder), adopt=True)
    opened.close()
    assert rows(room) == Counter(first)
    assert "on the left" in room.readings.read_text()
    room.open().close()  # nothing is left to ask


def test_a_reading_that_the_file_did_not_get_before_a_kill_is_no_deletion(room):
    opened = room.open()
    first = enter(opened, room, 4)
    opened.close()
    lines = room.readings.read_text().splitlines(keepends=True)
    room.readings.write_text("".join([*lines[:-1], hand_row(room, "1/Y 7")]))
    opened = EntrySession.open(load_campaign(room.folder), adopt=True)
    opened.close()
    assert rows(room) == Counter([*first, frozenset(("1/Y", "7"))])


def test_a_line_that_was_torn_anywhere_never_refuses_the_start(room):
    opened = room.open()
    first = enter(opened, room, 4)
    opened.close()
    whole = room.readings.read_bytes()
    last = whole.rindex(b"\n", 0, -1) + 1
    for kept in (0, 5, last - 3, *range(last + 1, len(whole), 5), len(whole) - 1):
        room.readings.write_bytes(whole[:kept])
        room.open().close()
        assert rows(room) == Counter(first)
    room.readings.write_bytes(whole[: last + 20] + bytes(300))
    room.open().close()
    assert room.readings.read_bytes() == whole


def test_a_row_added_with_another_separator_than_the_file_has_is_taken_over(room):
    opened = room.open()
    first = enter(opened, room, 4)
    opened.close()
    text = "sep=;\n" + room.readings.read_text().replace(",", ";") + hand_row(room, "1/Y 7")
    room.readings.write_text(text)
    EntrySession.open(load_campaign(room.folder), adopt=True).close()
    assert rows(room) == Counter([*first, frozenset(("1/Y", "7"))])


def test_a_readings_sheet_is_not_left_behind(room):
    (room.folder / "survey" / "readings.xlsx").write_bytes(b"PK")
    with pytest.raises(InputError, match=r"save it as readings\.csv"):
        room.open()


def two_sessions(room):
    """Two entries that do not see each other's lock."""
    first = room.open()
    room.journal.with_suffix(".lock").unlink()
    return first, room.open()


def test_two_entries_whose_lock_was_deleted_write_one_good_journal(room):
    first, second = two_sessions(room)
    pairs = []
    for number in range(12):
        entry_session, person = ((first, ANN), (second, BOB))[number % 2]
        entry_session.catch_up()
        target = entry_session.guide.next_target(person)
        answer = entry_session.record(target, room.shown[target.pair], person)
        assert answer.outcome == "recorded"
        pairs.append(target.pair)
        assert rows(room)[target.pair] == 1
    assert len(set(pairs)) == 12
    assert "another entry session writes to this journal" in " ".join(warnings(first))
    assert "another entry session writes to this journal" in " ".join(warnings(second))
    first.close()
    second.close()
    read_journal(room.journal)
    assert rows(room) == Counter(pairs)
    room.open().close()


def test_many_readings_at_the_same_moment_by_two_entries_are_all_there_once(room):
    first, second = two_sessions(room)
    done: list[frozenset[str]] = []

    def work(entry_session, person, stations):
        for station in stations:
            for target in entry_session.guide.plan[station].targets[:8]:
                answer = entry_session.record(target, room.shown[target.pair], person, sure=True)
                assert answer.outcome == "recorded"
                done.append(target.pair)

    threads = [
        threading.Thread(target=work, args=(first, ANN, (1, 2))),
        threading.Thread(target=work, args=(second, BOB, (3, 4))),
    ]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    first.close()
    second.close()
    assert len(done) == 32
    assert Counter(e.pair for e in read_journal(room.journal).entries if e.kind == "reading") == (
        Counter(done)
    )
    assert rows(room) == Counter(done)


def test_a_journal_that_was_replaced_takes_nothing_more(entry_session, room):
    enter(entry_session, room, 2)
    text = room.journal.read_bytes()
    room.journal.unlink()
    room.journal.write_bytes(text)
    target = entry_session.guide.next_target(ANN)
    with pytest.raises(NotRecordedError, match="deleted or replaced"):
        entry_session.record(target, room.shown[target.pair], ANN)
    assert target.pair not in entry_session.state.pairs


def forked(room, tmp_path):
    """Two folders that went on from one state: what two writers of a share make."""
    opened = room.open()
    first = enter(opened, room, 3)
    opened.close()
    other = copy_of(room, tmp_path / "other")
    found = []
    for one, stations in ((room, (0, 1)), (other, (2, 0))):
        opened = one.open()
        for station in stations:
            for target in opened.guide.plan[station].targets[3:6]:
                opened.record(target, one.shown[target.pair], ANN, sure=True)
                found.append(target.pair)
        opened.undo(ANN)
        found.pop()
        opened.close()
        time.sleep(0.002)
    return first + found, other


def test_two_journals_of_one_campaign_are_merged(room, tmp_path):
    pairs, other = forked(room, tmp_path)
    with room.readings.open("a") as stream:
        stream.write(hand_row(room, "1/Y 7"))
    done = CliRunner().invoke(main, ["journal-merge", str(room.folder), str(other.journal)])
    assert done.exit_code == 0, done.output
    assert "2 writer(s)" in done.output
    # Both read two pairs from O: these count twice, as two measurements do.
    assert rows(room) == Counter([*pairs, frozenset(("1/Y", "7"))])
    assert len(list(room.journal.parent.glob("journal.before-merge-*"))) == 1
    room.open().close()
    merged, _ = merge(load_campaign(room.folder), [other.journal])
    assert merged.branches >= 1
    assert rows(room) == Counter([*pairs, frozenset(("1/Y", "7"))])  # once more changes nothing


def test_one_journal_that_two_wrote_to_is_told_and_merged(room, tmp_path):
    pairs, other = forked(room, tmp_path)
    ours, theirs = (one.journal.read_bytes().splitlines(keepends=True) for one in (room, other))
    tails = [
        [line for line in lines if line not in both]
        for lines, both in ((ours, theirs), (theirs, ours))
    ]
    shuffled = [line for pair in zip(*tails, strict=True) for line in pair]
    room.journal.write_bytes(b"".join([*ours[: -len(tails[0])], *shuffled]))
    with pytest.raises(InputError, match=r"two entry sessions wrote .* `gtval journal-merge`"):
        room.open()
    merge(load_campaign(room.folder), [])
    assert rows(room) == Counter(pairs)
    room.open().close()


def test_a_line_that_follows_on_none_is_not_merged(room):
    opened = room.open()
    enter(opened, room, 4)
    opened.close()
    lines = room.journal.read_bytes().splitlines(keepends=True)
    room.journal.write_bytes(b"".join([lines[0], *lines[2:]]))
    with pytest.raises(InputError, match="follows on no other"):
        merge(load_campaign(room.folder), [])


def test_a_writer_that_meets_a_fork_stops(room, tmp_path):
    _, other = forked(room, tmp_path)
    opened = room.open()
    with room.journal.open("ab") as stream:  # as on a share without locks
        stream.write(other.journal.read_bytes().splitlines(keepends=True)[-1])
    target = opened.guide.next_target(ANN)
    with pytest.raises(NotRecordedError, match="journal-merge"):
        opened.record(target, room.shown[target.pair], ANN)
    opened.close()


def run_and_edit(room, rng, hand):
    """One run from a pipe, edited meanwhile and killed; the pairs acknowledged."""
    campaign = load_campaign(room.folder)
    looked = EntrySession.look(campaign)
    coming = looked.guide.following(ANN, 40)  # the last mark is read by hand alone
    targets = [t for t in coming if t.pair in room.shown and t.start != "4/Y"]
    lines = "".join(f"{t.start} {t.end} {room.shown[t.pair]}\n" for t in targets)
    process = subprocess.Popen(
        [GTVAL, "enter", str(room.folder), "--by", "ann", "--adopt"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    process.stdin.write(lines)
    process.stdin.flush()
    first = process.stdout.readline()
    time.sleep(rng.random() * 0.05)
    edit(room, rng, hand)
    time.sleep(rng.random() * 0.1)
    process.kill()
    said, _ = process.communicate()
    return [frozenset(pair) for pair in ACKNOWLEDGED.findall(first + said)]


def edit(room, rng, hand):
    """A row added by hand, by an editor that appends or one that puts a new file in place."""
    campaign = load_campaign(room.folder)
    guide = EntrySession.look(campaign).guide
    free = [t for t in guide.plan[-1].targets if t.pair not in hand and t.pair in room.shown]
    if not free or not room.readings.exists():
        return
    target = free[-1]
    row = BY_HAND.format(target.start, target.end, room.shown[target.pair])
    if rng.random() < 0.5:
        with room.readings.open("a") as stream:
            stream.write(row)
    else:
        new = room.readings.with_suffix(".new")
        new.write_text(room.readings.read_text() + row)
        new.replace(room.readings)
    hand.add(target.pair)


def kills_with_edits(folder, runs, seed):
    rng = random.Random(seed)
    room, hand, acknowledged = None, set(), []
    for run in range(runs):
        if room is None or len(acknowledged) > 60:
            room = entry_room(8, 4, folder / f"room{run}")
            hand, acknowledged = set(), []
        acknowledged += run_and_edit(room, rng, hand)
        with room.readings.open("a") as stream:  # an editor's unfinished last line is completed
            stream.write("")
        edit(room, rng, hand)
        opened = EntrySession.open(load_campaign(room.folder), adopt=True)
        opened.close()
        found = rows(room)
        assert set(acknowledged) <= set(found)
        assert hand <= set(found)
        assert max(found.values()) == 1


def test_kills_with_edits_by_hand_in_between_lose_nothing_and_double_nothing(tmp_path):
    kills_with_edits(tmp_path, 8, 1)


@pytest.mark.full
@pytest.mark.parametrize("part", range(10))
def test_two_hundred_kills_with_edits_by_hand_in_between(tmp_path, part):
    kills_with_edits(tmp_path, 20, 100 + part)
