"""Drives with errors that last: slow errors of each receiver, jumps, and clocks that are off.

The vehicle is made here and not by `data_samples`: it starts, brakes and stands, turns as tightly
as its speed allows, goes over hills and a rough road, and its body nods and leans on its springs.
The program knows none of that.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from data_samples.drives.drive import ANTENNAS, OFFSETS, RECEIVERS
from rtk_gt.receivers.steps import Steps
from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame

SITE = LocalFrame.from_degrees(45.5061, 9.1662, 177.0)
ETA = 1.75
START = 1.7e9
FINE = 0.05
"""Seconds between the moments at which the drive is known."""


@dataclass(frozen=True)
class Errors:
    """Errors of each receiver: white, and Gauss-Markov with a correlation time; common to all.

    Metres, horizontally; vertically they are ETA times as large.
    """

    white: float = 0.004
    slow: float = 0.0
    memory: float = 60.0
    common: float = 0.0
    common_memory: float = 60.0


@dataclass(frozen=True)
class Made:
    """Steps as recorded, and the truth: poses (t, 6), offsets and antennas (r, 3)."""

    steps: Steps
    poses: Array
    offsets: Array
    antennas: Array

    def jumped(self, who: list[int], rows: Array, size: Array) -> "Made":
        """The same with the fixes of some receivers off by ``size`` (3,) at the rows."""
        positions = self.steps.positions.copy()
        positions[np.ix_(rows, who)] += size
        return replace(self, steps=replace(self.steps, positions=positions))


def made_drive(
    seed: int,
    errors: Errors,
    *,
    seconds: float = 600.0,
    every: tuple[float, ...] = (0.2, 0.2, 0.2),
    fastest: float = 8.0,
    slopes: float = 6.0,
    bases: bool = True,
    delays: tuple[float, ...] = (0.0, 0.0, 0.0),
) -> Made:
    """A drive of some minutes; slopes up to about so many degrees.

    ``every`` receiver writes a fix so many seconds; one whose clock is ahead stamps its fixes late
    by its delay.
    """
    generator = np.random.default_rng(seed)
    poses = _driven(generator, seconds + 2 * max(map(abs, delays)) + 2.0, fastest, slopes)
    R = Rotation.from_euler("ZYX", poses[:, 3:]).as_matrix()
    true = poses[:, None, :3] + np.einsum("tij,rj->tri", R, ANTENNAS)
    offsets = OFFSETS if bases else np.zeros((3, 3))
    stride = round(min(every) / FINE)
    rows = np.arange(0, round(seconds / FINE), stride)
    noise = _noise(generator, errors, rows * FINE)
    positions = np.full((len(rows), 3, 3), np.nan)
    kinds = np.full((len(rows), 3), -1)
    for r in range(3):
        at = np.arange(0, len(rows), round(every[r] / min(every)))
        seen = rows[at] + round((delays[r] + max(map(abs, delays))) / FINE)
        positions[at, r] = true[seen, r] - offsets[r] + noise[at, r]
        kinds[at, r] = 4
    steps = Steps(RECEIVERS, START + rows * FINE, positions, kinds, SITE)
    middle = rows + round(max(map(abs, delays)) / FINE)
    return Made(steps, poses[middle], offsets, ANTENNAS)


def _noise(generator: np.random.Generator, errors: Errors, times: Array) -> Array:
    """(t, 3, 3) errors of three receivers."""
    step = float(times[1] - times[0])
    axes = np.array([1.0, 1.0, ETA])

    def slow(memory: float, columns: int) -> Array:
        keep = np.exp(-step / memory)
        driven = generator.standard_normal((len(times), columns, 3)) * np.sqrt(1 - keep**2)
        driven[0] /= np.sqrt(1 - keep**2)
        return np.asarray(lfilter([1.0], [1.0, -keep], driven, axis=0))

    found = errors.white * generator.standard_normal((len(times), 3, 3))
    found = found + errors.slow * slow(errors.memory, 3)
    return np.asarray((found + errors.common * slow(errors.common_memory, 1)) * axes)


def _driven(generator: np.random.Generator, seconds: float, fastest: float, slopes: float) -> Array:
    """(n, 6) poses of the roof, one every `FINE` seconds."""
    n = round(seconds / FINE) + 1
    t = np.arange(n) * FINE
    speed = np.repeat(generator.uniform(0.3, 1.0, n // 200 + 2) * fastest, 200)[:n]
    for at in generator.uniform(0, seconds, max(round(seconds / 120), 1)):
        speed[(t > at) & (t < at + generator.uniform(8, 25))] = 0.0
    speed = gaussian_filter1d(speed, 1.6 / FINE)  # brakes from 8 m/s with some 2 m/s^2
    wanted = np.repeat(generator.normal(0, 0.06, n // 120 + 2), 120)[:n]
    turns = generator.uniform(0, seconds, max(round(seconds / 20), 1))
    for at in turns:
        here = (t > at) & (t < at + generator.uniform(2, 5))
        wanted[here] = generator.choice([-1, 1]) * generator.uniform(0.08, 0.16)
    curvature = gaussian_filter1d(wanted, 0.4 / FINE)
    curvature = np.clip(
        curvature, -2.0 / np.maximum(speed, 2) ** 2, 2.0 / np.maximum(speed, 2) ** 2
    )
    yaw = generator.uniform(-np.pi, np.pi) + np.cumsum(speed * curvature) * FINE
    place = np.cumsum(speed[:, None] * np.column_stack([np.cos(yaw), np.sin(yaw)]), axis=0) * FINE
    height, gradient = _ground(generator, place, slopes)
    ahead = (gradient * np.column_stack([np.cos(yaw), np.sin(yaw)])).sum(1)
    left = (gradient * np.column_stack([-np.sin(yaw), np.cos(yaw)])).sum(1)
    push = np.gradient(speed, FINE)
    aside = speed**2 * curvature
    soft = gaussian_filter1d(np.radians(0.4) * push, 0.2 / FINE)
    lean = gaussian_filter1d(np.radians(0.6) * aside, 0.2 / FINE)
    shake = gaussian_filter1d(generator.standard_normal((n, 3)), 0.06 / FINE, axis=0)
    shake = (
        shake / shake.std(0) * np.array([0.003, 0.0015, 0.002]) * np.minimum(speed, 5)[:, None] / 5
    )
    pitch = -np.arctan(ahead) - soft + shake[:, 1]
    roll = np.arctan(left) + lean + shake[:, 2]
    return np.column_stack([place, height + shake[:, 0], yaw, pitch, roll])


def _ground(generator: np.random.Generator, place: Array, slopes: float) -> tuple[Array, Array]:
    """Heights (n,) and gradients (n, 2) of the ground: hills and humps."""
    lengths = generator.uniform(40, 250, 8)
    directions = generator.uniform(0, 2 * np.pi, 8)
    waves = 2 * np.pi / lengths[:, None] * np.column_stack([np.cos(directions), np.sin(directions)])
    phases = place @ waves.T + generator.uniform(0, 2 * np.pi, 8)
    steep = np.radians(slopes) / 2 / np.sqrt(2)
    size = steep * lengths / (2 * np.pi)
    return (size * np.sin(phases)).sum(1), (size * np.cos(phases)) @ waves
