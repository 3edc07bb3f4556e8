import pytest
from click.testing import CliRunner
from entry_rooms import ANN, BOB, enter_all, until

from survey.entry.dialogue.report import entry_report
from validation.campaign.folder import load_campaign
from validation.cli import main
from validation.page.people import Person

BOB_BLIND = Person("bob", second=True)


def codes(room):
    return {f.code: f for f in entry_report(load_campaign(room.folder)).findings}


def tables(room):
    (section,) = entry_report(load_campaign(room.folder)).sections
    return {block.title: block for block in section.blocks}


def test_without_a_journal_there_is_nothing_to_say(room):
    report = entry_report(load_campaign(room.folder))
    assert (report.findings, report.sections) == ((), ())


@pytest.fixture
def entered(room):
    """A room entered by two people, with a slip corrected, one left, and double entries."""
    entry_session = room.open()
    target = until(entry_session, room, "1/O 9")
    entry_session.record(target, "1.234", ANN)
    entry_session.record(target, room.shown[target.pair], ANN, again=True)
    entry_session.skip(entry_session.guide.target("1/Y 3"), "behind the heater", ANN)
    enter_all(entry_session, room)
    left = entry_session.guide.target("1/X 5")
    entry_session.record(left, f"{float(room.shown[left.pair]) + 0.1:.3f}", BOB, again=True)
    entry_session.jump(entry_session.guide.target("X 1"), ANN)
    while (target := entry_session.guide.next_target(BOB_BLIND)).end == "X":
        entry_session.record(target, room.shown[target.pair], BOB_BLIND)
    wrong = entry_session.guide.next_target(BOB_BLIND)
    entry_session.record(wrong, "19.000", BOB_BLIND)
    entry_session.close()
    return room


def test_who_measured_how_much_and_what_became_of_it(entered):
    people = {row[0]: row for row in tables(entered)["Who measured"].rows}
    assert set(people) == {"ann", "bob"}
    assert dict(tables(entered)["What they measured"].rows)["ann"] == "O, X, Y, XY, stop 1"
    fates = dict(tables(entered)["Corrections"].rows)
    assert fates["replaced by a new reading"] == 2
    assert fates["numbers entered"] == sum(row[1] for row in people.values())
    skipped = dict(tables(entered)["Pairs not measured"].rows)
    assert skipped["behind the heater"] == 1


def test_what_is_doubtful_still_is_a_warning_that_names_it(entered):
    finding = codes(entered)["entry-doubtful"]
    assert finding.severity == "warning"
    assert "1/X–5" in finding.text


def test_two_people_who_disagree_are_a_warning_and_rates_are_in_the_table(entered):
    assert codes(entered)["entry-disagrees"].severity == "warning"
    rates = dict(tables(entered)["Blind second entries"].rows)
    total = int(rates["pairs entered by two people"])
    assert rates["agreed at once"] == f"{total - 1} ({100 * (total - 1) / total:.1f} %)"
    assert rates["still open"] == "1"


def test_a_file_behind_the_journal_is_an_error(entered):
    assert "entry-file-differs" not in codes(entered)
    lines = entered.readings.read_text().splitlines(keepends=True)
    entered.readings.write_text("".join(lines[:-1]))
    assert codes(entered)["entry-file-differs"].severity == "error"


def test_the_survey_reports_it_and_script_in_names_and_remarks_is_text(entered):
    hostile = "</td><script>alert(1)</script><img src=x onerror=alert(2)>"
    eve = Person(hostile)
    entry_session = entered.open()
    target = entry_session.guide.target("1/Y 4")
    again = entry_session.record(target, entered.shown[target.pair], eve, again=True)
    entry_session.note(again.entry.number, hostile, eve)
    entry_session.skip(entry_session.guide.target("1/Y 2"), hostile, eve)
    entry_session.undo(eve)
    entry_session.skip(entry_session.guide.target("1/Y 3"), hostile, eve)
    entry_session.close()
    done = CliRunner().invoke(main, ["run", str(entered.folder)])
    assert done.exit_code == 0, done.output
    page = (entered.folder / "report" / "report.html").read_text()
    assert "How the readings were taken" in page
    assert "&lt;script&gt;alert(1)" in page
    assert "<script>alert" not in page
    assert "<img src=x" not in page
    assert "&lt;img src=x" in page  # the remark is there, as text


def test_remarks_are_in_the_report(room):
    entry_session = room.open()
    enter_all(entry_session, room, 3)
    entry_session.note(2, "stand moved", BOB)
    entry_session.close()
    (remark,) = tables(room)["Remarks"].rows
    assert remark[0] == "O–Y"
    assert remark[-1] == "stand moved"
