"""Wrong arguments of a function end in words that say what it takes."""

import functools
import inspect
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from validation.errors import GtvalError

P = ParamSpec("P")
R = TypeVar("R")


def said_plainly(function: Callable[P, R]) -> Callable[P, R]:
    """The function; what it cannot use ends in a GtvalError with its arguments as they are given.

    Parameters
    ----------
    function : callable
        Of the names of `gtval`.

    Raises
    ------
    GtvalError
        When the function is called with arguments that it cannot use.
    """

    @functools.wraps(function)
    def plain(*arguments: P.args, **options: P.kwargs) -> R:
        try:
            return function(*arguments, **options)
        except (GtvalError, MemoryError):
            raise
        except Exception as error:
            signature = inspect.signature(function)
            try:
                given = signature.bind(*arguments, **options).arguments
            except TypeError as wrong:
                text = f"gtval.{function.__name__}{signature}: {wrong}"
                raise GtvalError(text) from error
            listed = ", ".join(f"{name}: {_kind(value)}" for name, value in given.items())
            first = str(error).splitlines()[0] if str(error) else ""
            text = (
                f"gtval.{function.__name__} cannot use these arguments ({listed}): "
                f"{type(error).__name__}: {first}. It takes {signature}; "
                f"help(gtval.{function.__name__}) says more."
            )
            raise GtvalError(text) from error

    return plain


def _kind(value: object) -> str:
    """'(5, 2) array', 'list of 3', 'str'."""
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple):
        return f"{shape} array"
    if isinstance(value, list | tuple | dict):
        return f"{type(value).__name__} of {len(value)}"
    return type(value).__name__
