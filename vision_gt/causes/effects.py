"""Hypotheses: each another way to read what was seen and stated, with numbers of its own."""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from validation.poses.angles import Array
from vision_gt.causes.evidence import (
    BAR,
    CALIBRATION,
    REFERENCE_BOARD,
    STOP,
    WALK,
    Evidence,
    Group,
    Mask,
)
from vision_gt.causes.linear import Gain, Linear
from vision_gt.causes.trial import Solved, calibrated
from vision_gt.least_squares.adjustment import Knowledge
from vision_gt.least_squares.setups import (
    CAMERA_UNKNOWNS,
    Ints,
    Setup,
    camera_slots,
    part_slots,
)
from vision_gt.network.solution import REFERENCE

PRINT_RANGE = 0.1
"""How far a stated length of a board or a marker may be off, as a share: a printer that fits to the
page makes 3 to 6 per cent of it, a side measured with the white rim 10 to 20. A judgement."""
FOCAL_RANGE = 0.05
"""The same of a focal length: focus or zoom touched, or the file of another lens."""
CAMERA_RANGE = np.repeat([0.1, 0.05], 3)
"""Metres and radians by which a camera is moved that somebody touched."""
MARKER_RANGE = np.repeat([0.05, 0.2], 3)
"""By which a marker on a robot is moved or turned."""
BAR_RANGE = np.repeat([0.05, 0.05], 3)
"""By which a bar is built differently from what was stated."""
REFERENCE_RANGE = np.array([0.1, 0.05, 0.05])
"""Height and tilts by which a reference pattern is laid differently. Where it lies in x, y and
heading no image tells."""
LENS_RANGE = np.array([50.0, 50.0, 30.0, 30.0, 0.1, 0.1, 0.003, 0.003, 0.1])
"""By which a camera's parameters in a file differ from its own: of another camera of its kind."""
LEAST_AFTER = 2
"""Stops that have to show that something moved: one may be a leg before a marker."""
DIMA_RANGE = np.array([0.1, 0.05, 0.05])
"""Height and tilts by which the place of the dima-marker is measured wrongly: those of the robot
before the cameras, alike, as images tell no more of it."""
_UPRIGHT = np.array([2, 3, 4])
"""Height and tilts among the six numbers of a change."""


@dataclass(frozen=True)
class Effect(ABC):
    """One hypothesis.

    Parameters
    ----------
    kind : str
        What it is: 'bar_scale', 'camera_moved', ...
    subject : str
        Camera or marker; empty where there is one of its kind.
    since : str
        The first stop at which it holds; empty where it always does.
    places : int
        How many of its kind are tried.
    """

    kind: str
    subject: str = ""
    since: str = ""
    places: int = field(default=1, compare=False)

    def like(self, other: "Effect") -> bool:
        """Whether another hypothesis is the same but for what may be hard to tell."""
        return self == other

    @property
    @abstractmethod
    def prior(self) -> Array:
        """(k,) standard deviations of its numbers before looking."""

    @abstractmethod
    def gain(self, linear: Linear) -> Gain:
        """What it gains to first order, at a solution without it."""


