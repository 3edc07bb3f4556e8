"""docs/field.md is for printing: it fits one page, and what it says to type is understood."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from markdown_it import MarkdownIt

from survey.entry.dialogue.words import COMMANDS
from survey.settings import EntrySettings

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
PAGE = Path(__file__).parents[4] / "docs" / "field.md"
STYLE = """
@page { size: A4; margin: 12mm }
body { font: 10pt/1.35 "DejaVu Sans", sans-serif; margin: 0 }
h1 { font-size: 1.4em; margin: 0 } p, ul, ol, table, pre { margin: .45em 0 }
td, th { text-align: left; vertical-align: top; padding: .1em .8em .1em 0 }
"""
"""Large letters of a wide font, as for reading on the floor."""


def letters_of_keys(text):
    """The one-letter commands that the page names in its code."""
    return {code.split()[0] for code in re.findall(r"`([a-z?](?: [^`]*)?)`", text)}


@pytest.mark.browser
@pytest.mark.skipif(not BROWSER, reason="Chromium is not installed")
def test_it_prints_on_one_page(tmp_path):
    body = MarkdownIt("commonmark").enable("table").render(PAGE.read_text())
    page, pdf = tmp_path / "field.html", tmp_path / "field.pdf"
    page.write_text(f"<!doctype html><meta charset=utf-8><style>{STYLE}</style>{body}")
    options = ("--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer")
    subprocess.run(
        [BROWSER, *options, f"--print-to-pdf={pdf}", str(page)],
        check=True,
        capture_output=True,
        timeout=120,
    )
    assert len(re.findall(rb"/Type\s*/Page\b", pdf.read_bytes())) == 1


def test_the_page_of_the_campaign_folder_has_all_settings():
    table = (PAGE.parent / "campaign.md").read_text()
    assert [name for name in EntrySettings.model_fields if f"`{name}`" not in table] == []


def test_every_key_that_it_names_is_one():
    known = {command.split()[0] for command, _ in COMMANDS}
    assert letters_of_keys(PAGE.read_text()) <= known
    assert {"u", "r", "k", "s", "j", "p", "n", "l", "d", "i", "q"} <= letters_of_keys(
        PAGE.read_text()
    )
