"""Planar scans as sensors give them, and what a robot with one or more scanners saw at a stop."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from laser_gt.scans.planar import transform
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.shown import Shown

Indices = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]

MIN_RETURNS = 10
"""Fewer returns do not make a scan that can be matched: the local matcher wants as many pairs."""


@dataclass(frozen=True, repr=False)
class Scan(Shown):
    """One sweep of a scanner, in the sensor's frame.

    Parameters
    ----------
    ranges : (n,) array
        Metres; infinite where nothing came back. No-returns stay in the scan: they say that the
        beam met nothing, which is knowledge about free space only up to `free_range`.
    angles : (n,) array
        Radians, increasing, over at most one turn.
    range_min, range_max : float
        Metres; a range outside is no return.
    sigma : float, optional
        Standard deviation of a range in metres; estimated from the scan where not given.
    shared_sigma, shared_beams : float
        What of it neighbouring beams share, in metres, and over how many beams that falls to
        1 / e: see `laser_gt.scans.noise`.
    time : float
        Seconds; NaN where not recorded.
    sensor : str
        Name of the scanner.

    Raises
    ------
    GtvalError
        For no beams, arrays of different length, NaN or negative ranges, angles that do not
        increase, limits that leave nothing.
    """

    ranges: Array
    angles: Array
    range_min: float = 0.02
    range_max: float = 80.0
    sigma: float | None = None
    time: float = float("nan")
    sensor: str = "laser"
    shared_sigma: float = 0.0
    shared_beams: float = 1.0

    def __post_init__(self) -> None:
        ranges = np.array(self.ranges, dtype=float)
        angles = np.array(self.angles, dtype=float)
        object.__setattr__(self, "ranges", ranges)
        object.__setattr__(self, "angles", angles)
        fault = scan_fault(ranges, angles, self.range_min, self.range_max)
        if fault is None and self.sigma is not None and not 0 < self.sigma < 1:
            fault = f"a range sigma of {self.sigma} m is not possible"
        if fault is not None:
            raise GtvalError(f"scan of sensor '{self.sensor}': {fault}")

    def __len__(self) -> int:
        return len(self.ranges)

    @cached_property
    def returned(self) -> Flags:
        """(n,) True where the beam came back with a range inside the limits."""
        return (self.ranges >= self.range_min) & (self.ranges < self.range_max)

    @cached_property
    def points(self) -> Array:
        """(m, 2) end points of the beams that returned, in the sensor's frame."""
        ranges, angles = self.ranges[self.returned], self.angles[self.returned]
        return np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=-1)

    @cached_property
    def beam_limits(self) -> tuple[Array, Array]:
        """(n,), (n,) least and greatest range of each beam and its two neighbours, 0 for none."""
        ranges = np.where(self.returned, self.ranges, 0.0)
        padded = np.pad(ranges, 1, mode="edge")
        around = np.stack([padded[:-2], padded[1:-1], padded[2:]])
        return around.min(0), around.max(0)

    @cached_property
    def step(self) -> float:
        """Typical angle between neighbouring beams, in radians.

        The median over four beams: where a moving scanner put a scan together from several turns,
        neighbours are near and far by turns.
        """
        if len(self) < 2:
            return 2 * np.pi
        over = min(4, len(self) - 1)
        return float(np.median(self.angles[over:] - self.angles[:-over]) / over)

    @cached_property
    def range_sigma(self) -> float:
        """Standard deviation of a range in metres: the stated one, or `estimated_sigma`."""
        return self.sigma if self.sigma is not None else estimated_sigma(self)


def scan_fault(ranges: Array, angles: Array, range_min: float, range_max: float) -> str | None:
    """Why arrays are not a scan, in words; None if they are one."""
    if ranges.ndim != 1 or ranges.shape != angles.shape:
        return f"{ranges.shape} ranges for {angles.shape} angles"
    if ranges.size == 0:
        return "it has no beams"
    if not np.isfinite(angles).all():
        return f"the angle of beam {int((~np.isfinite(angles)).argmax())} is not finite"
    falling = np.append(np.diff(angles) <= 0, False)
    limits = np.isfinite([range_min, range_max]).all() and 0 <= range_min < range_max
    checks = (
        (np.array([not limits]), f"range limits {range_min} to {range_max} m leave nothing"),
        (np.isnan(ranges), "the range of beam {} is not a number"),
        (ranges < 0, "the range of beam {} is negative"),
        (falling, "its angles do not increase from beam {} to the next"),
        (np.array([angles[-1] - angles[0] > 2 * np.pi + 1e-6]), "its angles exceed one turn"),
    )
    return next((text.format(int(bad.argmax())) for bad, text in checks if bad.any()), None)


