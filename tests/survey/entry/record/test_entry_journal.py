import json
import os
import random

import pytest

from survey.entry.record.entries import Entry
from survey.entry.record.journal import Journal, NotRecordedError, read_journal
from validation.errors import GtvalError, InputError


def reading(number=1, **values):
    return Entry("reading", id=f"id{number}", start="O", end=str(number), metres=1.5, **values)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "survey" / "journal.jsonl"


@pytest.fixture
def filled(path):
    journal = Journal.open(path)
    for number in range(1, 6):
        journal.append(reading(number, by="Ann Müller", text="1,5 «x»"))
    journal.close()
    return path


def test_what_is_appended_is_read_back(filled):
    entries = read_journal(filled).entries
    assert [e.number for e in entries] == [1, 2, 3, 4, 5]
    assert entries[2].by == "Ann Müller"
    assert entries[2].metres == 1.5


def test_every_line_is_json_that_any_tool_reads(filled):
    lines = [json.loads(line) for line in filled.read_text().splitlines()]
    assert [line["end"] for line in lines] == ["1", "2", "3", "4", "5"]


def test_a_torn_last_line_is_cut_off_wherever_it_is_torn(filled):
    whole = filled.read_bytes()
    last = whole.rstrip(b"\n").rfind(b"\n") + 1
    for size in (last + 1, last + 20, len(whole) - 2, len(whole) - 1):
        filled.write_bytes(whole[:size])
        journal = Journal.open(filled)
        assert len(journal.entries) == 4
        assert journal.recovered_bytes == size - last
        journal.append(reading(9))
        journal.close()
        assert [e.end for e in read_journal(filled).entries] == ["1", "2", "3", "4", "9"]


def test_blocks_of_a_power_cut_that_hold_nothing_are_cut_off(filled):
    whole = filled.read_bytes()
    filled.write_bytes(whole + b"\0" * 512)
    assert len(read_journal(filled).entries) == 5


def test_no_change_of_any_byte_goes_unnoticed(filled):
    whole = filled.read_bytes()
    rng = random.Random(3)
    for place in rng.sample(range(whole.rfind(b'{"kind"')), 60):
        changed = bytearray(whole)
        changed[place] ^= 1 << rng.randrange(7)
        filled.write_bytes(changed)
        with pytest.raises(InputError, match=r"journal\.jsonl, line \d"):
            read_journal(filled)


@pytest.mark.parametrize("order", [(1, 2, 4, 5), (1, 3, 2, 4, 5), (1, 2, 2, 3, 4, 5), (2, 3)])
def test_lines_taken_out_exchanged_or_doubled_are_noticed(filled, order):
    lines = filled.read_bytes().splitlines(keepends=True)
    filled.write_bytes(b"".join(lines[i - 1] for i in order))
    with pytest.raises(InputError, match="damaged"):
        read_journal(filled)


def test_a_second_process_is_refused_with_the_reason(path):
    first = Journal.open(path, "ann")
    with pytest.raises(GtvalError, match=rf"another entry session .*ann, process {os.getpid()}"):
        Journal.open(path, "bob")
    first.close()
    Journal.open(path, "bob").close()


def test_a_write_that_fails_leaves_nothing_and_may_be_tried_again(path, monkeypatch):
    journal = Journal.open(path)
    journal.append(reading(1))
    whole = path.read_bytes()
    real_write = os.write

    def half_then_full(handle, data):
        real_write(handle, bytes(data)[:20])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "write", half_then_full)
    with pytest.raises(NotRecordedError, match=r"NOT recorded: .*No space left"):
        journal.append(reading(2))
    monkeypatch.undo()
    assert path.read_bytes() == whole
    journal.append(reading(3))
    journal.close()
    assert [e.end for e in read_journal(path).entries] == ["1", "3"]


def test_where_even_the_cut_fails_nothing_more_is_written(path, monkeypatch):
    journal = Journal.open(path)
    journal.append(reading(1))

    def fail(*_):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fsync", fail)
    monkeypatch.setattr(os, "ftruncate", fail)
    with pytest.raises(NotRecordedError):
        journal.append(reading(2))
    monkeypatch.undo()
    with pytest.raises(NotRecordedError, match="not open"):
        journal.append(reading(3))
    journal.close()


def test_a_folder_in_the_way_is_a_plain_error(path):
    path.mkdir(parents=True)
    with pytest.raises(GtvalError, match="cannot"):
        Journal.open(path)
