"""What is known and unknown when scans, fixes and walls are adjusted, and the scans' equations.

Residuals of points are their distances from slightly bent pieces of walls and ground, whitened.
"""

from dataclasses import dataclass, field

import numpy as np

from rtk_gt.path.orientation import matrix_of, rotation_rates
from rtk_gt.receivers.fixes import Ints
from rtk_gt.sensors.ground import KnownGround
from rtk_gt.sensors.pass_matching import MatchingSettings, weights_of
from rtk_gt.sensors.scans import Cloud
from rtk_gt.sensors.surfaces import Surfaces
from rtk_gt.sensors.trajectory import Spline, Trajectory, Vehicle
from validation.poses.angles import Array
from validation.statistics.robust import sigma_from_median

GRAZING = 0.3
"""Surfaces are rough: the noise across them is at least this share of that along the beam. A
judgement; it bounds what one grazing beam can weigh to 11 times a square one."""
SHAPE = 6
"""Numbers of a piece: height, two slopes, three curvatures."""


@dataclass(frozen=True)
class ScannerSettings:
    """How scans and fixes are adjusted.

    ``apart``: passes are at least so many seconds apart. ``pieces``: edge of the flat pieces and
    how far from their planes points may be, metres, from round to round; the last are used until
    the scanners stay where they are. ``points``: at most so many of a scanner are used. ``block``
    and ``independent``: of the points that one piece shows in so many seconds, so many count, as
    they share what the curves and the plane leave out. ``sharpest``: least standard deviation of
    a point, metres. ``bend``: standard deviation of the curvature of walls and ground, 1/m.
    ``knots``: seconds between the knots of the path at most; scans see wiggles that fixes do not.
    ``matching``: of the first, rough solution.

    Judgements: as those of `MatchingSettings`; pieces are as large as parts of facades and roads
    that are flat; 5 mm is the resolution of a scanner, 0.02 / m a bend by 1 cm in a piece of 2 m;
    in a second a vehicle's path is smooth.
    """

    apart: float = 8.0
    pieces: tuple[tuple[float, float], ...] = ((2.0, 0.6), (2.0, 0.4), (1.5, 0.3), (1.5, 0.2))
    points: int = 200_000
    block: float = 1.0
    independent: int = 4
    sharpest: float = 0.005
    bend: float = 0.02
    knots: float = 1.0
    matching: MatchingSettings = field(
        default_factory=lambda: MatchingSettings(sources=6000, gates=(1.0, 0.7, 0.5, 0.5))
    )


@dataclass(frozen=True)
class Points:
    """Points of all scanners.

    Parameters
    ----------
    own : (n, 3) array
        Each in the frame of its scanner, metres.
    scan : (n,) int array
        The scan that each came from.
    times : (s,) array
        Of the scans, seconds since 1970.
    scanner : (s,) int array
        That made each scan.
    """

    own: Array
    scan: Ints
    times: Array
    scanner: Ints

    @property
    def of(self) -> Ints:
        """(n,) the scanner of each point."""
        return np.asarray(self.scanner[self.scan])

    def select(self, rows: Ints) -> "Points":
        """The chosen points."""
        return Points(self.own[rows], self.scan[rows], self.times, self.scanner)

    def in_vehicle(self, places: Array) -> Array:
        """(n, 3) points in the vehicle frame, for scanners at (k, 6)."""
        found = np.empty_like(self.own)
        of = self.of
        for row, place in enumerate(places):
            mine = of == row
            found[mine] = Cloud(self.own[mine], self.scan[mine]).in_vehicle(place)
        return found


@dataclass(frozen=True)
class State:
    """All unknowns: curves, vehicle, scanners (k, 6), road (5,) and pieces (c, 6)."""

    spline: Spline
    vehicle: Vehicle
    places: Array
    ground: Array
    pieces: Array


@dataclass(frozen=True)
class Given:
    """All that does not change: fixes, points, what is known beforehand.

    ``points`` are those for walls and ground, ``road`` all that may be on the road; ``starts`` and
    ``sigmas`` (k, 6) are the places measured by hand.
    """

    trajectory: Trajectory
    points: Points
    road: Points
    starts: Array
    sigmas: Array
    ground: KnownGround | None
    prior: tuple[Array, Array]
    settings: ScannerSettings


@dataclass(frozen=True)
class World:
    """Points in the local frame (n, 3), where they were seen from (n, 3), in the vehicle (n, 3).

    ``axes`` (s, 3, 3) and ``rates`` (s, 3, 3) are the vehicle's rotation at each scan and
    `rotation_rates` there.
    """

    points: Array
    origins: Array
    own: Array
    axes: Array
    rates: Array


