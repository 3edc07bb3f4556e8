"""What is doubtful where the work stands is asked for again at once, and never out of date."""

import pytest
from entry_rooms import ANN, until

from survey.entry.dialogue.entry_session import EntrySession


@pytest.fixture
def left_doubtful(room):
    """The stop's first mark is done, with a wrong reading that nobody looked at."""
    entry_session = room.open()
    target = until(entry_session, room, "1/O 9")
    entry_session.record(target, f"{float(room.shown[target.pair]) + 0.2:.3f}", ANN)
    while not entry_session.state.counting(entry_session.guide.target("1/O 16").pair):
        asked = entry_session.guide.next_target(ANN)
        entry_session.record(asked, room.shown[asked.pair], ANN)
    assert entry_session.guide.next_target(ANN) == target
    entry_session.close()
    return room, target


def asked_without_checks(room) -> tuple[object, bool]:
    """What is asked first, and whether the checks were needed for it."""
    entry_session = room.open()
    target = entry_session.guide.next_target(ANN)
    needed = entry_session._checks is not None
    entry_session.close()
    return target, needed


def test_a_doubtful_reading_is_asked_for_again_without_computing_anything(left_doubtful):
    room, target = left_doubtful
    assert asked_without_checks(room) == (target, False)


def test_after_a_crash_at_the_last_reading_of_a_mark_nothing_is_computed_either(left_doubtful):
    room, target = left_doubtful
    entry_session = room.open()
    last = entry_session.guide.target("1/O 16")
    entry_session.record(last, room.shown[last.pair], ANN, again=True)
    entry_session.journal.close()  # as if killed before anything more was done
    assert asked_without_checks(room) == (target, False)


@pytest.mark.parametrize("damage", ["", "{", "[]", '{"of": 1, "doubtful": 3}', "\0" * 100])
def test_a_damaged_copy_is_computed_anew(left_doubtful, damage):
    room, target = left_doubtful
    room.journal.with_suffix(".doubts").write_text(damage)
    assert asked_without_checks(room) == (target, True)
    assert asked_without_checks(room) == (target, False)


def test_a_copy_counts_for_its_journal_and_campaign_only(left_doubtful):
    room, target = left_doubtful
    entry_session = room.open()
    (number,) = entry_session.state.counting(target.pair)
    entry_session.keep(number, ANN)
    entry_session.close()
    asked, needed = asked_without_checks(room)
    assert (asked.start, needed) == ("1/X", True)
    toml = room.folder / "campaign.toml"
    toml.write_text(toml.read_text() + "\n# a change\n")
    assert asked_without_checks(room) == (asked, True)


def test_all_doubtful_readings_are_known_at_once_after_an_orderly_end(left_doubtful):
    room, _ = left_doubtful
    entry_session = room.open()
    found = entry_session.doubtful()
    entry_session.close()
    assert len(found) == 1
    entry_session = room.open()
    assert entry_session.doubtful() == found
    assert entry_session._checks is None
    assert entry_session.unexamined() == 0
    assert entry_session.doubtful_so_far() == found
    entry_session.close()


def test_what_changed_since_is_looked_through_anew(left_doubtful):
    room, target = left_doubtful
    entry_session = room.open()
    assert entry_session.doubtful()
    entry_session.close()
    entry_session = room.open()
    entry_session.record(target, room.shown[target.pair], ANN, again=True)
    assert entry_session.doubtful() == []
    again = entry_session.guide.target("1/O 3")
    entry_session.record(again, f"{float(room.shown[again.pair]) + 0.2:.3f}", ANN, again=True)
    assert [entry_session.state.entries[n].pair for n in entry_session.doubtful()] == [again.pair]
    entry_session.journal.close()  # as if killed: nothing more is kept
    entry_session = room.open()
    assert [entry_session.state.entries[n].pair for n in entry_session.doubtful()] == [again.pair]
    entry_session.close()


def test_looking_writes_nothing(left_doubtful):
    from validation.campaign.folder import load_campaign

    room, _ = left_doubtful
    copy = room.journal.with_suffix(".doubts")
    copy.unlink()
    EntrySession.look(load_campaign(room.folder)).guide.next_target(ANN)
    assert not copy.exists()
