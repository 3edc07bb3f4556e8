"""Images looked at and decided on in the browser, by mouse, by touch and by keyboard alone."""

import contextlib
import shutil
import time

import numpy as np
import pytest
from imaged_rooms import written
from page_server import PageServer, errors, faults, joined, picture, wait, waiting_in, waits_in
from web_browser import DESKTOP, PHONE, open_browser, sized

from vision_gt.images.decisions import decided, image_decisions

CAMERAS = ("1", "2", "3", "4")


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """A campaign with reference images of four cameras, and where the corners are in them."""
    folder = tmp_path_factory.mktemp("imaged") / "room"
    return folder, written(folder)


@pytest.fixture(scope="module")
def served(room):
    folder, _ = room
    with PageServer(folder, folder.parent / "log") as server:
        yield server
        assert server.memory() < 300  # megabytes
        server.check_sound()


@pytest.fixture(scope="module")
def ann(served):
    with served.join("ann") as client:
        yield client


@pytest.fixture(scope="module")
def browser():
    with open_browser() as opened:
        yield opened


@pytest.fixture
def history(served):
    """All decisions, of a test that begins without any."""
    path = served.folder / "vision/decisions.csv"
    path.unlink(missing_ok=True)
    return lambda: image_decisions(path)


def reference(camera):
    return f"vision/reference/{camera}.png"


# -- strangers and mistakes -------------------------------------------------------------------


@pytest.mark.parametrize(
    "said",
    [
        {"decision": "use"},
        {"image": reference(1)},
        {"image": reference(1), "decision": "keep"},
        {"image": "vision/reference/9.png", "decision": "leave-out"},
        {"image": "campaign.toml", "decision": "leave-out"},
        {"image": "../../etc/passwd", "decision": "leave-out"},
        {"image": "/etc/passwd", "decision": "leave-out"},
        {"image": "vision/reference/../reference/1.png", "decision": "leave-out"},
        {"image": f"{reference(1)}\x00", "decision": "leave-out"},
        {"image": f"{reference(1)}\nx", "decision": "leave-out"},
        {"image": [reference(1)], "decision": "leave-out"},
        {"image": reference(1), "decision": "corner"},
        {"image": reference(1), "decision": "corner", "x": 1},
        {"image": reference(1), "decision": "corner", "x": "1", "y": 2},
        {"image": reference(1), "decision": "corner", "x": 1e9, "y": 2},
        {"image": reference(1), "decision": "corner", "x": True, "y": 2},
        {"image": reference(1), "decision": "corner", "x": 1, "y": 2, "axis_x": 3},
        {"image": reference(1), "decision": "corner", "axis_x": 3, "axis_y": 3},
        {"image": reference(1), "decision": "leave-out", "x": 1, "y": 2},
    ],
)
def test_what_is_no_decision_is_refused_and_records_nothing(ann, history, said):
    answer = ann.post("/images/decide", json=said)
    assert answer.status_code in (400, 409), answer.text
    assert history() == []


def test_no_number_that_is_none_is_a_place(ann, history):
    content = f'{{"image": "{reference(1)}", "decision": "corner", "x": NaN, "y": Infinity}}'
    kind = {"Content-Type": "application/json"}
    assert ann.post("/images/decide", content=content, headers=kind).status_code == 400
    assert history() == []


@pytest.mark.parametrize(
    "image",
    ["", "campaign.toml", "../room/campaign.toml", "/etc/passwd", "vision", "vision/reference",
     "vision/../vision/reference/1.png", "vision/reference/1.png\x00", "VISION/reference/1.png",
     "vision/link.png", "vision/poses/out/pose1.png"],
)  # fmt: skip
def test_only_images_of_the_campaign_are_shown(served, ann, tmp_path_factory, image):
    outside = tmp_path_factory.mktemp("outside") / "pose1.png"
    shutil.copy(served.folder / reference(1), outside)
    link, folder = served.folder / "vision/link.png", served.folder / "vision/poses/out"
    folder.parent.mkdir(exist_ok=True)
    link.symlink_to(outside)
    folder.symlink_to(outside.parent)
    try:
        for path in ("picture", "look"):
            answer = ann.get(f"/images/{path}", params={"image": image, "width": "64"})
            assert answer.status_code == 409, answer.text
            assert "error" in answer.json()
        said = {"image": image or "x", "decision": "leave-out"}
        assert ann.post("/images/decide", json=said).status_code == 409
    finally:
        link.unlink()
        folder.unlink()
    assert not (served.folder / "vision/decisions.csv").exists()


@pytest.mark.parametrize("width", ["", "x", "-1", "1e3", "٣", "999999999", "1.5"])
def test_a_width_is_a_whole_number(ann, width):
    answer = ann.get("/images/picture", params={"image": reference(1), "width": width})
    assert answer.status_code == 400


