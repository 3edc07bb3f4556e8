"""Poses or positions of two tables beside each other, and the chain that corrects the one.

A corrected pose is ``frame . scale (G + time v) . A^-1`` with the GT pose G, its velocity v, and
the correction A of the mount, as for planar poses. Where only one side knows the orientation, A is
a lever arm that this orientation turns; where none does, there is no A.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from validation.errors import GtvalError
from validation.explain.fitting.models import Motion
from validation.poses.angles import Array
from validation.poses.pose_table import PoseTable, in_common

AXES = ("x", "y", "z")
PARTS: Mapping[str, tuple[str, ...]] = {
    "frame": tuple(f"frame_{one}" for one in (*AXES, "rx", "ry", "rz")),
    "scale": ("scale",),
    "time": ("time",),
    "mount": (
        *(f"mount_{one}" for one in ("rx", "ry", "rz")),
        *(f"mount_{one}" for one in AXES),
    ),
}
"""Parameters of each part: shifts along axes and turns about them, frame on the left, mount in the
robot's axes."""
PARAMETERS = tuple(name for names in PARTS.values() for name in names)
WORDS = {
    "frame": "a wrong frame",
    "scale": "a wrong scale",
    "time": "a time offset",
    "mount": "a wrong mount",
}


def unit_of(name: str) -> str:
    """'m', 'rad', 's' or ''."""
    if name == "time":
        return "s"
    return "" if name == "scale" else "rad" if name[-2:] in {"rx", "ry", "rz"} else "m"


@dataclass(frozen=True)
class SpacePairs:
    """What both tables know of the stops that they share.

    Parameters
    ----------
    system : str
        Name of the system.
    ids : tuple of str
        The n stops.
    width : int
        2 in the plane, 3 in space.
    truth, given : (n, 3) array
        Positions, metres; z is 0 in the plane.
    turned_truth, turned_given : Rotation, optional
        Orientations; None where not known.
    motion : Motion, optional
        Of the given positions, along the frame's axes.
    rates : (n, 3) array, optional
        Of the given orientations, radians a second about the robot's axes.
    """

    system: str
    ids: tuple[str, ...]
    width: int
    truth: Array
    given: Array
    turned_truth: Rotation | None
    turned_given: Rotation | None
    motion: Motion | None = None
    rates: Array | None = None

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def oriented(self) -> bool:
        """Whether both know the orientation."""
        return self.turned_truth is not None and self.turned_given is not None

    @property
    def some_orientation(self) -> bool:
        """Whether one of both does, so that a lever arm can show."""
        return self.turned_truth is not None or self.turned_given is not None

    @property
    def parts(self) -> tuple[str, ...]:
        """Parts of the chain that these tables can speak of."""
        asked = {"time": self.motion is not None, "mount": self.some_orientation}
        return tuple(part for part in PARTS if asked.get(part, True))

    def parameters(self, parts: tuple[str, ...]) -> tuple[int, ...]:
        """Columns of `PARAMETERS` that these parts have here."""
        names = {name for part in parts for name in PARTS[part]}
        if self.width == 2:
            names = {name for name in names if name[-2:] not in {"_z", "rx", "ry"}}
        if not self.oriented:
            names = {name for name in names if not name.startswith("mount_r")}
        return tuple(i for i, name in enumerate(PARAMETERS) if name in names)


def orientations(table: PoseTable) -> Rotation | None:
    """Orientations of a table's poses; None where it has positions only."""
    named = [one.name for one in table.components]
    if "theta" in named:
        turned = np.zeros((len(table), 3))
        turned[:, 2] = table.poses[:, named.index("theta")]
        return Rotation.from_rotvec(turned)
    if "yaw" in named:
        columns = [named.index(one) for one in ("yaw", "pitch", "roll")]
        return Rotation.from_euler("ZYX", table.poses[:, columns])
    return None


