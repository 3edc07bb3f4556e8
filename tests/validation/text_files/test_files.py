"""Files are written whole or not at all."""

import os
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from validation.errors import GtvalError
from validation.text_files import writing as files
from validation.text_files.writing import append_rows, write_files


def contents(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_new_files_are_made_with_their_folders(tmp_path):
    paths = write_files(tmp_path / "results", {"a.csv": "ä\n", "deep/er/b.bin": b"\0\1"})
    assert paths == [tmp_path / "results/a.csv", tmp_path / "results/deep/er/b.bin"]
    assert contents(tmp_path / "results") == {"a.csv": "ä\n".encode(), "deep/er/b.bin": b"\0\1"}


def test_old_files_are_replaced_and_no_other_is_touched(tmp_path):
    (tmp_path / "a").write_text("old")
    (tmp_path / "mine").write_text("mine")
    write_files(tmp_path, {"a": "new"})
    assert contents(tmp_path) == {"a": b"new", "mine": b"mine"}


def test_files_have_the_permissions_of_any_new_file(tmp_path):
    (tmp_path / "usual").write_text("")
    [path] = write_files(tmp_path, {"a": "x"})
    assert path.stat().st_mode == (tmp_path / "usual").stat().st_mode


@pytest.mark.parametrize("failing", [0, 1, 2])
def test_a_failure_in_the_middle_of_the_renames_leaves_everything_as_it_was(
    tmp_path, monkeypatch, failing
):
    before = {"0": b"old 0", "2": b"old 2"}
    for name, content in before.items():
        (tmp_path / name).write_bytes(content)
    original = Path.replace

    def replace(self: Path, target: Path) -> Path:
        if Path(target).name == str(failing) and ".old." not in self.name:
            raise OSError(28, "No space left on device")
        return original(self, target)

    monkeypatch.setattr(Path, "replace", replace)
    with pytest.raises(GtvalError, match=r"cannot write to .*: No space left on device"):
        write_files(tmp_path, {"0": "new 0", "1": "new 1", "2": "new 2"})
    assert contents(tmp_path) == before


@pytest.mark.parametrize("with_links", [True, False])
def test_a_success_leaves_no_temporary_file(tmp_path, monkeypatch, with_links):
    if not with_links:

        def refuse(_self: Path, _target: Path) -> None:
            raise OSError(95, "Operation not supported")

        monkeypatch.setattr(Path, "hardlink_to", refuse)
    for generation in ("one", "two"):
        write_files(tmp_path, {"a": generation, "b": generation})
        assert contents(tmp_path) == {"a": generation.encode(), "b": generation.encode()}


def test_a_full_disk_while_filling_leaves_the_old_files(tmp_path, monkeypatch):
    (tmp_path / "a").write_text("old")
    calls = iter(range(9))

    def full(_handle: int) -> None:
        if next(calls) == 1:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(GtvalError, match="No space left"):
        write_files(tmp_path, {"a": "new", "b": "new"})
    assert contents(tmp_path) == {"a": b"old"}


def test_an_interrupt_leaves_the_old_files_and_goes_through(tmp_path, monkeypatch):
    (tmp_path / "a").write_text("old")

    def interrupted(_target: Path, _content: str | bytes) -> Path:
        raise KeyboardInterrupt

    monkeypatch.setattr(files, "_stage", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_files(tmp_path, {"a": "new"})
    assert contents(tmp_path) == {"a": b"old"}


def test_a_file_in_the_way_of_the_folder_is_told(tmp_path):
    (tmp_path / "results").write_text("I am a file")
    with pytest.raises(GtvalError, match="cannot write to"):
        write_files(tmp_path / "results", {"a": "x"})
    assert contents(tmp_path) == {"results": b"I am a file"}


def test_a_folder_in_the_way_of_a_file_is_told(tmp_path):
    (tmp_path / "b").mkdir()
    (tmp_path / "a").write_text("old")
    with pytest.raises(GtvalError, match="cannot write to"):
        write_files(tmp_path, {"a": "new", "b": "new"})
    assert contents(tmp_path) == {"a": b"old"}


def test_text_that_is_no_unicode_is_written_with_escapes(tmp_path):
    [path] = write_files(tmp_path, {"a": "bad \udce9 name"})
    assert path.read_bytes() == b"bad \\udce9 name"


def test_rows_that_do_not_fit_on_the_disk_are_added_whole_or_not_at_all(tmp_path):
    path = tmp_path / "decisions.csv"
    append_rows(path, ("who", "what"), [("ann", "yes")])
    before = path.read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) + 5, hard))  # half of the next row
    try:
        with pytest.raises(GtvalError, match="cannot write"):
            append_rows(path, ("who", "what"), [("bob", "no")])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_bytes() == before
    append_rows(path, ("who", "what"), [("bob", "no")])
    assert path.read_bytes() == before + b"bob,no\n"


@pytest.mark.skipif(os.name != "posix", reason="elsewhere nobody is said to be gone")
def test_what_a_killed_writer_left_goes_with_the_next_write_and_nobody_elses(tmp_path):
    script = (
        "import os, signal, sys; from pathlib import Path; "
        "from validation.text_files.writing import write_files; "
        "write_files(Path(sys.argv[1]), {'a': 'new', 'b': 'new'}, "
        "before=lambda: os.kill(os.getpid(), signal.SIGKILL))"
    )
    killed = subprocess.run([sys.executable, "-c", script, str(tmp_path)], check=False)
    assert killed.returncode == -signal.SIGKILL
    left = sorted(tmp_path.iterdir())
    assert len(left) == 2
    number = left[0].name.split("-")[1]
    others = [
        left[0].with_name(left[0].name.replace(f"-{number}-", f"-{os.getpid()}-")),
        tmp_path / ".a.0000x-12-0.tmp",
        tmp_path / f".a.{number}.tmp",
        tmp_path / "notes.tmp",
    ]
    for one in others:
        one.write_text("of somebody else")
    write_files(tmp_path, {"a": "again"})
    assert sorted(tmp_path.iterdir()) == sorted([*others, tmp_path / "a"])
