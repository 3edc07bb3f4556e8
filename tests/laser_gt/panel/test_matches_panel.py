"""Matches looked at, decided on and moved in the browser; and no decision lost however it ends."""

import re
import time

import numpy as np
import pytest
from held_up_rooms import copied, held_up_room
from page_server import (
    Killed,
    PageServer,
    errors,
    faults,
    joined,
    picture,
    wait,
    waiting_in,
    waits_in,
)
from web_browser import DESKTOP, PHONE, open_browser, sized

from laser_gt.logs.decision_file import decision_history, read_decisions

pytestmark = pytest.mark.xdist_group("matches")  # one room for all

STOPS = ("1", "2", "3")
PAIRS = (("1", "2"), ("1", "3"), ("2", "3"))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A room whose matches are kept: only held up ones, so that no stop is placed."""
    folder = held_up_room(tmp_path_factory.mktemp("held") / "room")
    with PageServer(folder, folder.parent / "log") as server, server.join() as ann:
        ann.get("/matches/")
        wait(lambda: ann.get("/matches/pair?reference=1&moving=2").status_code == 200, 60)
    return folder


@pytest.fixture
def served(made, tmp_path):
    folder = copied(made, tmp_path / "room")
    with PageServer(folder, tmp_path / "log") as server:
        yield server
        assert server.memory() < 300  # megabytes
        said = server.log.read_text()
        assert "Traceback" not in said


@pytest.fixture(scope="module")
def browser():
    with open_browser() as opened:
        yield opened


def decisions(served):
    return read_decisions(served.folder / "laser/decisions.csv", STOPS)


def ready(client):
    client.get("/matches/")
    wait(lambda: client.get("/matches/pair?reference=1&moving=2").status_code == 200, 60)


@pytest.mark.parametrize(
    "said",
    [
        {"decision": "accept"},
        {"reference": "1", "moving": "2"},
        {"reference": "1", "moving": "2", "decision": "keep"},
        {"reference": "1", "moving": "../2", "decision": "accept"},
        {"reference": "1", "moving": "<script>", "decision": "accept"},
        {"reference": "1", "moving": "2\nx,y", "decision": "accept"},
        {"reference": "1", "moving": "2", "decision": "guess"},
        {"reference": "1", "moving": "2", "decision": "guess", "x": 1e9, "y": 0, "theta": 0},
        {"reference": "1", "moving": "2", "decision": "guess", "x": "1", "y": 0, "theta": 0},
        {"reference": ["1"], "moving": "2", "decision": "accept"},
    ],
)
def test_what_is_no_decision_is_refused_and_records_nothing(refusing, said):
    served, ann = refusing
    answer = ann.post("/matches/decide", json=said)
    assert answer.status_code in (400, 409), answer.text
    assert not (served.folder / "laser/decisions.csv").exists()


@pytest.fixture(scope="module")
def refusing(made, tmp_path_factory):
    folder = copied(made, tmp_path_factory.mktemp("refusing") / "room")
    with PageServer(folder, folder.parent / "log") as server, server.join() as client:
        ready(client)
        yield server, client


def test_infinity_is_no_place(refusing):
    _, ann = refusing
    said = '{"reference": "1", "moving": "2", "x": Infinity, "y": NaN, "theta": 0}'
    for path in ("try", "decide"):
        answer = ann.post(
            f"/matches/{path}", content=said, headers={"Content-Type": "application/json"}
        )
        assert answer.status_code == 400


@pytest.mark.full
def test_a_name_with_a_formula_or_markup_stays_text(made, tmp_path):
    folder = copied(made, tmp_path / "room")
    with PageServer(folder, tmp_path / "log") as server, server.join("=1+1<b>") as eve:
        ready(eve)
        said = {"reference": "1", "moving": "2", "decision": "accept"}
        assert eve.post("/matches/decide", json=said).json() == {"recorded": 1}
        wait(lambda: "accept by" in eve.get("/matches/list").text)
        assert "<b>" not in eve.get("/matches/list").text.replace("<b>1 –", "").replace(
            "<b>2 –", ""
        )


def test_what_has_changed_since_it_was_looked_at_is_not_accepted(made, tmp_path):
    folder = copied(made, tmp_path / "room")
    with PageServer(folder, tmp_path / "log") as server, server.join() as ann:
        ready(ann)
        [kind] = set(re.findall(r'data-kind="([^"]+)"', ann.get("/matches/list").text))
        looked = ann.post("/matches/batch", json={"kind": kind, "look": True}).json()
        assert looked["count"] == 3
        first, *_ = looked["pairs"]
        said = {"reference": first[0], "moving": first[1], "decision": "reject"}
        assert ann.post("/matches/decide", json=said).status_code == 200
        answer = ann.post("/matches/batch", json={"kind": kind, "pairs": looked["pairs"]})
        assert answer.status_code == 409
        assert "look again" in answer.json()["error"]
        assert len(decisions(server)) == 2  # the one pair, named either way round
        looked = ann.post("/matches/batch", json={"kind": kind, "look": True}).json()
        assert looked["count"] == 2
        answer = ann.post("/matches/batch", json={"kind": kind, "pairs": looked["pairs"]})
        assert answer.json() == {"recorded": 2}


def decision(number, note):
    reference, moving = PAIRS[number % 3]
    return {"reference": reference, "moving": moving, "decision": "accept", "note": note}


@pytest.mark.parametrize("kills", [1, pytest.param(100, marks=pytest.mark.full)])
def test_no_acknowledged_decision_is_lost_by_a_kill_and_none_is_there_twice(made, tmp_path, kills):
    folder = copied(made, tmp_path / "room")
    rng = np.random.default_rng([20261129, kills])
    page = Killed(folder, tmp_path / "log", "/matches/decide", decision, ready)
    for _ in range(kills):
        page.kill_once(rng.uniform(0.02, 0.4))
    # The one that got no answer is sent again, as the page does.
    with page.served() as (_, client):
        page.send(client)
    history = decision_history(folder / "laser/decisions.csv", STOPS)
    page.check([one.note for _, one in history], kills)


def title(browser):
    return browser.find_element("id", "pair-title").text


def shown(browser):
    wait(lambda: browser.find_elements("css selector", "#pairs [aria-current]"), 60)
    wait(lambda: "Choose" not in title(browser))


@pytest.mark.browser
def test_pairs_are_inspected_moved_accepted_together_and_taken_back_by_mouse(browser, served):
    from selenium.webdriver import ActionChains

    sized(joined(browser, served, "/matches/"), DESKTOP)
    shown(browser)
    assert "0 of 3 stops are placed" in browser.find_element("id", "placed").text
    for size in (DESKTOP, PHONE):
        sized(browser, size)
        picture(browser, f"matches_{size['width']}")
        assert faults(browser) == []
    sized(browser, DESKTOP)
    first = title(browser)
    canvas = browser.find_element("id", "scans")
    for name in ("residuals", "normals", "when", "zoom-in", "fit"):
        browser.find_element("id", name).click()
    browser.find_element("id", "when").click()
    browser.find_element("id", "reject").click()
    wait(lambda: title(browser) != first)
    wait(lambda: {one.kind for one in decisions(served).values()} == {"reject"})
    # The blue scan is dragged away; it finds back at once.
    browser.find_element("id", "move").click()
    ActionChains(browser).drag_and_drop_by_offset(canvas, 25, 12).perform()
    wait(lambda: "From here the match" in browser.find_element("id", "tried").text)
    picture(browser, "matches_moved")
    assert faults(browser) == []
    browser.find_element("id", "take-guess").click()
    wait(lambda: {one.kind for one in decisions(served).values()} == {"reject", "guess"})
    for _ in range(2):
        browser.find_element("id", "undo").click()
        time.sleep(0.1)
    wait(lambda: decisions(served) == {})
    # All that one thing holds up, together.
    wait(lambda: "Accept all 3" in browser.find_element("id", "batches").text)
    wait(lambda: browser.find_element("css selector", "[data-kind]").click() is None)
    wait(lambda: "would place 3 more" in browser.find_element("id", "batch-text").text)
    picture(browser, "matches_batch")
    browser.find_element("id", "batch-accept").click()
    wait(lambda: len(decisions(served)) == 6)
    wait(lambda: "All 3 stops are placed" in browser.find_element("id", "placed").text)
    assert errors(browser) == []
    assert faults(browser) == []
    browser.find_element("id", "undo").click()
    wait(lambda: decisions(served) == {})


@pytest.mark.browser
def test_pairs_are_inspected_by_keyboard_alone_and_others_see_it(browser, served):
    from selenium.webdriver.common.keys import Keys

    sized(joined(browser, served, "/matches/"), PHONE)
    shown(browser)
    browser.find_element("css selector", "#pairs button").send_keys("j")
    wait(lambda: "aria-current" in browser.find_elements("css selector", "#pairs button")[1]
         .get_attribute("outerHTML"))  # fmt: skip
    browser.switch_to.active_element.send_keys("m")
    canvas = browser.find_element("id", "scans")
    assert browser.switch_to.active_element == canvas
    canvas.send_keys(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, ",")
    wait(lambda: "From here the match" in browser.find_element("id", "tried").text)
    canvas.send_keys(Keys.ESCAPE)
    assert browser.switch_to.active_element.get_attribute("id") == "move"
    browser.switch_to.active_element.send_keys("a")
    wait(lambda: {one.kind for one in decisions(served).values()} == {"accept"})
    browser.switch_to.active_element.send_keys("u")
    wait(lambda: decisions(served) == {})
    # Another program decides: that shows, too.
    path = served.folder / "laser/decisions.csv"
    with path.open("a") as stream:
        stream.write("now,1,2,reject,,,,a program,\n")
    wait(lambda: "reject by a program" in browser.find_element("id", "pairs").text)
    sized(browser, DESKTOP)
    assert errors(browser) == []


@pytest.mark.full
@pytest.mark.browser
def test_a_decision_waits_for_the_link(browser, served):
    sized(joined(browser, served, "/matches/"), PHONE)
    shown(browser)
    served.process.send_signal(19)  # stopped: it answers no more
    try:
        waits_in(browser, "matches", {"reference": "1", "moving": "2", "decision": "accept"})
    finally:
        served.process.send_signal(18)
    browser.refresh()
    wait(lambda: len(decisions(served)) == 2)
    wait(lambda: waiting_in(browser, "matches") == [])
