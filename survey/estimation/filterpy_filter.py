"""filterpy's extended Kalman filter, imported without what the survey never uses of it.

On import filterpy takes two distributions from scipy.stats, for densities and plots, and asks
one of them whether it knows the argument ``allow_singular``. Loading scipy.stats takes longer
than solving a whole survey; it is put off until one of the two is used.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import Any

_PUT_OFF = "scipy.stats"


def extended_kalman_filter(dim_x: int, dim_z: int) -> Any:
    """A ``filterpy.kalman.ExtendedKalmanFilter`` for so many states and measurements."""
    with _stats_put_off():
        from filterpy.kalman import ExtendedKalmanFilter  # noqa: PLC0415

    return ExtendedKalmanFilter(dim_x=dim_x, dim_z=dim_z)


class _WhenUsed:
    """A name of scipy.stats that is looked up when it is used."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> Any:
        if isinstance(sys.modules.get(_PUT_OFF), _PutOff):
            return _accept_anything
        return getattr(getattr(import_module(_PUT_OFF), self._name), attribute)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return getattr(import_module(_PUT_OFF), self._name)(*args, **kwargs)


def _accept_anything(*_args: Any, **_kwargs: Any) -> None:
    """What the question for an argument meets during the import: every SciPy of today knows it."""


class _PutOff(ModuleType):
    """Stands for scipy.stats while filterpy is imported."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return _WhenUsed(name)


@contextmanager
def _stats_put_off() -> Iterator[None]:
    """scipy.stats is not loaded by an import, unless it or filterpy is there already."""
    if _PUT_OFF in sys.modules or "filterpy.kalman" in sys.modules:
        yield
        return
    stand_in = _PutOff(_PUT_OFF)
    sys.modules[_PUT_OFF] = stand_in
    try:
        yield
    finally:
        if sys.modules.get(_PUT_OFF) is stand_in:
            del sys.modules[_PUT_OFF]
