"""Structured explanations of errors, as one chain of transforms with parts switched on or off.

A corrected pose is

    drift . frame . slip . [P A P^-1] . scale (G + time v) . A^-1

with the GT pose G, its velocity v, and P the reference pose of a system whose frame was tied to
the GTV frame by one surveyed pose through the very mount that is used for all poses (AD2.3,
"Validation of the laser-based GT system"). A is the correction of the mount: true mount = A .
mount used, in the robot frame. The slip is the survey's own error at P, which shifts and turns
all poses about P; it is no fault of the system but must not be taken for one. The drift is a shift
and a turn of the pose that change evenly from the first pose to the last, with none in the middle;
the growth is one with none at the first pose.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array

PARTS = {
    "frame": ("frame_x", "frame_y", "frame_theta"),
    "mount": ("mount_x", "mount_y", "mount_theta"),
    "turn": ("mount_theta",),
    "shift": ("frame_x", "frame_y"),
    "scale": ("scale",),
    "time": ("time",),
    "drift": ("drift_x", "drift_y", "drift_theta"),
    "growth": ("growth_x", "growth_y", "growth_theta"),
    "slip": ("slip_x", "slip_y", "slip_theta"),
}
PARAMETERS = tuple(dict.fromkeys(name for names in PARTS.values() for name in names))
UNITS = {
    name: "m"
    if name.endswith(("_x", "_y"))
    else "rad"
    if name.endswith("theta")
    else {"scale": "", "time": "s"}[name]
    for name in PARAMETERS
}


@dataclass(frozen=True)
class ErrorModel:
    """One explanation: which parts of the chain are free.

    Parameters
    ----------
    name : str
        Short name: 'none', 'frame', 'reference_mount', ...
    words : str
        What it says, for a sentence.
    parts : tuple of str
        The systematic parts, of 'frame', 'mount', 'turn' (of the mount alone), 'shift' (of the
        frame alone), 'scale', 'time', 'drift', 'growth'.
    through_reference : bool
        Whether the mount also stands in P A P^-1.
    slip : bool
        Whether the reference pose's own error is fitted along.
    """

    name: str
    words: str
    parts: tuple[str, ...] = ()
    through_reference: bool = False
    slip: bool = False

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the systematic parameters."""
        return tuple(name for part in self.parts for name in PARTS[part])

    @property
    def fitted(self) -> tuple[str, ...]:
        """Names of all that is fitted, the systematic parameters first."""
        return self.parameters + (PARTS["slip"] if self.slip else ())

    @property
    def columns(self) -> tuple[int, ...]:
        """Where the fitted parameters stand in PARAMETERS."""
        return tuple(PARAMETERS.index(name) for name in self.fitted)

    @property
    def drifts(self) -> bool:
        """Whether it changes along the order of the poses."""
        return bool({"drift", "growth"} & set(self.parts))

    def nested_in(self, other: "ErrorModel") -> bool:
        """Whether the other explains all that this one can, and more."""
        return set(self.parameters) < set(other.parameters)


