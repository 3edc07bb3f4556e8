"""Whether the Vframe points are what their labels say.

Exchanging labels of a symmetric frame turns or mirrors the whole room and fits the readings to
the Vframe points just as well: for the square O, X, Y, XY there are eight such labellings. Only
something that breaks the symmetry can tell: coordinates from elsewhere, or readings of robot
frames, whose rig has a handedness. This module finds the labellings that fit, asks everything
that could tell them apart, and refuses the given one if it is contradicted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from typing import Literal

import numpy as np
from scipy.special import chdtrc

from survey.estimation.evidence import Evidence
from survey.estimation.geometry import rigid_alignment
from survey.estimation.robot_frames import best_fit, pose_readings
from survey.estimation.vframe import estimate_vframe
from survey.estimation.world_points import WorldPoints, locate_world_points
from survey.readings.readings import Readings
from validation.campaign.folder import RobotFrame, Vframe
from validation.errors import GtvalError
from validation.poses.angles import Array

MOST_POINTS = 5
"""Frames of more points have too many labellings to try those that are no symmetry: 120 are tried
of 5 points, 720 would be of 6."""
_SAME_PLACE = 1e-6
"""Nominal points nearer than this, in metres, are the same."""
MOST_POSES = 3
"""Robot frames asked. A judgement: one tells a mirror image from the truth, and where the names
are exchanged at that stop, the two others do."""
MOST_OF_A_POSE = 1000.0
"""What the readings of one stop may say at most, in chi-squared: whatever happened at one stop, the
others overrule it. A mirror image costs a stop 1e4 and more."""
DECISIVE = 30.0
"""Difference of chi-squared (natural odds of millions) from which evidence decides."""
PUBLISHED_SIGMA = 0.02
"""Standard deviation, in metres, granted to published coordinates. A judgement: it separates errors
of centimetres in print from mirror images, which are metres off."""
GUESS_SIGMA = 0.3
"""The same for the place of a stop measured by steps and by eye: those that
AD2.3 prints are up to 12 cm off."""
MOST_POINTS_TRIED = 6
"""World points with which exchanged labels are tried. A judgement: three readings more than needed
in all would do, and one of them may hold a blunder."""
_HOPELESS = 1e-6
"""p-value of the world points below which the given labels are doubted without any symmetry. A
judgement: exchanged labels miss by decimetres, hundreds of sigmas."""

_Frame = tuple[str, Array, float]
"""Pose, its best state (3,), and the cost there."""
Kind = Literal["given", "mirrored", "turned", "exchanged"]


@dataclass(frozen=True)
class Labelling:
    """One way of reading the labels.

    Parameters
    ----------
    meaning : mapping of str to str
        Label in the readings to the point it would stand for; only where the two differ.
    kind : {"given", "mirrored", "turned", "exchanged"}
        As given; a mirror image or a turn of the given one; or labels exchanged without symmetry.
    cost : float
        Chi-squared of the world points.
    evidence : mapping of str to float
        Chi-squared of each thing that could tell.
    """

    meaning: Mapping[str, str]
    kind: Kind
    cost: float
    evidence: Mapping[str, float]

    @property
    def total(self) -> float:
        """Chi-squared with all the evidence."""
        return self.cost + sum(self.evidence.values())

    def __str__(self) -> str:
        if not self.meaning:
            return "labels as given"
        return "labels read as " + ", ".join(f"{a} = {b}" for a, b in self.meaning.items())


@dataclass(frozen=True)
class LabellingVerdict:
    """What can be said of the labels.

    Parameters
    ----------
    status : {"confirmed", "unconfirmed", "unambiguous"}
        'confirmed': others fit the readings, evidence decides for the given one;
        'unconfirmed': nothing tells it from a mirror image; 'unambiguous': no other fits.
    given : Labelling
        The labels as they are.
    others : tuple of Labelling
        Those that fit the readings to the Vframe points as well.
    decided_by : tuple of str
        What told.
    """

    status: Literal["confirmed", "unconfirmed", "unambiguous"]
    given: Labelling
    others: tuple[Labelling, ...] = ()
    decided_by: tuple[str, ...] = ()

    @property
    def open_mirrors(self) -> list[Labelling]:
        """Mirror images that nothing excludes."""
        return [
            other
            for other in self.others
            if other.kind == "mirrored" and other.total - self.given.total < DECISIVE
        ]


def judge_labelling(
    vframe: Vframe,
    rig: RobotFrame,
    readings: Readings,
    world: WorldPoints,
    evidence: Evidence,
) -> LabellingVerdict:
    """Whether the given labels can be believed.

    Raises
    ------
    GtvalError
        If another labelling fits decisively better: the given one must not be used.

    Notes
    -----
    AD2.3 prints its table of readings with X and Y exchanged; the printed coordinates follow
    only from the corrected labels.
    """
    candidates = _labellings_that_fit(vframe, rig, readings, world, evidence)
    given = next(c for c in candidates if c.kind == "given")
    least = min(candidate.total for candidate in candidates)
    if given.total - least > DECISIVE:
        as_good = [c for c in candidates if c.total - least < DECISIVE]
        _refuse(given, min(as_good, key=lambda c: len(c.meaning)))
    others = tuple(c for c in candidates if c is not given and c.cost - given.cost < DECISIVE)
    if not others:
        return LabellingVerdict("unambiguous", given)
    verdict = LabellingVerdict("confirmed", given, others, _deciders(given, others))
    if verdict.open_mirrors:
        return LabellingVerdict("unconfirmed", given, others, verdict.decided_by)
    return verdict


def _deciders(given: Labelling, others: Sequence[Labelling]) -> tuple[str, ...]:
    """Evidence that speaks decisively against at least one mirror image."""
    return tuple(
        name
        for name, cost in given.evidence.items()
        if any(o.evidence.get(name, cost) - cost > DECISIVE for o in others if o.kind == "mirrored")
    )


def _labellings_that_fit(
    vframe: Vframe,
    rig: RobotFrame,
    readings: Readings,
    world: WorldPoints,
    evidence: Evidence,
) -> list[Labelling]:
    """The given labelling and those that fit the readings no worse, with their evidence.

    A labelling that is a symmetry of the frame needs no solving: it carries the world points
    along and leaves every residual as it is. The others matter only if the given one fits badly.
    """
    names = tuple(vframe.points)
    nominal = np.array(list(vframe.points.values()))
    cost = sum(point.cost for point in world.points)
    freedom = sum(point.redundancy for point in world.points)
    images: list[_Image] = []
    for order, motion in _symmetries(nominal):
        meaning = {names[i]: names[j] for i, j in enumerate(order) if i != j}
        images.append(_Image(meaning, motion, cost))
    frames = _some_frames(readings, world, rig)
    mirrored = next((i for i in images if i.motion.is_mirror), None)
    turned_over = [] if mirrored is None else _some_frames(readings, mirrored.of(world), rig)
    found = []
    for image in images:
        if image.motion.is_mirror and mirrored is not None:
            carried = image.motion.after(mirrored.motion)
            found.append(_weighed(image, world, evidence, turned_over, carried))
        else:
            found.append(_weighed(image, world, evidence, frames, image.motion))
    few = len(names) <= MOST_POINTS
    if few and freedom and chdtrc(freedom, cost) < _HOPELESS:
        found += _exchanged(vframe, readings, world, rig, evidence, images)
    return found


@dataclass(frozen=True)
class _Motion:
    """A symmetry of the frame: p -> matrix p + shift."""

    matrix: Array
    shift: Array

    @property
    def is_mirror(self) -> bool:
        return bool(np.linalg.det(self.matrix) < 0)

    def __call__(self, point: Array) -> Array:
        return np.asarray(self.matrix @ point + self.shift)

    def after(self, other: "_Motion") -> "_Motion":
        """The motion that takes the image under ``other`` to the image under this one."""
        matrix = self.matrix @ other.matrix.T
        return _Motion(matrix, self.shift - matrix @ other.shift)


@dataclass(frozen=True)
class _Image:
    """A labelling and what it does to the world points."""

    meaning: Mapping[str, str]
    motion: _Motion
    cost: float

    @property
    def kind(self) -> Kind:
        if not self.meaning:
            return "given"
        return "mirrored" if self.motion.is_mirror else "turned"

    def of(self, world: WorldPoints) -> WorldPoints:
        """World points where this labelling would put them."""
        A = self.motion.matrix
        points = tuple(
            replace(p, position=self.motion(p.position), covariance=A @ p.covariance @ A.T)
            for p in world.points
        )
        blocks = np.kron(np.eye(len(points)), A)
        return WorldPoints(points, blocks @ world.covariance @ blocks.T, ())


def _symmetries(points: Array) -> list[tuple[tuple[int, ...], _Motion]]:
    """Turns and mirror images that carry the points (n, 2) onto themselves, the identity first.

    Each with the row that every point is carried to. Two points fix a motion and its mirror
    image, so trying all places for the two that are farthest apart finds every symmetry.
    """
    distance = np.linalg.norm(points[:, None] - points, axis=-1)
    a, b = np.unravel_index(distance.argmax(), distance.shape)
    found: dict[tuple[int, ...], _Motion] = {}
    for i, j in permutations(range(len(points)), 2):
        if abs(distance[i, j] - distance[a, b]) > _SAME_PLACE:
            continue
        for flip in (np.eye(2), np.diag([1.0, -1.0])):
            x, y, theta = rigid_alignment(points[[a, b]] @ flip, points[[i, j]])
            c, s = np.cos(theta), np.sin(theta)
            motion = _Motion(np.array([[c, -s], [s, c]]) @ flip, np.array([x, y]))
            moved = points @ motion.matrix.T + motion.shift
            gap = np.linalg.norm(moved[:, None] - points, axis=-1)
            if (gap.min(1) < _SAME_PLACE).all():
                found.setdefault(tuple(int(k) for k in gap.argmin(1)), motion)
    return sorted(found.items(), key=lambda one: (one[1].is_mirror, one[0]))


def _exchanged(
    vframe: Vframe,
    readings: Readings,
    world: WorldPoints,
    rig: RobotFrame,
    evidence: Evidence,
    images: Sequence[_Image],
) -> list[Labelling]:
    """Labellings without symmetry that fit decisively better than a given one that does not."""
    names = tuple(vframe.points)
    tried = [dict(image.meaning) for image in images]
    some = [point.name for point in world.points[:MOST_POINTS_TRIED]]
    given_cost = sum(point.cost for point in world.points[:MOST_POINTS_TRIED])
    identity = _Motion(np.eye(2), np.zeros(2))
    found = []
    for order in permutations(names):
        meaning = {a: b for a, b in zip(names, order, strict=True) if a != b}
        if meaning in tried:
            continue
        relabelled = _relabelled(readings, meaning)
        fit = locate_world_points(some, relabelled, estimate_vframe(vframe, relabelled))
        cost = sum(point.cost for point in fit.points)
        if len(fit.points) == len(some) and given_cost - cost > DECISIVE:
            whole = sum(p.cost for p in world.points) * cost / given_cost
            frames = _some_frames(relabelled, fit, rig)
            weighed = _weighed(_Image(meaning, identity, whole), fit, evidence, frames, identity)
            found.append(replace(weighed, kind="exchanged"))
    return found


def _relabelled(readings: Readings, meaning: Mapping[str, str]) -> Readings:
    """Readings with their Vframe labels replaced."""
    return replace(
        readings,
        start=tuple(meaning.get(name, name) for name in readings.start),
        end=tuple(meaning.get(name, name) for name in readings.end),
    )


def _weighed(
    image: _Image,
    world: WorldPoints,
    evidence: Evidence,
    frames: Sequence[_Frame],
    carried: _Motion,
) -> Labelling:
    """A labelling with what everything else says of it.

    ``frames`` are robot frames solved with world points of the same handedness; the turn
    ``carried`` takes them to this labelling without changing their cost.
    """
    moved = image.of(world)
    chi2: dict[str, float] = {}
    where = dict(zip(moved.names, moved.positions, strict=True))
    for name, points, sigma in (
        ("published coordinates", evidence.published, PUBLISHED_SIGMA),
        ("hand-measured points", evidence.hand, evidence.hand_sigma),
    ):
        shared = [p for p in points if p in where]
        if shared:
            chi2[name] = _capped(np.array([(where[p] - points[p]) / sigma for p in shared]))
    if frames:
        chi2["robot-frame readings"] = float(sum(min(c, MOST_OF_A_POSE) for _, _, c in frames))
    guessed = [(pose, state) for pose, state, _ in frames if pose in evidence.guesses]
    if guessed:
        off = [carried(state[:2]) - evidence.guesses[pose][:2] for pose, state in guessed]
        chi2["hand-measured poses"] = _capped(np.array(off) / GUESS_SIGMA)
    return Labelling(dict(image.meaning), image.kind, image.cost, chi2)


def _capped(normalised: Array) -> float:
    """Chi-squared in which no single number counts for more than a hundred sigmas."""
    return float((np.minimum(np.abs(normalised), 100.0) ** 2).sum())


def _some_frames(readings: Readings, world: WorldPoints, rig: RobotFrame) -> list[_Frame]:
    """The best fit of a few robot frames, those with the most readings, however bad it is."""
    count = readings.count_of_pose
    some = sorted(count, key=lambda pose: -count[pose])[:MOST_POSES]
    fits = [(pose, best_fit(pose_readings(pose, readings, world, rig))) for pose in some]
    return [(pose, *fit) for pose, fit in fits if fit is not None]


def _refuse(given: Labelling, best: Labelling) -> None:
    """Raise, saying which labelling fits and how to state it."""
    settings = ", ".join(f'{a} = "{b}"' for a, b in best.meaning.items())
    reasons = [
        f"{name} (chi-squared {best.evidence[name]:.3g} instead of {cost:.3g})"
        for name, cost in given.evidence.items()
        if name in best.evidence and cost - best.evidence[name] > DECISIVE
    ]
    if given.cost - best.cost > DECISIVE:
        reasons.insert(
            0, f"readings to the Vframe points (chi-squared {best.cost:.3g}, not {given.cost:.3g})"
        )
    also = " The readings to the Vframe points alone fit both: the frame is symmetric." * (
        abs(given.cost - best.cost) < DECISIVE
    )
    what = {
        "mirrored": "all points would be a mirror image of where they are, metres off",
        "turned": "all points would be turned about the frame, metres off",
        "exchanged": "the readings do not meet in one place",
    }[best.kind]
    raise GtvalError(
        f"the labels of the Vframe points are exchanged: as given, {what}."
        f"{also} The other labelling is supported by "
        f"{'; '.join(reasons)}. If the labels were exchanged on the form, state it in "
        f"campaign.toml, table [survey.labels]: {settings}"
    )
