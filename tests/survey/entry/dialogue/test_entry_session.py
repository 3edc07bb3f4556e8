import shutil
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from entry_rooms import ANN, BOB, EntryRoom, enter_all, entry_room, until
from surveys import simulated

from data_samples.rooms.campaign_files import write_campaign
from survey.entry.dialogue.entry_session import EntrySession
from survey.entry.record.readings_csv import csv_text
from survey.entry.room.targets import Target
from survey.estimation.solve import solve_survey
from survey.readings.readings import load_readings
from survey.settings import SurveySettings
from validation.campaign.folder import load_campaign
from validation.errors import GtvalError, InputError
from validation.page.people import Person

BOB_BLIND = Person("bob", second=True)


@pytest.fixture(scope="module")
def measured(tmp_path_factory) -> EntryRoom:
    """A room in which all was entered."""
    room = entry_room(2, 1, tmp_path_factory.mktemp("measured") / "room")
    entry_session = room.open()
    enter_all(entry_session, room)
    entry_session.close()
    return room


@pytest.fixture
def copy(measured, tmp_path) -> EntryRoom:
    folder = tmp_path / "copy"
    shutil.copytree(measured.folder, folder)
    return EntryRoom(folder, measured.shown)


def rows(room):
    return room.readings.read_text().splitlines()[1:]


def test_the_plan_is_frame_then_world_points_then_stops(entry_session):
    order = [station.name for station in entry_session.guide.plan]
    assert order == ["O", "X", "Y", "XY", "1/O", "1/X", "1/Y"]
    first = [t.end for t in entry_session.guide.plan[0].targets]
    assert first[:4] == ["X", "Y", "XY", "1"]
    # The first three world points of a mark lie all around the room.
    assert [t.end for t in entry_session.guide.plan[4].targets][:5] == ["1", "6", "11", "2", "3"]


def test_a_whole_campaign_solves_to_its_true_poses(measured):
    campaign = load_campaign(measured.folder)
    settings = campaign.section("survey", SurveySettings)
    file = load_readings(campaign, settings)
    base = campaign.settings
    solution = solve_survey(base.vframe, base.robot_frame, file.used, settings.world_points)
    assert len(file.used) == len(measured.shown)
    assert [frame.pose for frame in solution.frames] == ["1"]


def test_it_goes_on_exactly_where_it_was(room):
    first = room.open()
    until(first, room, "X 5")
    first.close()
    again = room.open()
    assert again.guide.next_target(ANN) == again.guide.target("X 5")
    again.close()


def test_a_jump_is_remembered(room):
    first = room.open()
    first.jump(first.guide.target("1/X 7"), ANN)
    first.close()
    again = room.open()
    assert again.guide.next_target(ANN) == again.guide.target("1/X 7")
    again.close()


def test_a_slip_is_doubtful_and_comes_back_before_the_laser_is_moved(entry_session, room):
    target = until(entry_session, room, "1/O 9")
    shown = room.shown[target.pair]
    answer = entry_session.record(target, f"{float(shown) + 0.09:.3f}", ANN)
    assert answer.verdict.status == "doubtful"
    assert answer.verdict.suspects == (answer.entry.number,)
    while (following := entry_session.guide.next_target(ANN)) != target:
        assert following.start == "1/O"
        entry_session.record(following, room.shown[following.pair], ANN)
    fixed = entry_session.record(target, shown, ANN, again=True)
    assert fixed.verdict.status == "fits"
    assert entry_session.doubtful() == []
    assert entry_session.guide.next_target(ANN).start == "1/X"
    # Everything that was ever entered is still in the journal.
    assert [e.text for e in entry_session.journal.entries if e.pair == target.pair] == [
        f"{float(shown) + 0.09:.3f}",
        shown,
    ]


def test_more_decimals_than_are_shown_come_back_before_the_laser_is_moved(entry_session, room):
    target = until(entry_session, room, "1/O 9")
    shown = room.shown[target.pair]
    answer = entry_session.record(target, f"{shown}4", ANN)
    assert answer.verdict.status == "doubtful"
    while (following := entry_session.guide.next_target(ANN)) != target:
        assert following.start == "1/O"
        entry_session.record(following, room.shown[following.pair], ANN)
    assert entry_session.doubtful() == [answer.entry.number]
    entry_session.record(target, shown, ANN, again=True)
    assert entry_session.doubtful() == []
    assert entry_session.guide.next_target(ANN).start == "1/X"


def test_a_kept_reading_is_doubtful_no_longer(entry_session, room):
    target = until(entry_session, room, "1/O 9")
    wrong = f"{float(room.shown[target.pair]) + 0.09:.3f}"
    answer = entry_session.record(target, wrong, ANN)
    entry_session.keep(answer.entry.number, ANN)
    assert entry_session.doubtful() == []


