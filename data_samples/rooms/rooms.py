"""The synthetic room: walls, obstacles, world points and the stops of a robot.

A room knows nothing of instruments or errors; everything in it is the truth, in the GTV frame.
"""

from dataclasses import dataclass, field

import numpy as np

from data_samples.rooms.sight import outline_segments, sees
from validation.campaign.folder import Vframe
from validation.errors import GtvalError
from validation.poses.angles import Array, wrap

_MARGIN_AROUND_VFRAME = 0.3
"""Metres of floor kept around the Vframe's points: a person stands there with the laser."""
_TRIES = 2000
"""Places tried for pillars: enough that a room of 7 m by 10 m never lacks one that fits."""


@dataclass(frozen=True)
class RoomSettings:
    """How large a room is and what is in it; the rest is drawn.

    Parameters
    ----------
    width, length : float
        Sides of the room in metres.
    skew : float
        Slope of one short wall against the other: metres for each metre along it.
    heaters : int
        Boxes that stand against the walls.
    heater_width, heater_depth : (float, float)
        Least and greatest size of a box, along its wall and into the room.
    pillars : int
        Square columns inside the room, away from the stops and the Vframe points.
    pillar_side : float
        Their side.
    world_points : int
        Marked points on the walls.
    stops : int
        Stops of the robot.
    runs : int
        Times that the path goes along the long side and back.
    clearance : float
        Least distance of a stop from walls and obstacles; a robot frame's own reach is part
        of it.
    heading_sigma : float
        How much the robot's heading strays from the direction of its path, radians.
    turn : float, optional
        Direction of the room's width in the GTV frame, radians; drawn where not given.
    """

    width: float = 7.0
    length: float = 10.0
    skew: float = 0.02 / 3
    heaters: int = 4
    heater_width: tuple[float, float] = (0.4, 1.2)
    heater_depth: tuple[float, float] = (0.15, 0.4)
    pillars: int = 0
    pillar_side: float = 0.3
    world_points: int = 16
    stops: int = 26
    runs: int = 3
    clearance: float = 0.9
    heading_sigma: float = 0.3
    turn: float | None = None


@dataclass(frozen=True)
class Room:
    """All that is true of a room, in the GTV frame.

    Parameters
    ----------
    settings : RoomSettings
        What it was made from.
    vframe : Vframe
        The nominal points on the floor; they define the frame.
    outline : (4, 2) array
        Corners of the walls, in order.
    obstacles : (k, 4, 2) array
        Corners of the boxes and pillars.
    world_names : tuple of str
        '1', '2', ... in the order met along the walls.
    world_points : (n, 2) array
        Their coordinates, on the walls.
    stop_names : tuple of str
        '1', '2', ... along the path.
    stops : (s, 3) array
        Poses of the robot frame.
    path : (p, 2) array
        Corners of the path.
    """

    settings: RoomSettings
    vframe: Vframe
    outline: Array
    obstacles: Array
    world_names: tuple[str, ...]
    world_points: Array
    stop_names: tuple[str, ...]
    stops: Array
    path: Array = field(default_factory=lambda: np.empty((0, 2)))

    @property
    def segments(self) -> Array:
        """(m, 2, 2) walls and sides of obstacles: all that blocks a sight line."""
        return blocking_segments(self.outline, self.obstacles)


def blocking_segments(outline: Array, obstacles: Array) -> Array:
    """(m, 2, 2) sides of the walls (..., 2) and the obstacles (k, 4, 2)."""
    return np.concatenate([outline_segments(outline), outline_segments(obstacles)])


