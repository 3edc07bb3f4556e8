"""What is wrong with a value of campaign.toml, in words: pydantic's own are for programmers."""

from collections.abc import Mapping
from typing import Any

NAME = r"^[^\s/,;\"]+$"
"""Pattern of the names of points, stops, cameras and receivers."""
SYSTEM = r"^[a-z][a-z0-9_]*$"
"""Pattern of the names of systems."""

_LIST = "write a list, in square brackets"
_TABLE = "write a table: keys and values under a heading in square brackets"
_WORDS = {
    NAME: "write a name without spaces, '/', ',', ';' and quotes",
    SYSTEM: "write a name of small letters, digits and '_' that begins with a letter",
    "string": "write a text in quotes",
    "string_too_short": "write a text that is not empty",
    "float": "write a number, without quotes and without a unit",
    "int": "write a whole number, without quotes",
    "bool": "write true or false, without quotes",
    "date": "write a date as YYYY-MM-DD, without a time",
    "list": _LIST,
    "tuple": _LIST,
    "dict": _TABLE,
    "model": _TABLE,
    "finite_number": "write a finite number",
    "greater_than": "write a number greater than {gt:g}",
    "greater_than_equal": "write a number of at least {ge:g}",
    "less_than": "write a number less than {lt:g}",
    "less_than_equal": "write a number of at most {le:g}",
    "literal_error": "write one of {expected}",
    "too_long": "write {max_length} values, not {actual_length}",
    "too_short": "write at least {min_length} values, not {actual_length}",
    "missing": "the key is missing; add it",
}
"""By the kind of a fault, the word that it begins with, or the pattern that it is about."""


def in_words(fault: Mapping[str, Any]) -> str:
    """What to write in place of a bad value.

    Parameters
    ----------
    fault : mapping
        One of pydantic's ValidationError.errors().
    """
    kind, context = str(fault["type"]), fault.get("ctx", {})
    if kind == "missing" and isinstance(fault["loc"][-1], int):
        return f"the list is too short; add value number {fault['loc'][-1] + 1}"
    own = str(fault["msg"]).removeprefix("Value error, ")
    known = (context.get("pattern", ""), kind, kind.partition("_")[0])
    words = [_WORDS[one].format(**context) for one in known if one in _WORDS]
    return words[0] if words else own
