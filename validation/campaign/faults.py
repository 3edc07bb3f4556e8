"""What is wrong with a value of campaign.toml, in words: pydantic's own are for programmers."""

from collections.abc import Mapping
from typing import Any

NAME = r"^[^\s/,;\"]+$"
"""Pattern of the names of points, stops, cameras and receivers."""
SYSTEM = r"^[a-z][a-z0-9_]*$"
"""Pattern of the names of systems."""

_PATTERNS = {
    NAME: "write a name without spaces, '/', ',', ';' and quotes",
    SYSTEM: "write a name of small letters, digits and '_' that begins with a letter",
}
_TYPES = {
    "string": "write a text in quotes",
    "float": "write a number, without quotes and without a unit",
    "int": "write a whole number, without quotes",
    "bool": "write true or false, without quotes",
    "date": "write a date as YYYY-MM-DD, without a time",
    "list": "write a list, in square brackets",
    "tuple": "write a list, in square brackets",
    "dict": "write a table: keys and values under a heading in square brackets",
    "model": "write a table: keys and values under a heading in square brackets",
}
_LIMITS = {
    "string_too_short": "write a text that is not empty",
    "finite_number": "write a finite number",
    "greater_than": "write a number greater than {gt:g}",
    "greater_than_equal": "write a number of at least {ge:g}",
    "less_than": "write a number less than {lt:g}",
    "less_than_equal": "write a number of at most {le:g}",
    "literal_error": "write one of {expected}",
    "too_long": "write {max_length} values, not {actual_length}",
}


def in_words(fault: Mapping[str, Any]) -> str:
    """What to write in place of a bad value.

    Parameters
    ----------
    fault : mapping
        One of pydantic's ValidationError.errors().
    """
    kind, context = str(fault["type"]), fault.get("ctx", {})
    if kind == "missing" and fault["loc"] and isinstance(fault["loc"][-1], int):
        return f"the list is too short; add value number {fault['loc'][-1] + 1}"
    if kind == "missing":
        return "the key is missing; add it"
    if kind == "string_pattern_mismatch":
        return _PATTERNS.get(context["pattern"], f"write a text like {context['pattern']}")
    if kind in _LIMITS:
        return _LIMITS[kind].format(**context)
    own = str(fault["msg"]).removeprefix("Value error, ")
    return own if kind == "value_error" else _TYPES.get(kind.partition("_")[0], own)
