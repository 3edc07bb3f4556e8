"""Laser scans of a synthetic campaign: files for laser/ and the [laser] table."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from data_samples.rooms import Room
from data_samples.scanners import (
    FLAT,
    SICK_FRONT,
    SICK_REAR,
    Floor,
    Panels,
    Scanner,
    box,
    polyline,
    take_scan,
    uneven_floor,
)
from laser_gt.planar import between, compose
from laser_gt.scan_csv import scan_csv
from laser_gt.scans import Scan
from validation.angles import Array


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
    """

    scanners: Sequence[Scanner] = (SICK_FRONT, SICK_REAR)
    mount_sigmas: tuple[float, float, float] = (0.001, 0.001, 0.0005)
    mount_error: tuple[float, float, float] = (0.0, 0.0, 0.0)
    odometry_sigmas: tuple[float, float, float] = (0.05, 0.05, 0.04)
    floor_height: float = 0.0
    moved_boxes: int = 0


def room_panels(room: Room) -> Panels:
    """Walls and obstacles of a room as panels."""
    panels = polyline(room.outline, closed=True)
    for obstacle in room.obstacles:
        panels = panels + polyline(obstacle, closed=True)
    return panels


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
    floor = uneven_floor(rng, settings.floor_height) if settings.floor_height > 0 else FLAT
    scans = [
        (stop, scan)
        for stop, pose in zip(room.stop_names, room.stops, strict=True)
        for scan in _stop_scans(room, settings, pose, rng, floor)
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


def _stop_scans(
    room: Room, settings: LaserSimulation, pose: Array, rng: np.random.Generator, floor: Floor
) -> list[Scan]:
    """One scan of each scanner."""
    panels = room_panels(room)
    for _ in range(settings.moved_boxes):
        away, around = rng.uniform(1.0, 2.5), rng.uniform(-np.pi, np.pi)
        place = pose[:2] + away * np.array([np.cos(around), np.sin(around)])
        panels = panels + box((*place, rng.uniform(-np.pi, np.pi)), 0.35, 0.35, high=0.6)
    return [take_scan(panels, scanner, pose, rng, floor=floor) for scanner in settings.scanners]


def _odometry(stops: Array, settings: LaserSimulation, rng: np.random.Generator) -> Array:
    """(n, 3) poses that drift from stop to stop, from zero."""
    steps = between(stops[:-1], stops[1:])
    steps = steps + rng.normal(0, 1, steps.shape) * settings.odometry_sigmas
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
