"""Results as JSON that any reader takes: no NaN, no types of our own."""

import json
import math
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any


def as_json(value: Any) -> Any:
    """The value as nested dicts, lists, str, int, float, bool and None.

    Parameters
    ----------
    value : object
        Dataclasses, named tuples, pydantic models, mappings, sequences, numpy arrays and
        scalars, paths, dates, or anything nested of these. NaN and infinity become None, as
        JSON knows neither; fields that are functions are left out.
    """
    if isinstance(value, Enum):
        return as_json(value.value)
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    named = _named_parts(value)
    if named is not None:
        return {str(name): as_json(item) for name, item in named.items() if not callable(item)}
    return _list_or_text(value)


def _named_parts(value: Any) -> Mapping[Any, Any] | None:
    """The fields of a record or the items of a mapping; None for all else."""
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: getattr(value, f.name) for f in fields(value)}
    if hasattr(value, "model_dump"):
        return dict(value.model_dump())
    if hasattr(value, "_asdict"):
        return dict(value._asdict())
    return value if isinstance(value, Mapping) else None


def _list_or_text(value: Any) -> Any:
    """Arrays and collections as lists, all else as text."""
    if hasattr(value, "tolist"):
        return as_json(value.tolist())
    if isinstance(value, AbstractSet):
        return [as_json(item) for item in sorted(value)]
    if isinstance(value, Path):
        return value.as_posix()
    if hasattr(value, "isoformat"):
        return value.isoformat()
    if hasattr(value, "__iter__"):
        return [as_json(item) for item in value]
    return str(value)


def json_text(value: Any, *, ascii_only: bool = False) -> str:
    """The value as indented JSON text ending in a line break; see `as_json`.

    Parameters
    ----------
    value : object
        As for `as_json`.
    ascii_only : bool
        Whether all other characters are escaped.
    """
    text = json.dumps(as_json(value), indent=2, ensure_ascii=ascii_only, allow_nan=False)
    return text + "\n"
