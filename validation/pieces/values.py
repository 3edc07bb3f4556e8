"""Values of computations as JSON and back, to the last bit; nothing that is read is executed."""

import base64
import json
import math
import sys
from collections.abc import Callable, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import fields, is_dataclass
from datetime import date
from enum import Enum
from functools import partial
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel
from scipy.sparse import csr_array
from scipy.spatial.transform import RigidTransform, Rotation

PACKAGES = ("survey", "vision_gt", "laser_gt", "rtk_gt", "validation")
"""Whose classes may stand in a value."""
_PLAIN = (type(None), bool, int, float, str)
_COLLECTIONS = (tuple, list, set, frozenset, dict, MappingProxyType)
_KINDS = "biufcSUmM"
"""Of arrays: numbers, truth values, texts and times, but no objects."""


Octets = npt.NDArray[np.uint8]


_OF_SCIPY: Mapping[str, tuple[type, Callable[[Any], tuple[Any, ...]], Callable[..., Any]]] = {
    "transform": (
        RigidTransform,
        lambda one: (one.as_matrix(),),
        partial(RigidTransform, normalize=False),
    ),
    "rotation": (Rotation, lambda one: (one.as_quat(),), partial(Rotation, normalize=False)),
    "sparse rows": (
        csr_array,
        lambda one: (one.data, one.indices, one.indptr, one.shape),
        lambda data, indices, starts, shape: csr_array((data, indices, starts), shape),
    ),
}
"""Kinds of scipy: what they are made of, and how they are made of it to the last bit."""


class UnknownKindError(TypeError):
    """A value has a part that is of no kind that can be kept."""


def as_json(value: object) -> Any:
    """A value in terms of JSON; what it is made of is told beside it.

    An object that comes again is told once, so that it is one object again when it is read.

    Parameters
    ----------
    value : object
        Numbers, texts, arrays, paths, dates, collections, and frozen results of gtval's packages.

    Raises
    ------
    UnknownKindError
        For anything else, as a function or a random generator.
    """
    return _Writer().told(value)


def digest_of_value(value: object) -> str:
    """SHA-256 of a value: the same for values of the same parts, whichever of them are one object.

    Raises
    ------
    UnknownKindError
        As of `as_json`.
    """
    return _text(_Digester().told(value))


def _text(told: object) -> str:
    return sha256(json.dumps(told).encode()).hexdigest()


class _Writer:
    """Tells values in terms of JSON."""

    def __init__(self) -> None:
        self._known: dict[int, Any] = {}
        self._held: list[object] = []
        """So that no other object gets the place of one that is known."""

    def told(self, value: Any) -> Any:
        """A value, or where it was told before."""
        if type(value) in _PLAIN:
            return value
        if id(value) not in self._known:
            made = self._parts(value)
            self._held.append(value)
            first, self._known[id(value)] = self.both(made)
            return first
        return self._known[id(value)]

    def both(self, made: Any) -> tuple[Any, Any]:
        """What stands for an object at first, and when it comes again: its number."""
        return made, {"again": len(self._known)}

    def octets(self, flat: Octets) -> str:
        """What stands for the octets of an array."""
        return base64.b64encode(flat.data).decode("ascii")

    def _parts(self, value: Any) -> Any:
        kind = type(value)
        if kind in _COLLECTIONS:
            return {"collection": kind.__name__, "of": self._items(value)}
        if isinstance(value, np.ndarray | np.generic):
            return self._array(value)
        if isinstance(value, Enum):
            return {"enum": _class_name(type(value)), "is": value.name}
        own = self._single(value) or self._of_scipy(value)
        return own or {"class": _class_name(kind), "of": self._of_class(value)}

    def _single(self, value: Any) -> dict[str, Any] | None:
        if isinstance(value, bytes):
            return {"bytes": self.octets(np.frombuffer(value, np.uint8))}
        if isinstance(value, Path):
            return {"path": str(value)}
        return {"date": value.isoformat()} if type(value) is date else None

    def _items(self, value: Any) -> list[Any]:
        """What a collection holds: pairs of a mapping, and of a set in an order of its own."""
        if isinstance(value, Mapping):
            return [[self.told(key), self.told(one)] for key, one in value.items()]
        if isinstance(value, AbstractSet):
            value = sorted(value, key=repr)
        return [self.told(one) for one in value]

    def _array(self, value: Any) -> Any:
        if value.dtype.kind not in _KINDS or isinstance(value, np.ma.MaskedArray | np.matrix):
            raise UnknownKindError(f"an array of {value.dtype}")
        rows = np.asarray(value)
        columns = rows.flags.f_contiguous and not rows.flags.c_contiguous
        flat = np.ascontiguousarray(rows.T if columns else rows).reshape(-1)
        return {
            "array": rows.dtype.str,
            "shape": list(rows.shape),
            "order": "F" if columns else "C",
            "single": isinstance(value, np.generic),
            "is": self.octets(flat.view(np.uint8)),
        }

    def _of_scipy(self, value: Any) -> dict[str, Any] | None:
        for name, (kind, parts, _) in _OF_SCIPY.items():
            if type(value) is kind:
                return {"scipy": name, "of": [self.told(one) for one in parts(value)]}
        return None

    def _of_class(self, value: Any) -> Any:
        if is_dataclass(value):
            return {one.name: self.told(getattr(value, one.name)) for one in fields(value)}
        if isinstance(value, tuple):  # named
            return [self.told(one) for one in value]
        if isinstance(value, BaseModel):
            return {name: self.told(one) for name, one in vars(value).items()}
        raise UnknownKindError(f"{type(value).__module__}.{type(value).__qualname__}")


