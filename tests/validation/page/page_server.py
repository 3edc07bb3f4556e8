"""`gtval open` as a process, and browsers that look at it."""

import contextlib
import json
import threading
import time
from pathlib import Path

import httpx
from web_browser import PICTURES, violations
from web_server import WebServer


class PageServer(WebServer):
    """The served page of a campaign."""

    def __init__(self, folder: Path, log: Path, *options: str) -> None:
        self.folder = folder
        options = options if "--port" in options else ("--port", "0", *options)
        super().__init__(log, ["open", str(folder), "--no-browser", *options])


class Killed:
    """A page that is killed at random moments while decisions are sent to it.

    ``said`` gives the body of a decision by its note; what was acknowledged is in ``acknowledged``.
    """

    def __init__(self, folder, log, path, said, begin=None):
        self.folder, self.log, self.path, self.said, self.begin = folder, log, path, said, begin
        self.acknowledged, self.number = [], 0
        self.cookies, self.port = None, "0"

    def send(self, client):
        """Whether the page answered to one more decision."""
        note = f"n{self.number}"
        try:
            if client.post(self.path, json=self.said(self.number, note)).status_code == 200:
                self.acknowledged.append(note)
        except httpx.TransportError:
            return False
        return True

    @contextlib.contextmanager
    def served(self):
        """The page, and a device that stays let in whatever was killed."""
        with PageServer(self.folder, self.log, "--port", self.port) as server:
            self.port = server.port
            if self.cookies is None:
                with server.join() as client:
                    self.cookies = dict(client.cookies)
            with httpx.Client(base_url=server.url, cookies=self.cookies, timeout=20) as client:
                if self.begin:
                    self.begin(client)
                yield server, client

    def kill_once(self, after):
        """Send until the page is killed, some seconds after it began."""
        with self.served() as (server, client):
            self.send(client)
            self.number += 1
            killing = threading.Timer(after, server.kill)
            killing.start()
            while self.send(client):
                self.number += 1
            killing.join()

    def check(self, notes, kills):
        """All that was acknowledged is there, and nothing twice."""
        assert len(notes) == len(set(notes))
        assert set(self.acknowledged) <= set(notes)
        assert len(self.acknowledged) >= kills


def joined(browser, served, path="/", name="ann"):
    """The browser on a path of the page, let in by the code."""
    browser.get(served.url)
    browser.delete_all_cookies()
    browser.get("about:blank")
    browser.get_log("browser")  # what an earlier server left
    browser.get(f"{served.url}{path}#{served.code}")
    browser.find_element("id", "name").send_keys(name)
    browser.find_element("css selector", "#join button").click()
    wait(lambda: browser.find_elements("css selector", ".head nav"), 30)
    browser.get(f"{served.url}{path}")
    return browser


def waits_in(browser, panel, said):
    """Put a decision into the browser's storage, as the page keeps one that has no answer yet."""
    put = (
        "localStorage.setItem(`gtval:${arguments[0]}:"
        "${document.documentElement.dataset.campaign}:1`, arguments[1])"
    )
    browser.execute_script(put, panel, json.dumps(said))


def waiting_in(browser, panel):
    """The decisions that wait there."""
    of = "Object.keys(localStorage).filter((key) => key.startsWith(`gtval:${arguments[0]}:`))"
    found = browser.execute_script(f"return {of}.map((key) => localStorage.getItem(key))", panel)
    return [json.loads(one) for one in found]


def wait(condition, seconds=60):
    """Until a condition holds; one about what is just being replaced does not, yet."""
    from selenium.common.exceptions import NoSuchElementException, StaleElementReferenceException

    until = time.monotonic() + seconds
    while time.monotonic() < until:
        with contextlib.suppress(NoSuchElementException, StaleElementReferenceException):
            if condition():
                return
        time.sleep(0.03)
    raise AssertionError("it did not happen")


