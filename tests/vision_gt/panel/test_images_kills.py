"""Servers and browsers that die amid decisions: what was acknowledged is there, and once."""

import os
import signal
import time
from itertools import pairwise

import numpy as np
import pytest
from imaged_rooms import written
from page_server import Killed, PageServer, joined, wait
from web_browser import new_browser

from vision_gt.images.decisions import image_decisions


def reference(camera):
    return f"vision/reference/{camera}.png"


def decision(number, note):
    return {"image": reference(number % 4 + 1), "decision": "leave-out", "note": note}


@pytest.mark.full
@pytest.mark.parametrize("kills", [100])
def test_no_acknowledged_decision_is_lost_by_a_kill_and_none_is_there_twice(tmp_path, kills):
    folder = tmp_path / "room"
    written(folder)
    rng = np.random.default_rng([20261129, kills])
    page = Killed(folder, tmp_path / "log", "/images/decide", decision)
    for _ in range(kills):
        page.kill_once(rng.uniform(0.02, 0.3))
    with page.served() as (_, client):
        page.send(client)
    page.check([one.note for _, one in image_decisions(folder / "vision/decisions.csv")], kills)


@pytest.mark.full
@pytest.mark.browser
@pytest.mark.parametrize("kills", [8])
def test_a_browser_that_dies_loses_no_acknowledged_decision(tmp_path, kills):
    folder = tmp_path / "room"
    written(folder)
    rng = np.random.default_rng([20261129, kills, 1])
    acknowledged = 0
    with PageServer(folder, tmp_path / "log") as server:
        for _ in range(kills):
            browser = new_browser(f"--user-data-dir={tmp_path / 'profile'}")
            try:
                joined(browser, server, "/images/")
                button = lambda: browser.find_element("id", "leave-out")  # noqa: B023, E731
                wait(lambda: "corners" in browser.find_element("id", "verdict").text)  # noqa: B023
                end = time.monotonic() + rng.uniform(0.3, 1.5)
                while time.monotonic() < end:
                    before = button().text
                    button().click()
                    wait(lambda: button().text != before, 20)  # noqa: B023
                    acknowledged += 1
                button().click()  # and dies before anybody has seen the answer
                os.kill(browser.capabilities["goog:processID"], signal.SIGKILL)
            finally:
                browser.service.stop()
        found = [one.kind for _, one in image_decisions(folder / "vision/decisions.csv")]
        server.check_sound()
    # Left out and used again in turn: none of them twice, and all that were seen.
    assert all(one != other for one, other in pairwise(found))
    assert acknowledged <= len(found) <= acknowledged + kills