def space_pairs(
    validation: PoseTable, gt: PoseTable, times: Mapping[str, float] | None = None
) -> SpacePairs:
    """The two tables at the stops in common, as far as both go.

    Parameters
    ----------
    validation, gt : PoseTable
        Poses or positions, in the plane or in space; where one is in the plane, both are seen from
        above.
    times : mapping of str to float, optional
        Seconds of the stops, where the robot moved.

    Raises
    ------
    GtvalError
        If one has no positions, or no stop is in common.
    """
    ids = tuple(in_common([validation, gt]))
    ours, theirs = validation.select(ids), gt.select(ids)
    width = 3 if all("z" in [c.name for c in one.components] for one in (ours, theirs)) else 2
    true, given = (_positions(one, width) for one in (ours, theirs))
    first, second = orientations(ours), orientations(theirs)
    if width == 2:
        first, second = _from_above(first), _from_above(second)
    motion, rates = _motion(ids, given, second, times)
    return SpacePairs(gt.system, ids, width, true, given, first, second, motion, rates)


def _positions(table: PoseTable, width: int) -> Array:
    named = [one.name for one in table.components]
    if not {"x", "y"} <= set(named):
        raise GtvalError(f"'{table.system}' has no positions x and y")
    found = np.zeros((len(table), 3))
    for column, axis in enumerate(AXES[:width]):
        found[:, column] = table.poses[:, named.index(axis)]
    return found


def _from_above(turned: Rotation | None) -> Rotation | None:
    """Headings alone."""
    if turned is None:
        return None
    ahead = turned.apply([1.0, 0.0, 0.0])
    about = np.zeros((len(ahead), 3))
    about[:, 2] = np.arctan2(ahead[:, 1], ahead[:, 0])
    return Rotation.from_rotvec(about)


def _motion(
    ids: tuple[str, ...],
    positions: Array,
    turned: Rotation | None,
    times: Mapping[str, float] | None,
) -> tuple[Motion | None, Array | None]:
    """The motion, and turn rates by the poses before and after; None where times do not say."""
    if times is None or any(name not in times for name in ids) or len(ids) < 3:
        return None, None
    stamps = np.array([times[name] for name in ids])
    order = np.argsort(stamps, kind="stable")
    if (np.diff(stamps[order]) <= 0).any():
        return None, None
    rank = np.argsort(order)
    rates = None
    if turned is not None:
        before, after = order[np.maximum(rank - 1, 0)], order[np.minimum(rank + 1, len(ids) - 1)]
        span = (stamps[after] - stamps[before])[:, None]
        rates = (turned[before].inv() * turned[after]).as_rotvec() / span
    return Motion.along(stamps, positions), rates


@dataclass(frozen=True)
class State:
    """Values of all parameters; turns as rotations, as they do not add up."""

    shift: Array
    turn: Rotation
    scale: float
    time: float
    mount_turn: Rotation
    arm: Array

    @classmethod
    def none(cls) -> "State":
        """No correction."""
        still = Rotation.identity()
        return cls(np.zeros(3), still, 0.0, 0.0, still, np.zeros(3))

    def moved(self, step: npt.NDArray[np.float64]) -> "State":
        """After a step (14,) in the order of `PARAMETERS`."""
        return State(
            self.shift + step[:3],
            Rotation.from_rotvec(step[3:6]) * self.turn,
            self.scale + float(step[6]),
            self.time + float(step[7]),
            Rotation.from_rotvec(step[8:11]) * self.mount_turn,
            self.arm + step[11:14],
        )

    @property
    def values(self) -> Array:
        """(14,) in the order of `PARAMETERS`; turns as rotation vectors."""
        ends = [self.scale], [self.time]
        turned = self.turn.as_rotvec(), self.mount_turn.as_rotvec()
        return np.concatenate([self.shift, turned[0], *ends, turned[1], self.arm])