def test_a_picture_is_no_larger_than_asked_for(ann):
    import cv2

    for width, expected in (("64", 64), ("1", 32), ("4000", 640)):
        answer = ann.get("/images/picture", params={"image": reference(1), "width": width})
        assert answer.headers["content-type"] == "image/jpeg"
        assert answer.headers["cache-control"] == "no-store"
        found = cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_GRAYSCALE)
        assert found.shape[1] == expected


def test_a_name_with_markup_stays_text_and_a_damaged_image_is_told(served, ann, history):
    name = "vision/reference/<img src=x onerror=alert(1)>.png"
    path = served.folder / name
    path.write_bytes((served.folder / reference(1)).read_bytes()[:500])
    try:
        assert "<img" not in ann.get("/images/list").text
        assert "&lt;img" in ann.get("/images/list").text
        for route in ("picture", "look"):
            answer = ann.get(f"/images/{route}", params={"image": name, "width": "64"})
            assert answer.status_code == 409
            assert "truncated" in answer.json()["error"]
        assert ann.post("/images/decide", json={"image": name, "decision": "leave-out"}).json() == {
            "recorded": 1
        }
        assert [one.image for _, one in history()] == [name]
    finally:
        path.unlink()


# -- what is decided ---------------------------------------------------------------------------


def test_a_decision_counts_once_and_each_person_takes_back_their_own(served, ann, history):
    with served.join("bob") as bob:
        leave = {"image": reference(1), "decision": "leave-out", "note": "blurred"}
        assert ann.post("/images/decide", json=leave).json() == {"recorded": 1}
        assert ann.post("/images/decide", json=leave).json() == {"recorded": 0}
        corner = {"image": reference(1), "decision": "corner", "x": 10.5, "y": 20}
        assert bob.post("/images/decide", json=corner).json() == {"recorded": 1}
        assert bob.get("/images/look", params={"image": reference(1)}).json()["left_out"] == {
            "by": "ann",
            "note": "blurred",
        }
        assert ann.post("/images/undo", json={}).json() == {"images": [reference(1)]}
        assert ann.post("/images/undo", json={}).status_code == 409
        found = decided(history())
        assert (found.left_out, list(found.corners)) == ({}, [reference(1)])
        assert bob.post("/images/undo", json={}).json() == {"images": [reference(1)]}
        assert decided(history()).corners == {}
        # One of before that is sent again, by a browser that does not know of the answer.
        old = {**leave, "id": "one", "note": "old"}
        assert ann.post("/images/decide", json=old).json() == {"recorded": 1}
        assert ann.post("/images/decide", json=leave).json() == {"recorded": 1}
        assert ann.post("/images/decide", json=old).json() == {"recorded": 0}


# -- in the browser ----------------------------------------------------------------------------


def opened(browser, served, size):
    sized(browser, DESKTOP)
    joined(browser, served, "/images/")
    sized(browser, size)
    ready(browser, "1")
    return browser


def ready(browser, camera):
    """Until the reference image of a camera is shown with what was found in it.

    From one to the next leads what is decided.
    """
    wait(lambda: title(browser) == f"reference pattern, camera {camera}")
    wait(lambda: "corners" in browser.find_element("id", "verdict").text)


def title(browser):
    return browser.find_element("id", "image-title").text


def told(browser):
    return browser.find_element("id", "corner-told").text


def on_screen(browser, place):
    """Where a pixel of the image is on the screen."""
    # The image fits the canvas: as large as both sides allow, in its middle.
    box = browser.execute_script(
        "const b = document.getElementById('picture').getBoundingClientRect();"
        "const c = document.getElementById('picture');"
        "return [b.left + c.clientLeft, b.top + c.clientTop, c.clientWidth, c.clientHeight]"
    )
    scale = min(box[2] / 640, box[3] / 480)
    middle = np.array([box[0] + box[2] / 2, box[1] + box[3] / 2])
    return middle + (np.asarray(place) - [319.5, 239.5]) * scale


def mouse(browser, place):
    x, y = on_screen(browser, place)
    for kind in ("mousePressed", "mouseReleased"):
        said = {"type": kind, "x": x, "y": y, "button": "left", "clickCount": 1}
        browser.execute_cdp_cmd("Input.dispatchMouseEvent", said)


def touch(browser, place):
    x, y = on_screen(browser, place)
    said = {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]}
    browser.execute_cdp_cmd("Input.dispatchTouchEvent", said)
    browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


def clicked(browser, name):
    """A button clicked with the mouse."""
    browser.find_element("id", name).click()