class Motion(NamedTuple):
    """How the robot moves at n poses: a cubic in time before each and one after it.

    ``velocities`` (n, 3) in m/s and rad/s, ``accelerations`` (n, 3) in m/s^2 and rad/s^2, ``jerks``
    (n, 2, 3) in m/s^3 and rad/s^3, and ``reach`` (n, 2) seconds up to which each cubic holds;
    beyond, the velocity stays. ``doubts`` (n, 3) are the velocities less those that every other
    pose gives, in the same units: what is not known of the way between poses.
    """

    velocities: Array
    accelerations: Array
    jerks: Array
    reach: Array
    doubts: Array

    @classmethod
    def steady(cls, velocities: Array) -> "Motion":
        """Of poses (n, 3) whose velocities stay."""
        n = len(velocities)
        nothing = np.zeros((n, 3))
        return cls(velocities, nothing, np.zeros((n, 2, 3)), np.zeros((n, 2)), nothing)

    @classmethod
    def along(cls, stamps: Array, path: Array) -> "Motion":
        """A cubic spline through poses (n, 3), whose angles do not jump, in any order of time.

        Along a smooth path its velocities are off by the third power of the time between poses,
        those from the two neighbours by the second.
        """
        from scipy import interpolate  # noqa: PLC0415 - half a second, for moving robots only

        order = np.argsort(stamps, kind="stable")
        sorted_stamps, sorted_path = stamps[order], path[order]
        spline = interpolate.CubicSpline(sorted_stamps, sorted_path)
        doubts = np.zeros(path.shape)
        for first in (0, 1):
            rows = slice(first, None, 2)
            if len(sorted_stamps[rows]) > 1:
                coarse = interpolate.CubicSpline(sorted_stamps[rows], sorted_path[rows])
                known = sorted_stamps[rows]
                doubts[order[rows]] = spline(known, 1) - coarse(known, 1)
        pieces = np.clip(np.argsort(order)[:, None] + [-1, 0], 0, len(stamps) - 2)
        reach, jerks = np.diff(stamps[order])[pieces], 6 * spline.c[0][pieces]
        return cls(spline(stamps, 1), spline(stamps, 2), jerks, reach, doubts)

    def select(self, rows: npt.ArrayLike | slice) -> "Motion":
        """Of some poses."""
        some = rows if isinstance(rows, slice) else np.asarray(rows)
        return Motion(*(one[some] for one in self))

    def later(self, time: Array) -> tuple[Array, Array]:
        """(..., n, 3) way within times (..., 1, 1), and the velocity after it."""
        near = np.clip(time, -self.reach[:, :1], self.reach[:, 1:])
        jerk = np.where(time < 0, self.jerks[:, 0], self.jerks[:, 1])
        rate = self.velocities + self.accelerations * near + jerk * near**2 / 2
        way = self.velocities * near + self.accelerations * near**2 / 2 + jerk * near**3 / 6
        return way + rate * (time - near), rate


class Corrected(NamedTuple):
    """Corrected poses with their derivatives.

    ``poses`` (..., n, 3) with unwrapped angles, ``by_parameters`` (..., n, 3, k) by the fitted
    parameters and ``by_pose`` (..., n, 3, 3) by the GT poses themselves.
    """

    poses: Array
    by_parameters: Array
    by_pose: Array


FRAME_TURN = ErrorModel(
    "frame_turn", "a wrong frame and a wrong heading of the mount", ("frame", "turn")
)
"""What is left of 'frame_mount' where all poses have one heading: the shift of either looks the
same there, but their turns do not, as only the frame's moves positions."""


SHIFT_MOUNT = ErrorModel(
    "shift_mount", "a wrong mount (a lever arm) and a shifted frame", ("shift", "mount")
)
"""What is left of 'frame_mount' where the robot turns on one spot: a turn of the frame and one of
the mount look the same there, but the arm of the mount shows."""

FROM_THE_FIRST = "growing_drift"
DRIFTS = (
    ErrorModel("drift", "a drift", ("drift",)),
    ErrorModel(FROM_THE_FIRST, "a drift that starts at the first pose", ("growth",)),
    ErrorModel("frame_drift", "a drift from the first pose on", ("frame", "drift")),
    ErrorModel("mount_drift", "a wrong mount and a drift", ("mount", "drift")),
    ErrorModel(
        "frame_mount_drift", "a wrong frame, a wrong mount and a drift", ("frame", "mount", "drift")
    ),
)
"""Weighed where errors depend on their neighbours."""


def candidates(*, reference: bool, moving: bool) -> tuple[ErrorModel, ...]:
    """The explanations to be weighed against each other, the simplest first.

    Parameters
    ----------
    reference : bool
        Whether the system's reference pose is known: its slip is then part of every explanation
        that does not leave the frame free.
    moving : bool
        Whether velocities are known, so that a time offset could show.
    """
    slip = reference
    mount = ErrorModel("mount", "a wrong mount", ("mount",), slip=slip)
    models = [
        ErrorModel("none", "no systematic error", slip=slip),
        ErrorModel("scale", "a wrong scale", ("scale",), slip=slip),
        ErrorModel("frame", "a wrong frame", ("frame",)),
        mount,
    ]
    if reference:
        words = "a wrong mount that also shifted the frame through the reference pose"
        models.append(ErrorModel("reference_mount", words, ("mount",), True, True))
    models += [
        ErrorModel("frame_scale", "a wrong frame and scale", ("frame", "scale")),
        ErrorModel("frame_mount", "a wrong frame and a wrong mount", ("frame", "mount"), reference),
    ]
    if reference:
        words = "a wrong mount that also shifted the frame, and a wrong scale"
        models.append(ErrorModel("reference_mount_scale", words, ("mount", "scale"), True, True))
    models.append(
        ErrorModel(
            "frame_mount_scale",
            "a wrong frame, mount and scale",
            ("frame", "mount", "scale"),
            reference,
        )
    )
    if moving:
        models += [
            ErrorModel("time", "a time offset", ("time",), slip=slip),
            ErrorModel("frame_time", "a wrong frame and a time offset", ("frame", "time")),
            ErrorModel("mount_time", "a wrong mount and a time offset", ("mount", "time")),
            ErrorModel(
                "frame_mount_time",
                "a wrong frame, a wrong mount and a time offset",
                ("frame", "mount", "time"),
                reference,
            ),
        ]
    return tuple(models)


