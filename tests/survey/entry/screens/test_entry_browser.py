"""The page in a real browser of the size of a phone."""

import contextlib
import time

import pytest
from entry_rooms import enter_all, entry_room
from entry_server import EntryServer
from web_browser import BROWSER, DRIVER, PHONE, PICTURES, new_browser

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not (BROWSER and DRIVER), reason="Chromium or its driver is not installed"),
]


def phone():
    """A browser of the size of a phone."""
    opened = new_browser()
    opened.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", PHONE)
    return opened


@pytest.fixture(scope="module")
def browsers():
    opened = []
    try:
        opened += [phone(), phone()]
        yield opened
    finally:
        for one in opened:
            one.quit()


@pytest.fixture(scope="module")
def measured_room(tmp_path_factory):
    """A room whose world points are measured; the first mark is next."""
    room = entry_room(seed=3, stops=2, folder=tmp_path_factory.mktemp("web") / "room")
    entry_session = room.open()
    enter_all(entry_session, room, 70)
    entry_session.close()
    return room


@pytest.fixture
def served(measured_room, tmp_path):
    from entry_rooms import copy_of

    room = copy_of(measured_room, tmp_path / "room")
    with EntryServer(room, tmp_path / "log") as server:
        yield server


def join(browser, served, name):
    browser.get(served.url)
    browser.delete_all_cookies()
    browser.execute_script("localStorage.clear()")
    browser.get("about:blank")
    browser.get(f"{served.url}/#{served.code}")
    browser.find_element("id", "name").send_keys(name)
    browser.find_element("css selector", "#join button").click()
    wait(lambda: browser.find_elements("id", "distance"), seconds=60)
    return browser


def wait(condition, seconds=15):
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if condition():
            return
        time.sleep(0.03)
    raise AssertionError("it did not happen")


def text(browser, name):
    return browser.find_element("id", name).text


def type_reading(browser, room, value=None):
    """Type what is shown for the pair on the page, as a distance meter does: digits and Enter."""
    pair = frozenset((text(browser, "from"), text(browser, "to")))
    browser.find_element("id", "distance").send_keys(f"{value or room.shown[pair]}\n")
    return pair


def offline(browser, down):
    browser.execute_cdp_cmd("Network.enable", {})
    browser.execute_cdp_cmd(
        "Network.emulateNetworkConditions",
        {"offline": down, "latency": 0, "downloadThroughput": -1, "uploadThroughput": -1},
    )


def picture(browser, name):
    if PICTURES:
        browser.save_screenshot(f"{PICTURES}/{name}.png")


def recorded(room):
    """Pairs of the readings in the journal, in their order."""
    return [entry.pair for entry in room.recorded()]


def test_a_whole_stop_is_entered_with_the_link_lost_in_the_middle(browsers, served):
    browser, room = join(browsers[0], served, "ann"), served.room
    before = len(recorded(room))
    typed = []
    picture(browser, "next")
    for number in range(48):
        if number == 12:
            offline(browser, down=True)
        if number == 20:
            picture(browser, "offline")
            assert "8 waiting" in text(browser, "link")
            offline(browser, down=False)
            browser.refresh()
            wait(lambda: text(browser, "link") == "connected")
        typed.append(type_reading(browser, room))
        if number < 12:
            wait(lambda n=number: len(recorded(room)) == before + n + 1)
    wait(lambda: len(recorded(room)) >= before + 48)
    assert recorded(room)[before:] == typed
    wait(lambda: text(browser, "from") == "2/O")
    picture(browser, "stop_done")
    offline_noise = ("ERR_INTERNET_DISCONNECTED", "ERR_NETWORK_IO_SUSPENDED")
    errors = [e["message"] for e in browser.get_log("browser")]
    assert [e for e in errors if not any(noise in e for noise in offline_noise)] == []


def test_what_waits_survives_a_closed_page_and_is_delivered_once(browsers, served):
    browser, room = join(browsers[0], served, "ann"), served.room
    before = len(recorded(room))
    offline(browser, down=True)
    typed = [type_reading(browser, room) for _ in range(4)]
    wait(lambda: "kept on this device" in text(browser, "answer"))
    picture(browser, "kept")
    first = browser.current_window_handle
    browser.switch_to.new_window("tab")
    second = browser.current_window_handle
    browser.switch_to.window(first)
    browser.close()
    browser.switch_to.window(second)
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", PHONE)
    assert len(recorded(room)) == before
    browser.get(served.url)
    wait(lambda: len(recorded(room)) == before + 4)
    wait(lambda: text(browser, "link") == "connected")
    browser.refresh()
    wait(lambda: text(browser, "link") == "connected")
    assert recorded(room)[before:] == typed


