"""A synthetic campus: hills, buildings with coloured fronts, lamp posts; and what rays hit."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from validation.poses.angles import Array

GRASS, ROAD, POST = 0, 1, 2
"""What a beam meets; the numbers stand in the colours of a cloud."""
_MARCH = 160
"""Steps along a beam: 0.2 m over a reach of 30 m, far shorter than the hills are long."""
_BISECTIONS = 25
"""They bring a step of 0.2 m below 1e-8 m, far below any scanner's resolution."""


@dataclass(frozen=True)
class Campus:
    """Ground z = h(x, y) with things on it; x east, y north, z up, metres.

    Parameters
    ----------
    waves : (k, 4) array
        Amplitude, wave numbers along x and y, and phase of the hills.
    boxes : (b, 6) array
        Buildings: least and greatest x, y, z.
    posts : (p, 3) array
        x, y and radius of vertical cylinders, 6 m high.
    road : (m, 2) array
        Centre line, whose surroundings are asphalt.
    """

    waves: Array
    boxes: Array
    posts: Array
    road: Array

    def height(self, x: Array, y: Array) -> Array:
        """Height of the ground, metres."""
        phase = self._phase(x, y)
        return np.asarray((self.waves[:, 0] * np.sin(phase)).sum(-1))

    def slope(self, x: Array, y: Array) -> Array:
        """(..., 2) derivative of the height by x and y."""
        part = self.waves[:, 0] * np.cos(self._phase(x, y))
        return np.stack(
            [(part * self.waves[:, 1]).sum(-1), (part * self.waves[:, 2]).sum(-1)], axis=-1
        )

    def _phase(self, x: Array, y: Array) -> Array:
        return np.asarray(
            np.asarray(x)[..., None] * self.waves[:, 1]
            + np.asarray(y)[..., None] * self.waves[:, 2]
            + self.waves[:, 3]
        )

    def cast(self, origins: Array, directions: Array, reach: float = 30.0) -> Array:
        """(n,) distance at which each ray first hits something; inf where nothing is in reach.

        Parameters
        ----------
        origins, directions : (n, 3) array
            Above the ground; directions of unit length.
        reach : float
            Greatest distance, metres.
        """
        found = np.minimum(self._cast_ground(origins, directions, reach),
                           self._cast_boxes(origins, directions))  # fmt: skip
        found = np.minimum(found, self._cast_posts(origins, directions))
        return np.where(found <= reach, found, np.inf)

    def _cast_ground(self, origins: Array, directions: Array, reach: float) -> Array:
        """Marches along the ray, then halves the step in which it goes under."""
        steps = np.linspace(0.0, reach, _MARCH + 1)
        above = np.zeros(len(origins))
        under = np.full(len(origins), np.inf)
        for near, far in pairwise(steps):
            open_rays = np.isinf(under) & (directions[:, 2] < 0.3)
            if not open_rays.any():
                break
            hit = np.flatnonzero(open_rays)[self._depth(origins, directions, far, open_rays) > 0]
            above[hit], under[hit] = near, far
        rays = np.isfinite(under)
        for _ in range(_BISECTIONS):
            middle = (above[rays] + under[rays]) / 2
            below = self._depth(origins, directions, middle, rays) > 0
            under[rays] = np.where(below, middle, under[rays])
            above[rays] = np.where(below, above[rays], middle)
        return under

    def _depth(
        self, origins: Array, directions: Array, at: "Array | float", rays: "Array"
    ) -> Array:
        """How far under the ground the chosen rays are at a distance."""
        places = origins[rays] + np.asarray(at)[..., None] * directions[rays]
        return np.asarray(self.height(places[:, 0], places[:, 1]) - places[:, 2])

    def _cast_boxes(self, origins: Array, directions: Array) -> Array:
        """Nearest wall or roof hit by each ray (slab method)."""
        found = np.full(len(origins), np.inf)
        safe = np.where(np.abs(directions) < 1e-12, 1e-12, directions)
        for box in self.boxes:
            low, high = (box[::2] - origins) / safe, (box[1::2] - origins) / safe
            enter = np.minimum(low, high).max(1)
            leave = np.maximum(low, high).min(1)
            hit = (enter <= leave) & (enter > 0)
            found = np.where(hit, np.minimum(found, enter), found)
        return found

    def _cast_posts(self, origins: Array, directions: Array) -> Array:
        """Nearest post hit by each ray."""
        found = np.full(len(origins), np.inf)
        across = np.square(directions[:, :2]).sum(1)
        for x, y, radius in self.posts:
            away = origins[:, :2] - [x, y]
            half = (away * directions[:, :2]).sum(1)
            root = half**2 - across * (np.square(away).sum(1) - radius**2)
            with np.errstate(divide="ignore", invalid="ignore"):
                at = (-half - np.sqrt(np.where(root > 0, root, np.nan))) / across
            top = self.height(np.array(x), np.array(y)) + 6.0
            hit = (at > 0) & (origins[:, 2] + at * directions[:, 2] < top)
            found = np.where(hit, np.minimum(found, np.nan_to_num(at, nan=np.inf)), found)
        return found

    def colours(self, points: Array) -> Array:
        """(n, 3) colours, 0 to 1, of points on the surfaces: what a camera sees there."""
        found = np.tile([0.30, 0.55, 0.25], (len(points), 1))
        far = np.full(len(points), np.inf)
        for place in self.road:
            far = np.minimum(far, np.square(points[:, :2] - place).sum(1))
        found[far < 3.5**2] = [0.45, 0.45, 0.47]
        ground = self.height(points[:, 0], points[:, 1])
        high = points[:, 2] - ground > 0.02
        # Fronts in bands of brick and plaster, 2 m high: colours that tell a wrong projection.
        band = np.floor(points[:, 2] / 2.0).astype(int) % 2 == 0
        front = np.where(band[:, None], [0.62, 0.25, 0.18], [0.85, 0.80, 0.70])
        for box in self.boxes:
            inside = ((points >= box[::2] - 0.02) & (points <= box[1::2] + 0.02)).all(1) & high
            found[inside] = front[inside]
        for x, y, radius in self.posts:
            near = np.square(points[:, :2] - [x, y]).sum(1) < (radius + 0.03) ** 2
            found[near & high] = [0.10, 0.12, 0.35]
        return found

    def corners(self) -> Array:
        """(n, 3) corners of the buildings that a person can point at in an image."""
        choices = [
            [box[i], box[2 + j], z]
            for box in self.boxes
            for i in (0, 1)
            for j in (0, 1)
            for z in (box[5], box[5] - 2.0)
        ]
        return np.array(choices)