def correct(
    model: ErrorModel,
    parameters: Array,
    poses: Array,
    reference: Array | None = None,
    motion: Motion | None = None,
    places: Array | None = None,
) -> Corrected:
    """GT poses as they would be without the systematic error.

    Parameters
    ----------
    model : ErrorModel
        Which parts there are.
    parameters : (..., k) array
        In the order of ``model.fitted``: metres, radians, scale as excess over 1, seconds.
    poses : (n, 3) array
        GT poses in the GTV frame.
    reference : (3,) array, optional
        The reference pose P; needed by models that go through it or let it slip.
    motion : Motion, optional
        Of the poses, along the axes of the GTV frame; without it no time offset.
    places : (n,) array, optional
        Of the poses between the first and the last, from -1/2 to 1/2; without them no drift.

    Notes
    -----
    Positions are complex numbers, so that a rotation is a product; derivatives are carried
    forward through the chain.
    """
    parameters = np.asarray(parameters, dtype=float)
    at = {name: parameters[..., column, None] for column, name in enumerate(model.fitted)}
    chain = _Chain(poses, at, model.fitted)
    pivot = np.zeros(3) if reference is None else np.asarray(reference, dtype=float)
    centre = complex(pivot[0], pivot[1])
    if "time" in model.parts:
        chain.move(Motion.steady(np.zeros_like(poses)) if motion is None else motion)
    if "scale" in model.parts:
        chain.stretch(centre)
    if "mount" in model.parts or "turn" in model.parts:
        chain.unmount()
        if model.through_reference:
            chain.remount(centre, pivot[2])
    if model.slip:
        chain.turn("slip", centre)
    if "frame" in model.parts:
        chain.turn("frame", 0j)
    if "shift" in model.parts:
        chain.shift()
    if "drift" in model.parts:
        chain.drift("drift", np.zeros(len(poses)) if places is None else places)
    if "growth" in model.parts:
        chain.drift("growth", np.zeros(len(poses)) if places is None else places + 0.5)
    return chain.result()


