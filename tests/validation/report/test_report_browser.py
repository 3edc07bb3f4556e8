"""The report in a real browser, wide and on a phone."""

import shutil
from collections.abc import Iterator

import pytest
from web_browser import violations

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
DRIVER = shutil.which("chromedriver")

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not (BROWSER and DRIVER), reason="Chromium or its driver is not installed"),
]


@pytest.fixture(scope="module")
def report(ad23_run) -> str:
    folder, _ = ad23_run
    return (folder / "report/report.html").as_uri()


@pytest.fixture(scope="module")
def browser() -> Iterator:
    from selenium.webdriver import Chrome, ChromeOptions
    from selenium.webdriver.chrome.service import Service

    options = ChromeOptions()
    options.binary_location = BROWSER or ""
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = Chrome(options=options, service=Service(DRIVER))
    yield driver
    driver.quit()


def opened(browser, report: str, width: int):
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.get(report)
    return browser


@pytest.mark.parametrize("width", [1280, 390])
def test_the_page_does_not_overflow_and_logs_no_error(browser, report, width):
    page = opened(browser, report, width)
    assert page.execute_script("return document.documentElement.scrollWidth") <= width
    assert page.get_log("browser") == []
    assert violations(page) == []


def test_on_paper_no_table_is_wider_than_the_page(browser, report):
    page = opened(browser, report, 680)  # A4 with margins of 15 mm
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    wide = page.execute_script(
        "return [...document.querySelectorAll('.scroll')]"
        ".filter(box => box.scrollWidth > box.clientWidth + 1).map(box => box.innerText)"
    )
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
    assert wide == []


def test_nothing_but_the_page_itself_is_asked_for(browser, report):
    page = opened(browser, report, 1280)
    asked = page.execute_script(
        "return performance.getEntriesByType('resource').map(entry => entry.name)"
    )
    assert [name for name in asked if not name.startswith("data:")] == []


def test_wide_tables_scroll_in_their_own_box_by_keyboard(browser, report):
    page = opened(browser, report, 390)
    scrolled = page.execute_script(
        """
        const box = [...document.querySelectorAll('.scroll')]
          .find(box => box.scrollWidth > box.clientWidth + 50);
        box.focus();
        box.scrollLeft = 50;
        return [document.activeElement === box, box.scrollLeft];
        """
    )
    assert scrolled == [True, 50]


def test_every_link_of_the_contents_leads_to_a_heading(browser, report):
    page = opened(browser, report, 1280)
    targets = page.execute_script(
        """
        return [...document.querySelectorAll('nav a')]
          .map(a => document.querySelector(a.getAttribute('href')).tagName);
        """
    )
    assert len(targets) >= 5
    assert set(targets) == {"H2"}


def test_on_a_phone_numbers_keep_their_units_and_titles_are_whole(browser, report):
    page = opened(browser, report, 390)
    text = page.execute_script("return document.querySelector('.findings').innerText")
    assert "95\u00a0%" in text
    assert not [word for word in ("95 %", " 20:", "0.05 m ") if word in text]
    wide = page.execute_script(
        "return [...document.querySelectorAll('caption')].filter(one => {"
        "  const range = document.createRange(); range.selectNodeContents(one);"
        "  return range.getBoundingClientRect().width > 390; }).map(one => one.innerText)"
    )
    assert wide == []


def test_the_names_of_rows_stay_while_a_table_scrolls(browser, report):
    page = opened(browser, report, 390)
    places = page.execute_script(
        """
        const box = [...document.querySelectorAll('.scroll')]
          .find(box => box.scrollWidth > box.clientWidth + 50);
        const name = box.querySelector('tbody th');
        const before = name.getBoundingClientRect().left;
        box.scrollLeft = 50;
        return [before, name.getBoundingClientRect().left];
        """
    )
    assert places[0] == places[1]
