"""Signals laid over each other in the browser, and parts dragged, at any size and by any means."""

import re

import numpy as np
import pytest
from drive_rooms import LATE, driven
from page_server import PageServer, errors, faults, joined, picture, wait
from web_browser import DESKTOP, PHONE, sized


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = driven(tmp_path_factory.mktemp("driven") / "drive")
    with PageServer(folder, folder.parent / "log") as server:
        yield server
        assert server.memory() < 300  # megabytes
        server.check_sound()


@pytest.fixture(scope="module")
def bob(drive):
    with drive.join("bob") as client:
        yield client


PART = {"reference": "rig", "source": "camera", "from": 2, "to": 20, "moved": 0}


def test_the_delay_of_a_part_is_near_the_truth_wherever_it_was_put(bob):
    for moved in (0, -1.5):
        found = bob.post("/trajectories/part", json={**PART, "moved": moved}).json()
        assert found["verdict"] == "determined"
        # Three half widths of a 95 % interval are six standard deviations.
        half = (found["high"] - found["low"]) / 2
        assert abs(found["delay"] + LATE) < 3 * half < 0.05
        assert found["low"] < found["delay"] < found["high"]
    whole = bob.get("/trajectories/clock?reference=rig&source=camera").json()
    assert whole["low"] - 0.005 < -LATE < whole["high"] + 0.005


def test_signals_are_thinned_cut_and_broken_at_gaps(bob):
    signals = bob.get("/trajectories/signals?reference=rig&source=camera").json()
    assert len(signals["reference"]["times"]) <= 2500
    assert signals["reference"]["breaks"] == []
    times = np.array(signals["source"]["times"])
    [gap] = signals["source"]["breaks"]
    assert times[gap + 1] - times[gap] > 3
    # The headings of both are one curve, but for what the camera's stamps are late by.
    own, there = (np.array(signals[name]["heading"], float) for name in ("source", "reference"))
    off = own - np.interp(times - LATE, signals["reference"]["times"], there)
    assert np.abs(off - np.median(off)).max() < 6 * np.degrees(0.01) + 0.5
    close = bob.get("/trajectories/signals?reference=rig&source=camera&from=5&to=6").json()
    assert len(close["reference"]["times"]) in (50, 51)


@pytest.mark.parametrize(
    "changed",
    [
        {"source": "outside"},
        {"source": "../outside"},
        {"source": "camera.csv"},
        {"source": ""},
        {"source": ["camera"]},
        {"reference": "<script>"},
        {"from": 3, "to": 3},
        {"from": "2"},
        {"to": None},
        {"to": 1e12},
        {"moved": 1e6},
        {"moved": True},
        {"from": 1000, "to": 1001},
        {"moved": 3000},
    ],
)
def test_what_is_no_part_of_a_trajectory_of_the_campaign_is_refused(bob, changed):
    answer = bob.post("/trajectories/part", json={**PART, **changed})
    assert answer.status_code in (400, 409), answer.text
    assert "outside.csv" not in answer.text


def test_numbers_that_are_none_are_refused(bob):
    content = '{"reference":"rig","source":"camera","from":NaN,"to":Infinity,"moved":0}'
    kind = {"Content-Type": "application/json"}
    assert bob.post("/trajectories/part", content=content, headers=kind).status_code == 400
    for query in ("from=nan&to=5", "from=1", "from=5&to=1", "from=x&to=y", "from=0&to=inf"):
        path = f"/trajectories/signals?reference=rig&source=camera&{query}"
        assert bob.get(path).status_code == 400
    for path in ("signals", "clock"):
        answer = bob.get(f"/trajectories/{path}?reference=rig&source=outside")
        assert answer.status_code == 409


def part_told(browser):
    return browser.find_element("id", "part-told").text


def found(browser):
    """The delay of the part that the page shows, milliseconds; None while it works it out."""
    said = part_told(browser)
    return float(said.split(" ms")[0].replace("−", "-")) if "found in" in said else None


def plot(browser):
    return browser.execute_script(
        "const b = document.getElementById('plot').getBoundingClientRect();"
        "return [b.left, b.top, b.width, b.height]"
    )


def numbers(browser):
    """First and last second of the part, and by how much it is moved."""
    names = ("first", "last", "moved")
    return [float(browser.find_element("id", one).get_attribute("value")) for one in names]


def view(browser):
    """The first and the last second that the plot shows, to a tenth."""
    label = browser.find_element("id", "plot").get_attribute("aria-label")
    return [float(part) for part in re.search(r"(-?[\d.]+) to (-?[\d.]+) s", label).groups()]


