"""The way of a robot from stop to stop, as its motors make it."""

from dataclasses import dataclass

import numpy as np

from validation.poses.angles import Array, wrap
from validation.trajectories.stops import Stop

STEP = 0.005
"""Seconds between true poses: at 1 m/s a straight line between two is right to a micrometre."""
LAG = 0.3
"""Seconds that speed and turn rate follow what is asked of them late."""
ARRIVED = 0.03
"""Metres from a goal at which the robot brakes."""
ROOM = np.array([8.0, 6.0])
"""Sides of the room, metres."""
MARGIN = 0.7
"""Metres from the walls that no stop is nearer than."""


@dataclass(frozen=True)
class TruePath:
    """Where a robot was.

    Parameters
    ----------
    times : (n,) array
        Seconds from the start, `STEP` apart.
    poses : (n, 3) array
        x, y, theta; the heading goes on and on without jumps.
    stops : tuple of Stop
        Where and when it stood still.
    """

    times: Array
    poses: Array
    stops: tuple[Stop, ...]

    def at(self, times: Array) -> Array:
        """(m, 3) poses at other times, on straight lines."""
        return np.column_stack([np.interp(times, self.times, column) for column in self.poses.T])


def drive(seconds: float, rng: np.random.Generator) -> TruePath:
    """A drive from goal to goal, some backwards, with a stop at each.

    Parameters
    ----------
    seconds : float
        Of the whole.
    rng : numpy.random.Generator
        For goals, speeds and the lengths of stops.
    """
    pose = np.append(MARGIN + rng.random(2) * (ROOM - 2 * MARGIN), rng.uniform(-np.pi, np.pi))
    parts: list[Array] = []
    stops: list[Stop] = []
    count, total = 0, round(seconds / STEP)
    while count < total:
        standing = np.tile(pose, (round(rng.uniform(3.0, 7.0) / STEP), 1))
        if count + len(standing) <= total:
            start, end = count * STEP, (count + len(standing) - 1) * STEP
            stops.append(Stop(str(len(stops) + 1), start, end))
        way = _leg(pose, _goal(pose, rng), rng)
        parts += [standing, way]
        count += len(standing) + len(way)
        pose = way[-1]
    poses = np.vstack(parts)[:total]
    return TruePath(STEP * np.arange(total, dtype=np.float64), poses, tuple(stops))


def through(places: Array, seconds: float, rng: np.random.Generator) -> TruePath:
    """A drive from place to place, in an order drawn at random, with a stop at each.

    Parameters
    ----------
    places : (p, 3) array
        Where the robot may stop; it begins at one of them, in its heading.
    seconds : float
        Of the whole.
    rng : numpy.random.Generator
        For the order, speeds and the lengths of stops.
    """
    at = int(rng.integers(len(places)))
    pose = np.array(places[at], dtype=float)
    parts: list[Array] = []
    stops: list[Stop] = []
    count, total = 0, round(seconds / STEP)
    while count < total:
        standing = np.tile(pose, (round(rng.uniform(1.0, 2.0) / STEP), 1))
        stops.append(Stop(str(len(stops) + 1), count * STEP, (count + len(standing) - 1) * STEP))
        others = np.delete(np.arange(len(places)), at)
        at = int(rng.choice(others))
        way = _leg(pose, places[at, :2], rng)
        parts += [standing, way]
        count += len(standing) + len(way)
        pose = way[-1]
    poses = np.vstack(parts)[:total]
    kept = tuple(stop for stop in stops if stop.end <= (total - 1) * STEP)
    return TruePath(STEP * np.arange(total, dtype=np.float64), poses, kept)


def _goal(pose: Array, rng: np.random.Generator) -> Array:
    """A place in the room that is not near."""
    while True:
        goal = MARGIN + rng.random(2) * (ROOM - 2 * MARGIN)
        if np.linalg.norm(goal - pose[:2]) > 1.2:
            return np.asarray(goal)


def _leg(pose: Array, goal: Array, rng: np.random.Generator) -> Array:
    """(n, 3) poses on the way to a goal: turn towards it, go, brake."""
    x, y, heading = (float(number) for number in pose)
    backwards = rng.random() < 0.2
    fastest, quickest = rng.uniform(0.4, 1.0), rng.uniform(0.6, 1.2)
    speed = turning = 0.0
    way = []
    braking = False
    for _ in range(round(60.0 / STEP)):
        dx, dy = goal[0] - x, goal[1] - y
        distance = float(np.hypot(dx, dy))
        off = float(wrap(np.arctan2(dy, dx) - heading + (np.pi if backwards else 0.0)))
        braking = braking or distance < ARRIVED
        wanted = 0.0 if braking else min(fastest, 1.2 * distance + 0.02) * max(np.cos(off), 0.0)
        turn = 0.0 if braking else float(np.clip(2.0 * off, -quickest, quickest))
        speed += STEP / LAG * ((-wanted if backwards else wanted) - speed)
        turning += STEP / LAG * (turn - turning)
        if braking and abs(speed) < 1e-4 and abs(turning) < 1e-4:
            break
        heading += STEP * turning
        x += STEP * speed * np.cos(heading)
        y += STEP * speed * np.sin(heading)
        way.append((x, y, heading))
    return np.array(way)
