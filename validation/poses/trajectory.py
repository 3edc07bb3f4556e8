"""Poses at times, with their covariances, their gaps and their clock."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, Self

import numpy as np
import numpy.typing as npt

from validation.errors import GtvalError
from validation.poses.angles import Array, wrap
from validation.poses.pose_table import PLANAR, SPATIAL, Component
from validation.shown import Shown

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Kind = Literal["plane", "space", "points_plane", "points_space"]
"""Poses in the plane or in space, or positions without orientation."""
Stamps = Literal["capture", "receipt", "unknown"]
"""What the stamps are: when light fell on the sensor, or when a message arrived."""

NUMBERS: Mapping[Kind, int] = {"plane": 3, "space": 7, "points_plane": 2, "points_space": 3}
"""Numbers of one pose: x, y, theta; x, y, z and a quaternion x, y, z, w; x, y; x, y, z."""
FREEDOMS: Mapping[Kind, int] = {"plane": 3, "space": 6, "points_plane": 2, "points_space": 3}
"""Numbers of one error: as above, but a small rotation about the fixed axes X, Y, Z in space."""
COMPONENTS: Mapping[Kind, tuple[Component, ...]] = {
    "plane": PLANAR,
    "space": SPATIAL,
    "points_plane": PLANAR[:2],
    "points_space": SPATIAL[:3],
}

GAP_INTERVALS = 3.5
"""Longest interval, in median intervals, that is no gap. Two frames lost in a row leave an interval
of three and some jitter; the error of a straight line between two poses grows with the square of
the interval, so that this one is twelve times that of the usual interval."""


@dataclass(frozen=True)
class Clock:
    """What the stamps of a source are.

    Parameters
    ----------
    stamps : {"capture", "receipt", "unknown"}
        Receipt stamps hold the latency of the way from the sensor.
    rate : float, optional
        Frames a second, where the source has a rate.
    exposure : float, optional
        Seconds; a stamp at the start of the exposure is half of it early.
    """

    stamps: Stamps = "unknown"
    rate: float | None = None
    exposure: float | None = None


@dataclass(frozen=True, repr=False)
class Trajectory(Shown):
    """Poses of one system at n times.

    Parameters
    ----------
    system : str
        Its name.
    times : (n,) array
        Seconds since ``epoch``, strictly increasing.
    poses : (n, k) array
        One pose a row: see `NUMBERS`. Metres, radians; quaternions are normalised.
    kind : {"plane", "space", "points_plane", "points_space"}
        What a row of ``poses`` is.
    covariances : (n, m, m) array, optional
        Of the m numbers of one error, see `FREEDOMS`; all NaN where not stated.
    epoch : int
        Whole seconds taken off all stamps, so that nanoseconds survive in ``times``.
    clock : Clock
        What the stamps are.
    longest_interval : float, optional
        Seconds; nothing is interpolated over a longer one. By default `GAP_INTERVALS` median
        intervals.
    frame, child_frame : str
        Names of the frame of the coordinates and of the moving frame, where a file states them.
    provenance : mapping
        Facts for results/run.json.

    Raises
    ------
    GtvalError
        For wrong shapes, times that do not increase, numbers that are not finite, quaternions of
        length zero.
    """

    system: str
    times: Array
    poses: Array
    kind: Kind = "plane"
    covariances: Array = field(default_factory=lambda: np.empty(0))
    epoch: int = 0
    clock: Clock = Clock()
    longest_interval: float | None = None
    frame: str = ""
    child_frame: str = ""
    provenance: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        times = np.asarray(self.times, dtype=float)
        poses = np.array(self.poses, dtype=float)
        n, m = len(times), FREEDOMS[self.kind]
        who = f"trajectory of '{self.system}'"
        if poses.shape != (n, NUMBERS[self.kind]) or times.ndim != 1:
            expected = f"{n} poses of {NUMBERS[self.kind]} numbers"
            raise GtvalError(f"{who}: expected {expected}, got {poses.shape}")
        covariances = np.asarray(self.covariances, dtype=float)
        if covariances.size == 0:
            covariances = np.broadcast_to(np.nan, (n, m, m))
        if covariances.shape != (n, m, m):
            raise GtvalError(f"{who}: covariances {covariances.shape}, not {(n, m, m)}")
        if not (np.isfinite(times).all() and np.isfinite(poses).all()):
            raise GtvalError(f"{who}: a time or a pose is not finite")
        if n > 1 and not (np.diff(times) > 0).all():
            raise GtvalError(f"{who}: its times do not increase; sort them, and drop repeats")
        if self.kind == "space":
            length = np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
            if (length < 0.5).any():
                raise GtvalError(f"{who}: a quaternion has no length")
            # What is of length 1 but for rounding stays as it is: files are read back exactly.
            poses[:, 3:] /= np.where(np.abs(length - 1) < 1e-15, 1.0, length)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "poses", poses)
        object.__setattr__(self, "covariances", covariances)

    def __len__(self) -> int:
        return len(self.times)

    @property
    def components(self) -> tuple[Component, ...]:
        """Names and kinds of the numbers that a table of these poses has."""
        return COMPONENTS[self.kind]

    @property
    def dimensions(self) -> int:
        """2 in the plane, 3 in space."""
        return 2 if self.kind in {"plane", "points_plane"} else 3

    @property
    def positions(self) -> Array:
        """(n, 2 or 3) in metres."""
        return self.poses[:, : self.dimensions]

    @property
    def has_orientation(self) -> bool:
        """Whether it has poses, not positions only."""
        return self.kind in {"plane", "space"}

    @property
    def rotations(self) -> "Rotation":
        """(n) rotations from the moving frame to the frame of the coordinates.

        Raises
        ------
        GtvalError
            For positions without orientation.
        """
        from scipy.spatial.transform import Rotation  # noqa: PLC0415  (tables of stops do without)

        if self.kind == "plane":
            return Rotation.from_rotvec(self.poses[:, 2:] * [0.0, 0.0, 1.0])
        if self.kind == "space":
            return Rotation.from_quat(self.poses[:, 3:])
        raise GtvalError(f"'{self.system}' has positions only, no orientation")

    @property
    def headings(self) -> Array:
        """(n,) angle of the X axis of the moving frame in the plane X, Y, in (-pi, pi]."""
        if self.kind == "plane":
            return wrap(self.poses[:, 2])
        ahead = self.rotations.apply([1.0, 0.0, 0.0])
        return np.asarray(np.arctan2(ahead[:, 1], ahead[:, 0]))

    @property
    def has_covariance(self) -> npt.NDArray[np.bool_]:
        """(n,) True where a covariance is stated."""
        return np.asarray(np.isfinite(self.covariances).all((1, 2)))

    @property
    def gap(self) -> float:
        """Seconds; an interval that is longer is a gap."""
        if self.longest_interval is not None:
            return self.longest_interval
        return GAP_INTERVALS * float(np.median(np.diff(self.times))) if len(self) > 1 else 0.0

    @property
    def gaps(self) -> Array:
        """(g, 2) first and last time of each gap, seconds since ``epoch``."""
        wide = np.flatnonzero(np.diff(self.times) > self.gap)
        return np.column_stack([self.times[wide], self.times[wide + 1]])

    def times_since(self, epoch: int) -> Array:
        """(n,) seconds since another epoch."""
        return self.times + (self.epoch - epoch)

    def shifted(self, delay: float) -> Self:
        """The same poses with a delay added to the stamps, in seconds."""
        return replace(self, times=self.times + delay)

    def select(self, which: npt.ArrayLike) -> Self:
        """The rows of a mask, a slice or row numbers, in their order."""
        rows = np.arange(len(self))[which] if isinstance(which, slice) else np.asarray(which)
        return replace(
            self,
            times=self.times[rows],
            poses=self.poses[rows],
            covariances=self.covariances[rows],
            # What is a gap does not change when rows are left out.
            longest_interval=self.gap if len(self) > 1 else self.longest_interval,
        )

    def planar(self) -> Self:
        """The trajectory seen from above: x, y and the heading, or x, y.

        The covariance is that of x, y and the rotation about the vertical.
        """
        if self.dimensions == 2:
            return self
        kept = [0, 1, 5] if self.kind == "space" else [0, 1]
        poses = self.poses[:, :2]
        if self.kind == "space":
            poses = np.column_stack([poses, self.headings])
        return replace(
            self,
            poses=poses,
            kind="plane" if self.kind == "space" else "points_plane",
            covariances=self.covariances[:, kept][:, :, kept],
        )
