"""Laser scans of a synthetic campaign: files for laser/ and the [laser] table."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from data_samples.rooms.rooms import Room
from data_samples.rooms.scanners import (
    FLAT,
    SICK_FRONT,
    SICK_REAR,
    Floor,
    Panels,
    Scanner,
    box,
    panels,
    polyline,
    take_scan,
    uneven_floor,
)
from laser_gt.logs.scan_csv import scan_csv
from laser_gt.scans.planar import between, compose
from laser_gt.scans.scan import Scan
from validation.poses.angles import Array


@dataclass(frozen=True)
class LaserSimulation:
    """Scanners on the robot and what is wrong with them.

    Parameters
    ----------
    scanners : sequence of Scanner
        With their true mounts; rigidly joined, so that an error of the mount is one for all.
    mount_sigmas : (float, float, float)
        With which the mount is measured by hand: x, y (metres), theta (radians).
    mount_error : (float, float, float)
        Added to the stated mount and not covered by the stated sigmas.
    odometry_sigmas : (float, float, float)
        From stop to stop.
    floor_height : float
        Amplitude of the waves of the floor in metres; 0 for a flat one.
    moved_boxes : int
        Boxes of the size of a bin that stand elsewhere at every stop.
    glass : float
        Width in metres of a window from the floor in each wall; 0 for none.
    lean : float
        Angle by which the walls lean into the room, in radians.
    """

    scanners: Sequence[Scanner] = (SICK_FRONT, SICK_REAR)
    mount_sigmas: tuple[float, float, float] = (0.001, 0.001, 0.0005)
    mount_error: tuple[float, float, float] = (0.0, 0.0, 0.0)
    odometry_sigmas: tuple[float, float, float] = (0.05, 0.05, 0.04)
    floor_height: float = 0.0
    moved_boxes: int = 0
    glass: float = 0.0
    lean: float = 0.0


FAULTS = ("boxes", "edges", "floor", "glass", "grazing", "lean", "lost", "tilt")
"""What `with_faults` knows, each of a size that a lab may meet."""


def with_faults(
    faults: Iterable[str], mount_error: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> LaserSimulation:
    """Scanners and a room with named faults, for trying out what a verdict makes of them.

    Parameters
    ----------
    faults : iterable of str
        'boxes': two bins elsewhere at every stop. 'edges': beams of 10 mrad that mix ranges at
        edges. 'floor': waves of up to 4 mm each (AD2.3 suspected the floor). 'glass': a window of
        2 m in each wall that answers only when hit squarely. 'grazing': ranges 3 mm longer by
        incidence. 'lean': walls that lean by 2 degrees. 'lost': 5 % of the beams do not come
        back. 'tilt': scan planes that slope by 1 degree (AD2.3 suspected them).
    mount_error : (float, float, float)
        Of the stated mount: x, y (metres), theta (radians).

    Raises
    ------
    ValueError
        For a name that is not in `FAULTS`.
    """
    chosen = set(faults)
    unknown = chosen - set(FAULTS)
    if unknown:
        raise ValueError(f"no such fault: {', '.join(sorted(unknown))}; there are {FAULTS}")
    slope = float(np.tan(np.deg2rad(1.0)))
    scanners = [
        replace(
            scanner,
            divergence=0.01 if "edges" in chosen else 0.0,
            incidence_bias=0.003 if "grazing" in chosen else 0.0,
            drop_rate=0.05 if "lost" in chosen else 0.0,
            tilt=(slope, 0.0) if "tilt" in chosen else (0.0, 0.0),
        )
        for scanner in (SICK_FRONT, SICK_REAR)
    ]
    return LaserSimulation(
        scanners,
        mount_error=mount_error,
        floor_height=0.004 if "floor" in chosen else 0.0,
        moved_boxes=2 if "boxes" in chosen else 0,
        glass=2.0 if "glass" in chosen else 0.0,
        lean=float(np.deg2rad(2.0)) if "lean" in chosen else 0.0,
    )


def room_panels(room: Room, glass: float = 0.0, lean: float = 0.0) -> Panels:
    """Walls and obstacles of a room as panels.

    Parameters
    ----------
    room : Room
        The room.
    glass : float
        Width in metres of a window in the middle of each wall; 0 for none. Behind it, two metres
        on, is the wall of another building.
    lean : float
        Angle in radians by which the walls lean to the left of their direction.
    """
    found = polyline(room.outline, closed=True, lean=lean)
    if glass > 0:
        found = _with_windows(room.outline, glass, lean)
    for obstacle in room.obstacles:
        found = found + polyline(obstacle, closed=True)
    return found


def _with_windows(outline: Array, width: float, lean: float) -> Panels:
    """Walls with a pane in the middle of each, and what stands behind it."""
    starts, ends = outline, np.roll(outline, -1, axis=0)
    length = np.sqrt(((ends - starts) ** 2).sum(-1, keepdims=True))
    along = (ends - starts) / length
    half = np.minimum(width, 0.8 * length) / 2
    middle = (starts + ends) / 2
    left, right = middle - half * along, middle + half * along
    centre = outline.mean(0)
    away = np.column_stack([-along[:, 1], along[:, 0]])
    away *= np.sign(((middle - centre) * away).sum(-1, keepdims=True))
    return (
        panels(starts, left, lean=lean)
        + panels(right, ends, lean=lean)
        + panels(left, right, glass=True)
        + panels(starts + 2 * away - 3 * along, ends + 2 * away + 3 * along)
    )


def laser_files(room: Room, settings: LaserSimulation, rng: np.random.Generator) -> dict[str, str]:
    """Scans of all stops, odometry and the true mount, as texts of files.

    The text under 'campaign.toml' is to be added to the end of that file.

    Parameters
    ----------
    room : Room
        With its stops.
    settings : LaserSimulation
        Scanners.
    rng : numpy.random.Generator
        Source of all chance.
    """
    taken = scans_at_stops(room, room.stops, settings, rng)
    scans = [
        (stop, scan) for stop, found in zip(room.stop_names, taken, strict=True) for scan in found
    ]
    stated = _stated_mounts(settings, rng)
    lines = ["pose,x,y,theta"]
    for stop, pose in zip(room.stop_names, _odometry(room.stops, settings, rng), strict=True):
        lines.append(",".join([stop, *(f"{v:.4f}" for v in pose)]))
    truth = ["scanner,x,y,theta"]
    truth += [
        ",".join([scanner.name, *(repr(float(v)) for v in scanner.mount)])
        for scanner in settings.scanners
    ]
    return {
        "laser/scans.csv": scan_csv(scans),
        "laser/odometry.csv": "\n".join(lines) + "\n",
        "truth/laser_mount.csv": "\n".join(truth) + "\n",
        "campaign.toml": _toml(settings, stated),
    }


def scans_at_stops(
    room: Room, poses: Array, settings: LaserSimulation, rng: np.random.Generator
) -> list[list[Scan]]:
    """The scans of all scanners at each of some robot poses, (n, 3)."""
    floor = uneven_floor(rng, settings.floor_height) if settings.floor_height > 0 else FLAT
    return [_stop_scans(room, settings, pose, rng, floor) for pose in poses]


def _stop_scans(
    room: Room, settings: LaserSimulation, pose: Array, rng: np.random.Generator, floor: Floor
) -> list[Scan]:
    """One scan of each scanner."""
    there = room_panels(room, settings.glass, settings.lean)
    for _ in range(settings.moved_boxes):
        away, around = rng.uniform(1.0, 2.5), rng.uniform(-np.pi, np.pi)
        place = pose[:2] + away * np.array([np.cos(around), np.sin(around)])
        there = there + box((*place, rng.uniform(-np.pi, np.pi)), 0.35, 0.35, high=0.6)
    return [take_scan(there, scanner, pose, rng, floor=floor) for scanner in settings.scanners]


def _odometry(stops: Array, settings: LaserSimulation, rng: np.random.Generator) -> Array:
    """(n, 3) poses that drift from stop to stop, from zero."""
    steps = between(stops[:-1], stops[1:])
    return chained(steps + rng.normal(0, 1, steps.shape) * settings.odometry_sigmas)


def chained(steps: Array) -> Array:
    """(n + 1, 3) poses of a walk of n steps, (n, 3), seen from its start."""
    poses = [np.zeros(3)]
    for step in steps:
        poses.append(compose(poses[-1], step))
    return np.array(poses)


def _stated_mounts(settings: LaserSimulation, rng: np.random.Generator) -> Mapping[str, Array]:
    """Mounts as measured: all scanners off by the same rigid error."""
    true = [np.array(scanner.mount) for scanner in settings.scanners]
    first = true[0] + rng.normal(0, settings.mount_sigmas) + settings.mount_error
    return {
        scanner.name: compose(first, between(true[0], mount))
        for scanner, mount in zip(settings.scanners, true, strict=True)
    }


def _toml(settings: LaserSimulation, stated: Mapping[str, Array]) -> str:
    """The [laser] table."""
    length = round(max(settings.odometry_sigmas[:2]) * 1.5, 3)
    angle = round(settings.odometry_sigmas[2] * 1.5, 3)
    parts = [f"\n[laser]\nguess_sigmas = [{length}, {angle}]\n"]
    for name, mount in stated.items():
        numbers = ", ".join(f"{v:.5f}" for v in mount)
        sigmas = ", ".join(str(v) for v in settings.mount_sigmas)
        parts.append(f"\n[laser.scanners.{name}]\nmount = [{numbers}]\nmount_sigmas = [{sigmas}]\n")
    return "".join(parts)
