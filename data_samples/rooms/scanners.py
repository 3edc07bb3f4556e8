"""Laser scanners in the synthetic room: ranges with the faults that real ones have.

The room is a set of flat panels in space: walls, pillars, furniture, glass. A scanner casts its
beams in space too, so a tilted scan plane and a floor that is not flat have the effects that
AD2.3 ("Validation results" of the laser-based GT system) conjectures, and not others: ranges on
upright walls change to second order only, leaning panels and panels that end change them to
first order.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from laser_gt.scans.planar import compose, rotation
from laser_gt.scans.scan import Scan, Sweep, merge, sweep
from validation.poses.angles import Array

Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Panels:
    """Flat panels that beams can meet.

    Parameters
    ----------
    starts, ends : (m, 2) arrays
        Foot of the panel on the floor, in metres, in the GTV frame.
    low, high : (m,) arrays
        Heights between which the panel is there.
    lean : (m,) array
        Angle from the upright in radians, to the left of the direction start to end.
    bias : (m,) array
        What the surface adds to a range (reflectivity), in metres.
    glass : (m,) bool array
        Glass reflects only near normal incidence and lets other beams through.
    """

    starts: Array
    ends: Array
    low: Array
    high: Array
    lean: Array
    bias: Array
    glass: Flags

    def __len__(self) -> int:
        return len(self.starts)

    def __add__(self, other: "Panels") -> "Panels":
        names = ("starts", "ends", "low", "high", "lean", "bias", "glass")
        return Panels(
            *(np.concatenate([getattr(self, name), getattr(other, name)]) for name in names)
        )


def panels(
    starts: npt.ArrayLike,
    ends: npt.ArrayLike,
    *,
    low: float = 0.0,
    high: float = 3.0,
    lean: float = 0.0,
    bias: float = 0.0,
    glass: bool = False,
) -> Panels:
    """Panels of one kind from their feet, (m, 2) each."""
    starts = np.asarray(starts, dtype=float).reshape(-1, 2)
    ends = np.asarray(ends, dtype=float).reshape(-1, 2)
    each = np.ones(len(starts))
    return Panels(
        starts, ends, low * each, high * each, lean * each, bias * each, np.full(len(each), glass)
    )


def polyline(corners: npt.ArrayLike, *, closed: bool = False, **kind: float) -> Panels:
    """Panels along a chain of corners, (k, 2)."""
    points = np.asarray(corners, dtype=float)
    if closed:
        points = np.concatenate([points, points[:1]])
    return panels(points[:-1], points[1:], **kind)  # type: ignore[arg-type]


def box(pose: npt.ArrayLike, length: float, width: float, **kind: float) -> Panels:
    """The four sides of a cupboard, pillar or table leg around a pose (x, y, theta)."""
    x, y, theta = np.asarray(pose, dtype=float)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [length / 2, width / 2]
    return polyline(corners @ rotation(theta).T + [x, y], closed=True, **kind)


@dataclass(frozen=True)
class Floor:
    """A floor that is not flat: a sum of waves.

    Parameters
    ----------
    amplitudes : (k,) array
        Metres.
    wave_vectors : (k, 2) array
        Radians a metre.
    phases : (k,) array
        Radians.
    """

    amplitudes: Array
    wave_vectors: Array
    phases: Array

    def slope(self, point: Array) -> Array:
        """(2,) gradient of the height at a point."""
        angle = self.wave_vectors @ point + self.phases
        return np.asarray(-(self.amplitudes * np.sin(angle)) @ self.wave_vectors)


FLAT = Floor(np.zeros(1), np.zeros((1, 2)), np.zeros(1))
"""A floor without waves."""


def uneven_floor(rng: np.random.Generator, height: float = 0.002) -> Floor:
    """Waves of 1.5 to 6 m length and a few millimetres, as concrete floors have them."""
    lengths = rng.uniform(1.5, 6.0, 6)
    headings = rng.uniform(-np.pi, np.pi, 6)
    vectors = 2 * np.pi / lengths[:, None] * np.column_stack([np.cos(headings), np.sin(headings)])
    return Floor(rng.uniform(0, height, 6), vectors, rng.uniform(-np.pi, np.pi, 6))


@dataclass(frozen=True)
class Scanner:
    """A planar laser scanner and its faults.

    Parameters
    ----------
    beams : int
        Number of beams.
    field_of_view : float
        Radians, symmetric about the sensor's x axis; a full turn leaves out the last beam.
    range_min, range_max : float
        Metres.
    sigma : float
        Standard deviation of a range.
    resolution : float
        Ranges are rounded to multiples of it; 0 for none.
    divergence : float
        Full angle of the beam; where it meets an edge the range is a mixture. 0 for none.
    incidence_bias : float
        Metres added at grazing incidence: this times (1 / cos - 1), cos limited to 0.1.
    drop_rate : float
        Share of beams that get lost.
    glass_angle : float
        Largest angle of incidence in radians at which glass answers.
    tilt : (2,) tuple
        Slope of the scan plane along the sensor's x and y axes (conjecture 2 of AD2.3).
    height : float
        Of the scan plane over the floor, in metres.
    mount : (3,) tuple
        Sensor frame in the robot frame.
    name : str
        Of the scanner.
    """

    beams: int = 361
    field_of_view: float = np.pi
    range_min: float = 0.05
    range_max: float = 30.0
    sigma: float = 0.01
    resolution: float = 0.001
    divergence: float = 0.0
    incidence_bias: float = 0.0
    drop_rate: float = 0.0
    glass_angle: float = 0.15
    tilt: tuple[float, float] = (0.0, 0.0)
    height: float = 0.2
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    name: str = "laser"

    @property
    def angles(self) -> Array:
        """(beams,) angles of the beams in the sensor frame."""
        half = self.field_of_view / 2
        full_turn = self.field_of_view > 2 * np.pi - 1e-9
        return np.linspace(-half, half, self.beams, endpoint=not full_turn)


FULL_TURN = Scanner(722, 2 * np.pi)
HALF_TURN = Scanner(361, np.pi)
SICK_FRONT = Scanner(
    361, np.pi, sigma=0.005, resolution=0.001, mount=(0.1780, 0.1915, np.pi / 2), name="front"
)
SICK_REAR = replace(SICK_FRONT, mount=(0.1780, -0.4085, -np.pi / 2), name="rear")
"""Scanners of half a degree a beam; the last two as on the robot of AD2.3, looking both ways."""


@dataclass(frozen=True)
class Cast:
    """What beams meet: ranges (infinite for nothing), cosines of incidence, panels (-1: none)."""

    ranges: Array
    cosines: Array
    panel: npt.NDArray[np.intp] = field(repr=False)


def cast(room: Panels, origin: Array, directions: Array, glass_angle: float = 0.15) -> Cast:
    """First panel that each beam meets.

    Parameters
    ----------
    room : Panels
        What there is.
    origin : (3,) array
        Of all beams.
    directions : (n, 3) array
        Unit vectors.
    glass_angle : float
        Glass answers up to this angle of incidence and is not there beyond it.

    Notes
    -----
    A leaning panel is the plane through its foot whose normal is (n cos a, -sin a), n being the
    horizontal normal to the left of the foot line; the beam meets it at
    ((foot - origin) . normal) / (direction . normal).
    """
    along = room.ends - room.starts
    length = np.sqrt((along**2).sum(-1))
    along = along / length[:, None]
    left = np.column_stack([-along[:, 1], along[:, 0]])
    normal = np.column_stack([left * np.cos(room.lean)[:, None], -np.sin(room.lean)])
    foot = np.column_stack([room.starts, np.zeros(len(room))])
    facing = directions @ normal.T
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = ((foot - origin) * normal).sum(-1) / facing
        hit = origin + distance[..., None] * directions[:, None, :]
        position = ((hit[..., :2] - room.starts) * along).sum(-1)
        there = (distance > 1e-6) & (position >= 0) & (position <= length)
        there &= (hit[..., 2] >= room.low) & (hit[..., 2] <= room.high)
    there &= ~room.glass | (np.abs(facing) >= np.cos(glass_angle))
    distance = np.where(there, distance, np.inf)
    panel = distance.argmin(-1)
    rows = np.arange(len(directions))
    nearest = distance[rows, panel]
    met = np.isfinite(nearest)
    cosines = np.where(met, np.abs(facing[rows, panel]), 1.0)
    return Cast(nearest, cosines, np.where(met, panel, -1))


def _directions(angles: Array, pose: Array, slope: Array) -> Array:
    """(n, 3) beams of a scan plane with a slope, in the GTV frame.

    The plane is spanned by the sensor's axes lifted by the slope along each of them.
    """
    across = rotation(pose[2]) @ np.stack([np.cos(angles), np.sin(angles)])
    lift = slope @ np.stack([np.cos(angles), np.sin(angles)])
    beams = np.column_stack([across.T, lift])
    return np.asarray(beams / np.sqrt((beams**2).sum(-1, keepdims=True)))


def take_scan(
    room: Panels,
    scanner: Scanner,
    robot: npt.ArrayLike,
    rng: np.random.Generator,
    *,
    floor: Floor = FLAT,
    time: float = float("nan"),
) -> Scan:
    """A scan from a robot pose in the GTV frame.

    Parameters
    ----------
    room : Panels
        What there is.
    scanner : Scanner
        With its mount on the robot.
    robot : (3,) array_like
        Robot pose.
    rng : numpy.random.Generator
        Source of all chance.
    floor : Floor
        Its slope tilts the robot.
    time : float
        Time stamp.
    """
    robot = np.asarray(robot, dtype=float)
    pose = compose(robot, scanner.mount)
    slope = rotation(pose[2]).T @ floor.slope(robot[:2]) + np.asarray(scanner.tilt)
    origin = np.array([pose[0], pose[1], scanner.height])
    angles = scanner.angles
    met = cast(room, origin, _directions(angles, pose, slope), scanner.glass_angle)
    ranges = _biased(met, room, scanner)
    if scanner.divergence > 0:
        ranges = _mixed(ranges, room, scanner, origin, pose, slope, rng)
    ranges = ranges + rng.normal(0.0, scanner.sigma, len(ranges))
    ranges = np.where(rng.random(len(ranges)) < scanner.drop_rate, np.inf, ranges)
    if scanner.resolution > 0:
        ranges = np.round(ranges / scanner.resolution) * scanner.resolution
    seen = (ranges >= scanner.range_min) & (ranges < scanner.range_max)
    return Scan(
        np.where(seen, ranges, np.inf),
        angles,
        scanner.range_min,
        scanner.range_max,
        time=time,
        sensor=scanner.name,
    )


def _biased(met: Cast, room: Panels, scanner: Scanner) -> Array:
    """Ranges with the biases of surface and incidence, infinite where nothing was met."""
    surface = np.append(room.bias, 0.0)[met.panel]
    grazing = 1 / np.maximum(met.cosines, 0.1) - 1
    return np.asarray(met.ranges + surface + scanner.incidence_bias * grazing)


def _mixed(
    ranges: Array,
    room: Panels,
    scanner: Scanner,
    origin: Array,
    pose: Array,
    slope: Array,
    rng: np.random.Generator,
) -> Array:
    """Ranges at edges mixed from what the two sides of the beam meet."""
    half = scanner.divergence / 2
    sides = np.stack(
        [
            _biased(
                cast(
                    room,
                    origin,
                    _directions(scanner.angles + offset, pose, slope),
                    scanner.glass_angle,
                ),
                room,
                scanner,
            )
            for offset in (-half, half)
        ]
    )
    both = np.isfinite(sides[0]) & np.isfinite(sides[1])
    apart = np.where(both, sides[0], 0.0) - np.where(both, sides[1], 0.0)
    edge = np.abs(apart) > 0.1
    share = rng.random(len(ranges))
    mixture = np.where(edge, sides[0], 0.0) * share + np.where(edge, sides[1], 0.0) * (1 - share)
    return np.where(edge, mixture, ranges)


def take_sweep(
    room: Panels,
    scanners: Sequence[Scanner],
    robot: npt.ArrayLike,
    rng: np.random.Generator,
    *,
    floor: Floor = FLAT,
    name: str = "",
) -> Sweep:
    """What all scanners of a robot see: in the sensor frame for one, the robot frame for more."""
    scans = [take_scan(room, scanner, robot, rng, floor=floor) for scanner in scanners]
    if len(scans) == 1:
        return sweep(scans[0], name)
    return merge(scans, [scanner.mount for scanner in scanners], name)


def bare_room(rng: np.random.Generator, length: float = 8.0, width: float = 7.0) -> Panels:
    """Walls of a room with a niche and a step, lower left corner at (0, 0)."""
    niche = rng.uniform(0.25, 0.45) * length
    depth = rng.uniform(0.3, 0.7)
    outline = [
        [0, 0],
        [niche, 0],
        [niche, -depth],
        [niche + 1.2, -depth],
        [niche + 1.2, 0],
        [length, 0],
        [length, width],
        [0.6 * length, width],
        [0.6 * length, width - 0.4],
        [0, width - 0.4],
    ]
    return polyline(np.array(outline), closed=True)


def furniture(
    rng: np.random.Generator, length: float = 8.0, width: float = 7.0, pieces: int = 7
) -> Panels:
    """Boxes along the walls of a `bare_room` of that size."""
    boxes = []
    for _ in range(pieces):
        side = rng.integers(4)
        along, away = rng.uniform(0.1, 0.9), rng.uniform(0.15, 0.6)
        x, y = [
            (along * length, away),
            (along * length, width - 0.4 - away),
            (away, along * width),
            (length - away, along * width),
        ][side]
        size = rng.uniform(0.25, 0.9, 2)
        boxes.append(box((x, y, rng.normal(0, 0.15)), size[0], size[1], high=1.2))
    return sum(boxes[1:], boxes[0])


def furnished_room(
    rng: np.random.Generator, length: float = 8.0, width: float = 7.0, pieces: int = 7
) -> Panels:
    """A room with furniture."""
    return bare_room(rng, length, width) + furniture(rng, length, width, pieces)


def corridor(
    rng: np.random.Generator, length: float = 40.0, width: float = 2.0, doors: int = 0
) -> Panels:
    """A corridor along x through the origin, with door recesses of 10 cm drawn at random."""
    half = length / 2
    places = np.sort(rng.uniform(-half + 2, half - 2, doors))
    walls = []
    for side in (-1.0, 1.0):
        y = side * width / 2
        corners = [[-half, y]]
        for place in places[rng.random(doors) < 0.5]:
            deep = y + 0.1 * side
            corners += [[place, y], [place, deep], [place + 0.9, deep], [place + 0.9, y]]
        walls.append(polyline(np.array([*corners, [half, y]])))
    ends = panels([[-half, -width], [half, -width]], [[-half, width], [half, width]])
    return walls[0] + walls[1] + ends
