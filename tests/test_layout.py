"""The rooms of the house: no circles, no crowds, no long modules, and pictures that are true."""

import ast
import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MOST_MODULES, MOST_LINES, MOST_CODE_LINES = 16, 450, 91_000
"""The code lines are those of today: whoever adds some looks for others that can go."""


def loaded(path):
    """A script as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


pictures = loaded(ROOT / "docs" / "make_room_pictures.py")


def folders(package):
    """Dotted names of a package and of its rooms that hold rooms or modules."""
    names = pictures.modules(package)
    return [name for name, path in names.items() if path.name == "__init__.py"]


@pytest.mark.parametrize("package", pictures.PACKAGES)
def test_no_rooms_import_each_other_in_a_circle(package):
    # Imports inside functions and those for type checkers count: a circle is one wherever it
    # is written.
    own = pictures.modules(package)
    found = {name: pictures.circles(pictures.arrows(name, own)) for name in folders(package)}
    assert {name: some for name, some in found.items() if some} == {}


@pytest.mark.parametrize("package", pictures.PACKAGES)
def test_no_folder_is_crowded_and_no_module_long(package):
    own = pictures.modules(package)
    for folder in {path.parent for path in own.values()}:
        assert len(list(folder.glob("*.py"))) <= MOST_MODULES, folder
    for path in own.values():
        assert len(path.read_text(encoding="utf-8").splitlines()) <= MOST_LINES, path


def code_lines(text):
    """Lines of a module that are no docstring, no comment and not blank."""
    told = {
        line
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
        for line in range(node.lineno, node.end_lineno + 1)
    }
    lines = enumerate(text.splitlines(), 1)
    return sum(1 for at, line in lines if at not in told and line.strip()[:1] not in {"", "#"})


def test_code_lines_are_counted_without_what_is_said_of_them():
    text = '"""A module."""\n\n# a comment\nx = [\n    1,  # one\n]\n"""What x is."""\n'
    assert code_lines(text) == 3


def test_the_packages_do_not_grow():
    texts = [
        path.read_text(encoding="utf-8")
        for package in pictures.PACKAGES
        for path in pictures.modules(package).values()
    ]
    assert sum(map(code_lines, texts)) <= MOST_CODE_LINES


@pytest.mark.parametrize("package", pictures.PACKAGES)
def test_the_kept_picture_is_the_one_that_the_imports_give(package):
    kept = ROOT / "docs" / "images" / f"rooms_{package}.svg"
    assert kept.read_text(encoding="utf-8") == pictures.picture(package), "run `make images`"


def test_an_arrow_that_follows_from_others_is_left_out():
    graph = {"a": set(), "b": {"a"}, "c": {"a", "b"}, "d": {"a"}}
    assert pictures.shortest(graph) == {"a": set(), "b": {"a"}, "c": {"b"}, "d": {"a"}}


def test_a_circle_is_found_however_long():
    graph = {"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}
    assert pictures.circles(graph) == [("a", "b", "c")]
