"""Causes of errors in time, as one chain of transforms with parts switched on or off.

A source's pose S at its stamp t agrees with the reference R, up to noise, where

    drift(t - mid) . frame . scale(S) . mount  =  R(t + delay + clock drift (t - mid))

The frame maps the source's coordinates to the reference's. The mount is a constant transform on
the robot's side: a turn and a lever arm. The delay is what is added to the source's stamps.
"""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from validation.poses.angles import Array

CAUSES: Mapping[str, tuple[str, ...]] = {
    "frame": ("frame_x", "frame_y", "frame_theta"),
    "mount": ("mount_x", "mount_y", "mount_theta"),
    "turn": ("mount_theta",),
    "scale": ("scale",),
    "delay": ("delay",),
    "clock_drift": ("clock_drift",),
    "pose_drift": ("pose_drift_x", "pose_drift_y", "pose_drift_theta"),
}
"""Numbers of each cause; 'turn' is a mount with a wrong heading but no wrong lever arm."""
PARAMETERS = tuple(dict.fromkeys(name for names in CAUSES.values() for name in names))
UNITS: Mapping[str, str] = {
    **{name: "m" if name[-1] in "xy" else "rad" for name in PARAMETERS[:6]},
    "scale": "",
    "delay": "s",
    "clock_drift": "s/s",
    "pose_drift_x": "m/s",
    "pose_drift_y": "m/s",
    "pose_drift_theta": "rad/s",
}
WORDS: Mapping[str, str] = {
    "frame": "a wrong frame",
    "mount": "a wrong mount",
    "turn": "a wrong heading of the mount",
    "scale": "a wrong scale",
    "delay": "a delay",
    "clock_drift": "a clock that drifts",
    "pose_drift": "poses that drift",
}
"""What a cause says, for a sentence; as for stops where it is the same."""

FRAME = slice(0, 3)
MOUNT = slice(3, 6)
SCALE, DELAY, CLOCK = 6, 7, 8
DRIFT = slice(9, 12)


class Moving(NamedTuple):
    """Poses with their velocities, in the reference's frame.

    ``places`` (n,) complex x + iy in metres, ``headings`` (n,) in radians, ``velocities`` (n,)
    complex in m/s, ``turn_rates`` (n,) in rad/s.
    """

    places: "np.typing.NDArray[np.complex128]"
    headings: Array
    velocities: "np.typing.NDArray[np.complex128]"
    turn_rates: Array


def columns(causes: Iterable[str]) -> tuple[int, ...]:
    """Where the parameters of these causes stand in `PARAMETERS`."""
    wanted = {name for cause in causes for name in CAUSES[cause]}
    return tuple(place for place, name in enumerate(PARAMETERS) if name in wanted)


def corrected(parameters: Array, poses: Array, since: Array) -> Array:
    """(n, 3) source poses in the reference's frame, without the causes; headings not wrapped.

    Parameters
    ----------
    parameters : (12,) array
        In the order of `PARAMETERS`; scale and clock drift as excess over 1.
    poses : (n, 3) array
        Of the source: metres, radians.
    since : (n,) array
        Seconds since the middle of the source's stamps.
    """
    p = parameters
    place = (1 + p[SCALE]) * (poses[:, 0] + 1j * poses[:, 1])
    place = place + np.exp(1j * poses[:, 2]) * (p[3] + 1j * p[4])
    place = np.exp(1j * p[2]) * place + (p[0] + 1j * p[1]) + (p[9] + 1j * p[10]) * since
    heading = poses[:, 2] + p[5] + p[2] + p[11] * since
    return np.column_stack([place.real, place.imag, heading])


def reference_times(parameters: Array, stamps: Array, since: Array) -> Array:
    """(n,) stamps of the source on the reference's clock, in seconds."""
    return np.asarray(stamps + parameters[DELAY] + parameters[CLOCK] * since)


def slopes(parameters: Array, moving: Moving, since: Array) -> Array:
    """(n, 3, 12) derivative of reference minus corrected source by the parameters.

    Parameters
    ----------
    parameters : (12,) array
        Where the derivative is taken.
    moving : Moving
        The robot as the reference sees it, or as the corrected source does: the noise of the one
        is independent of that of the other, so that the product of the two derivatives holds
        motion alone.
    since : (n,) array
        Seconds since the middle.
    """
    p = parameters
    n = len(since)
    place = moving.places - (p[9] + 1j * p[10]) * since - (p[0] + 1j * p[1])
    ahead = np.exp(1j * (moving.headings - p[11] * since - p[5]))
    z = np.zeros((n, 12), dtype=complex)
    z[:, 0], z[:, 1], z[:, 2] = -1.0, -1j, -1j * place
    z[:, 3], z[:, 4] = -ahead, -1j * ahead
    z[:, SCALE] = -(place - ahead * (p[3] + 1j * p[4])) / (1 + p[SCALE])
    z[:, DELAY], z[:, CLOCK] = moving.velocities, moving.velocities * since
    z[:, 9], z[:, 10] = -since, -1j * since
    heading = np.zeros((n, 12))
    heading[:, 2] = heading[:, 5] = -1.0
    heading[:, DELAY], heading[:, CLOCK] = moving.turn_rates, moving.turn_rates * since
    heading[:, 11] = -since
    return np.stack([z.real, z.imag, heading], axis=1)