class _Chain:
    """Positions and angles on their way through the chain, with their derivatives."""

    def __init__(self, poses: Array, at: dict[str, Array], names: Sequence[str]) -> None:
        some = next(iter(at.values()), np.zeros((1,)))
        shape = np.broadcast_shapes(some.shape, (len(poses),))
        self.at, self.names = at, tuple(names)
        self.z = np.broadcast_to(poses[:, 0] + 1j * poses[:, 1], shape)
        self.theta = np.broadcast_to(poses[:, 2], shape)
        self.dz = np.zeros((*shape, len(self.names)), dtype=complex)
        self.dtheta = np.zeros((*shape, len(self.names)))
        self.by_x = np.ones(shape, dtype=complex)
        self.by_theta = np.zeros(shape, dtype=complex)

    def _column(self, name: str) -> int:
        return self.names.index(name)

    def _rotate(self, turn: Array, centre: complex) -> None:
        """Turn everything about a centre by unit complex numbers."""
        self.z = centre + turn * (self.z - centre)
        self.dz = self.dz * turn[..., None]
        self.by_x, self.by_theta = self.by_x * turn, self.by_theta * turn

    def move(self, motion: Motion) -> None:
        """Where the robot was a time offset later."""
        column = self._column("time")
        way, rate = motion.later(self.at["time"][..., None])
        self.z = self.z + way[..., 0] + 1j * way[..., 1]
        self.theta = self.theta + way[..., 2]
        self.dz[..., column] = rate[..., 0] + 1j * rate[..., 1]
        self.dtheta[..., column] = rate[..., 2]

    def stretch(self, centre: complex) -> None:
        """Scale positions about a centre."""
        factor = 1 + self.at["scale"]
        column = self._column("scale")
        away = self.z - centre
        self.z = centre + factor * away
        self.dz, self.by_x = self.dz * factor[..., None], self.by_x * factor
        self.dz[..., column] = away

    def unmount(self) -> None:
        """The inverse of the mount correction, on the right: z - e^(i (theta - alpha)) a."""
        alpha = self.at["mount_theta"]
        turned = np.exp(1j * (self.theta - alpha))
        arm = turned * (self.at.get("mount_x", 0.0) + 1j * self.at.get("mount_y", 0.0))
        self.z = self.z - arm
        # What came before changes theta, and so the direction of the arm.
        self.dz = self.dz - 1j * arm[..., None] * self.dtheta
        self.by_theta = self.by_theta - 1j * arm
        self.theta = self.theta - alpha
        if "mount_x" in self.at:
            self.dz[..., self._column("mount_x")] += -turned
            self.dz[..., self._column("mount_y")] += -1j * turned
        self.dz[..., self._column("mount_theta")] += 1j * arm
        self.dtheta[..., self._column("mount_theta")] -= 1.0

    def remount(self, centre: complex, heading: float) -> None:
        """The mount correction seen from the reference pose, on the left: P A P^-1."""
        alpha = self.at["mount_theta"]
        away = np.exp(1j * alpha) * (self.z - centre)
        self._rotate(np.exp(1j * alpha), centre)
        direction = np.exp(1j * heading)
        self.z = self.z + direction * (self.at["mount_x"] + 1j * self.at["mount_y"])
        self.theta = self.theta + alpha
        self.dz[..., self._column("mount_x")] += direction
        self.dz[..., self._column("mount_y")] += 1j * direction
        self.dz[..., self._column("mount_theta")] += 1j * away
        self.dtheta[..., self._column("mount_theta")] += 1.0

    def turn(self, part: str, centre: complex) -> None:
        """A rotation about a centre and a shift: the slip or the frame."""
        x, y, angle = (self.at[name] for name in PARTS[part])
        away = np.exp(1j * angle) * (self.z - centre)
        self._rotate(np.exp(1j * angle), centre)
        self.z = self.z + x + 1j * y
        self.theta = self.theta + angle
        columns = [self._column(name) for name in PARTS[part]]
        self.dz[..., columns[0]] += 1.0
        self.dz[..., columns[1]] += 1j
        self.dz[..., columns[2]] += 1j * away
        self.dtheta[..., columns[2]] += 1.0

    def shift(self) -> None:
        """A shift of the frame."""
        self.z = self.z + self.at["frame_x"] + 1j * self.at["frame_y"]
        self.dz[..., self._column("frame_x")] += 1.0
        self.dz[..., self._column("frame_y")] += 1j

    def drift(self, part: str, places: Array) -> None:
        """A shift and a turn in proportion to the place along the order."""
        x, y, angle = (self.at[name] for name in PARTS[part])
        self.z = self.z + places * (x + 1j * y)
        self.theta = self.theta + places * angle
        columns = [self._column(name) for name in PARTS[part]]
        self.dz[..., columns[0]] += places
        self.dz[..., columns[1]] += 1j * places
        self.dtheta[..., columns[2]] += places

    def result(self) -> Corrected:
        """Real arrays."""
        poses = np.stack([self.z.real, self.z.imag, self.theta], -1)
        by_parameters = np.stack([self.dz.real, self.dz.imag, self.dtheta], -2)
        by_pose = np.zeros((*self.z.shape, 3, 3))
        by_pose[..., 0, 0] = by_pose[..., 1, 1] = self.by_x.real
        by_pose[..., 1, 0], by_pose[..., 0, 1] = self.by_x.imag, -self.by_x.imag
        by_pose[..., 0, 2], by_pose[..., 1, 2] = self.by_theta.real, self.by_theta.imag
        by_pose[..., 2, 2] = 1.0
        return Corrected(poses, by_parameters, by_pose)