def make_campus(generator: np.random.Generator, steepest: float, road: Array) -> Campus:
    """A campus around a road.

    Parameters
    ----------
    generator : numpy.random.Generator
        Of all random choices.
    steepest : float
        Greatest slope near the road, radians.
    road : (m, 2) array
        Centre line; things stand beside it.
    """
    lengths = generator.uniform(45.0, 80.0, 5)
    directions = generator.uniform(0, 2 * np.pi, 5)
    k = 2 * np.pi / lengths
    waves = np.column_stack(
        [1 / k, k * np.cos(directions), k * np.sin(directions), generator.uniform(0, 2 * np.pi, 5)]
    )
    level = Campus(waves, np.empty((0, 6)), np.empty((0, 3)), road)
    worst = np.linalg.norm(level.slope(road[:, 0], road[:, 1]), axis=1).max()
    waves[:, 0] *= np.tan(steepest) / worst
    ground = Campus(waves, np.empty((0, 6)), np.empty((0, 3)), road)
    return Campus(waves, _buildings(generator, ground), _posts(generator, ground), road)


def _buildings(generator: np.random.Generator, ground: Campus) -> Array:
    """Boxes on both sides of the road, and at its ends; none nearer than 7 m to it."""
    low, high = ground.road.min(0), ground.road.max(0)
    boxes = []
    for side in (-1, 1):
        edge = high[1] + 8.0 if side > 0 else low[1] - 8.0
        x = low[0]
        while x < high[0]:
            width, depth = generator.uniform(9, 16), generator.uniform(5, 9)
            back = edge + side * generator.uniform(0, 4)
            y = sorted([back, back + side * depth])
            z = float(ground.height(np.array(x), np.array(back)))
            boxes.append([x, x + width, *y, z - 8.0, z + generator.uniform(5, 10)])
            x += width + generator.uniform(4, 9)
    for end in (low[0] - 18.0, high[0] + 10.0):
        z = float(ground.height(np.array(end), np.array(0.0)))
        boxes.append([end, end + 8.0, -9.0, 9.0, z - 8.0, z + 8.0])
    for end in (low[0] + 7.0, high[0] - 7.0):
        # A kiosk where the road turns: seen from all sides while the vehicle goes around it.
        z = float(ground.height(np.array(end), np.array(0.0)))
        boxes.append([end - 1.5, end + 1.5, -1.0, 1.0, z - 2.0, z + 3.0])
    return np.array(boxes)


def _posts(generator: np.random.Generator, ground: Campus) -> Array:
    """Lamp posts every 12 m or so, 4 m beside the road."""
    low, high = ground.road.min(0), ground.road.max(0)
    x = np.arange(low[0] + 5, high[0] - 5, 12.0)
    x = x + generator.uniform(-2, 2, len(x))
    y = np.where(np.arange(len(x)) % 2 == 0, high[1] + 4.0, low[1] - 4.0)
    return np.column_stack([x, y, np.full(len(x), 0.12)])