def picture(browser, name):
    """A screenshot, where they are wanted."""
    if PICTURES:
        browser.save_screenshot(f"{PICTURES}/{name}.png")


def errors(browser):
    """What the console of the browser holds against the page."""
    return [one["message"] for one in browser.get_log("browser") if one["level"] == "SEVERE"]


FAULTS = """
const seen = (e) => e.getClientRects().length && getComputedStyle(e).visibility !== 'hidden';
const all = (s) => [...document.querySelectorAll(s)].filter(seen);
const named = (e) => (e.getAttribute('aria-label') || e.labels?.[0]?.textContent || e.textContent
  || e.getAttribute('title') || e.getAttribute('alt') || '').trim();
const ids = [...document.querySelectorAll('[id]')].map((e) => e.id);
const lights = (c) => c.match(/[\\d.]+/g).slice(0, 3).map((v) => {
  v = v / 255; return v <= .03928 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4; });
const light = (c) => { const [r, g, b] = lights(c); return .2126 * r + .7152 * g + .0722 * b; };
const behind = (e) => { for (; e; e = e.parentElement) {
  const c = getComputedStyle(e).backgroundColor;
  if (!/rgba.*, 0\\)|transparent/.test(c)) return c; } return 'rgb(255,255,255)'; };
const contrast = (e) => {
  const [a, b] = [light(getComputedStyle(e).color), light(behind(e))].sort((x, y) => y - x);
  return (a + .05) / (b + .05); };
const texts = all('body *').filter((e) => [...e.childNodes].some((n) => n.nodeType === 3
  && n.textContent.trim()) && !e.closest('script, canvas, svg, .unseen, [disabled], .skip'));
const levels = all('h1, h2, h3, h4').map((e) => +e.tagName[1]);
return [
  ...all('button, a[href], input, select, textarea, summary, iframe, canvas, [role=img]')
    .filter((e) => !named(e)).map((e) => 'no name: ' + e.outerHTML.slice(0, 120)),
  ...ids.filter((one, at) => ids.indexOf(one) !== at).map((one) => 'id twice: ' + one),
  ...texts.filter((e) => contrast(e) < 4.5).map((e) => 'contrast '
    + contrast(e).toFixed(1) + ': ' + e.outerHTML.slice(0, 120)),
  ...levels.filter((one, at) => at && one > levels[at - 1] + 1)
    .map((one) => 'heading leaps to ' + one),
  ...(document.documentElement.lang ? [] : ['no language']),
  ...(document.title ? [] : ['no title']),
  ...(document.querySelectorAll('main').length === 1 ? [] : ['not one main']),
  ...(document.documentElement.scrollWidth > innerWidth ? ['wider than the screen: '
    + document.documentElement.scrollWidth] : []),
  ...[...document.querySelectorAll('[aria-labelledby], [aria-describedby], [aria-controls]')]
    .flatMap((e) => ['aria-labelledby', 'aria-describedby', 'aria-controls']
      .flatMap((a) => (e.getAttribute(a) || '').split(' ').filter(Boolean)))
    .filter((one) => !document.getElementById(one)).map((one) => 'leads nowhere: ' + one),
  ...all('button').filter((e) => e.getBoundingClientRect().height < 23.5)
    .map((e) => 'small: ' + e.outerHTML.slice(0, 80)),
  ...[...document.querySelectorAll('[tabindex]')].filter((e) => e.tabIndex > 0)
    .map((e) => 'order of its own: ' + e.outerHTML.slice(0, 80)),
];
"""
"""What keeps people out who see little, use a screen reader, or no mouse: names, contrast (WCAG
1.4.3, 4.5 to 1), headings, ids, what scrolls sideways (1.4.10), targets (2.5.8, 24 pixels)."""
# axe-core has more rules, but none for what scrolls sideways, nor always one for targets.


def faults(browser):
    """Places of the page that keep somebody out; rules of axe-core that are violated."""
    return browser.execute_script(FAULTS) + violations(browser)
