"""In docstrings, bars and underscores belong to formulas: |w|, DICT_*. They are no markup."""

import re
from types import GenericAlias

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


def _is_alias(
    _app: Sphinx, _what: str, _name: str, thing: object, _skip: object, _options: object
) -> bool | None:
    """Leave out aliases such as ``tuple[str, ...]``, which autodoc takes for classes."""
    return True if isinstance(thing, GenericAlias) else None


def setup(app: Sphinx) -> dict[str, bool]:
    """Before numpydoc reads a docstring; and a lexer for tables, which have no colours."""
    app.connect("autodoc-process-docstring", _escape, priority=100)
    app.connect("autodoc-skip-member", _is_alias)
    app.add_lexer("csv", TextLexer)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
