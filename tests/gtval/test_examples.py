"""The example of every façade name runs, here and from the installed wheel."""

import doctest
import inspect
from importlib import import_module

import pytest

import gtval
import gtval.plugins
import gtval.testing

OPTIONS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE | doctest.FAIL_FAST


def functions(module):
    """Functions among the names of a module."""
    named = {name: getattr(module, name) for name in dir(module) if name[0] != "_"}
    own = {name: one for name, one in named.items() if inspect.isfunction(one)}
    return {name: one for name, one in own.items() if one.__module__.startswith("gtval.")}


EXAMPLES = {
    **{f"gtval.{name}": one for name, one in functions(gtval).items()},
    **{f"gtval.testing.{name}": one for name, one in functions(gtval.testing).items()},
    "gtval": gtval,
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_example_runs(name, tmp_path):
    known = {"gtval": gtval, "folder": tmp_path}
    parts = doctest.DocTestFinder(recurse=False).find(EXAMPLES[name], name, globs=known)
    examples = [example for part in parts for example in part.examples]
    assert 1 <= len(examples) <= 5
    told: list[str] = []
    runner = doctest.DocTestRunner(verbose=False, optionflags=OPTIONS)
    for part in parts:
        runner.run(part, out=told.append)
    assert not told, "".join(told)


@pytest.mark.parametrize("module", ["gtval", "gtval.plugins"])
def test_every_name_is_there_once_and_says_what_it_is(module):
    home = import_module(module)
    assert len(set(home.__all__)) == len(home.__all__)
    assert all(getattr(home, name).__doc__ for name in home.__all__ if name != "Progress")
