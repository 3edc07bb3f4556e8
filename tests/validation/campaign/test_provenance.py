"""Which files a result was made from."""

import hashlib

import pytest

from validation.campaign.provenance import input_hashes
from validation.errors import GtvalError


def test_inputs_are_hashed_and_what_was_computed_is_not(tmp_path):
    for name in ("campaign.toml", "survey/a.csv", "results/x", "report/y", ".git/z", "b.tmp"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(name)
    hashes = input_hashes(tmp_path)
    assert list(hashes) == ["campaign.toml", "survey/a.csv"]
    assert hashes["survey/a.csv"] == hashlib.sha256(b"survey/a.csv").hexdigest()


def test_one_changed_byte_changes_the_hash(tmp_path):
    (tmp_path / "a").write_bytes(b"1.000")
    before = input_hashes(tmp_path)
    (tmp_path / "a").write_bytes(b"1.001")
    assert input_hashes(tmp_path) != before


def test_a_file_that_cannot_be_read_is_told(tmp_path, monkeypatch):
    (tmp_path / "a").write_bytes(b"1")

    def refuse(*_arguments: object) -> None:
        raise OSError(13, "Permission denied")

    monkeypatch.setattr(hashlib, "file_digest", refuse)
    with pytest.raises(GtvalError, match=r"cannot read .*a: Permission denied"):
        input_hashes(tmp_path)
