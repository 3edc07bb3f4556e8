"""Results of single functions kept from one run to the next, by all that they are given."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import ParamSpec, TypeVar

from validation.pieces.store import FOLDER, KeptPieces, code_of, kept_in, key_of
from validation.pieces.values import UnknownKindError, as_json, digest_of_value, from_json

Given = ParamSpec("Given")
Result = TypeVar("Result")


class _Kept:
    """The results of one campaign, and which of them this run has used."""

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder
        self._files: dict[str, KeptPieces] = {}
        self._used: dict[str, list[str]] = {}

    def of(self, package: str) -> KeptPieces:
        """Those of the functions of a package."""
        if package not in self._files and self.folder is not None:
            path = self.folder / f"{package}_steps.jsonl"
            self._files[package] = KeptPieces(path, f"steps of {package.removesuffix('_gt')}")
        return self._files[package]

    def use(self, package: str, key: str) -> None:
        """Tell that this run has used a result."""
        self._used.setdefault(package, []).append(key)

    def close(self) -> None:
        """Forget what this run has not used."""
        for package, keys in self._used.items():
            self._files[package].forget_others(dict.fromkeys(keys))


_kept: ContextVar[_Kept | None] = ContextVar("kept", default=None)


@contextmanager
def results_kept_in(campaign: Path | None) -> Iterator[None]:
    """Keep results of `kept_result` functions, and pieces as `kept_in`, below a campaign folder.

    Those that a whole block has not used are forgotten at its end. Inside another such block
    that one counts, and with None nothing is kept.
    """
    if _kept.get() is not None:
        yield
        return
    kept = _Kept(None if campaign is None else campaign / FOLDER)
    token = _kept.set(kept)
    try:
        with nullcontext() if campaign is None else kept_in(campaign):
            yield
        kept.close()
    finally:
        _kept.reset(token)


def kept_result(
    *apart: str,
) -> Callable[[Callable[Given, Result]], Callable[Given, Result]]:
    """Keep what a function returns, where `results_kept_in` says; for what takes half a second.

    Parameters
    ----------
    *apart : str
        Parameters that the result does not depend on, as one that is told the progress.

    Notes
    -----
    The function must depend on nothing but its arguments. A result is read again from what was
    kept of it, also by the run that makes it, so that later runs cannot differ by the order in
    which an array lies in memory. What cannot be written as `validation.pieces.values` does is
    worked out each time.
    """

    def decorated(function: Callable[Given, Result]) -> Callable[Given, Result]:
        parameters = signature(function)
        package = function.__module__.partition(".")[0]

        @wraps(function)
        def once(*args: Given.args, **more: Given.kwargs) -> Result:
            kept = _kept.get()
            if kept is None or kept.folder is None:
                return function(*args, **more)
            bound = parameters.bind(*args, **more)
            bound.apply_defaults()
            given = {name: one for name, one in bound.arguments.items() if name not in apart}
            try:
                told = [function.__module__, function.__qualname__, digest_of_value(given)]
            except UnknownKindError:
                return function(*args, **more)
            key = key_of(code_of(package, "validation"), json.dumps(told).encode())
            return _done_once(key, kept, package, lambda: function(*args, **more))

        return once

    return decorated


def _done_once(key: str, kept: _Kept, package: str, work: Callable[[], Result]) -> Result:
    """A result that is kept, or is worked out and kept."""
    pieces = kept.of(package)
    kept.use(package, key)
    try:
        told = pieces.get(key)
        if told is not None:
            found: Result = from_json(told["is"])
            pieces.count(taken=1)
            return found
    except (ValueError, LookupError, TypeError, AttributeError, ImportError, RecursionError):
        pass  # it is done again
    result = work()
    try:
        line = as_json(result)
        again: Result = from_json(line)
    except UnknownKindError:
        return result
    pieces.add(key, {"is": line})
    pieces.count(done=1)
    return again