@dataclass(frozen=True)
class Scaled(Effect):
    """A length, or a focal length, is (1 + s) times what was stated.

    Parameters
    ----------
    what : {"size", "focal"}
        Of printed things, or of a lens.
    """

    what: Literal["size", "focal"] = "size"

    @property
    def prior(self) -> Array:
        """(1,) of the share."""
        return np.array([PRINT_RANGE if self.what == "size" else FOCAL_RANGE])

    def holds(self, evidence: Evidence) -> Mask:
        """(g,) whether it concerns a group."""
        return np.array([self._concerns(g) for g in evidence.groups])

    def _concerns(self, g: Group) -> bool:
        if self.what == "focal":
            return g.camera == self.subject and g.kind not in {CALIBRATION, WALK}
        if self.kind in {"bar_scale", "whole_bar_scale"}:
            return g.kind == BAR
        if self.kind == "reference_scale":
            return g.kind == REFERENCE_BOARD
        if self.kind == "board_scale":
            return g.kind in {BAR, REFERENCE_BOARD}
        if self.kind == "bar_and_marker_scale" and g.kind == BAR:
            return True
        return g.marker is not None and (not self.subject or g.marker == int(self.subject))

    def gain(self, linear: Linear) -> Gain:
        """The column of the scale."""
        at, evidence = linear.at.setup, linear.at.evidence
        rows = evidence.rows(self.holds(evidence))
        views, lin = evidence.views, linear.lin
        if self.what == "focal":
            f = at.intrinsics[views.camera[rows]][:, None, :2]
            column = (lin.by_camera[rows][:, :, 6:8] * f).sum(-1)
        else:
            part = views.part[rows]
            turned = (at.R_part[part] @ views.point[rows][..., None])[..., 0]
            if self.kind == "whole_bar_scale":
                turned = turned + at.t_part[part]
            column = (lin.by_part[rows][:, :, :3] * turned[:, None]).sum(-1)
        return linear.columns(rows, column[..., None])

    def applied(self, evidence: Evidence, s: float) -> Evidence:
        """The problem with the scale taken into account."""
        views = evidence.views
        rows = evidence.rows(self.holds(evidence))
        if self.what == "size":
            point = views.point.copy()
            point[rows] *= 1 + s
            scaled = replace(evidence, views=replace(views, point=point))
            return _longer_bar(scaled, s) if self.kind == "whole_bar_scale" else scaled
        pixel, covariance = views.pixel.copy(), views.covariance.copy()
        centre = evidence.setup.intrinsics[views.camera[rows], 2:4]
        pixel[rows] = centre + (pixel[rows] - centre) / (1 + s)
        covariance[rows] /= (1 + s) ** 2
        return replace(evidence, views=replace(views, pixel=pixel, covariance=covariance))


@dataclass(frozen=True)
class Moved(Effect):
    """A camera, or a marker on the robot, is elsewhere from one stop on.

    From the first: since the network was calibrated, or since the walk around the robot.
    """

    @property
    def prior(self) -> Array:
        """(6,) of translation and turn."""
        return CAMERA_RANGE if self.kind == "camera_moved" else MARKER_RANGE

    def like(self, other: Effect) -> bool:
        """Whether another one is the same move at some moment."""
        return (self.kind, self.subject) == (other.kind, other.subject)

    def holds(self, evidence: Evidence) -> Mask:
        """(g,) whether a group is seen by what moved, after it moved."""
        later = set(evidence.stops[evidence.stops.index(self.since) :])
        return np.array([self._concerns(g) and g.moment in later for g in evidence.groups])

    def stops(self, evidence: Evidence) -> list[str]:
        """Stops at which it is seen, in their order."""
        seen = {g.moment for g in evidence.groups if self._concerns(g)}
        return [stop for stop in evidence.stops if stop in seen]

    def moments(self, evidence: Evidence) -> list[str]:
        """Stops since which it may be elsewhere: so many others show it, too."""
        return self.stops(evidence)[: 1 - LEAST_AFTER]

    def _concerns(self, g: Group) -> bool:
        name = g.camera if self.kind == "camera_moved" else str(g.marker)
        return g.kind == STOP and name == self.subject

    def gain(self, linear: Linear) -> Gain:
        """The columns of the change."""
        rows = linear.at.evidence.rows(self.holds(linear.at.evidence))
        if self.kind == "camera_moved":
            return linear.columns(rows, linear.lin.by_camera[rows][:, :, :6])
        return linear.columns(rows, linear.lin.by_part[rows])

    def applied(self, evidence: Evidence) -> tuple[Evidence, Ints, Ints]:
        """The problem with one camera or part more; places of the new and the old unknowns."""
        rows = evidence.rows(self.holds(evidence))
        if self.kind == "camera_moved":
            return _with_camera(evidence, rows, evidence.cameras.index(self.subject))
        return _with_part(evidence, rows, evidence.marker_part(int(self.subject)))