def make_room(
    settings: RoomSettings, rng: np.random.Generator, vframe: Vframe | None = None
) -> Room:
    """A room drawn at random, in the GTV frame.

    Parameters
    ----------
    settings : RoomSettings
        Its sizes and counts.
    rng : numpy.random.Generator
        Source of all that is drawn.
    vframe : Vframe, optional
        The nominal points on the floor; a square of 2.5 m by default.

    Raises
    ------
    GtvalError
        If the room is too small for what should be in it, or too few places on its walls
        can be seen from all Vframe points.

    Notes
    -----
    After AD2.3, "Definition of the validation frame" and "Definition of world-points": a room
    of about 7 m by 10 m whose short walls are not parallel by 2 cm in 3 m; world points all
    around it, kept only if seen from every Vframe point; some 3 runs forward and backward
    along the longest side.
    """
    vframe = vframe or Vframe()
    points = np.array(list(vframe.points.values()))
    placement = _place_vframe(settings, points, rng)
    outline = _outline(settings)
    heaters = _heaters(settings, outline, rng)
    path = _path(settings)
    stops = _stops(settings, path, rng)
    floor = placement.to_room(points)
    pillars = _pillars(settings, np.vstack([stops[:, :2], floor]), rng)
    obstacles = np.concatenate([heaters, pillars])
    world_points = _world_points(settings, outline, obstacles, floor, rng)
    return Room(
        settings=settings,
        vframe=vframe,
        outline=placement.to_gtv(outline),
        obstacles=placement.to_gtv(obstacles),
        world_names=_numbers(settings.world_points),
        world_points=placement.to_gtv(world_points),
        stop_names=_numbers(settings.stops),
        stops=np.column_stack([placement.to_gtv(stops[:, :2]), wrap(stops[:, 2] + placement.turn)]),
        path=placement.to_gtv(path),
    )


@dataclass(frozen=True)
class _Placement:
    """Where the GTV origin lies in the room frame, and how the room is turned in the GTV frame."""

    origin: Array
    turn: float

    @property
    def _rotation(self) -> Array:
        c, s = np.cos(self.turn), np.sin(self.turn)
        return np.array([[c, -s], [s, c]])

    def to_gtv(self, points: Array) -> Array:
        """(..., 2) room coordinates as GTV coordinates."""
        return np.asarray((points - self.origin) @ self._rotation.T)

    def to_room(self, points: Array) -> Array:
        """(..., 2) GTV coordinates as room coordinates."""
        return np.asarray(points @ self._rotation + self.origin)


def _numbers(count: int) -> tuple[str, ...]:
    return tuple(str(number) for number in range(1, count + 1))


def _place_vframe(settings: RoomSettings, points: Array, rng: np.random.Generator) -> _Placement:
    """A place for the Vframe points away from walls and boxes, wherever they turn."""
    turn = rng.uniform(-np.pi, np.pi) if settings.turn is None else settings.turn
    centre = (points.max(0) + points.min(0)) / 2
    reach = np.hypot(*(points - centre).T).max() + _MARGIN_AROUND_VFRAME
    half = np.array([settings.width, settings.length]) / 2
    free = half - settings.heater_depth[1] - settings.skew * settings.width / 2 - reach
    if (free < 0).any():
        raise GtvalError(
            f"a room of {settings.width:g} m by {settings.length:g} m is too small for Vframe "
            f"points that reach {reach - _MARGIN_AROUND_VFRAME:.2f} m around their centre"
        )
    middle = half + rng.uniform(-1, 1, 2) * free
    unplaced = _Placement(np.zeros(2), turn)
    return _Placement(middle - unplaced.to_room(centre), turn)


def _outline(settings: RoomSettings) -> Array:
    """(4, 2) corners in the room frame: x along the width, y along the length."""
    w, length, rise = settings.width, settings.length, settings.skew * settings.width / 2
    return np.array([[0, 0], [w, 0], [w, length + rise], [0, length - rise]], dtype=float)


def _heaters(settings: RoomSettings, outline: Array, rng: np.random.Generator) -> Array:
    """(k, 4, 2) boxes with one side on a wall."""
    k = settings.heaters
    sides = outline_segments(outline)[rng.integers(len(outline), size=k)]
    along = sides[:, 1] - sides[:, 0]
    lengths = np.hypot(*along.T)[:, None]
    along = along / lengths
    inwards = np.column_stack([-along[:, 1], along[:, 0]])
    width = np.minimum(rng.uniform(*settings.heater_width, (k, 1)), lengths)
    depth = rng.uniform(*settings.heater_depth, (k, 1))
    first = sides[:, 0] + rng.uniform(0, 1, (k, 1)) * (lengths - width) * along
    second = first + width * along
    return np.stack([first, second, second + depth * inwards, first + depth * inwards], axis=1)


