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
