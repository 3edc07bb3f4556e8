"""docs/deliverable.md, held against the program: its items, commands, chapters and numbers."""

import ast
import re

import pytest
from blocks import REPOSITORY
from deliverable_numbers import COMPUTED, Demo
from test_documentation import command_of

from data_samples.demo import copy_demo
from validation.report.document import build_document

PAGE = REPOSITORY / "docs" / "deliverable.md"
PACKAGES = ("validation", "survey", "vision_gt", "laser_gt")
ENGINES = ("scan matching", "genetic aligner")
ROW = re.compile(r"^\| (\d+) \| (.*) \|$", re.MULTILINE)


def items() -> dict[int, list[str]]:
    """Cells of each item: item, command, chapter, verdict, difference, printed, computed."""
    text = PAGE.read_text(encoding="utf-8")
    return {int(number): cells.split(" | ") for number, cells in ROW.findall(text)}


ITEMS = items()


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    folder = tmp_path_factory.mktemp("deliverable") / "demo"
    copy_demo(folder)
    return Demo(folder)


def titles_in_the_sources() -> set[str]:
    """Titles of sections that any package can give."""
    found = set()
    for package in PACKAGES:
        for path in (REPOSITORY / package).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if not (isinstance(node, ast.Call) and node.args):
                    continue
                if getattr(node.func, "id", "") == "Section" and isinstance(
                    node.args[0], ast.Constant
                ):
                    found.add(node.args[0].value)
    return found | {f"Laser GT: {engine}" for engine in ENGINES}


def test_all_71_items_are_there_in_their_order():
    assert list(ITEMS) == list(range(1, 72))
    assert all(len(cells) == 7 for cells in ITEMS.values())


def test_no_item_is_missing_and_what_is_partly_there_says_why():
    for number, (_, command, chapter, verdict, *_) in ITEMS.items():
        assert re.fullmatch(r"yes|better|partly: .{20,}", verdict), number
        assert command.startswith("`gtval "), number
        assert chapter, number


@pytest.mark.parametrize("number", ITEMS)
def test_its_command_exists(number):
    words = ITEMS[number][1].strip("`").removeprefix("gtval ").split()
    command, left = command_of(words)
    assert command is not None
    assert all(word.startswith("--") for word in left), left


def test_its_chapter_is_in_the_report(demo):
    own = {section.title for section in build_document(demo.run).sections}
    anywhere = titles_in_the_sources()
    for number, (_, _, chapter, *_) in ITEMS.items():
        name = chapter.removesuffix(" †")
        if name == chapter:
            assert name in own, number
        else:
            assert name in anywhere, number
            assert name not in own, number


def test_its_number_is_what_the_program_computes(demo):
    shown = {number: cells[6] for number, cells in ITEMS.items() if cells[6] != "–"}
    assert shown == {number: compute(demo) for number, compute in COMPUTED.items()}


PRINTED_AGAIN = (1, 26)
"""Items whose computed number is written exactly as the printed one."""


@pytest.mark.parametrize("number", PRINTED_AGAIN)
def test_what_was_printed_comes_out_to_the_last_digit(number):
    *_, printed, computed = ITEMS[number]
    assert printed == computed


def test_the_summary_says_what_the_findings_say(demo):
    text = " ".join(PAGE.read_text(encoding="utf-8").split()).replace("−", "-")
    assert "23 of 40 images" in text
    assert "cameras 1 and 2" in demo.finding("recognised_not_used", "vision")
    rows = {row["without"]: row for row in demo.rows("paired.csv")[:8] if row["component"] == "x"}
    for row in rows.values():
        mean, low, high = (1e3 * float(row[key]) for key in ("mean", "low", "high"))
        assert f"{mean:+.0f} mm ({low:+.0f} to {high:+.0f})" in text
    (motion,) = demo.rows("motions.csv")
    ratio = float(motion["error_dx"]) / float(motion["sigma_dx"])
    assert round(ratio) == 3
