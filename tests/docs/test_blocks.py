"""Every block of code of README and docs does what it says, from top to bottom of each page."""

import csv
import io
import json

import pytest
from blocks import NOT_CODE, PAGES, REASONS, REPOSITORY, RUN, Reader, blocks_of, commands_of

MOST_LEFT_OUT = 12
"""Blocks that may be left out in all pages together: each is a promise that nothing holds."""
NAMES = [page.relative_to(REPOSITORY).as_posix() for page in PAGES]


@pytest.fixture
def reader(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return Reader(tmp_path)


def follow(page, reader, *, full):
    """A page done from top to bottom, or up to where it becomes slow."""
    for block in blocks_of(page):
        if block.mark("full") is not None and not full:
            return
        reader.follow(block)


ASIDE = ("docs/howto/", "docs/results.md", "docs/samples.md", "docs/deliverable.md")
"""Pages that are followed in the full tests alone: they do to the same campaigns what others do."""


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, id=name, marks=pytest.mark.full if name.startswith(ASIDE) else ())
        for page, name in zip(PAGES, NAMES, strict=True)
    ],
)
def test_a_page_works_as_it_is_written(page, reader):
    follow(page, reader, full=False)


SLOW = [page for page in PAGES if any(block.mark("full") is not None for block in blocks_of(page))]


@pytest.mark.full
@pytest.mark.parametrize("page", SLOW, ids=lambda page: page.stem)
def test_a_slow_page_works_to_its_end(page, reader):
    follow(page, reader, full=True)


@pytest.mark.parametrize("page", PAGES, ids=NAMES)
def test_every_block_says_what_it_is(page):
    for block in blocks_of(page):
        assert block.language in RUN | NOT_CODE, f"{block.place}: {block.language or 'no language'}"
        if block.language == "csv":
            rows = list(csv.reader(io.StringIO(block.text)))
            assert len({len(row) for row in rows}) == 1, block.place
        if block.language == "json":
            json.loads(block.text)


def test_commands_are_shown_in_blocks_that_are_run():
    for page in PAGES:
        for block in blocks_of(page):
            if block.language in NOT_CODE:
                lines = [line.strip().removeprefix("$ ") for line in block.text.splitlines()]
                assert not [line for line in lines if line.startswith("gtval ")], block.place


def test_few_blocks_are_left_out_and_each_says_why():
    left_out = [block for page in PAGES for block in blocks_of(page) if block.mark("not run")]
    assert len(left_out) <= MOST_LEFT_OUT
    for block in left_out:
        assert block.mark("not run") in REASONS, block.place


def test_the_harness_sees_a_command_that_fails(tmp_path, reader):
    page = tmp_path / "page.md"
    page.write_text("```console\n$ gtval run nowhere\n```\n")
    (block,) = blocks_of(page)
    assert commands_of(block) == [("gtval run nowhere", "")]
    with pytest.raises((AssertionError, ValueError)):
        reader.follow(block)
