"""Poses with covariances, named components and where they came from."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations_with_replacement
from pathlib import Path
from typing import Literal, Self

import numpy as np
import numpy.typing as npt

from validation.errors import FaultyResultError, GtvalError, InputError, Problem, shown
from validation.poses.angles import Array, wrap
from validation.poses.covariances import all_sound, bad_place, covariance_fault
from validation.poses.follows import Follows
from validation.poses.nets import Net
from validation.shown import Shown
from validation.text_files.csv_tables import Column, read_csv
from validation.text_files.csv_text import harmless


@dataclass(frozen=True)
class Component:
    """One number of a pose.

    Parameters
    ----------
    name : str
        'x', 'theta', ...
    kind : {"length", "angle"}
        Metres or radians; the difference of angles is wrapped to (-pi, pi].
    code : str
        One letter for the covariance columns.
    """

    name: str
    kind: Literal["length", "angle"]
    code: str

    @property
    def unit(self) -> str:
        """'m' or 'rad'."""
        return "m" if self.kind == "length" else "rad"


PLANAR = (
    Component("x", "length", "x"),
    Component("y", "length", "y"),
    Component("theta", "angle", "t"),
)
MAKERS = ("camera", "scanner", "receiver", "observer", "day")
"""Kinds of who makes a pose: a source says 'camera 2, day 2023-05-04'."""
SPATIAL = (
    Component("x", "length", "x"),
    Component("y", "length", "y"),
    Component("z", "length", "z"),
    Component("yaw", "angle", "w"),
    Component("pitch", "angle", "p"),
    Component("roll", "angle", "r"),
)


@dataclass(frozen=True, repr=False)
class PoseTable(Shown):
    """Poses of one system at named stops, in the GTV frame.

    Parameters
    ----------
    system : str
        'survey', 'vision', 'laser_genetic', ...
    ids : sequence of str
        Names of the stops, unique, n of them.
    poses : (n, k) array
        One pose a row, metres and radians, in the order of ``components``.
    covariances : (n, k, k) array, optional
        Covariance of each; all NaN for a pose whose covariance is not stated.
    components : tuple of Component
        PLANAR or SPATIAL, or another choice of named numbers.
    sources : sequence of str, optional
        Where each pose came from: 'camera 4+1', 'published', ...
    joint : (n k, n k) array, optional
        Covariance of all poses together, where they are correlated.
    factor : (n k, r) array, optional
        The same in few numbers, where poses share the errors of few unknowns: the covariance
        between two different poses is ``factor`` times its transpose there. Instead of ``joint``;
        `joint_covariance` gives the matrix of either.
    signs : (r,) array, optional
        1 or -1 for each column of the factor, all 1 by default: what a column of -1 gives is taken
        away, as where poses err less together than each of them.
    net : Net, optional
        What the poses err as parts of a net of measurements, beside the factor; also instead of
        ``joint``.
    provenance : mapping
        Facts of the whole table for results/run.json.
    follows : Follows, optional
        How its errors follow those of another table, where its frame or mount came from that.

    Raises
    ------
    FaultyResultError
        For repeated ids, wrong shapes, numbers that are not finite, and covariances that are
        not symmetric and positive definite.
    """

    system: str
    ids: tuple[str, ...]
    poses: Array
    covariances: Array = field(default_factory=lambda: np.empty(0))
    components: tuple[Component, ...] = PLANAR
    sources: tuple[str, ...] = ()
    joint: Array | None = None
    factor: Array | None = None
    signs: Array | None = None
    net: Net | None = None
    provenance: Mapping[str, object] = field(default_factory=dict)
    follows: Follows | None = None

    def __post_init__(self) -> None:
        n, k = len(self.ids), len(self.components)
        poses = (
            np.asarray(self.poses, dtype=float).reshape(-1, k)
            if n == 0
            else np.asarray(self.poses, dtype=float)
        )
        covariances = np.asarray(self.covariances, dtype=float)
        if covariances.size == 0:
            covariances = np.full((n, k, k), np.nan)
        object.__setattr__(self, "ids", tuple(str(name) for name in self.ids))
        object.__setattr__(self, "poses", poses)
        object.__setattr__(self, "covariances", covariances)
        object.__setattr__(self, "sources", tuple(self.sources) or ("",) * n)
        if self.factor is None:
            object.__setattr__(self, "signs", None)
        self._check(n, k)

    def _check(self, n: int, k: int) -> None:
        """Raise for anything that would make later numbers meaningless."""
        who = f"poses of system '{self.system}'"
        if self.poses.shape != (n, k):
            raise FaultyResultError(f"{who}: expected {(n, k)} numbers, got {self.poses.shape}")
        if self.covariances.shape != (n, k, k):
            raise FaultyResultError(f"{who}: covariances {self.covariances.shape}, not {(n, k, k)}")
        self._check_joint(who, n * k)
        if len(self.sources) != n:
            raise FaultyResultError(f"{who}: {len(self.sources)} sources for {n} poses")
        bad = [name for name in self.ids if not name.isprintable() or name.strip() != name]
        if bad or "" in self.ids:
            raise FaultyResultError(f"{who}: not a name for a stop: {shown(bad[0] if bad else '')}")
        if len(set(self.ids)) != n:
            twice = sorted(name for name, count in Counter(self.ids).items() if count > 1)
            raise FaultyResultError(f"{who}: these ids occur more than once: {', '.join(twice)}")
        if np.isfinite(self.poses).all() and all_sound(self.covariances):
            return
        for name, pose, covariance in zip(self.ids, self.poses, self.covariances, strict=True):
            if not np.isfinite(pose).all():
                raise FaultyResultError(f"{who}: pose {name} is not finite: {pose}")
            fault = covariance_fault(covariance)
            if fault:
                raise FaultyResultError(f"{who}: the covariance of pose {name} {fault}")

    def _check_joint(self, who: str, size: int) -> None:
        """Raise for a joint covariance of another number of poses."""
        if self.joint is not None and self.joint.shape != (size, size):
            raise FaultyResultError(
                f"{who}: joint covariance {self.joint.shape}, not {(size, size)}"
            )
        if self.joint is not None and (self.factor is not None or self.net is not None):
            raise FaultyResultError(f"{who}: give the joint covariance or its factor, not both")
        if self.net is not None and self.net.by.shape[0] != size:
            raise FaultyResultError(f"{who}: a net of {self.net.by.shape[0]} numbers, not {size}")
        if self.factor is not None:
            if self.factor.ndim != 2 or len(self.factor) != size:
                raise FaultyResultError(f"{who}: factor {self.factor.shape}, not {size} rows")
            signs = np.ones(self.factor.shape[1]) if self.signs is None else self.signs
            if signs.shape != self.factor.shape[1:] or not (np.abs(signs) == 1).all():
                raise FaultyResultError(f"{who}: signs are 1 or -1 for each column of the factor")
        if self.follows is not None and len(self.follows.by) != size:
            raise FaultyResultError(f"{who}: follows by {len(self.follows.by)} rows, not {size}")

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def has_covariance(self) -> npt.NDArray[np.bool_]:
        """(n,) True where a covariance is stated."""
        return np.asarray(np.isfinite(self.covariances).all((1, 2)))

    @property
    def is_correlated(self) -> bool:
        """Whether it states how its poses are correlated."""
        return not (self.joint is None and self.factor is None and self.net is None)

    @property
    def joint_covariance(self) -> Array | None:
        """(n k, n k) covariance of all poses together; None where no correlation is known."""
        if self.factor is None and self.net is None:
            return self.joint
        n, k = self.poses.shape
        rows, signs = self.shared_part()
        flat = rows.reshape(n * k, len(signs))
        whole = (flat * signs) @ flat.T
        if self.net is not None:
            whole = whole + self.net.matrix()
        whole = whole.reshape(n, k, n, k)
        whole[np.arange(n), :, np.arange(n)] = self.covariances
        return whole.reshape(n * k, n * k)

    def shared_part(self) -> tuple[Array, Array]:
        """Rows (n, k, r) of the factor, of no columns where there is none, and signs (r,)."""
        n, k = self.poses.shape
        columns = 0 if self.factor is None else self.factor.shape[1]
        rows = np.zeros((n, k, 0)) if self.factor is None else self.factor.reshape(n, k, columns)
        return rows, np.ones(rows.shape[2]) if self.signs is None else self.signs

    def own_covariances(self) -> Array:
        """(n, k, k) what each pose has beside what factor and net say it shares."""
        rows, signs = self.shared_part()
        own = self.covariances - (rows * signs) @ np.swapaxes(rows, 1, 2)
        return np.asarray(own if self.net is None else own - self.net.blocks)

    def select(self, ids: Iterable[str]) -> Self:
        """The rows of the named stops, in that order."""
        chosen = tuple(ids)
        if chosen == self.ids:
            return self
        where = {name: row for row, name in enumerate(self.ids)}
        missing = [name for name in chosen if name not in where]
        if missing:
            raise GtvalError(f"system '{self.system}' has no pose {', '.join(missing)}")
        rows = [where[name] for name in chosen]
        k = len(self.components)
        flat = (np.array(rows, dtype=int)[:, None] * k + np.arange(k)).ravel()
        return replace(
            self,
            ids=chosen,
            poses=self.poses[rows],
            covariances=self.covariances[rows],
            sources=tuple(self.sources[row] for row in rows),
            joint=None if self.joint is None else self.joint[np.ix_(flat, flat)],
            factor=None if self.factor is None else self.factor[flat],
            net=None if self.net is None else self.net.select(np.array(rows, dtype=np.intp)),
            follows=None if self.follows is None else self.follows.rows(flat),
        )

    def only(self, components: Sequence[Component]) -> Self:
        """The table with some of its components, in their order."""
        if tuple(components) == self.components:
            return self
        at = [self.components.index(one) for one in components]
        n, k = self.poses.shape
        flat = (np.arange(n)[:, None] * k + at).ravel()
        return replace(
            self,
            poses=self.poses[:, at],
            covariances=self.covariances[:, at][:, :, at],
            components=tuple(components),
            joint=None if self.joint is None else self.joint[np.ix_(flat, flat)],
            factor=None if self.factor is None else self.factor[flat],
            net=None if self.net is None else self.net.only(np.array(at, dtype=np.intp)),
            follows=None if self.follows is None else self.follows.rows(flat),
        )


def refuse_twice(systems: Sequence[str]) -> None:
    """Raise a GtvalError where a system is named twice."""
    twice = sorted({name for name in systems if systems.count(name) > 1})
    if twice:
        raise GtvalError(f"these systems are given twice: {', '.join(twice)}")


def pose_difference(a: Array, b: Array, components: Sequence[Component] = PLANAR) -> Array:
    """Difference a - b per component, angles wrapped to (-pi, pi].

    Parameters
    ----------
    a, b : (..., k) array
        Poses in the same frame, metres and radians.
    components : sequence of Component
        Their k components.
    """
    difference = np.asarray(a, dtype=float) - np.asarray(b, dtype=float)
    angles = np.array([component.kind == "angle" for component in components])
    return np.where(angles, wrap(difference), difference)


def _covariance_columns(components: Sequence[Component]) -> list[str]:
    return [a.code + b.code for a, b in combinations_with_replacement(components, 2)]


ROWS = 4096
"""Poses that are turned into text at a time."""


def to_csv(table: PoseTable) -> str:
    """The table as CSV text; `from_csv` reads the same numbers back to the last bit.

    Columns ``pose``, the components, the upper triangle of the covariance (blank where not
    stated) and ``source``.
    """
    return "\n".join(csv_lines(table)) + "\n"


def csv_lines(table: PoseTable) -> Iterator[str]:
    """The lines of `to_csv`, without their ends."""
    header = ["pose", *(c.name for c in table.components), *_covariance_columns(table.components)]
    yield ",".join([*header, "source"])
    upper = np.triu_indices(len(table.components))
    blank = [""] * len(upper[0])
    for start in range(0, len(table), ROWS):
        rows = slice(start, start + ROWS)
        covariances = table.covariances[rows]
        own = covariances[:, upper[0], upper[1]].tolist()
        stated = np.isfinite(covariances).all(axis=(1, 2)).reshape(-1)
        poses = table.poses[rows].tolist()
        for name, pose, cells, known, source in zip(
            table.ids[rows], poses, own, list(stated), table.sources[rows], strict=True
        ):
            covariance = map(repr, cells) if known else blank
            ends = _quoted(name), _quoted(" ".join(source.split()))
            yield ",".join([ends[0], *map(repr, pose), *covariance, ends[1]])


def _quoted(cell: str) -> str:
    cell = harmless(cell)
    return '"' + cell.replace('"', '""') + '"' if re.search(r'[",;\t]', cell) else cell


def from_csv(
    path: Path,
    system: str | None = None,
    components: tuple[Component, ...] = PLANAR,
    sigmas: Sequence[float] | None = None,
) -> PoseTable:
    """Poses from a CSV file as `to_csv` writes it, the covariance columns being optional.

    Parameters
    ----------
    path : Path
        The file.
    system : str, optional
        Name of the system; taken from a name ``poses_<system>.csv`` where not given.
    components : tuple of Component
        Its components.
    sigmas : sequence of float, optional
        Standard deviations for rows without covariance of their own.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    names = _covariance_columns(components)
    columns = [
        Column("pose"),
        *(
            Column(c.name, "number", low=-1e6, high=1e6, unit=c.unit)
            if c.kind == "length"
            else Column(c.name, "number", low=-4 * np.pi, high=4 * np.pi, unit="rad")
            for c in components
        ),
        *(Column(name, "number", required=False, blank=True) for name in names),
        *(Column(name, required=False, blank=True) for name in ("source", *MAKERS)),
    ]
    csv = read_csv(path, columns)
    csv.flag_duplicates(["pose"])
    n, k = len(csv), len(components)
    upper = np.triu_indices(k)
    covariances = np.full((n, k, k), np.nan)
    values = np.column_stack([csv.numbers[name] for name in names]).reshape(n, len(names))
    covariances[:, upper[0], upper[1]] = values
    covariances[:, upper[1], upper[0]] = values
    blank = np.isnan(values).all(1)
    if sigmas is not None:
        covariances[blank] = np.diag(np.square(sigmas))
    for row in () if all_sound(covariances) else np.flatnonzero(~blank):
        fault = covariance_fault(covariances[row])
        if fault is None:
            continue
        csv.problems.append(
            Problem(
                path,
                f"the covariance of pose {csv.text['pose'][row]} {fault}",
                csv.lines[row],
                *bad_place(names, values[row], covariances[row]),
            )
        )
    if n == 0:
        csv.problems.append(Problem(path, "the file has a header but no pose", 1))
    csv.raise_problems()
    return PoseTable(
        system=system or path.stem.removeprefix("poses_"),
        ids=tuple(csv.text["pose"]),
        poses=np.column_stack([csv.numbers[c.name] for c in components]),
        covariances=covariances,
        components=components,
        sources=tuple(map(_source, *(csv.text[name] for name in (*MAKERS, "source")))),
    )


def _source(*cells: str) -> str:
    """The source of a pose, with who made it: 'board, camera 2, day 2023-05-04'."""
    own, told = cells[-1], zip(MAKERS, cells, strict=False)
    new = [f"{kind} {name}" for kind, name in told if name and f"{kind} " not in own]
    return ", ".join([own, *new] if own else new)


def in_common(tables: Sequence[PoseTable]) -> list[str]:
    """Ids that all the tables have, in the order of the first.

    Raises
    ------
    InputError
        If there is none.
    """
    shared = set(tables[0].ids).intersection(*(table.ids for table in tables[1:]))
    if not shared:
        names = " and ".join(f"'{table.system}'" for table in tables)
        raise InputError([Problem("poses", f"the systems {names} have no pose id in common")])
    return [name for name in tables[0].ids if name in shared]
