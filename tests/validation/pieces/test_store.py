"""Pieces of work outlive a run, and are done again only where what they depend on has changed."""

import json
import multiprocessing

import pytest

from validation.pieces import store
from validation.pieces.store import KeptPieces, code_of, counted, kept_here, kept_in, key_of
from validation.pieces.work import done_once

KEYS = [key_of(bytes([number])) for number in range(20)]


class Squares:
    """How squares are kept."""

    @staticmethod
    def written(result, _job):
        return {"square": result}

    @staticmethod
    def read(told, _job):
        return int(told["square"])


def key(job):
    return KEYS[job]


def square(number):
    return number * number


def no_more(number):
    raise AssertionError(f"{number} again")


def test_what_was_done_is_taken_over_in_the_order_of_the_jobs(tmp_path):
    path = tmp_path / "kept" / "squares.jsonl"
    with counted() as first:
        assert done_once(square, [3, 1], key, KeptPieces(path, "squares"), Squares()) == [9, 1]
    with counted() as then:
        found = done_once(square, [0, 1, 2, 3], key, KeptPieces(path, "squares"), Squares())
    assert found == [0, 1, 4, 9]
    assert (first.of("squares").taken, first.of("squares").done) == (0, 2)
    assert (then.of("squares").taken, then.of("squares").done) == (2, 2)
    assert then.text() == "Taken over from earlier runs: 2 of 4 squares\n"
    again = done_once(no_more, [3, 2, 1, 0], key, KeptPieces(path, "squares"), Squares())
    assert again == [9, 4, 1, 0]


def test_each_is_kept_before_the_next_is_done(tmp_path):
    path = tmp_path / "squares.jsonl"

    def stopping(number):
        if number == 2:
            raise KeyboardInterrupt
        return number * number

    with pytest.raises(KeyboardInterrupt):
        done_once(stopping, [0, 1, 2, 3], key, KeptPieces(path, "squares"), Squares())
    kept = KeptPieces(path, "squares")
    assert [one in kept for one in KEYS[:4]] == [True, True, False, False]


def test_a_line_cut_at_any_byte_costs_that_piece_alone(tmp_path):
    path = tmp_path / "squares.jsonl"
    done_once(square, [5, 6], key, KeptPieces(path, "squares"), Squares())
    whole = path.read_bytes()
    first = whole.index(b"\n") + 1
    for cut in range(first, len(whole), 7):
        path.write_bytes(whole[:cut])
        kept = KeptPieces(path, "squares")
        assert done_once(square, [5, 6, 7], key, kept, Squares()) == [25, 36, 49]
        assert len(KeptPieces(path, "squares")) == 3
        path.write_bytes(whole)


@pytest.mark.parametrize("told", ['{"square":"x"}', "[]", '{"other":1}', "{"])
def test_a_piece_that_cannot_be_read_is_done_again(tmp_path, told):
    path = tmp_path / "squares.jsonl"
    line = json.dumps({"key": KEYS[4]}, separators=(",", ":"))[:-1] + "," + told[1:]
    path.write_text(line.rstrip("}") + "}\n")
    assert done_once(square, [4], key, KeptPieces(path, "squares"), Squares()) == [16]


def test_a_piece_of_which_one_letter_is_another_is_done_again(tmp_path):
    path = tmp_path / "squares.jsonl"
    done_once(square, [12], key, KeptPieces(path, "squares"), Squares())
    whole = path.read_text()
    for damaged in (whole.replace("144", "145"), whole.replace("square", "sqware")):
        path.write_text(damaged)
        kept = KeptPieces(path, "squares")
        assert key(12) in kept
        assert kept.get(key(12)) is None
        assert done_once(square, [12], key, kept, Squares()) == [144]


def add_many(path, numbers):
    kept = KeptPieces(path, "squares")
    for number in numbers:
        kept.add(key_of(str(number).encode()), {"square": number, "long": "x" * 20_000})


def test_two_runs_at_once_mix_no_lines(tmp_path):
    path = tmp_path / "squares.jsonl"
    context = multiprocessing.get_context("spawn")
    runs = [context.Process(target=add_many, args=(path, range(n, n + 100))) for n in (0, 1000)]
    for run in runs:
        run.start()
    for run in runs:
        run.join()
    kept = KeptPieces(path, "squares")
    assert len(kept) == 200
    for number in (*range(100), *range(1000, 1100)):
        assert kept.get(key_of(str(number).encode()))["square"] == number


def test_only_pieces_of_some_keys_are_left(tmp_path):
    path = tmp_path / "squares.jsonl"
    kept = KeptPieces(path, "squares")
    done_once(square, range(10), key, kept, Squares())
    kept.forget_others([KEYS[2], KEYS[7], "never there"])
    for one in (kept, KeptPieces(path, "squares")):
        assert len(one) == 2
        assert one.get(KEYS[7])["square"] == 49
    assert [one.name for one in tmp_path.iterdir()] == ["squares.jsonl"]


def test_a_key_changes_with_the_code_and_with_where_a_part_ends(monkeypatch):
    assert key_of(b"ab", b"c") != key_of(b"a", b"bc")
    before = code_of("laser_gt.matching")
    assert before == code_of("laser_gt.matching") != code_of("laser_gt.scans")
    with monkeypatch.context() as patched:
        patched.setattr(store, "version", lambda name: f"another {name}")
        for kept in (code_of, store.libraries):
            kept.cache_clear()
        assert code_of("laser_gt.matching") != before
    for kept in (code_of, store.libraries):
        kept.cache_clear()
    assert code_of("laser_gt.matching") == before
    with pytest.raises(ModuleNotFoundError):
        code_of("laser_gt.nothing_such")


def closures():
    """What each kind of piece is made by, as its key says, and where the function is."""
    from data_samples.studies import trial
    from laser_gt.campaign import kept as pairs
    from laser_gt.driving import links, refining
    from vision_gt.images import kept as images

    yield "vision_gt.images.jobs", images.CODE
    yield "laser_gt.matching.judgement", pairs.CODE
    yield "laser_gt.matching.genetic", pairs.CODE
    for module in (links, refining, trial):
        yield module.__name__, module.CODE


OF_NO_NUMBER = (
    *("validation.errors", "validation.pieces", "validation.shown", "validation.text_files"),
    "data_samples.studies.plan",  # settings, whose values are in the key
    "laser_gt.logs.records",  # reads files, whose content is in the key
)


@pytest.mark.parametrize(("module", "code"), list(closures()))
def test_a_key_has_all_code_that_its_piece_is_made_by(module, code):
    grimp = pytest.importorskip("grimp")
    packages = ("laser_gt", "vision_gt", "validation", "survey", "rtk_gt", "data_samples")
    upstream = grimp.build_graph(*packages).find_upstream_modules(module)
    known = (*code, *store._SHARED, *OF_NO_NUMBER)
    unknown = [
        one
        for one in upstream
        if not any(one == name or one.startswith(f"{name}.") for name in known)
    ]
    assert unknown == []


def test_nothing_is_kept_where_nothing_says_where(tmp_path):
    assert kept_here("squares.jsonl", "squares") is None
    assert done_once(square, [2], key, None, Squares()) == [4]
    with kept_in(tmp_path):
        assert kept_here("squares.jsonl", "squares").path == tmp_path / "kept" / "squares.jsonl"
    assert kept_here("squares.jsonl", "squares") is None
