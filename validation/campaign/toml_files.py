"""TOML files: read, and what is wrong in them told by file, line, key and value."""

import difflib
import re
import tomllib
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from validation.campaign.faults import in_words
from validation.errors import InputError, Problem
from validation.text_files.reading import file_bytes

MAX_TOML_BYTES = 1_000_000
"""A thousand times what people write: a larger file is something else under a wrong name."""


def read_toml(path: Path, what: str, missing: str) -> dict[str, Any]:
    """Contents of a TOML file.

    Parameters
    ----------
    path : Path
        The file.
    what : str
        What it is: 'a campaign.toml'.
    missing : str
        What is said where there is none.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        if not path.exists():
            raise InputError([Problem(path, missing)])
        data = file_bytes(path, MAX_TOML_BYTES, what, text=True)
        return tomllib.loads(data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        line = path.read_bytes()[: error.start].count(b"\n") + 1
        raise InputError([Problem(path, "not UTF-8; save the file as UTF-8", line)]) from None
    except tomllib.TOMLDecodeError as error:
        raise InputError([Problem(path, f"not valid TOML: {error}")]) from None
    except RecursionError:
        raise InputError([Problem(path, "not valid TOML: nested too deeply")]) from None
    except ValueError as error:  # a NUL byte in the name, or a number of thousands of digits
        raise InputError([Problem(path, f"cannot be read: {error}")]) from None


def input_error(
    path: Path, model: type[BaseModel], error: ValidationError, prefix: tuple[str, ...] = ()
) -> InputError:
    """The same faults with file, line and dotted key, and the keys that there are."""
    problems = []
    for fault in error.errors():
        keys = prefix + tuple(str(part) for part in fault["loc"] if part != "[key]")
        value = fault["input"]
        shown = None if fault["type"] == "missing" or isinstance(value, dict) else str(value)
        what = in_words(fault)
        if fault["type"] == "extra_forbidden":
            known = _keys_of(model, fault["loc"][:-1])
            what = f"unknown key{closest(keys[-1], known)}; there are {', '.join(sorted(known))}"
        problems.append(Problem(path, what, line_of(path, keys), ".".join(keys) or None, shown))
    return InputError(problems)


def _keys_of(model: type[BaseModel], loc: tuple[int | str, ...]) -> set[str]:
    """The keys of a table, by where it stands below the table of a model."""
    for name in (part for part in loc if isinstance(part, str) and part in model.model_fields):
        stated = model.model_fields[name].annotation
        inner = [one for one in (stated, *get_args(stated)) if isinstance(one, type)]
        model = next((one for one in inner if issubclass(one, BaseModel)), model)
    return set(model.model_fields)


def closest(key: str, known: set[str] | frozenset[str]) -> str:
    """'; did you mean ...?' where a known name is near; else nothing."""
    near = difflib.get_close_matches(key, known, 1)
    return f"; did you mean '{near[0]}'?" if near else ""


_TABLE = re.compile(r"\[\[?[^\[\],=]+\]\]?\s*(#.*)?$")
"""The line that begins a table; a row of a list has commas, or is one of numbers."""


def line_of(path: Path, keys: tuple[str, ...]) -> int | None:
    """Line on which a dotted key is set, as far as the text tells; None if it is not found.

    Parameters
    ----------
    path : Path
        A TOML file.
    keys : tuple of str
        The key; after the name of an array of tables, the number of the table, from 0.
    """
    names = [part for key in keys if not key.isdigit() for part in key.split(".")]
    if not names:
        return None
    wanted: dict[tuple[str, ...], int] = {}
    for at, key in enumerate(keys):
        if key.isdigit():
            wanted[tuple(one for one in keys[:at] if not one.isdigit())] = int(key)
    met: dict[tuple[str, ...], int] = {}
    prefix: list[str] = []
    best: int | None = None
    here = True
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    for number, line in enumerate(lines, 1):
        text = line.strip()
        if _TABLE.match(text):
            prefix = text.split("#")[0].strip("[] ").split(".")
            if text.startswith("[["):
                whole = tuple(prefix)
                below = {key: n for key, n in met.items() if key[: len(whole)] != whole}
                met = below | {whole: met.get(whole, -1) + 1}
            here = all(met.get(key, n) == n for key, n in wanted.items())
            if here and prefix == names[: len(prefix)]:
                best = number
            continue
        if not here:
            continue
        found = [*prefix, *text.split("=")[0].strip().strip('"').split(".")]
        if "=" in text and found == names[: len(found)]:
            return number
    return best