def test_exchanged_digits_are_suggested_and_never_applied(entry_session, room):
    target = until(entry_session, room, "1/O 9")
    shown = room.shown[target.pair]
    typed = shown[:2] + shown[3] + shown[2] + shown[4:]
    answer = entry_session.record(target, typed, ANN)
    assert float(shown) in [h.metres for h in answer.verdict.hypotheses]
    assert answer.entry.metres == float(typed)
    assert typed in room.readings.read_text()


def test_the_reading_of_a_neighbour_is_recognised(entry_session, room):
    target = until(entry_session, room, "1/O 9")
    answer = entry_session.record(target, room.shown[frozenset(("1/O", "10"))], ANN)
    assert "10" in answer.verdict.other_ends


def test_a_wrong_first_reading_of_a_world_point_is_found_by_the_third_at_the_latest(
    entry_session, room
):
    target = entry_session.guide.target("O 14")
    entry_session.record(target, "21.600", ANN)
    entry_session.record(
        entry_session.guide.target("X 14"), room.shown[frozenset(("X", "14"))], ANN
    )
    last = entry_session.record(
        entry_session.guide.target("Y 14"), room.shown[frozenset(("Y", "14"))], ANN
    )
    number = entry_session.state.counting(target.pair)[0]
    assert number in last.verdict.suspects
    assert number in entry_session.doubtful()


def test_a_stop_is_good_enough_before_all_of_it_is_read(entry_session, room):
    until(entry_session, room, "1/Y 1")
    enough_at = None
    for target in entry_session.guide.plan[-1].targets:
        entry_session.record(target, room.shown[target.pair], ANN)
        status = entry_session.status(target)
        if status.good_enough and enough_at is None:
            enough_at = status.readings
    assert enough_at is not None
    assert enough_at < 48
    assert max(entry_session.status(target).sigmas[:2]) <= entry_session.settings.pose_sigma
    assert 0.6 < entry_session.status(target).m0 < 1.4


def test_an_undone_reading_is_next_again_and_gone_from_the_file(entry_session, room):
    target = until(entry_session, room, "O 4")
    entry_session.record(target, room.shown[target.pair], ANN)
    before = len(rows(room))
    entry_session.undo(ANN)
    assert entry_session.guide.next_target(ANN) == target
    assert len(rows(room)) == before - 1


def test_one_more_reading_of_a_pair_is_set_aside_and_counts_once_it_is_kept(entry_session, room):
    target = entry_session.guide.target("O X")
    entry_session.record(target, "2.500", ANN)
    again = entry_session.record(target, "2.501", BOB)
    assert again.outcome == "set aside"
    assert len(rows(room)) == 1
    entry_session.keep(again.entry.number, BOB)
    assert len(rows(room)) == 2


def test_the_same_entry_sent_twice_is_recorded_once(entry_session, room):
    target = entry_session.guide.target("O X")
    first = entry_session.record(target, "2.500", ANN, entry_id="a1")
    again = entry_session.record(target, "2.500", ANN, entry_id="a1")
    assert (again.outcome, again.entry) == ("repeated", first.entry)
    assert len(rows(room)) == 1


def test_what_is_no_distance_is_noted_but_no_reading(entry_session):
    target = entry_session.guide.target("O X")
    answer = entry_session.record(target, "abc", ANN)
    assert answer.outcome == "refused"
    assert entry_session.journal.entries[-1].text == "abc"
    assert entry_session.guide.next_target(ANN) == target


def test_pairs_that_are_not_in_the_survey_are_refused(entry_session):
    for start, end in (("1", "2"), ("1/O", "1/X"), ("O", "99"), ("O", "O"), ("../../x", "O")):
        with pytest.raises(GtvalError, match="no pair"):
            entry_session.record(Target(start, end), "2.5", ANN)


def test_a_skip_is_passed_over_with_its_reason_until_somebody_jumps_there(entry_session):
    target = entry_session.guide.next_target(ANN)
    entry_session.skip(target, "behind\nthe heater", ANN)
    assert entry_session.guide.skipped(target.pair) == "behind the heater"
    assert entry_session.guide.next_target(ANN) != target
    entry_session.jump(target, ANN)
    assert entry_session.guide.next_target(ANN) == target


def test_pairs_listed_as_hidden_are_skipped_with_their_reason(room):
    (room.folder / "survey/not_visible.csv").write_text("from,to,reason\nO,3,pillar\n1/*,4,\n")
    entry_session = room.open()
    assert entry_session.guide.skipped(frozenset(("O", "3"))) == "pillar"
    assert entry_session.guide.skipped(frozenset(("1/X", "4"))) == "not visible"
    assert "3" not in [t.end for t in entry_session.guide.following(ANN, 8)]
    entry_session.close()


