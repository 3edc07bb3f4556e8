"""Rooms of which many pairs were not read, and what dense least squares says of them."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.optimize import least_squares

from survey.estimation.evidence import Evidence
from survey.estimation.geometry import rotate
from survey.readings.readings import Readings
from validation.campaign.folder import RobotFrame, Vframe
from validation.poses.angles import Array, wrap

FRAMES = (
    {"O": (0.0, 0.0), "X": (2.5, 0.0), "Y": (0.0, 2.5), "XY": (2.5, 2.5)},
    {
        "O": (0.0, 0.0),
        "X": (2.5, 0.0),
        "Y": (0.0, 2.5),
        "XY": (2.5, 2.5),
        "P": (5.0, 0.0),
        "Q": (5.0, 2.5),
    },
)
RIG = {"O": (0.0, 0.0), "X": (0.6, 0.0), "Y": (0.0, 0.4)}
VFRAME_SIGMA, MARKING_SIGMA, SHAPE_SIGMA, SIDES_SIGMA = 0.002, 0.001, 0.001, 0.001
HALF_TOLERANCE, SETUP_SIGMA, RESOLUTION = 0.00075, 0.002, 0.001
SIGMA = float(np.sqrt(HALF_TOLERANCE**2 + SETUP_SIGMA**2 + RESOLUTION**2 / 12))


@dataclass(frozen=True)
class SparseRoom:
    """A room of which many pairs were not read, with the truth."""

    vframe: Vframe
    rig: RobotFrame
    readings: Readings
    world: dict[str, Array]
    stops: dict[str, Array]
    places: dict[str, Array]
    evidence: Evidence

    @property
    def world_names(self) -> list[str]:
        return list(self.world)


def sparse_room(
    seed: int,
    *,
    stops: int | None = None,
    marks: int | None = None,
    missing: float | None = None,
    rough: str | None = None,
    repeat: int = 1,
) -> SparseRoom:
    """A room, drawn; what is not given is drawn too. ``rough`` is 'none', 'two' or 'all'."""
    rng = np.random.default_rng([20261128, seed])
    frame = FRAMES[rng.integers(2)]
    count = int(rng.integers(12, 17)) if marks is None else marks
    stops = int(rng.integers(6, 27)) if stops is None else stops
    missing = float(rng.uniform(0.35, 0.6)) if missing is None else missing
    rough = str(rng.choice(["none", "two", "all"])) if rough is None else rough
    low = np.array([-rng.uniform(2, 5), -rng.uniform(2, 7)])
    high = np.array([rng.uniform(5.5, 9), rng.uniform(3, 6)])
    world = {str(i + 1): p for i, p in enumerate(_on_walls(count, low, high, rng))}
    size = high - low
    poses = {
        str(j + 1): np.append(
            low + size * (0.12 + 0.76 * rng.random(2)), rng.uniform(-np.pi, np.pi)
        )
        for j in range(stops)
    }
    shape = np.array(list(RIG.values())) + rng.normal(0, SHAPE_SIGMA, (3, 2))
    places = {n: np.array(p) + rng.normal(0, VFRAME_SIGMA, 2) for n, p in frame.items()}
    places |= world
    for name, pose in poses.items():
        for k, point in enumerate(RIG):
            body = shape[k] + rng.normal(0, MARKING_SIGMA, 2)
            places[f"{name}/{point}"] = pose[:2] + rotate(pose[2], body)
    pairs = list(combinations(frame, 2))
    others = [(v, w) for v in frame for w in world]
    others += [(f"{s}/{r}", w) for s in poses for r in RIG for w in world]
    pairs += [pair for pair in others if rng.random() > missing]
    pairs = pairs * repeat
    exact = np.array([np.linalg.norm(places[a] - places[b]) for a, b in pairs])
    noisy = exact + rng.normal(0, np.hypot(HALF_TOLERANCE, SETUP_SIGMA), len(exact))
    readings = Readings(
        tuple(a for a, _ in pairs),
        tuple(b for _, b in pairs),
        np.round(noisy / RESOLUTION) * RESOLUTION,
        np.full(len(pairs), SIGMA),
        line=tuple(range(2, len(pairs) + 2)),
    )
    sides = {
        f"{a}-{b}": float(np.linalg.norm(shape[i] - shape[j]) + rng.normal(0, SIDES_SIGMA))
        for (i, a), (j, b) in combinations(enumerate(RIG), 2)
    }
    rig = RobotFrame(
        points=dict(RIG),
        marking_sigma=MARKING_SIGMA,
        shape_sigma=SHAPE_SIGMA,
        sides=sides,
        sides_sigma=SIDES_SIGMA,
    )
    return SparseRoom(
        Vframe(points=dict(frame), sigma=VFRAME_SIGMA),
        rig,
        readings,
        world,
        poses,
        places,
        _rough(rough, world, poses, rng),
    )


def _on_walls(count: int, low: Array, high: Array, rng: np.random.Generator) -> Array:
    """Places all around a rectangle, a little in front of or behind its walls."""
    width, height = high - low
    at = (np.arange(count) + rng.uniform(0.1, 0.9, count)) / count * 2 * (width + height)
    corners = np.cumsum([0, width, height, width, height])
    side = np.searchsorted(corners, at, side="right") - 1
    along = at - corners[side]
    x = np.choose(side, [low[0] + along, np.full(count, high[0]), high[0] - along, low[0] + 0 * at])
    y = np.choose(side, [low[1] + 0 * at, low[1] + along, np.full(count, high[1]), high[1] - along])
    return np.column_stack([x, y]) + rng.normal(0, 0.1, (count, 2))


def _rough(
    what: str, world: dict[str, Array], poses: dict[str, Array], rng: np.random.Generator
) -> Evidence:
    """Rough coordinates 0.3 to 1 m off, headings up to 0.3 rad."""

    def off(place: Array) -> Array:
        angle = rng.uniform(0, 2 * np.pi)
        return place + rng.uniform(0.3, 1.0) * np.array([np.cos(angle), np.sin(angle)])

    if what == "none":
        return Evidence()
    if what == "two":
        names = rng.choice(list(world), 2, replace=False)
        return Evidence(hand={str(name): off(world[str(name)]) for name in names}, hand_sigma=0.5)
    guesses = {n: np.append(off(p[:2]), p[2] + rng.uniform(-0.3, 0.3)) for n, p in poses.items()}
    return Evidence(hand={n: off(p) for n, p in world.items()}, hand_sigma=0.5, guesses=guesses)


@dataclass(frozen=True)
class Oracle:
    """What dense least squares, started at the truth, says of a room."""

    poses: dict[str, Array]
    sigma: dict[str, Array]
    cost: float
    freedom: int
    places: dict[str, Array]
    place_sigma: dict[str, Array]
    w: Array

    @property
    def determined(self) -> list[str]:
        """Stops whose x and y have standard deviations below 20 mm."""
        return [name for name, s in self.sigma.items() if (s[:2] < 0.02).all()]


def oracle(room: SparseRoom) -> Oracle:
    """Least squares over Vframe points, world points, marks, stops and the rig's shape.

    Derivatives by differences; 100 m of prior on every world point and stop keep what nothing
    determines from spoiling the matrix.
    """
    points = list(room.places)
    where = {name: i for i, name in enumerate(points)}
    first = np.array([where[a] for a in room.readings.start])
    second = np.array([where[b] for b in room.readings.end])
    v, w, s, k = len(room.vframe.points), len(room.world), len(room.stops), len(RIG)
    nominal, body = np.array(list(room.vframe.points.values())), np.array(list(RIG.values()))
    ends = np.array(list(combinations(range(k), 2)))
    lengths = np.array(list(room.rig.sides.values()))
    truth = np.concatenate(
        [np.concatenate([*room.places.values(), *room.stops.values()]), body.ravel()]
    )
    split = np.cumsum([2 * len(points), 3 * s])

    def residuals(x: Array) -> Array:
        p, f, r = np.split(x, split, axis=-1)
        p, f, r = (a.reshape(*x.shape[:-1], -1, n) for a, n in ((p, 2), (f, 3), (r, 2)))
        d = np.linalg.norm(p[..., first, :] - p[..., second, :], axis=-1)
        marks = p[..., v + w :, :].reshape(*x.shape[:-1], s, k, 2)
        expected = f[..., :, None, :2] + rotate(
            f[..., 2][..., None] + np.zeros(k), r[..., None, :, :] + np.zeros((s, 1, 1))
        )
        side = np.linalg.norm(r[..., ends[:, 0], :] - r[..., ends[:, 1], :], axis=-1)
        parts = [
            (d - room.readings.distance) / room.readings.sigma,
            ((p[..., :v, :] - nominal) / VFRAME_SIGMA).reshape(*x.shape[:-1], -1),
            ((marks - expected) / MARKING_SIGMA).reshape(*x.shape[:-1], -1),
            ((r - body) / SHAPE_SIGMA).reshape(*x.shape[:-1], -1),
            (side - lengths) / SIDES_SIGMA,
            (x[..., 2 * v : -2 * k] - truth[2 * v : -2 * k]) / 100.0,
        ]
        return np.concatenate(parts, axis=-1)

    def jacobian(x: Array) -> Array:
        step = 1e-6
        moved = np.eye(len(x)) * step
        out = np.empty((len(residuals(x)), len(x)))
        for rows in np.array_split(np.arange(len(x)), max(len(x) // 40, 1)):
            out[:, rows] = (
                (residuals(x + moved[rows]) - residuals(x - moved[rows])) / (2 * step)
            ).T
        return out

    found = least_squares(residuals, truth, jacobian, method="lm", xtol=1e-12, ftol=1e-12)
    covariance = np.linalg.inv(found.jac.T @ found.jac)
    sigma = np.sqrt(np.diagonal(covariance))[split[0] : split[1]].reshape(s, 3)
    poses = found.x[split[0] : split[1]].reshape(s, 3)
    names = list(room.stops)
    unread = len(found.x) - 2 * v - 2 * k
    near = np.sqrt(np.diagonal(covariance))[: split[0]].reshape(-1, 2)
    rows = found.jac[: len(first)]
    redundancy = 1 - np.einsum("ou,uv,ov->o", rows, covariance, rows)
    return Oracle(
        dict(zip(names, poses, strict=True)),
        dict(zip(names, sigma, strict=True)),
        float(2 * found.cost),
        len(found.fun) - unread - len(found.x),
        dict(zip(points, found.x[: split[0]].reshape(-1, 2), strict=True)),
        dict(zip(points, near, strict=True)),
        -found.fun[: len(first)] / np.sqrt(redundancy),
    )


def pose_error(found: Array, truth: Array) -> Array:
    """Difference of two poses, the heading wrapped."""
    off = np.asarray(found) - truth
    off[..., 2] = wrap(off[..., 2])
    return off