def estimated_sigma(scan: Scan) -> float:
    """Standard deviation of the ranges from the second differences of their inverses, in metres.

    Along a straight wall 1 / r is a sine of the beam's angle, however grazing the beam, so its
    second difference (with the sine's own curvature added back) is noise alone. The median over
    all beams, divided by what it is for white noise: 0.6745 sqrt(6) sigma / r^2; what is beyond
    three standard deviations, corners and edges, is left out, and the median taken again.
    Limited to 1 mm to 50 mm.
    """
    ranges = scan.ranges[scan.returned]
    if len(ranges) < MIN_RETURNS:
        return 0.01
    inverse = 1 / ranges
    second = inverse[:-2] + inverse[2:] - (2 - scan.step**2) * inverse[1:-1]
    noise = np.abs(second) * ranges[1:-1] ** 2 / np.sqrt(6)
    sigma = float(np.median(noise)) / 0.6745
    for _ in range(2):
        inside = noise[noise <= 3 * sigma]
        sigma = float(np.median(inside)) / 0.6745 if inside.size else sigma
    return float(np.clip(sigma, 0.001, 0.05))


@dataclass(frozen=True)
class View:
    """A scan and where its sensor sits.

    Parameters
    ----------
    scan : Scan
        What it saw.
    mount : (3,) array
        Sensor frame in the sweep's frame (robot frame, or the sensor's own): x, y, theta.
    """

    scan: Scan
    mount: Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Sweep:
    """All that a robot's scanners saw at one stop, in one frame.

    Parameters
    ----------
    views : sequence of View
        One for each scanner; two of 180 degrees make one of 360.
    name : str
        The stop.

    Raises
    ------
    GtvalError
        If fewer than 10 beams of all the views came back: nothing can be matched.
    """

    views: tuple[View, ...]
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "views", tuple(self.views))
        if not self.views:
            raise GtvalError(f"stop '{self.name}' has no scan")
        returns = sum(int(view.scan.returned.sum()) for view in self.views)
        if returns < MIN_RETURNS:
            beams = sum(len(view.scan) for view in self.views)
            raise GtvalError(
                f"the scan of stop '{self.name}' has {returns} returns of {beams} beams; at least "
                f"{MIN_RETURNS} are needed to match it"
            )

    @cached_property
    def points(self) -> Array:
        """(n, 2) end points of all views, in order, in the sweep's frame."""
        return np.concatenate([transform(view.mount, view.scan.points) for view in self.views])

    @cached_property
    def origins(self) -> Array:
        """(n, 2) position of the sensor that saw each point."""
        return np.concatenate(
            [np.broadcast_to(view.mount[:2], (len(view.scan.points), 2)) for view in self.views]
        )

    @cached_property
    def reach(self) -> float:
        """Largest distance of a point from the sweep's origin, in metres."""
        return float(np.sqrt((self.points**2).sum(-1).max()))

    @cached_property
    def range_sigma(self) -> float:
        """Root mean square of the views' range standard deviations, in metres."""
        return float(np.sqrt(np.mean([view.scan.range_sigma**2 for view in self.views])))


def sweep(scan: Scan, name: str = "") -> Sweep:
    """What one scanner saw, in its own frame."""
    return Sweep((View(scan),), name)


def bare(one: Sweep) -> Sweep:
    """The sweep without what was worked out of it, as it is sent to another process."""
    views = (View(replace(view.scan), view.mount) for view in one.views)
    return Sweep(tuple(views), one.name)


def digest_of(one: Sweep) -> str:
    """Hash of all that a sweep is, its name and times apart."""
    digest = hashlib.sha256()
    for view in one.views:
        scan = view.scan
        noise = (scan.sigma, scan.shared_sigma, scan.shared_beams)
        digest.update(repr((len(scan), scan.range_min, scan.range_max, noise)).encode())
        for array in (scan.ranges, scan.angles, view.mount):
            digest.update(np.ascontiguousarray(array, dtype=float).tobytes())
    return digest.hexdigest()


def merge(
    scans: Sequence[Scan], mounts: Sequence[npt.ArrayLike], name: str = "", max_delay: float = 0.05
) -> Sweep:
    """The scans of several scanners at one stop as one sweep in the robot frame.

    Parameters
    ----------
    scans : sequence of Scan
        One for each scanner.
    mounts : sequence of (3,) array_like
        Sensor frames in the robot frame.
    name : str
        The stop.
    max_delay : float
        Largest difference of the time stamps in seconds. Stamps that are not recorded (NaN) are
        not compared.

    Raises
    ------
    GtvalError
        If the stamps are further apart: the scanners run on different clocks, or the scans were
        not taken together, and a moving robot would be smeared.
    """
    times = np.array([scan.time for scan in scans])
    times = times[np.isfinite(times)]
    if times.size > 1 and np.ptp(times) > max_delay:
        raise GtvalError(
            f"stop '{name}': the time stamps of its scanners are {np.ptp(times):.3f} s apart, more "
            f"than {max_delay} s; bring their clocks together or raise max_delay if the robot stood"
        )
    views = [
        View(scan, np.asarray(mount, dtype=float))
        for scan, mount in zip(scans, mounts, strict=True)
    ]
    return Sweep(tuple(views), name)