def look(pairs: SpacePairs, state: State) -> tuple[Array, Array]:
    """Residuals and their derivatives.

    Parameters
    ----------
    pairs : SpacePairs
        The n stops.
    state : State
        Of the chain.

    Returns
    -------
    residuals : (n, 6) array
        Validation minus corrected: positions, and the turn between the orientations as a rotation
        vector in the frame's axes; the latter zero where not both are known.
    slopes : (n, 6, 14) array
        Derivatives of the corrected poses by a step of each parameter, as `State.moved` takes it.
    """
    n, p = len(pairs), pairs.given
    motion = Motion.steady(np.zeros((n, 3))) if pairs.motion is None else pairs.motion
    late, velocities = motion.later(np.array([[state.time]]))
    turned_to = state.turn.apply(p + late)
    place = (1 + state.scale) * turned_to
    slopes = np.zeros((n, 6, len(PARAMETERS)))
    slopes[:, :3, :3] = np.eye(3)
    corrected, own = pairs.turned_truth, pairs.turned_given
    if own is not None:
        moved = own
        if pairs.rates is not None:
            moved = own * Rotation.from_rotvec(state.time * pairs.rates)
        corrected = state.turn * moved * state.mount_turn.inv()
    arm = np.zeros(3)
    # What the frame turns: the place, and the arm too where the given orientation turns it.
    swung = place
    if corrected is not None:
        arm = corrected.apply(state.arm)
        swung = place - arm if own is not None else place
        matrices = np.broadcast_to(corrected.as_matrix(), (n, 3, 3))
        slopes[:, :3, 11:14] = -matrices
        place = place - arm
        if own is not None:
            slopes[:, :3, 8:11] = -matrices @ _cross(state.arm)
            slopes[:, 3:, 8:11] = -matrices
    slopes[:, :3, 3:6] = -_cross(swung)
    slopes[:, 3:, 3:6] = np.eye(3)
    slopes[:, :3, 6] = turned_to
    if pairs.motion is not None:
        slopes[:, :3, 7] = (1 + state.scale) * state.turn.apply(velocities)
        if pairs.rates is not None and own is not None:
            rates = (state.turn * own).apply(pairs.rates)
            slopes[:, 3:, 7] = rates
            slopes[:, :3, 7] -= np.cross(rates, arm)
    residuals = np.zeros((n, 6))
    residuals[:, :3] = pairs.truth - place - state.shift
    if pairs.turned_truth is not None and own is not None and corrected is not None:
        residuals[:, 3:] = (pairs.turned_truth * corrected.inv()).as_rotvec()
    return residuals, slopes


def _cross(vectors: Array) -> Array:
    """(..., 3, 3) matrices of the cross product with vectors (..., 3)."""
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=float), -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def begin(pairs: SpacePairs) -> State:
    """Frame and turn of the mount by closed formulas, as if there were no arm and no scale.

    Notes
    -----
    Umeyama (1991), without scale; in the plane by the sum of products of complex numbers.
    """
    ours, theirs = (one - np.median(one, axis=0) for one in (pairs.truth, pairs.given))
    if pairs.width == 2:
        product = np.vdot(theirs[:, 0] + 1j * theirs[:, 1], ours[:, 0] + 1j * ours[:, 1])
        turn = Rotation.from_rotvec([0.0, 0.0, float(np.angle(product))])
    else:
        left, _, right = np.linalg.svd(ours.T @ theirs)
        signs = np.array([1.0, 1.0, np.linalg.det(left @ right)])
        turn = Rotation.from_matrix((left * signs) @ right)
    shift = np.median(pairs.truth - turn.apply(pairs.given), axis=0)
    mount = Rotation.identity()
    if pairs.turned_truth is not None and pairs.turned_given is not None:
        mount = (pairs.turned_truth.inv() * turn * pairs.turned_given).mean()
    return State(shift, turn, 0.0, 0.0, mount, np.zeros(3))
