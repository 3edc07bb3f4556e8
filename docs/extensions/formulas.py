"""In docstrings, bars and underscores belong to formulas: |w|, DICT_*. They are no markup."""

import re

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

_LITERAL = re.compile(r"(`+[^`]*`+)")
_MARKUP = re.compile(r"\||(?<=\w)_(?=\W|$)")


def escaped(line: str) -> str:
    """The line with bars and trailing underscores escaped, but for what stands in backticks."""
    parts = _LITERAL.split(line)
    parts[::2] = [_MARKUP.sub(lambda found: "\\" + found[0], part) for part in parts[::2]]
    return "".join(parts)


def _escape(
    _app: Sphinx, _what: str, _name: str, _thing: object, _options: object, lines: list[str]
) -> None:
    lines[:] = [escaped(line) for line in lines]


def setup(app: Sphinx) -> dict[str, bool]:
    """Before numpydoc reads a docstring; and a lexer for tables, which have no colours."""
    app.connect("autodoc-process-docstring", _escape, priority=100)
    app.add_lexer("csv", TextLexer)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