def to_part(browser):
    """The view of the part alone, with all of its points."""
    browser.find_element("id", "to-part").click()
    first, last, _ = numbers(browser)
    wait(lambda: np.ptp(view(browser)) < 1.4 * (last - first))
    browser.execute_script("document.getElementById('plot').scrollIntoView({block: 'center'})")


def on_edge(browser, name):
    """Where an edge, or the middle, of the part is on the screen, by what is told of the view."""
    left, top, width, height = plot(browser)
    (first, last, moved), (start, end) = numbers(browser), view(browser)
    time = {"first": first, "last": last, "middle": (first + last) / 2}[name] + moved
    return left + 1 + 52 + (time - start) / (end - start) * (width - 2 - 52 - 18), top + height / 3


def drag(browser, place, by, *, touch=False):
    x, y = place
    kinds = ("touchStart", "touchMove", "touchEnd") if touch else (
        "mousePressed", "mouseMoved", "mouseReleased"
    )  # fmt: skip
    for kind, at in zip(
        (kinds[0], *[kinds[1]] * 4, kinds[2]), (0, 0.25, 0.5, 0.75, 1, 1), strict=True
    ):
        if touch:
            points = [] if kind == "touchEnd" else [{"x": x + at * by, "y": y}]
            browser.execute_cdp_cmd(
                "Input.dispatchTouchEvent", {"type": kind, "touchPoints": points}
            )
        else:
            said = {"type": kind, "x": x + at * by, "y": y, "button": "left", "clickCount": 1}
            browser.execute_cdp_cmd("Input.dispatchMouseEvent", said)


@pytest.mark.browser
@pytest.mark.parametrize(
    ("size", "touch"), [(DESKTOP, False), pytest.param(PHONE, True, marks=pytest.mark.full)]
)
def test_a_part_is_dragged_by_mouse_and_by_touch_and_its_delay_shows(browser, drive, size, touch):
    sized(browser, DESKTOP)
    joined(browser, drive, "/trajectories/")
    sized(browser, size)
    wait(lambda: "As a whole: −1" in browser.find_element("id", "whole").text)
    wait(lambda: found(browser) is not None)
    picture(browser, f"trajectories_{size['width']}")
    assert faults(browser) == []
    to_part(browser)
    before = float(browser.find_element("id", "first").get_attribute("value"))
    drag(browser, on_edge(browser, "first"), 40, touch=touch)
    wait(lambda: float(browser.find_element("id", "first").get_attribute("value")) > before + 0.2)
    wait(lambda: found(browser) is not None)
    to_part(browser)
    drag(browser, on_edge(browser, "middle"), 12, touch=touch)
    wait(lambda: found(browser) is not None and abs(found(browser) + 1000 * LATE) < 20)
    # It stands where it was found.
    wait(
        lambda: abs(float(browser.find_element("id", "moved").get_attribute("value")) + LATE) < 0.02
    )
    picture(browser, f"trajectories_part_{size['width']}")
    assert faults(browser) == []
    assert errors(browser) == []


@pytest.mark.full
@pytest.mark.browser
def test_by_keyboard_alone_and_a_file_that_changes_shows(browser, drive):
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.keys import Keys

    sized(browser, PHONE)
    joined(browser, drive, "/trajectories/")
    wait(lambda: found(browser) is not None)
    keys = lambda *some: ActionChains(browser).send_keys(*some).perform()  # noqa: E731
    keys("n")
    wait(
        lambda: "part 2" in browser.find_element("css selector", "#parts [aria-pressed=true]").text
    )
    wait(lambda: found(browser) is not None)
    browser.execute_script("document.getElementById('plot').focus()")
    ActionChains(browser).key_down(Keys.SHIFT).send_keys(*[Keys.ARROW_RIGHT] * 10).key_up(
        Keys.SHIFT
    ).perform()
    wait(
        lambda: (
            abs(float(browser.find_element("id", "moved").get_attribute("value")) - 0.2 + LATE)
            < 0.03
        )
    )
    wait(
        lambda: abs(float(browser.find_element("id", "moved").get_attribute("value")) + LATE) < 0.02
    )
    for signal in ("turn", "speed", "heading"):
        browser.find_element("css selector", f"[data-signal={signal}]").send_keys(Keys.SPACE)
    keys("a", "z", "+", "-", "0")
    moved = browser.find_element("id", "last")
    moved.send_keys(Keys.ARROW_UP)
    wait(lambda: found(browser) is not None)
    # The reference is the other one: the delay is the other way round.
    browser.find_element("id", "reference").send_keys("cam")
    wait(lambda: browser.find_element("id", "source-title").text == "rig against camera")
    wait(lambda: "As a whole: 1" in browser.find_element("id", "whole").text)
    (drive.folder / "camera.csv").touch()
    wait(lambda: "As a whole: 1" in browser.find_element("id", "whole").text)
    assert errors(browser) == []
