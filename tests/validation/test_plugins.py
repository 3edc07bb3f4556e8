import importlib.metadata
import sys

import pytest

from validation.plugins import EntryPoint, entry_points


@pytest.mark.parametrize("group", ["gtval.commands", "gtval.systems", "console_scripts"])
def test_the_standard_library_finds_the_same(group):
    ours = {(entry.name, entry.value) for entry in entry_points(group=group)}
    theirs = {(e.name, e.value) for e in importlib.metadata.entry_points(group=group)}
    assert ours == theirs
    assert ours


def test_a_package_found_twice_counts_once(tmp_path, monkeypatch):
    for place in ("a", "b"):
        folder = tmp_path / place / "lab_rig-1.0.dist-info"
        folder.mkdir(parents=True)
        (folder / "entry_points.txt").write_text(
            f"[gtval.systems]\nrig = lab.{place}:SYSTEM\n\n[other]\nx = y:Z\n"
        )
    monkeypatch.setattr(sys, "path", [str(tmp_path / "a"), str(tmp_path / "b"), "no/such/folder"])
    assert entry_points(group="gtval.systems") == [EntryPoint("rig", "lab.a:SYSTEM")]


def test_loading_gives_the_object_or_says_what_is_missing():
    assert EntryPoint("x", "validation.plugins:EntryPoint.load").load() is EntryPoint.load
    with pytest.raises(ImportError):
        EntryPoint("x", "no_such_module:X").load()
    with pytest.raises(AttributeError):
        EntryPoint("x", "validation.plugins:Nothing").load()