def _path(settings: RoomSettings) -> Array:
    """(p, 2) corners of lanes along the length, up and down in turn."""
    margin = settings.clearance + settings.heater_depth[1]
    rise = settings.skew * settings.width / 2
    lanes = 2 * settings.runs
    if settings.stops < 1 or settings.runs < 1:
        raise GtvalError("a room needs at least one stop and one run")
    if 2 * margin >= settings.width or 2 * margin + rise >= settings.length:
        raise GtvalError(
            f"a room of {settings.width:g} m by {settings.length:g} m leaves no place for a "
            f"robot that keeps {margin:g} m from its walls"
        )
    x = np.repeat(np.linspace(margin, settings.width - margin, lanes), 2)
    ends = [margin, settings.length - margin - rise]
    y = np.array([ends if lane % 2 == 0 else ends[::-1] for lane in range(lanes)]).ravel()
    return np.column_stack([x, y])


def _stops(settings: RoomSettings, path: Array, rng: np.random.Generator) -> Array:
    """(s, 3) poses evenly along the path, heading along it more or less."""
    legs = np.diff(path, axis=0)
    mileage = np.concatenate([[0.0], np.cumsum(np.hypot(*legs.T))])
    at = (np.arange(settings.stops) + rng.uniform(0.2, 0.8, settings.stops)) * (
        mileage[-1] / settings.stops
    )
    leg = np.clip(np.searchsorted(mileage, at, side="right") - 1, 0, len(legs) - 1)
    heading = np.arctan2(legs[leg, 1], legs[leg, 0])
    heading = heading + settings.heading_sigma * rng.standard_normal(settings.stops)
    place = np.column_stack([np.interp(at, mileage, path[:, axis]) for axis in (0, 1)])
    return np.column_stack([place, heading])


def _pillars(settings: RoomSettings, keep_clear: Array, rng: np.random.Generator) -> Array:
    """(k, 4, 2) columns away from the given points (n, 2) and from the walls."""
    half = settings.pillar_side / 2
    distance = settings.clearance + half * np.sqrt(2)
    border = settings.heater_depth[1] + half
    high = np.array([settings.width, settings.length * (1 - settings.skew)]) - border
    tried = rng.uniform(border, high, (_TRIES, 2)) if settings.pillars else np.empty((0, 2))
    gaps = np.hypot(*(tried[:, None] - keep_clear).transpose(2, 0, 1)).min(1, initial=np.inf)
    centres = tried[gaps >= distance][: settings.pillars]
    if len(centres) < settings.pillars:
        raise GtvalError(
            f"there is no place for {settings.pillars} pillars at {settings.clearance:g} m from "
            "all stops and Vframe points"
        )
    corners = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return np.asarray(centres[:, None] + corners)


def _world_points(
    settings: RoomSettings,
    outline: Array,
    obstacles: Array,
    vframe: Array,
    rng: np.random.Generator,
) -> Array:
    """(n, 2) points spread along the walls, each seen from all Vframe points (m, 2)."""
    n = settings.world_points
    candidates = 12 * n
    sides = outline_segments(outline)
    mileage = np.concatenate([[0.0], np.cumsum(np.hypot(*(sides[:, 1] - sides[:, 0]).T))])
    at = (np.arange(candidates) + rng.uniform(0, 1, candidates)) * mileage[-1] / candidates
    corners = np.vstack([outline, outline[:1]])
    places = np.column_stack([np.interp(at, mileage, corners[:, axis]) for axis in (0, 1)])
    seen = sees(places[:, None], vframe, blocking_segments(outline, obstacles)).all(1)
    places = places[seen]
    if len(places) < n:
        raise GtvalError(
            f"only {len(places)} of {candidates} places on the walls are seen from all Vframe "
            f"points; {n} are needed"
        )
    return np.asarray(places[((np.arange(n) + 0.5) * len(places) / max(n, 1)).astype(int)])
