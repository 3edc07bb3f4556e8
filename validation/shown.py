"""How results look at a prompt and in a notebook."""

from collections.abc import Collection, Mapping
from dataclasses import fields
from functools import singledispatch
from typing import Any

MOST_ITEMS = 4
"""A judgement: so many names still read at one glance; of more only the number is told."""


class Shown:
    """Base of frozen results: one line at a prompt, tables in a notebook.

    The line has the fields that hold something, arrays by their shape. What a notebook shows is
    handed in: `html_of` has a form for each kind of result whose form is loaded.
    """

    def __repr__(self) -> str:
        said = (
            f"{field.name}={_brief(value)}"
            for field in fields(self)  # type: ignore[arg-type]
            if field.repr and not _is_empty(value := getattr(self, field.name))
        )
        return f"{type(self).__name__}({', '.join(said)})"

    def _repr_html_(self) -> str | None:
        """What a notebook shows; None, which means the line, where no form is loaded."""
        return html_of(self)


@singledispatch
def html_of(_result: object) -> str | None:
    """HTML of a result; a kind's form is added by ``html_of.register``."""
    return None


def _is_empty(value: object) -> bool:
    """Whether there is nothing to tell of."""
    return value is None or (isinstance(value, Collection) and not len(value))


def _brief(value: Any) -> str:
    """A value in a few characters."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, str | int):
        return repr(value)
    if hasattr(value, "shape"):
        return f"{value.shape} array"
    if isinstance(value, Collection):
        if (
            not isinstance(value, Mapping)
            and len(value) <= MOST_ITEMS
            and all(isinstance(item, str | int) for item in value)
        ):
            return repr(value)
        return f"{len(value)} items"
    return type(value).__name__