@dataclass(frozen=True)
class Released(Effect):
    """A thing is not where it was stated to be, or a lens is not what its file says.

    The bar's second board; height and tilts of the reference pattern and of the dima-marker on the
    robot, or their height alone ('reference_height', 'dima_height'), which one wrong number in
    campaign.toml makes; a lens.
    """

    @property
    def prior(self) -> Array:
        """(k,) of what it is off by, or of the lens, beyond what was stated."""
        ranges = {
            "bar": BAR_RANGE,
            "reference": REFERENCE_RANGE,
            "reference_height": REFERENCE_RANGE[:1],
            "dima": DIMA_RANGE,
            "dima_height": DIMA_RANGE[:1],
            "lens": LENS_RANGE,
        }
        return ranges[self.kind]

    @property
    def of_reference(self) -> bool:
        """Whether it is about the reference pattern."""
        return self.kind.startswith("reference")

    @property
    def numbers(self) -> Ints:
        """(k,) places of its numbers among all those of the thing."""
        n = len(self.prior)
        return np.arange(n) if self.kind in {"bar", "lens"} else _UPRIGHT[:n]

    def _wide(self, size: int) -> Array:
        """(size, size) what is not known of the thing, beyond what was stated."""
        wide = np.zeros(size)
        wide[self.numbers] = self.prior**2
        return np.diag(wide)

    def _slots(self, at: Solved) -> tuple[Ints, Array, Array]:
        """Places among all unknowns, information and distance from what was stated."""
        evidence = at.evidence
        shared, bodies = at.setup.change_from(evidence.setup)
        if self.of_reference:
            i = evidence.bodies.index(REFERENCE)
            first = int(evidence.knowledge.free.sum()) + 6 * i
            return first + np.arange(6), evidence.knowledge.bodies[i], bodies[i]
        slots = self.slots(evidence)
        places = np.cumsum(evidence.knowledge.free) - 1
        return places[slots], evidence.knowledge.shared[slots, slots], shared[slots]

    def slots(self, evidence: Evidence) -> slice:
        """Places of its unknowns among the shared ones."""
        if self.kind == "lens":
            camera = camera_slots(evidence.cameras.index(self.subject))
            return slice(camera.start + 6, camera.stop)
        part = 1 if self.kind == "bar" else evidence.marker_part(int(self.subject))
        return part_slots(evidence.setup, part)

    def gain(self, linear: Linear) -> Gain:
        """The columns of what was stated."""
        if self.kind == "lens":
            evidence = linear.at.evidence
            rows = evidence.rows([g.camera == self.subject for g in evidence.groups])
            return linear.columns(rows, linear.lin.by_camera[rows][:, :, 6:])
        return linear.released(*self._slots(linear.at), self.numbers)

    def applied(self, evidence: Evidence) -> Evidence:
        """The problem with it known less well."""
        known = evidence.knowledge
        shared, bodies, free = known.shared.copy(), known.bodies.copy(), known.free.copy()
        if self.of_reference:
            i = evidence.bodies.index(REFERENCE)
            bodies[i] = np.linalg.inv(np.linalg.inv(bodies[i]) + self._wide(6))
        else:
            slots = self.slots(evidence)
            wide = self._wide(slots.stop - slots.start)
            if free[slots].all():
                wide = wide + np.linalg.inv(shared[slots, slots])
            shared[slots, slots], free[slots] = np.linalg.inv(wide), True
        return replace(evidence, knowledge=Knowledge(shared, bodies, free))


def _longer_bar(evidence: Evidence, s: float) -> Evidence:
    """The second board farther from the first, as stated."""
    t_part = evidence.setup.t_part.copy()
    t_part[1] *= 1 + s
    return replace(evidence, setup=replace(evidence.setup, t_part=t_part))


def _with_camera(evidence: Evidence, rows: Ints, old: int) -> tuple[Evidence, Ints, Ints]:
    """Some corners seen by a camera of the same lens in another place."""
    setup, known = evidence.setup, evidence.knowledge
    c = len(setup.R_camera)
    new = Setup(
        np.concatenate([setup.R_camera, setup.R_camera[old : old + 1]]),
        np.concatenate([setup.t_camera, setup.t_camera[old : old + 1]]),
        np.concatenate([setup.intrinsics, setup.intrinsics[old : old + 1]]),
        setup.R_body,
        setup.t_body,
        setup.R_part,
        setup.t_part,
    )
    at = np.r_[0 : CAMERA_UNKNOWNS * c, CAMERA_UNKNOWNS * (c + 1) : new.shared]
    slots, before = camera_slots(c), camera_slots(old)
    fresh, used = np.r_[slots], np.r_[before]
    prior = np.concatenate([CAMERA_RANGE, np.full(9, 1.0)])
    # The lens is the same: tied so that it differs by less than anything that is measured.
    prior[6:] = np.array([1e-4] * 4 + [1e-7] * 5)
    tied = np.concatenate([np.ones(6, dtype=bool), known.free[used[6:]]])
    grown = _grown(known, new.shared, at, (fresh[tied], used[tied]), prior[tied])
    camera = evidence.views.camera.copy()
    camera[rows] = c
    views = replace(evidence.views, camera=camera)
    return (
        replace(evidence, views=views, setup=new, knowledge=grown),
        fresh[:6],
        used[:6],
    )


