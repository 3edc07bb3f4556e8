"""Names that are loaded when they are first used, so that importing them costs next to nothing."""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module


def lazily(module: str, homes: Mapping[str, str]) -> Callable[[str], object]:
    """The ``__getattr__`` of a module whose names live in others (PEP 562).

    Parameters
    ----------
    module : str
        The module, its ``__name__``.
    homes : mapping of str to str
        Names, separated by spaces, by the module that holds them.
    """
    home_of = {name: home for home, names in homes.items() for name in names.split()}

    def load(name: str) -> object:
        if name not in home_of:
            raise AttributeError(f"module '{module}' has no attribute '{name}'")
        value = getattr(import_module(home_of[name]), name)
        setattr(sys.modules[module], name, value)
        return value

    return load
