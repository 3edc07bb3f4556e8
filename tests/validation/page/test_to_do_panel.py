"""The list of what to do, and the run that is started, watched and stopped from the page."""

import json
import signal
import sys

import pytest
from page_rooms import written
from page_server import PageServer, errors, faults, joined, picture, wait
from web_browser import DESKTOP, PHONE, sized

from validation.errors import GtvalError
from validation.page.desk import Desk
from validation.page.own.to_do import OpenToDo
from validation.page.runner import Runner


@pytest.fixture(autouse=True)
def interrupted():
    """A shell's background process ignores interrupts, and so would all that it starts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def ended(runner):
    wait(lambda: not runner.state.is_at_work)
    return runner.state


def program(tmp_path, text):
    path = tmp_path / "program.py"
    path.write_text(text)
    return (sys.executable, str(path))


def test_a_run_tells_its_progress_and_its_end(tmp_path):
    said = 'import json\nprint(json.dumps({"what": "x", "share": 0.5}), flush=True)\n'
    runner = Runner(tmp_path, program(tmp_path, said + "input()"))
    assert runner.start("ann").state == "running"
    done = ended(runner)  # input() meets the end of the file
    assert (done.state, done.by, done.share) == ("failed", "ann", 0.5)
    assert "EOFError" in done.what


def test_one_run_at_a_time_which_can_be_stopped(tmp_path):
    waits = "import time\ntry:\n    print('{\"share\": 0}', flush=True)\n    time.sleep(60)\n"
    runner = Runner(tmp_path, program(tmp_path, waits + "except KeyboardInterrupt:\n    exit(130)"))
    runner.start("ann")
    with pytest.raises(GtvalError, match="at work already, started by ann"):
        runner.start("bob")
    wait(lambda: runner.state.what == "")
    runner.stop()
    assert ended(runner).state == "stopped"
    assert runner.start("bob").number == 2
    runner.stop()
    ended(runner)


def test_what_a_run_says_last_is_told_where_it_fails(tmp_path):
    runner = Runner(tmp_path, program(tmp_path, 'print(\'{"error": "bad line 7"}\'); exit(2)'))
    runner.start("")
    assert ended(runner).what == "bad line 7"


def item(subject, text):
    return {"subject": subject, "text": text, "to": "findings", "name": "Findings"}


def test_a_line_that_a_later_run_no_longer_says_is_ticked(tmp_path):
    folder = written(tmp_path)
    (folder / "report").mkdir()
    opened = OpenToDo(Desk(folder, Runner(folder)))

    def lines(*items):
        (folder / "report/to_do.json").write_text(json.dumps({"to_do": items}))
        return [(one["subject"], one["done"]) for one in opened.state()["lines"]]

    first = item("rig", "12 matches may be wrong"), item("stop 3", "Survey this stop again")
    assert lines(*first) == [("rig", False), ("stop 3", False)]
    # Another number is the same line.
    assert lines(item("rig", "7 matches may be wrong")) == [("rig", False), ("stop 3", True)]
    assert lines(*first) == [("rig", False), ("stop 3", False)]
    (folder / "report/to_do.json").write_text("cut sho")
    assert opened.state()["lines"] == []


@pytest.mark.browser
def test_run_and_read_the_report_by_keyboard_alone(served, browser):
    """A run from start to end, then the report; then a file changes and it is out of date."""
    from selenium.webdriver.common.keys import Keys

    sized(joined(browser, served, "/to_do/"), DESKTOP)
    assert "has not been run yet" in browser.find_element("id", "standing").text
    for _ in range(12):
        browser.switch_to.active_element.send_keys(Keys.TAB)
        if browser.switch_to.active_element.get_attribute("id") == "run":
            break
    browser.switch_to.active_element.send_keys(Keys.ENTER)
    wait(lambda: browser.find_element("id", "stop").is_displayed())
    wait(lambda: "run is done" in browser.find_element("id", "run-text").text, 60)
    wait(lambda: "up to date" in browser.find_element("id", "standing").text)
    assert browser.switch_to.active_element.tag_name in ("body", "button")
    picture(browser, "to_do")
    assert faults(browser) == []
    why = browser.find_element("css selector", ".ticks a.why")
    why.send_keys(Keys.ENTER)
    wait(lambda: browser.find_elements("id", "document"))
    browser.switch_to.frame("document")
    wait(lambda: "Ground-truth validation" in browser.find_element("tag name", "body").text)
    browser.switch_to.default_content()
    assert "up to date" in browser.find_element("id", "standing").text
    table = served.folder / "rig.csv"
    table.write_text(table.read_text().replace("1,", "1,", 1) + "99,0,0,0\n")
    wait(lambda: "out of date" in browser.find_element("id", "standing").text)
    for size in (DESKTOP, PHONE):
        sized(browser, size)
        assert faults(browser) == []
        picture(browser, f"report_{size['width']}")
    assert errors(browser) == []


@pytest.mark.browser
def test_a_page_goes_on_after_the_server_died(browser, tmp_path):
    folder = written(tmp_path / "other", 2)
    with PageServer(folder, tmp_path / "log") as first:
        sized(joined(browser, first, "/to_do/"), DESKTOP)
        wait(lambda: browser.find_element("id", "page-link").text == "connected")
        first.kill()
        wait(lambda: "no link" in browser.find_element("id", "page-link").text)
        with PageServer(folder, tmp_path / "log2", "--port", first.port):
            wait(lambda: browser.find_element("id", "page-link").text == "connected")
            assert not browser.find_elements("id", "code")  # still let in


def test_the_terminal_says_what_waits(served):
    from click.testing import CliRunner

    from validation.cli import main

    done = CliRunner().invoke(main, ["open", str(served.folder), "--json"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.output)
    assert told["failed"] == {}
    assert set(told["waiting"]) >= {"to_do", "report"}
