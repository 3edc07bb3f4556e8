"""Known errors: what went wrong, where, and what to do next.

Every error a user can cause ends in a :class:`GtvalError`, which the command line prints as
plain sentences with exit status 2. Bad files raise an :class:`InputError` that lists *all* the
bad places of the files read, not just the first.
"""

import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

LINES_NAMED = 15
"""Of these, lines whose numbers are told."""
MANY_ALIKE = 5
"""Bad places of one kind in one column up to which each has a line: more have one cause."""
MAX_SHOWN_PROBLEMS = 20
"""As many lines as stay on one screen of a terminal; the others are counted."""

_MAX_SHOWN_VALUE = 60
"""Characters of a bad value, so that file, line and what was expected stay on its line."""
_AGAIN = re.compile(r"([\x00-\x1f\x7f-\x9f\ufffd])\1+")
"""One control character again and again: what a loss of power leaves in a file."""


class GtvalError(Exception):
    """A known error, told in plain words; what a file put into them controls no terminal."""

    def __str__(self) -> str:
        return "".join(map(_harmless, super().__str__()))


class FaultyResultError(GtvalError):
    """What a system hands over is not what it promises: a fault of its program, not of the data."""


class FinalError(GtvalError):
    """A request that is refused for good: the same one would be refused again."""


@dataclass(frozen=True)
class Problem:
    """One bad place in an input file.

    Parameters
    ----------
    file : Path or str
        The file, as the user named it.
    expected : str
        What should have been there, in words.
    line : int, optional
        Line number, from 1; None where the whole file is meant.
    field : str, optional
        Column or key.
    value : str, optional
        What was found there.
    """

    file: Path | str
    expected: str
    line: int | None = None
    field: str | None = None
    value: str | None = None

    def __str__(self) -> str:
        where = f"{self.file}"
        if self.line is not None:
            where += f", line {self.line}"
        if self.field is not None:
            where += f", field {shown(self.field)}"
        if self.value is None:
            return f"{where}: {self.expected}"
        return f"{where}: {shown(self.value)} — {self.expected}"


def shown(value: str) -> str:
    """The value in quotes, shortened, with unprintable characters escaped, runs of one once."""
    short = "".join(map(_escaped, _AGAIN.sub(r"\1…", value)))
    if len(short) > _MAX_SHOWN_VALUE:
        short = short[: _MAX_SHOWN_VALUE - 1] + "…"
    return f"'{short}'"


def _escaped(character: str) -> str:
    """The character, escaped where it has no sign of its own."""
    if character.isprintable():
        return character
    return character.encode("unicode_escape", "surrogatepass").decode("ascii")


def _harmless(character: str) -> str:
    """The character, escaped where it controls a terminal or has no place in a text."""
    control = unicodedata.category(character).startswith("C") and character not in "\n\t"
    return _escaped(character) if control else character


class InputError(GtvalError):
    """Bad input files, with every bad place found.

    Parameters
    ----------
    problems : iterable of Problem
        At least one; what comes twice is told once.
    """

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(dict.fromkeys(problems))
        shown = _in_words(self.problems)
        more = len(shown) - MAX_SHOWN_PROBLEMS
        if more > 0:
            shown = [*shown[:MAX_SHOWN_PROBLEMS], f"… and {more} more."]
        super().__init__("\n".join(shown))


def _in_words(problems: Iterable[Problem]) -> list[str]:
    """The problems as text; of many alike in one column the first, and how many lines have it."""
    alike: dict[tuple[str, str | None, str], list[Problem]] = {}
    for one in problems:
        alike.setdefault((str(one.file), one.field, one.expected), []).append(one)
    told = []
    for one in problems:
        same = alike[str(one.file), one.field, one.expected]
        if len(same) <= MANY_ALIKE or one.line is None:
            told.append(str(one))
        elif one is same[0]:
            lines = ", ".join(str(other.line) for other in same[1:LINES_NAMED])
            left = len(same) - LINES_NAMED
            told.append(f"{one}; so in lines {lines}" + (f" and {left} more" if left > 0 else ""))
    return told
