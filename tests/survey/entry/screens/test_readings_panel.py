"""The entry page as a panel: it records what it records alone, and changes nothing by a look."""

import shutil

import pytest
from entry_rooms import enter_all, entry_room
from entry_server import reading
from page_server import PageServer, errors, joined, wait
from web_browser import BROWSER, DRIVER, PHONE, new_browser, sized


def test_a_reading_is_recorded_and_survives_a_kill(tmp_path):
    room = entry_room(5, 1, tmp_path / "room")
    with PageServer(room.folder, tmp_path / "log") as server:
        with server.join("ann") as ann:
            page = ann.get("/readings/").text
            assert 'id="distance"' in page
            assert 'aria-current="page"' in page
            answer = ann.post("/readings/readings", json=reading("one", text="2.501", again=False))
            assert answer.json()["outcome"] == "recorded"
            assert ann.get("/readings/state").json()["by"] == "ann"
            assert [one["name"] for one in ann.get("/versions").json()["panels"]][1] == "readings"
            with server.join("bob") as bob:  # another device, one state
                assert "2.501" in bob.get("/readings/state").text
        server.kill()
    [entry] = room.recorded()
    assert (entry.text, entry.by) == ("2.501", "ann")


def test_where_it_is_open_elsewhere_the_panel_says_so(tmp_path):
    room = entry_room(5, 1, tmp_path / "room")
    opened = room.open()
    try:
        with PageServer(room.folder, tmp_path / "log") as server, server.join() as ann:
            assert "cannot be shown" in ann.get("/readings/").text
            assert ann.post("/readings/readings", json=reading("one")).status_code == 409
    finally:
        opened.close()


def test_a_look_at_readings_written_elsewhere_changes_no_file(tmp_path):
    room = entry_room(5, 1, tmp_path / "room")
    opened = room.open()
    enter_all(opened, room, 5)
    opened.close()
    for path in room.journal.parent.glob("journal*"):
        path.unlink()
    shutil.rmtree(room.folder / "results", ignore_errors=True)
    before = sorted(path.name for path in room.folder.rglob("*"))
    with PageServer(room.folder, tmp_path / "log") as server, server.join() as ann:
        assert "written down in readings.csv" in ann.get("/readings/").text
        now = sorted(path.name for path in room.folder.rglob("*") if path.name != ".page.devices")
        assert now == before
        assert ann.post("/readings/begin", json={}).status_code == 200
        assert 'id="distance"' in ann.get("/readings/").text
    assert len(room.recorded()) == 5


@pytest.mark.full
@pytest.mark.browser
@pytest.mark.skipif(not (BROWSER and DRIVER), reason="Chromium or its driver is not installed")
def test_readings_are_typed_on_a_phone_below_the_panels(tmp_path):
    room = entry_room(5, 1, tmp_path / "room")
    browser = new_browser()
    try:
        with PageServer(room.folder, tmp_path / "log") as server:
            sized(joined(browser, server, "/readings/"), PHONE)
            for _ in range(3):
                pair = frozenset(browser.find_element("id", name).text for name in ("from", "to"))
                count = len(room.recorded())
                browser.find_element("id", "distance").send_keys(f"{room.shown[pair]}\n")
                wait(lambda count=count: len(room.recorded()) == count + 1)
            assert browser.execute_script("return document.documentElement.scrollWidth") <= 390
            assert errors(browser) == []
    finally:
        browser.quit()