def test_a_further_stop_is_begun_by_its_name(room):
    entry_session = room.open()
    target = entry_session.begin_stop("27b", ANN)
    assert (target.start, target.end) == ("27b/O", "1")
    with pytest.raises(GtvalError, match="there already"):
        entry_session.begin_stop("27b", ANN)
    for name in ("a/b", "", "a b", "x,y"):
        with pytest.raises(GtvalError, match="cannot be the name"):
            entry_session.begin_stop(name, ANN)
    entry_session.close()
    again = room.open()
    assert again.guide.next_target(ANN) == target
    again.close()


def test_a_second_measurement_from_the_other_end_counts_too(copy):
    entry_session = copy.open()
    target = entry_session.guide.next_target(BOB_BLIND)
    shown = copy.shown[target.pair]
    assert target.start in entry_session.guide.names.world
    answer = entry_session.record(target, f"{float(shown) + 0.003:.3f}", BOB_BLIND)
    assert answer.outcome == "agrees"
    assert len(entry_session.state.counting(target.pair)) == 2
    assert len(rows(copy)) == len(copy.shown) + 1
    entry_session.close()


def test_from_the_other_end_the_laser_stands_on_each_point_once_a_stop(copy):
    entry_session = copy.open()
    entry_session.jump(entry_session.guide.target("O X"), BOB_BLIND)
    targets = entry_session.guide.following(BOB_BLIND, 1000)
    assert {target.pair for target in targets} == set(copy.shown)
    of_stop = [t.start for t in targets if "/" in t.end]
    moves = [a for a, b in pairwise([*of_stop, ""]) if a != b]
    assert sorted(moves) == sorted(set(of_stop))  # never twice on the same world point
    entry_session.close()


def test_who_measures_a_second_time_may_leave_a_pair_out(copy):
    entry_session = copy.open()
    guide = entry_session.guide
    target = guide.next_target(BOB_BLIND)
    left = guide.second_progress(BOB_BLIND).left
    entry_session.skip(target, "cannot stand there", BOB_BLIND)
    assert guide.next_target(BOB_BLIND) != target
    assert entry_session.state.counting(target.pair)  # the first reading stays
    assert guide.skipped(target.pair) is None
    assert guide.second_progress(BOB_BLIND).left == left - 1
    entry_session.close()
    entry_session = copy.open()
    assert target not in entry_session.guide.following(BOB_BLIND, 1000)
    entry_session.jump(target, BOB_BLIND)
    assert entry_session.guide.next_target(BOB_BLIND) == target
    entry_session.undo(BOB_BLIND)
    entry_session.close()


def test_two_people_who_disagree_are_told_no_value_and_measure_again(copy):
    entry_session = copy.open()
    target = entry_session.guide.next_target(BOB_BLIND)
    shown = copy.shown[target.pair]
    other = f"{float(shown) + 0.2:.3f}"
    answer = entry_session.record(target, other, BOB_BLIND)
    assert answer.outcome == "disagrees"
    assert shown not in answer.text
    assert other not in answer.text
    assert len(rows(copy)) == len(copy.shown) - 1
    assert entry_session.disagreeing() == [target.pair]
    assert entry_session.guide.next_target(ANN).pair == target.pair
    settled = entry_session.record(entry_session.guide.next_target(ANN), other, ANN)
    assert settled.outcome == "agrees"
    entry_session.close()


def test_the_second_entry_is_for_the_other_person(copy):
    entry_session = copy.open()
    target = entry_session.guide.target("O 1")
    with pytest.raises(GtvalError, match="other person"):
        entry_session.record(target, copy.shown[target.pair], replace(ANN, second=True))
    entry_session.close()


def test_readings_from_before_are_taken_over_with_their_notes(copy):
    before = rows(copy)
    copy.journal.unlink()
    text = copy.readings.read_text().replace(",,,2\n", ',yes,"a, note",2\n', 1)
    copy.readings.write_text(text)
    entry_session = copy.open()
    assert entry_session.taken_over == len(before)
    assert len(entry_session.state.rows_of_file()) == len(before)
    assert "a, note" in copy.readings.read_text()
    assert entry_session.guide.next_target(ANN) is None
    entry_session.close()


def test_a_time_that_a_file_does_not_say_is_not_made_up(room):
    room.readings.write_text("time,from,to,distance\n,O,X,2.5\n2008-08-06T10:00,O,Y,2.5\n")
    room.open().close()
    assert [row.split(",")[0] for row in rows(room)] == ["", "2008-08-06T10:00"]
    room.open().close()  # it is as derived from the journal


