"""What the scanners of a moving robot saw, each scan as from one place at one time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laser_gt.driving.odometer import Odometer
from laser_gt.logs.motion import Timing, moved, sensor_twist, undistorted
from laser_gt.scans.planar import between, compose
from laser_gt.scans.scan import MIN_RETURNS, Scan, Sweep, View
from validation.poses.angles import Array


@dataclass(frozen=True)
class _Later:
    """A timing counted from another time."""

    timing: Timing | None
    offset: float

    def times(self, angles: Array) -> Array:
        base = np.zeros(len(angles)) if self.timing is None else self.timing.times(angles)
        return np.asarray(base + self.offset)


@dataclass(frozen=True)
class Sensor:
    """A scanner on the robot.

    Parameters
    ----------
    mount : (3,) array
        Sensor frame in the robot frame.
    timing : Timing or None
        When its beams are fired; None where not known: all at once.
    """

    mount: Array
    timing: Timing | None = None


def sweeps_of(
    scans: Mapping[str, Sequence[Scan]],
    sensors: Mapping[str, Sensor],
    odometer: Odometer | None,
    max_delay: float,
) -> tuple[list[Sweep], int]:
    """One sweep for each scan of the first scanner, in its frame at its stamp.

    Parameters
    ----------
    scans : mapping of str to sequence of Scan
        By scanner, each in the order of time. The first one's are all used; of the others, to
        each the one nearest in time.
    sensors : mapping of str to Sensor
        Of the same names.
    odometer : Odometer or None
        The motion, on the clock of the scans. Without it scans stay as they are.
    max_delay : float
        Scans of the other scanners that are further away in seconds are not used.

    Returns
    -------
    sweeps : list of Sweep
        Scans with fewer than ten returns are left out.
    corrected : int
        Sweeps of which the motion was known.
    """
    first, *others = scans
    times = np.array([scan.time for scan in scans[first]])
    twists = np.full((len(times), 3), np.nan) if odometer is None else odometer.twists(times)
    places = {name: np.array([scan.time for scan in scans[name]]) for name in others}
    sweeps: list[Sweep] = []
    for number, (scan, twist) in enumerate(zip(scans[first], twists, strict=True)):
        views = [_view(scan, sensors[first], sensors[first].mount, twist, scan.time)]
        for name in others:
            near = int(np.abs(places[name] - scan.time).argmin()) if len(places[name]) else -1
            if near >= 0 and abs(places[name][near] - scan.time) <= max_delay:
                other = scans[name][near]
                views.append(_view(other, sensors[name], sensors[first].mount, twist, scan.time))
        if sum(int(view.scan.returned.sum()) for view in views) >= MIN_RETURNS:
            sweeps.append(Sweep(tuple(views), str(number)))
    return sweeps, int(np.isfinite(twists).all(-1).sum())


def _view(scan: Scan, sensor: Sensor, laser: Array, twist: Array, time: float) -> View:
    """A scan as a scanner at rest at a time would have taken it, in the laser frame."""
    mount = between(laser, sensor.mount)
    if not np.isfinite(twist).all():
        return View(scan, mount)
    own = sensor_twist(twist, sensor.mount)
    late = scan.time - time
    if sensor.timing is None:
        return View(scan, compose(mount, moved(own, np.array([late]))[0]))
    straight = undistorted(scan, own, _Later(sensor.timing, late))
    return View(replace(straight, time=scan.time), mount)
