"""A function's result is taken over where its arguments are the same, and only there."""

import ast
from pathlib import Path

import numpy as np
import pytest

from validation.pieces import results
from validation.pieces.results import kept_result, results_kept_in
from validation.pieces.store import counted
from validation.results import Size

ROOT = Path(__file__).parents[3]
calls = []


def measured(array, factor=1.0, progress=None):
    """What is decorated below, as if it were of a package of gtval."""
    calls.append(factor)
    if progress is not None:
        progress(0.5)
    if factor < 0:
        raise ValueError("negative")
    return [Size("a", float(array.sum() * factor)), array.T * factor]


measured.__module__ = "validation.statistics"
once = kept_result("progress")(measured)


@pytest.fixture(autouse=True)
def none_called():
    calls.clear()


def test_the_same_arguments_are_worked_out_once(tmp_path):
    array = np.arange(6.0).reshape(2, 3)
    with results_kept_in(tmp_path), counted() as first:
        one = once(array, 2.0)
    with results_kept_in(tmp_path), counted() as then:
        again = once(factor=2.0, array=array.copy(), progress=lambda _share: None)
    assert calls == [2.0]
    assert one[0] == again[0] == Size("a", 30.0)
    assert one[1].tobytes("A") == again[1].tobytes("A")
    assert one[1].strides == again[1].strides
    assert first.text() == ""
    assert then.text() == "Taken over from earlier runs: 1 of 1 steps of validation\n"
    with results_kept_in(tmp_path):
        once(array, 3.0)
        once(array + 1, 2.0)
    assert calls == [2.0, 3.0, 2.0]


def test_nothing_is_kept_outside_and_of_what_fails(tmp_path):
    once(np.ones((1, 1)))
    once(np.ones((1, 1)))
    with results_kept_in(tmp_path):
        for _ in range(2):
            with pytest.raises(ValueError, match="negative"):
                once(np.ones((1, 1)), -1.0)
    assert len(calls) == 4
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_told_is_worked_out_each_time(tmp_path):
    with results_kept_in(tmp_path):
        for _ in range(2):
            with pytest.raises(TypeError):
                once(np.ones((1, 1)), factor=print)
    assert calls == [print, print]


def test_what_a_whole_run_has_not_used_is_forgotten_and_a_killed_one_forgets_nothing(tmp_path):
    array = np.ones((1, 1))
    with results_kept_in(tmp_path):
        once(array, 1.0)
        once(array, 2.0)

    def stopped():
        with results_kept_in(tmp_path):
            once(array, 1.0)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    with results_kept_in(tmp_path):
        once(array, 2.0)
    assert calls == [1.0, 2.0]
    with results_kept_in(tmp_path):
        once(array, 1.0)
    assert calls == [1.0, 2.0, 1.0]


@pytest.mark.parametrize("cut", [0.3, 0.6, 0.99])
def test_a_line_that_cannot_be_read_is_worked_out_again(tmp_path, cut):
    array = np.ones((2, 2))
    with results_kept_in(tmp_path):
        expected = once(array)
    (path,) = (tmp_path / "kept").iterdir()
    text = path.read_bytes()
    for spoilt in (
        text[: int(cut * len(text))] + b"\n",
        text.replace(b"validation.results", b"os"),
    ):
        path.write_bytes(spoilt)
        with results_kept_in(tmp_path):
            assert once(array)[0] == expected[0]
    assert len(calls) == 3


def test_another_code_has_another_key(tmp_path, monkeypatch):
    with results_kept_in(tmp_path):
        once(np.ones((1, 1)))
    monkeypatch.setattr(results, "code_of", lambda *_names: b"other")
    with results_kept_in(tmp_path):
        once(np.ones((1, 1)))
    assert len(calls) == 2


def decorated():
    """Modules of functions whose results are kept."""
    for package in ("survey", "vision_gt", "laser_gt", "rtk_gt", "validation"):
        for path in sorted((ROOT / package).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            if "@kept_result" in text:
                for node in ast.parse(text).body:
                    if isinstance(node, ast.FunctionDef) and node.decorator_list:
                        name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
                        yield name, node.name


@pytest.mark.parametrize("module", sorted({name for name, _ in decorated()}))
def test_a_result_depends_on_code_of_its_package_and_of_validation_alone(module):
    grimp = pytest.importorskip("grimp")
    packages = ("laser_gt", "vision_gt", "validation", "survey", "rtk_gt", "data_samples")
    upstream = grimp.build_graph(*packages).find_upstream_modules(module)
    others = {one.partition(".")[0] for one in upstream} - {"validation"}
    assert others == {module.partition(".")[0]} - {"validation"}