class _Digester(_Writer):
    """Tells each object by the digest of its parts."""

    def both(self, made: Any) -> tuple[Any, Any]:
        return (_text(made),) * 2

    def octets(self, flat: Octets) -> str:
        return sha256(flat.data).hexdigest()


def _class_name(kind: type) -> str:
    """'module:class' of one that may stand in a value."""
    if kind.__module__.partition(".")[0] not in PACKAGES or "<" in kind.__qualname__:
        raise UnknownKindError(f"{kind.__module__}.{kind.__qualname__}")
    return f"{kind.__module__}:{kind.__qualname__}"


def from_json(told: Any) -> Any:
    """The value that `as_json` was given.

    Raises
    ------
    ValueError, LookupError, TypeError, AttributeError, ImportError
        If it was not.
    """
    return _Reader().read(told)


class _Reader:
    """Reads values, each object that comes again as the one that it was."""

    def __init__(self) -> None:
        self._made: list[Any] = []

    def read(self, told: Any) -> Any:
        """A value."""
        if isinstance(told, _PLAIN):
            nothing = isinstance(told, float) and math.isnan(told)
            return math.nan if nothing else told  # one object, as where it is a default
        form = next(iter(told))
        if form == "again":
            return self._made[told["again"]]
        made = getattr(self, _READERS[form])(told)
        self._made.append(made)
        return made

    def _array(self, told: Mapping[str, Any]) -> Any:
        dtype = np.dtype(told["array"])
        if dtype.kind not in _KINDS:
            raise TypeError(f"an array of {dtype}")
        flat = np.frombuffer(base64.b64decode(told["is"]), dtype).copy()  # one may write to a copy
        rows = flat.reshape(told["shape"], order=told["order"])
        return rows[()] if told["single"] else rows

    def _collection(self, told: Mapping[str, Any]) -> Any:
        kind = next(one for one in _COLLECTIONS if one.__name__ == told["collection"])
        if kind in {dict, MappingProxyType}:
            pairs = {self.read(key): self.read(one) for key, one in told["of"]}
            return pairs if kind is dict else MappingProxyType(pairs)
        return kind(map(self.read, told["of"]))

    def _class(self, told: Mapping[str, Any]) -> Any:
        """A result with its parts, as they were: they were checked when it was made."""
        kind, parts = _class_of(told["class"]), told["of"]
        if is_dataclass(kind) and isinstance(kind, type):
            if set(parts) != {one.name for one in fields(kind)}:
                raise ValueError(f"{kind} has other parts")
            made: Any = object.__new__(kind)
            for name, one in parts.items():
                object.__setattr__(made, name, self.read(one))
            return made
        if issubclass(kind, tuple) and hasattr(kind, "_fields"):
            return kind(*map(self.read, parts))
        if issubclass(kind, BaseModel):
            return kind.model_construct(**{name: self.read(one) for name, one in parts.items()})
        raise TypeError(f"{kind} is no result")

    def _enum(self, told: Mapping[str, Any]) -> Enum:
        kind = _class_of(told["enum"])
        if not issubclass(kind, Enum):
            raise TypeError(f"{kind} is no enumeration")
        return kind[told["is"]]

    def _scipy(self, told: Mapping[str, Any]) -> Any:
        return _OF_SCIPY[told["scipy"]][2](*map(self.read, told["of"]))

    def _bytes(self, told: Mapping[str, Any]) -> bytes:
        return base64.b64decode(told["bytes"])

    def _path(self, told: Mapping[str, Any]) -> Path:
        return Path(told["path"])

    def _date(self, told: Mapping[str, Any]) -> date:
        return date.fromisoformat(told["date"])


_FORMS = ("array", "collection", "class", "enum", "scipy", "bytes", "path", "date")
_READERS = {form: f"_{form}" for form in _FORMS}
"""By the first name of what stands for a value."""


def _class_of(name: str) -> type:
    """A class of gtval's packages by its name."""
    module, _, path = name.partition(":")
    if module.partition(".")[0] not in PACKAGES:
        raise TypeError(f"{name} is not of gtval")
    found: Any = sys.modules.get(module) or import_module(module)
    for part in path.split("."):
        found = getattr(found, part)
    if not isinstance(found, type):
        raise TypeError(f"{name} is no class")
    return found