def test_a_reload_without_the_link_is_asked_about_and_loses_nothing(browsers, served):
    browser, room = join(browsers[0], served, "ann"), served.room
    before = len(recorded(room))
    asks = """
        const leaving = new Event('beforeunload', { cancelable: true });
        return !window.dispatchEvent(leaving);
    """
    wait(lambda: text(browser, "link") == "connected")
    assert not browser.execute_script(asks)
    offline(browser, down=True)
    typed = [type_reading(browser, room) for _ in range(3)]
    wait(lambda: "do not reload" in text(browser, "answer"))
    assert browser.execute_script(asks)
    from selenium.common.exceptions import WebDriverException

    with contextlib.suppress(WebDriverException):  # there is no page without the link
        browser.refresh()
    assert not browser.find_elements("id", "distance")
    offline(browser, down=False)
    browser.get(served.url)
    wait(lambda: len(recorded(room)) == before + 3)
    assert recorded(room)[before:] == typed
    wait(lambda: text(browser, "link") == "connected")


def test_the_second_person_is_led_from_the_other_end_and_sees_no_value(browsers, served):
    browser, room = join(browsers[0], served, "bob"), served.room
    browser.execute_script("document.querySelectorAll('details').forEach((d) => { d.open = true })")
    browser.find_element("id", "second").click()
    wait(lambda: "second entries: 0 of" in text(browser, "progress"))
    assert text(browser, "who") == "bob"
    wait(lambda: text(browser, "from") in ("X", "Y", "XY", *map(str, range(1, 17))))
    assert not browser.find_element("id", "why-again").is_displayed()
    page = browser.find_element("tag name", "main").text
    assert not {value for value in room.shown.values() if value in page}
    pair = type_reading(browser, room, "9.876")
    wait(lambda: "disagree" in text(browser, "answer"))
    assert "9.876" not in text(browser, "answer")
    wait(lambda: text(browser, "doubtful-title").startswith("Doubtful: 1"))
    assert "two entries disagree" in text(browser, "doubtful")
    picture(browser, "second")
    pair = type_reading(browser, room)
    wait(lambda: "both agree" in text(browser, "answer"))
    assert room.shown[pair] in text(browser, "answer")
    wait(lambda: "second entries: 1 of" in text(browser, "progress"))
    laser = text(browser, "from")
    browser.find_element("id", "skip").click()
    browser.find_element("id", "reason").send_keys("a wall\n")
    wait(lambda: "1 skipped" in text(browser, "progress"))
    assert text(browser, "from") == laser
    browser.find_element("id", "second").click()
    wait(lambda: "second" not in text(browser, "progress"))


def test_a_page_goes_on_after_the_laptop_died(browsers, served, tmp_path):
    browser, room = join(browsers[0], served, "ann"), served.room
    before = len(recorded(room))
    first = type_reading(browser, room)
    wait(lambda: len(recorded(room)) == before + 1)
    wait(lambda: text(browser, "link") == "connected")  # the answer has come, too
    port = served.url.rpartition(":")[2]
    served.kill()
    second = type_reading(browser, room)
    wait(lambda: "1 waiting" in text(browser, "link"))
    with EntryServer(room, tmp_path / "again.log", "--port", port) as again:
        # The device is still let in: nobody needs to type a code, and what waits is sent.
        wait(lambda: len(recorded(room)) == before + 2)
        assert not browser.find_elements("id", "code")
        assert again.process.poll() is None
    assert recorded(room)[before:] == [first, second]


def test_a_stop_that_is_good_enough_is_said_with_the_way_on(browsers, measured_room, tmp_path):
    from entry_rooms import copy_of

    room = copy_of(measured_room, tmp_path / "room")
    entry_session = room.open()
    enter_all(entry_session, room, 16 + 16 + 4)
    entry_session.close()
    with EntryServer(room, tmp_path / "log") as server:
        browser = join(browsers[0], server, "ann")
        wait(lambda: "12 more readings are not needed" in text(browser, "enough"))
        picture(browser, "enough")
        type_reading(browser, room)
        wait(lambda: "11 more readings" in text(browser, "enough"))
        browser.find_element("id", "next-stop").click()
        wait(lambda: text(browser, "from") == "2/O")
        assert text(browser, "move") == "Move the laser to 2/O."
        picture(browser, "move")


@pytest.mark.parametrize(("width", "height"), [(320, 568), (360, 640), (820, 1180)])
def test_target_field_and_answer_are_seen_without_scrolling(browsers, served, width, height):
    browser, room = join(browsers[0], served, "ann"), served.room
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride", {**PHONE, "width": width, "height": height}
    )
    try:
        type_reading(browser, room)
        wait(lambda: "ok" in browser.find_element("id", "answer").get_attribute("class"))
        picture(browser, f"width_{width}")
        sizes = browser.execute_script(
            """
            const box = (id) => document.getElementById(id).getBoundingClientRect();
            return [document.documentElement.scrollWidth, box('answer').bottom, box('from').top,
                    Math.min(...['undo', 'again', 'keep', 'skip'].map((id) => box(id).height))];
            """
        )
    finally:
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", PHONE)
    assert sizes[0] <= width
    assert 0 <= sizes[2] < sizes[1] <= height
    assert sizes[3] >= 44  # pixels, the least for a thumb