def tapped(browser, name):
    """A button pressed with a finger."""
    button = browser.find_element("id", name)
    browser.execute_script("arguments[0].scrollIntoView({block: 'nearest'})", button)
    box = browser.execute_script(
        "const b = arguments[0].getBoundingClientRect();"
        "return [b.left + b.width / 2, b.top + b.height / 2]",
        button,
    )
    said = {"type": "touchStart", "touchPoints": [{"x": box[0], "y": box[1]}]}
    browser.execute_cdp_cmd("Input.dispatchTouchEvent", said)
    browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})


def check_corners(found, places):
    """All four corners as they are in the images, and each row: to a pixel of detection."""
    assert set(found) == {reference(camera) for camera in CAMERAS}
    for camera in CAMERAS:
        corner, along = found[reference(camera)].places
        true = places[camera]
        assert np.linalg.norm(corner - true[0]) < 1.0
        row, clicked = true[1] - true[0], along - corner
        assert row @ clicked > 0.7 * np.linalg.norm(row) * np.linalg.norm(clicked)


@pytest.mark.browser
@pytest.mark.parametrize(
    "means",
    [
        (mouse, mouse, touch, touch),
        pytest.param((mouse,) * 4, marks=pytest.mark.full),
        pytest.param((touch,) * 4, marks=pytest.mark.full),
    ],
)
def test_the_corner_of_four_cameras_is_clicked_by_mouse_and_by_touch(
    browser, served, room, history, means
):
    opened(browser, served, DESKTOP)
    for camera, press in zip(CAMERAS, means, strict=True):
        size = DESKTOP if press is mouse else PHONE
        click = clicked if press is mouse else tapped
        sized(browser, size)
        ready(browser, camera)
        first, along, _ = room[1][camera]
        click(browser, "corner")
        wait(lambda: "Click the first corner" in told(browser))
        press(browser, first + 3)
        wait(lambda: "its row runs along" in told(browser))
        press(browser, 0.4 * first + 0.6 * along)
        wait(lambda: "row towards" in told(browser))
        picture(browser, f"corner_{size['width']}_{camera}")
        assert faults(browser) == []
        click(browser, "corner-take")
        wait(lambda name=camera: reference(name) in decided(history()).corners)
        wait(lambda: not browser.find_element("id", "picking").is_displayed())
    check_corners(decided(history()).corners, room[1])
    assert errors(browser) == []


