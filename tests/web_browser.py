"""Browsers that look at the pages of gtval."""

import contextlib
import os
import shutil

import pytest

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
DRIVER = shutil.which("chromedriver")
PHONE = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}
DESKTOP = {"width": 1280, "height": 900, "deviceScaleFactor": 1, "mobile": False}
PICTURES = os.environ.get("GTVAL_TEST_PICTURES")
"""A folder for screenshots, to be looked at."""


@contextlib.contextmanager
def open_browser():
    """A browser of the size of a desktop, closed at the end; skips where there is none."""
    if not (BROWSER and DRIVER):
        pytest.skip("Chromium or its driver is not installed")
    opened = new_browser()
    try:
        yield sized(opened, DESKTOP)
    finally:
        opened.quit()


def new_browser(*more):
    """A browser, with further arguments of its command line."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", *more):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(options=options, service=Service(DRIVER))


def sized(browser, size):
    """The browser, of that size."""
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": size["mobile"]})
    return browser


def violations(browser):
    """What axe-core holds against the page that is shown: rule and first places."""
    from axe_core_python.base import AXE_SCRIPT

    browser.set_script_timeout(60)
    browser.execute_script(AXE_SCRIPT)
    return browser.execute_async_script(
        """
        const answer = arguments[0];
        axe.run(document, { resultTypes: ['violations'] }).then(
          (found) => answer(found.violations.map((rule) =>
            `${rule.id}: ${rule.nodes.slice(0, 3).map((node) => node.html.slice(0, 160))}`)),
          (error) => answer([`axe-core: ${error}`]));
        """
    )
