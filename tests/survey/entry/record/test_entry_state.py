import pytest

from survey.entry.record.entries import FROM_FILE, FROM_FILE_UNUSED, Entry
from survey.entry.record.state import WAS_SET_ASIDE, EntryState

AB = frozenset(("O", "1"))


@pytest.fixture
def state():
    return EntryState(lambda a, b: abs(a - b) < 0.01)


def do(state, kind, **values):
    number = len(state.entries) + 1
    state.apply(Entry(kind, number=number, **{"start": "O", "end": "1", "by": "ann", **values}))
    return number


def read(state, metres=1.0, **values):
    return do(state, "reading", metres=metres, **values)


def test_a_reading_counts(state):
    one = read(state)
    assert state.counting(AB) == [one]
    assert state.rows_of_file() == [state.entries[one]]


def test_one_more_reading_of_a_pair_is_set_aside_until_it_is_meant(state):
    one, two = read(state), read(state, 1.1)
    assert state.counting(AB) == [one]
    keep = do(state, "keep", of=two, text=WAS_SET_ASIDE)
    assert state.counting(AB) == [one, two]
    do(state, "undo", of=keep)
    assert state.counting(AB) == [one]


def test_a_replaced_reading_comes_back_when_its_replacement_is_undone(state):
    one = read(state)
    two = read(state, 2.0, of=one)
    assert (state.counting(AB), state.replaced) == ([two], {one: two})
    do(state, "undo", of=two)
    assert (state.counting(AB), state.replaced) == ([one], {})


def test_undoing_twice_is_undoing_once(state):
    one = read(state)
    do(state, "undo", of=one)
    do(state, "undo", of=one)
    assert state.counting(AB) == []


def test_a_skip_is_undone_and_a_reading_ends_it(state):
    skip = do(state, "skip", text="behind the heater")
    assert state.pair(AB).skipped == "behind the heater"
    do(state, "undo", of=skip)
    assert state.pair(AB).skipped is None
    do(state, "skip", text="again")
    read(state)
    assert state.pair(AB).skipped is None


def test_two_people_who_agree_count_both_and_who_disagree_count_neither(state):
    one = read(state, 1.0)
    two = read(state, 1.005, second=True, by="bob")
    assert state.counting(AB) == [one, two]
    do(state, "undo", of=two)
    three = read(state, 1.5, second=True, by="bob")
    assert state.disagrees(AB)
    assert state.counting(AB) == []
    four = read(state, 1.498)
    assert state.counting(AB) == [three, four]
    assert not state.disagrees(AB)


def test_one_person_alone_does_not_agree_with_herself(state):
    read(state, 1.0)
    read(state, 2.0, second=True, by="bob")
    read(state, 1.0)
    assert state.disagrees(AB)


def test_the_same_display_typed_twice_is_one_measurement():
    state = EntryState(lambda a, b: a == b, second_measures=False)
    one = read(state, 1.0)
    read(state, 1.0, second=True, by="bob")
    assert state.counting(AB) == [one]


def test_rows_of_a_file_all_count_except_those_set_aside_there(state):
    one, two = (read(state, device=FROM_FILE) for _ in range(2))
    three = read(state, device=FROM_FILE_UNUSED)
    assert state.counting(AB) == [one, two]
    assert [e.number for e in state.rows_of_file()] == [one, two, three]


def test_each_device_takes_back_its_own(state):
    one = read(state, device="page 1")
    do(state, "note", of=one, device="page 2", text="x")
    assert state.last_action("page 1").number == one
    assert state.last_action("page 3") is None