def test_a_doubtful_reading_is_said_with_what_would_fit_and_comes_back(browsers, served):
    browser, room = join(browsers[0], served, "ann"), served.room
    for _ in range(8):
        type_reading(browser, room)
    wait(lambda: "fits" in text(browser, "answer"))
    pair = frozenset((text(browser, "from"), text(browser, "to")))
    shown = room.shown[pair]
    slipped = shown[:3] + shown[4] + shown[3]
    assert slipped != shown
    type_reading(browser, room, slipped)
    wait(lambda: "DOUBTFUL" in text(browser, "answer"))
    assert shown in text(browser, "answer")
    picture(browser, "doubtful")
    wait(lambda: text(browser, "doubtful-title") == "Doubtful: 1")
    browser.find_element("id", "again").click()
    assert frozenset((text(browser, "from"), text(browser, "to"))) == pair
    type_reading(browser, room, shown)
    wait(lambda: text(browser, "doubtful-title") == "Doubtful: 0")


def test_two_phones_see_one_state(browsers, served):
    one, two = join(browsers[0], served, "ann"), join(browsers[1], served, "bob")
    room = served.room
    first = (text(one, "from"), text(one, "to"))
    assert (text(two, "from"), text(two, "to")) == first
    type_reading(one, room)
    wait(lambda: (text(two, "from"), text(two, "to")) != first)
    # Both type the same display: one reading counts, the other is set aside and said so.
    wait(lambda: text(two, "to") == text(one, "to"))
    offline(two, down=True)
    type_reading(two, room)
    type_reading(one, room)
    wait(lambda: "ok" in one.find_element("id", "answer").get_attribute("class"))
    offline(two, down=False)
    wait(lambda: "set aside" in text(two, "answer"))


def test_everything_can_be_done_by_keyboard_and_has_a_label(browsers, served):
    browser = join(browsers[0], served, "ann")
    unnamed = browser.execute_script(
        """
        const named = (e) =>
          e.labels?.length || e.getAttribute('aria-label') || e.textContent.trim();
        return [...document.querySelectorAll('input, button, summary')]
          .filter((e) => !named(e)).map((e) => e.outerHTML);
        """
    )
    assert unnamed == []
    assert browser.switch_to.active_element.get_attribute("id") == "distance"
    reached = set()
    from selenium.webdriver.common.keys import Keys

    for _ in range(12):
        browser.switch_to.active_element.send_keys(Keys.TAB)
        reached.add(browser.execute_script("return document.activeElement.id"))
    assert {"undo", "again", "keep", "skip"} <= reached
    # Digits go to the field wherever the focus is: a distance meter is a keyboard.
    browser.execute_script("document.getElementById('undo').focus()")
    browser.switch_to.active_element.send_keys("5")
    assert browser.switch_to.active_element.get_attribute("id") == "distance"
    live = browser.find_element("id", "answer")
    assert live.get_attribute("aria-live") == "assertive"


def test_a_phone_needs_no_sideways_scrolling_and_script_in_a_note_is_text(browsers, served):
    browser, room = join(browsers[0], served, "ann"), served.room
    type_reading(browser, room)
    wait(lambda: "ok" in browser.find_element("id", "answer").get_attribute("class"))
    hostile = (
        "<img src=x onerror=\"document.title='taken'\"><script>document.title='taken'</script>"
    )
    browser.execute_script("document.querySelectorAll('details').forEach((d) => { d.open = true })")
    browser.find_element("id", "note").send_keys(hostile + "\n")
    wait(lambda: "onerror" in text(browser, "recent"))
    browser.refresh()
    wait(lambda: text(browser, "link") == "connected")
    browser.execute_script("document.querySelectorAll('details').forEach((d) => { d.open = true })")
    wait(lambda: "onerror" in text(browser, "recent"))
    assert browser.title != "taken"
    assert browser.execute_script("return document.documentElement.scrollWidth") <= PHONE["width"]
    picture(browser, "all_open")


def test_the_page_is_ready_within_a_second(browsers, served):
    browser = join(browsers[0], served, "ann")
    browser.refresh()
    timing = "return performance.getEntriesByType('navigation')[0].domComplete"
    wait(lambda: browser.execute_script(timing) > 0)
    assert browser.execute_script(timing) < 1000