def _with_part(evidence: Evidence, rows: Ints, old: int) -> tuple[Evidence, Ints, Ints]:
    """Some corners on another part of the same robot."""
    setup, known = evidence.setup, evidence.knowledge
    p = len(setup.R_part)
    new = replace(
        setup,
        R_part=np.concatenate([setup.R_part, setup.R_part[old : old + 1]]),
        t_part=np.concatenate([setup.t_part, setup.t_part[old : old + 1]]),
    )
    at = np.arange(setup.shared)
    fresh, used = np.r_[part_slots(new, p)], np.r_[part_slots(new, old)]
    grown = _grown(known, new.shared, at, (fresh, used), MARKER_RANGE)
    part = evidence.views.part.copy()
    part[rows] = p
    views = replace(evidence.views, part=part)
    return replace(evidence, views=views, setup=new, knowledge=grown), fresh, used


def _grown(
    known: Knowledge, size: int, at: Ints, tie: tuple[Ints, Ints], prior: Array
) -> Knowledge:
    """Knowledge with new unknowns that differ from old ones by no more than a range."""
    shared, free = np.zeros((size, size)), np.zeros(size, dtype=bool)
    shared[np.ix_(at, at)] = known.shared
    free[at] = known.free
    new, old = tie
    free[new] = True
    information = prior**-2.0
    shared[new, new] += information
    shared[old, old] += information
    shared[new, old] -= information
    shared[old, new] -= information
    return Knowledge(shared, known.bodies, free)


def all_effects(evidence: Evidence) -> Iterator[Effect]:
    """Every hypothesis with numbers that there is something to try on."""
    yield from _boards_and_markers(evidence)
    yield from _lenses(evidence)
    yield from _moves(evidence)


def _boards_and_markers(evidence: Evidence) -> Iterator[Effect]:
    """Sizes that were stated wrongly, and places."""
    kinds = {g.kind for g in evidence.groups}
    if BAR in kinds:
        yield from (Scaled("bar_scale"), Scaled("whole_bar_scale"), Released("bar"))
    if REFERENCE_BOARD in kinds:
        yield Scaled("reference_scale")
        yield from (Released("reference"), Released("reference_height"))
    if {BAR, REFERENCE_BOARD} <= kinds:
        yield Scaled("board_scale")
    if STOP in kinds:
        yield Scaled("marker_scale")
        if BAR in kinds:
            yield Scaled("bar_and_marker_scale")
        for number in evidence.markers:
            yield Scaled("marker_side", str(number), places=len(evidence.markers))
    for i, number in enumerate(evidence.markers):
        slots = part_slots(evidence.setup, 2 + i)
        if evidence.knowledge.shared[slots, slots].any():
            yield from (Released("dima", str(number)), Released("dima_height", str(number)))


def _lenses(evidence: Evidence) -> Iterator[Effect]:
    """Lenses that are not as calibrated, or not as their file says."""
    for name in evidence.cameras:
        if any(g.camera == name and g.kind not in {CALIBRATION, WALK} for g in evidence.groups):
            own, places = calibrated(evidence, name), len(evidence.cameras)
            yield Scaled("zoom" if own else "focal_length", name, places=places, what="focal")
            if not own:
                yield Released("lens", name, places=places)


def _moves(evidence: Evidence) -> Iterator[Moved]:
    """Cameras and markers that moved, at every moment at which that can be told."""
    for kind, names in (
        ("camera_moved", evidence.cameras),
        ("marker_moved", [str(n) for n in evidence.markers]),
    ):
        for name in names:
            stops = Moved(kind, name).moments(evidence)
            for stop in stops:
                yield Moved(kind, name, stop, places=len(names) * len(stops))