@pytest.mark.browser
def test_the_corner_of_four_cameras_is_gone_to_by_keyboard_alone(browser, served, room, history):
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.keys import Keys

    opened(browser, served, PHONE)
    keys = lambda *some: ActionChains(browser).send_keys(*some).perform()  # noqa: E731
    canvas = browser.find_element("id", "picture")
    for camera in CAMERAS:
        ready(browser, camera)
        keys("p")
        wait(lambda: browser.switch_to.active_element == canvas)
        if camera == "1":  # to the pixel, by the arrows
            x, y = np.round(room[1][camera][0] - [319.5, 239.5]).astype(int)
            chain = ActionChains(browser).key_down(Keys.SHIFT)
            chain.send_keys(*[Keys.ARROW_LEFT if x < 0 else Keys.ARROW_RIGHT] * (abs(x) // 10))
            chain.send_keys(*[Keys.ARROW_UP if y < 0 else Keys.ARROW_DOWN] * (abs(y) // 10))
            chain.key_up(Keys.SHIFT).send_keys(Keys.ENTER).perform()
        else:  # through the corners that are possible: by tab to the button
            keys(Keys.TAB)
            focused = lambda: browser.switch_to.active_element.get_attribute("id")  # noqa: E731
            while focused() != "corner-next":
                keys(Keys.TAB)
            right = False
            while not right:
                keys(Keys.SPACE)
                wait(lambda: "its row runs along" in told(browser))
                place = [
                    int(part) for part in told(browser).split(";")[0].split("at ")[1].split(", ")
                ]
                right = np.linalg.norm(np.array(place) - room[1][camera][0]) < 3
            canvas.send_keys("")
            browser.execute_script("arguments[0].focus()", canvas)
        wait(lambda: "its row runs along" in told(browser))
        keys(Keys.ENTER)
        wait(lambda name=camera: reference(name) in decided(history()).corners)
        wait(lambda: not browser.find_element("id", "picking").is_displayed())
    check_corners(decided(history()).corners, room[1])
    keys("u")
    wait(lambda: len(decided(history()).corners) == 3)
    assert errors(browser) == []


@pytest.mark.browser
def test_an_image_is_left_out_used_again_and_a_change_by_another_program_shows(
    browser, served, history
):
    opened(browser, served, PHONE)
    assert "to be clicked" in browser.find_element("css selector", ".late").text
    assert browser.find_element("css selector", "[data-name=images] .mark").text.startswith("4")
    first = browser.find_element("css selector", "#images button")
    first.send_keys("x")
    wait(lambda: list(decided(history()).left_out) == [reference(1)])
    wait(lambda: "Left out by ann" in browser.find_element("id", "decision").text)
    wait(lambda: browser.find_element("id", "leave-out").text == "Use again")
    browser.find_element("id", "undo").click()
    wait(lambda: decided(history()).left_out == {})
    with (served.folder / "vision/decisions.csv").open("a") as stream:
        stream.write("now,vision/reference/1.png,leave-out,,,,,a program,it is dark\n")
    wait(lambda: "by a program: it is dark" in browser.find_element("id", "images").text)
    # Before and after by a slider; the frames of a drive by another.
    for size, share in ((DESKTOP, "53"), (PHONE, "56")):
        sized(browser, size)
        row = browser.find_element("css selector", "[data-purpose=before] button")
        browser.execute_script("arguments[0].click()", row)
        wait(lambda: browser.find_element("id", "wiping").is_displayed())
        browser.find_element("id", "wipe").send_keys("\ue013" * 3)  # arrow up
        assert browser.find_element("id", "wipe").get_attribute("value") == share
        browser.find_element("id", "moment").send_keys("\ue013")
        wait(lambda: title(browser).startswith("drive, 170000000"))
        assert faults(browser) == []
        picture(browser, f"images_{size['width']}")
    assert errors(browser) == []


@pytest.mark.full
@pytest.mark.browser
def test_a_thousand_images_are_painted_within_a_second(browser, tmp_path):
    folder = tmp_path / "room"
    written(folder, others=1000)
    with PageServer(folder, tmp_path / "log") as server:
        sized(browser, DESKTOP)
        joined(browser, server, "/images/")
        browser.get(f"{server.url}/images/")
        paint = """return performance.getEntriesByName('first-contentful-paint')[0].startTime"""
        assert browser.execute_script(paint) < 1000
        assert len(browser.find_elements("css selector", "#images li")) == 1006
        time.sleep(1)
        assert server.memory() < 300


@pytest.mark.full
@pytest.mark.browser
def test_a_decision_waits_for_the_link(browser, served, history):
    opened(browser, served, PHONE)
    waits_in(browser, "images", {"image": reference(2), "decision": "leave-out"})
    browser.refresh()
    wait(lambda: list(decided(history()).left_out) == [reference(2)])
    wait(lambda: waiting_in(browser, "images") == [])


@pytest.mark.browser
def test_a_decision_outlives_a_campaign_file_that_is_being_edited(browser, served, history):
    from selenium.webdriver import ActionChains

    opened(browser, served, DESKTOP)
    of_rows = "return [...document.querySelectorAll('#images button')].map((b) => b.dataset.image)"
    second = browser.execute_script(of_rows)[1]
    # The next image, and at once the decision: about the one that is named, looked at or not.
    browser.execute_script("document.querySelector('#images button').focus()")
    ActionChains(browser).send_keys("j").perform()
    toml = served.folder / "campaign.toml"
    before = toml.read_text()
    toml.write_text(before + "\n[visi")
    try:
        ActionChains(browser).send_keys("x").perform()
        wait(lambda: "sent again by itself" in browser.find_element("id", "said").text)
        [one] = waiting_in(browser, "images")
    finally:
        toml.write_text(before)
    wait(lambda: [*decided(history()).left_out] == [one["image"]])
    assert one["image"] == second
    wait(lambda: waiting_in(browser, "images") == [])
    browser.get_log("browser")  # the refusals above


def test_a_page_of_another_campaign_decides_nothing_here(ann, history):
    said = {"image": reference(1), "decision": "leave-out"}
    answer = ann.post("/images/decide", json=said, headers={"Gtval-Campaign": "f" * 16})
    assert answer.status_code == 421
    assert history() == []


@pytest.mark.parametrize("name", ["a\nb.png", "a\tb.png", "a  b.png", "bad\udcff.png"])
def test_an_image_whose_name_no_table_can_hold_is_counted_and_not_listed(
    ann, served, history, name
):
    folder = served.folder / "vision/other"
    folder.mkdir(exist_ok=True)
    path = folder / name
    shutil.copy(served.folder / reference(1), path)
    try:
        wait(lambda: "1 images are not in this list" in ann.get("/images/list").text)
        image = path.relative_to(served.folder).as_posix()
        with contextlib.suppress(UnicodeEncodeError):
            said = {"image": image, "decision": "leave-out"}
            assert ann.post("/images/decide", json=said).status_code == 409
        assert history() == []
    finally:
        path.unlink()
