"""Thirty pairs inspected, one moved, many accepted, taken back: the main job from start to end."""

import time

import pytest
from held_up_rooms import AMBIGUOUS, held_up_room
from page_server import PageServer, errors, faults, joined, wait
from web_browser import DESKTOP, PHONE, open_browser, sized

from laser_gt.logs.decision_file import read_decisions

STOPS = [str(number) for number in range(1, 13)]
LOOKED_AT = 30


def title(browser):
    return browser.find_element("id", "pair-title").text


def shown(browser):
    """Whether the pair that the list marks is the one that is drawn."""
    [row] = browser.find_elements("css selector", "#pairs [aria-current] b")
    return title(browser).startswith(f"{row.text}:")


@pytest.mark.full
@pytest.mark.browser
@pytest.mark.parametrize("size", [DESKTOP, PHONE])
def test_thirty_pairs_are_inspected_one_is_moved_and_all_are_accepted(tmp_path, size):
    from selenium.webdriver import ActionChains

    folder = held_up_room(tmp_path / "room", stops=len(STOPS), strict=AMBIGUOUS)

    def decisions():
        made = read_decisions(folder / "laser/decisions.csv", STOPS)
        return {tuple(sorted(pair)): one.kind for pair, one in made.items()}

    with PageServer(folder, tmp_path / "log") as server, open_browser() as browser:
        joined(browser, server, "/matches/")
        sized(browser, size)
        wait(lambda: browser.find_elements("css selector", "#pairs [aria-current]"), 240)
        wait(lambda: shown(browser))
        began, seen = time.monotonic(), [title(browser)]
        for _ in range(LOOKED_AT - 1):
            browser.find_element("id", "next").click()
            wait(lambda: title(browser) != seen[-1] and shown(browser))
            seen.append(title(browser))
        assert len(set(seen)) == LOOKED_AT
        assert time.monotonic() - began < 60  # two seconds each, of this test's five minutes
        assert faults(browser) == []
        # One is moved; it finds back at once, and the guess is taken.
        browser.find_element("id", "move").click()
        canvas = browser.find_element("id", "scans")
        ActionChains(browser).drag_and_drop_by_offset(canvas, 20, 10).perform()
        wait(lambda: "From here the match" in browser.find_element("id", "tried").text)
        browser.find_element("id", "take-guess").click()
        wait(lambda: list(decisions().values()) == ["guess"])
        # The others together, and back.
        wait(lambda: browser.find_elements("css selector", "[data-kind]"))
        press = "document.getElementById('batches').open = true;"
        press += "const b = document.querySelector('[data-kind]'); b.scrollIntoView(); b.click();"
        browser.execute_script(press)
        wait(lambda: "would place" in browser.find_element("id", "batch-text").text)
        browser.find_element("id", "batch-accept").click()
        wait(lambda: "accept" in decisions().values())
        assert len(decisions()) >= LOOKED_AT
        wait(lambda: "All 12 stops are placed" in browser.find_element("id", "placed").text)
        browser.find_element("id", "undo").click()
        wait(lambda: list(decisions().values()) == ["guess"])
        browser.find_element("id", "undo").click()
        wait(lambda: decisions() == {})
        assert faults(browser) == []
        assert errors(browser) == []
        assert server.memory() < 300  # megabytes