def test_changes_by_hand_are_refused_until_they_are_adopted(copy):
    lines = copy.readings.read_text().splitlines()
    lines[3] = lines[3].replace(lines[3].split(",")[3], "3.999")
    del lines[10]
    copy.readings.write_text("\n".join(lines) + "\n")
    campaign = load_campaign(copy.folder)
    with pytest.raises(GtvalError, match=r"changed by hand: it has 1 row.* lacks 2 reading"):
        EntrySession.open(campaign)
    entry_session = EntrySession.open(campaign, adopt=True)
    assert len(rows(copy)) == len(copy.shown) - 1
    assert "3.999" in copy.readings.read_text()
    entry_session.close()
    copy.open().close()


def test_a_file_that_is_only_late_is_brought_up_to_date(copy):
    text = copy.readings.read_text()
    copy.readings.write_text("".join(text.splitlines(keepends=True)[:-1]))
    copy.open().close()
    assert copy.readings.read_text() == text


def test_rows_that_name_no_point_of_the_campaign_are_an_error_and_nothing_is_made(room):
    room.readings.write_text("from,to,distance\nO,1,2.5\nO,nowhere,2.5\n")
    with pytest.raises(InputError, match="nowhere"):
        room.open()
    assert not room.journal.exists() or room.journal.read_text() == ""


def test_a_simulated_campaign_is_taken_over_with_its_stops(tmp_path):
    room, made = simulated(3, 2)
    write_campaign(tmp_path, made, 3)
    campaign = load_campaign(tmp_path)
    entry_session = EntrySession.open(campaign)
    assert entry_session.taken_over == len(made.readings)
    assert entry_session.guide.names.stops == room.stop_names
    entry_session.close()
    settings = campaign.section("survey", SurveySettings)
    again = load_readings(campaign, settings).used
    assert sorted(again.distance) == sorted(made.shown)
    EntrySession.open(campaign).close()


def test_each_unknown_name_is_told_once_and_no_stop_is_begun(room):
    rows_of_two = "".join(f"1/O,{name},2.5\n" for name in ("1", "nowhere", "nowhere", "2", "far"))
    room.readings.write_text(f"from,to,distance\n8/O,1,2.5\n9/Q,1,2.5\n{rows_of_two}")
    with pytest.raises(InputError) as caught:
        room.open()
    told = [problem.expected.partition(";")[0] for problem in caught.value.problems]
    assert [name.rpartition(" ")[2] for name in told] == ["9/Q", "nowhere", "far"]
    assert not room.journal.exists() or room.journal.read_text() == ""


def test_a_pair_that_is_not_entered_is_told_apart_from_an_unknown_name(room):
    room.readings.write_text("from,to,distance\n1,2,2.5\n")
    with pytest.raises(InputError, match="this pair is not entered here"):
        room.open()


def test_a_reading_is_safe_even_if_the_readings_file_cannot_be_written(
    entry_session, room, monkeypatch
):
    def full(*_, **__):
        raise GtvalError("cannot write: No space left on device")

    monkeypatch.setattr("survey.entry.record.readings_file.write_files", full)
    target = entry_session.guide.next_target(ANN)
    answer = entry_session.record(target, room.shown[target.pair], ANN)
    assert answer.outcome == "recorded"
    assert "behind the journal" in entry_session.readings_file.problem
    monkeypatch.undo()
    target = entry_session.guide.next_target(ANN)
    entry_session.record(target, room.shown[target.pair], ANN)
    assert entry_session.readings_file.problem == ""
    assert len(rows(room)) == 2


def test_formulas_in_names_do_not_reach_a_spreadsheet(entry_session, room):
    target = entry_session.guide.next_target(ANN)
    entry_session.record(target, room.shown[target.pair], Person("=1+1"))
    assert rows(room)[0].split(",")[4] == "'=1+1"


def test_an_empty_remark_is_none(entry_session, room):
    target = entry_session.guide.next_target(ANN)
    number = entry_session.record(target, room.shown[target.pair], ANN).entry.number
    with pytest.raises(GtvalError, match="empty"):
        entry_session.note(number, " \x00 ", ANN)
    assert entry_session.state.notes == {}


def test_the_readings_file_follows_whatever_is_done(entry_session, room):
    """The file that grows line by line is the one that the journal gives as a whole."""
    rng = np.random.default_rng(20261125)
    done = []
    for _ in range(150):
        what = rng.integers(6)
        if what < 2 or not done:
            target = entry_session.guide.next_target(ANN)
            done.append(entry_session.record(target, room.shown[target.pair], ANN).entry)
        elif what == 2:
            entry_session.undo(ANN)
        else:
            one = done[rng.integers(len(done))]
            pair = Target(one.start, one.end)
            if what == 3:
                entry_session.record(pair, "4.321", ANN, again=bool(rng.integers(2)))
            elif what == 4:
                entry_session.note(one.number, 'a "remark", with all', ANN)
            else:
                entry_session.keep(one.number, ANN)
        assert room.readings.read_text() == csv_text(entry_session.state)