def world_of(data: Given, state: State) -> World:
    """The points where the state puts them."""
    points = data.points
    poses = state.spline.poses(points.times)
    axes = matrix_of(poses[:, 3:])
    own = points.in_vehicle(state.places)
    world = np.einsum("nij,nj->ni", axes[points.scan], own) + poses[points.scan, :3]
    eyes = np.einsum("sij,sj->si", axes, state.places[points.scanner, :3]) + poses[:, :3]
    return World(world, eyes[points.scan], own, axes, rotation_rates(poses[:, 3:]))


def scan_residuals(data: Given, state: State, surfaces: Surfaces) -> Array:
    """(m,) distances of points from their slightly bent pieces, metres."""
    local = surfaces.local(world_of(data, state).points)
    return _heights(local, state.pieces[surfaces.of])


def _bends(local: Array) -> Array:
    """(m, 6) what the numbers of a piece are multiplied by: 1, u, v, u^2 / 2, u v, v^2 / 2."""
    u, v = local[:, 0], local[:, 1]
    return np.column_stack([np.ones(len(u)), u, v, u**2 / 2, u * v, v**2 / 2])


def _heights(local: Array, pieces: Array) -> Array:
    """(m,) heights of points over their slightly bent pieces."""
    return np.asarray(local[:, 2] - (_bends(local) * pieces).sum(1))


@dataclass(frozen=True)
class ScanRows:
    """Whitened distances of points from their pieces, and their derivatives, each (m, 6).

    ``by_pose`` is by the vehicle's pose, ``by_place`` by the translation and the rotation vector
    of the point's own scanner in the vehicle frame, ``by_piece`` by the numbers of its piece.
    """

    residual: Array
    by_pose: Array
    by_place: Array
    by_piece: Array


def scan_rows(data: Given, state: State, surfaces: Surfaces) -> ScanRows:
    """The equations of the points that lie on pieces."""
    world = world_of(data, state)
    local = surfaces.local(world.points)
    pieces = state.pieces[surfaces.of]
    residual = _heights(local, pieces)
    u, v = local[:, 0], local[:, 1]
    by_u = pieces[:, 1] + pieces[:, 3] * u + pieces[:, 4] * v
    by_v = pieces[:, 2] + pieces[:, 4] * u + pieces[:, 5] * v
    lean = np.column_stack([-by_u, -by_v, np.ones(len(u))])
    normals = np.einsum("mji,mj->mi", surfaces.axes[surfaces.of], lean)
    rows = surfaces.points
    scan = data.points.scan[rows]
    own = world.own[rows]
    in_vehicle = np.einsum("mij,mi->mj", world.axes[scan], normals)
    # d(R p) = omega x (R p), with omega = E d(angles); here both in the vehicle frame.
    turn = np.einsum("mij,mj->mi", world.axes[scan], np.cross(own, in_vehicle))
    by_angles = np.einsum("mi,mij->mj", turn, world.rates[scan])
    arms = own - state.places[data.points.scanner[scan], :3]
    # The noise of a range moves a point along its beam: less of it is across a grazed surface.
    facing = np.abs((in_vehicle * arms).sum(1)) / np.linalg.norm(arms, axis=1)
    scale = _whitening(data, surfaces, residual, np.maximum(facing, GRAZING))[:, None]
    return ScanRows(
        residual * scale[:, 0],
        np.hstack([normals, by_angles]) * scale,
        np.hstack([in_vehicle, np.cross(arms, in_vehicle)]) * scale,
        -_bends(local) * scale,
    )


def _whitening(data: Given, surfaces: Surfaces, residual: Array, facing: Array) -> Array:
    """(m,) square roots of the points' weights; noise is in proportion to ``facing``."""
    settings, points = data.settings, data.points
    along = residual / facing
    scan = points.scan[surfaces.points]
    scanner = points.scanner[scan]
    weight = np.empty(len(along))
    for one in np.unique(scanner):
        mine = scanner == one
        sigma = max(float(sigma_from_median(along[mine])), settings.sharpest)
        weight[mine] = weights_of(along[mine]) / sigma**2
    block = np.floor(points.times / settings.block).astype(np.int64)
    block -= block.min()
    key = (surfaces.of * (int(block.max()) + 1) + block[scan]) * len(data.starts) + scanner
    _, inverse, counts = np.unique(key, return_inverse=True, return_counts=True)
    share = np.minimum(settings.independent / counts[inverse], 1.0)
    return np.asarray(np.sqrt(weight * share) / facing)
