"""The vehicle's path as smooth curves through all RTK fixes, each at its own time.

The path of `rtk_gt.path.vehicle_path` has a pose only where all receivers have a fix together,
each on its own.
Here cubic B-splines of x, y, z, yaw, pitch and roll go through every fix of every receiver: noise
averages out, and times between the poses need no interpolation. How far apart the knots may be
is chosen by Akaike's criterion; that the noise is known from the antennas' distances makes the
criterion absolute.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from rtk_gt.offsets.estimate import Offsets
from rtk_gt.offsets.noise import GpsNoise
from rtk_gt.path.antennas import Antennas
from rtk_gt.path.interpolation import segments
from rtk_gt.path.orientation import matrix_of, rotation_rates
from rtk_gt.path.vehicle_path import VehiclePath
from rtk_gt.receivers.fixes import RTK_FIXED, Bools, Ints
from rtk_gt.receivers.steps import Steps
from validation.errors import GtvalError
from validation.poses.angles import Array

KNOT_SPACINGS = (2.0, 1.5, 1.0, 0.75, 0.5)
"""Seconds between knots that are tried: a judgement. Receivers at 1 Hz have fewer than one fix each
between knots of 0.5 s."""
ROUGHNESS = np.array([4.0, 4.0, 4.0, 1.5, 1.5, 1.5])
"""Standard deviation of the third derivative, m/s^3 and rad/s^3: a vehicle, driven softly. It
matters only where a single receiver is between two knots."""
FALSE_FIX = 4.5
"""Fixes off by more standard deviations are taken as false: chance does that to one fix of three
numbers in 50,000."""
_SHORTEST = 4
"""Poses in a row that a cubic needs."""
_ROUNDS = 12
"""At most; three with soft weights, then those that false fixes need to settle."""


@dataclass(frozen=True)
class Spline:
    """Six curves over unbroken stretches of time.

    Parameters
    ----------
    starts : (s,) array
        Begin of each stretch, seconds since 1970.
    spacings : (s,) array
        Seconds between its knots.
    counts : (s,) int array
        Number of its intervals; each stretch has three coefficients more.
    coefficients : (n, 6) array
        x, y, z in metres, yaw (unwrapped), pitch, roll in radians.
    """

    starts: Array
    spacings: Array
    counts: Ints
    coefficients: Array

    @property
    def firsts(self) -> Ints:
        """(s,) row of the first coefficient of each stretch."""
        return np.asarray(np.concatenate([[0], np.cumsum(self.counts + 3)[:-1]]))

    def covers(self, times: Array) -> Bools:
        """(m,) True at times within a stretch."""
        return self._stretch(times) >= 0

    def _stretch(self, times: Array) -> Ints:
        row = np.searchsorted(self.starts, times, side="right") - 1
        safe = np.maximum(row, 0)
        end = self.starts[safe] + self.spacings[safe] * self.counts[safe]
        return np.where((row >= 0) & (times <= end + 1e-9), safe, -1)

    def basis(self, times: Array, derivative: int = 0) -> tuple[Ints, Array]:
        """Rows (m, 4) and weights (m, 4) of the coefficients at times within the stretches."""
        stretch = self._stretch(times)
        if (stretch < 0).any():
            raise GtvalError("a time outside of the stretches has no pose")
        u = (times - self.starts[stretch]) / self.spacings[stretch]
        interval = np.clip(np.floor(u).astype(np.int64), 0, self.counts[stretch] - 1)
        u = u - interval
        if derivative == 0:
            rising = -3 * u**3 + 3 * u**2 + 3 * u + 1
            weights = [(1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, rising, u**3]
        else:
            weights = [-3 * (1 - u) ** 2, 9 * u**2 - 12 * u, -9 * u**2 + 6 * u + 3, 3 * u**2]
        scale = 6.0 * (self.spacings[stretch] if derivative else 1.0)
        rows = (self.firsts[stretch] + interval)[:, None] + np.arange(4)
        return rows, np.stack(weights, axis=1) / np.reshape(scale, (-1, 1) if derivative else ())

    def poses(self, times: Array) -> Array:
        """(m, 6) poses at times within the stretches; yaw is not wrapped."""
        rows, weights = self.basis(times)
        return np.asarray(np.einsum("mk,mkc->mc", weights, self.coefficients[rows]))

    def rates(self, times: Array) -> Array:
        """(m, 6) first derivatives by time."""
        rows, weights = self.basis(times, 1)
        return np.asarray(np.einsum("mk,mkc->mc", weights, self.coefficients[rows]))

    def moved(self, change: Array) -> "Spline":
        """The curves with coefficients changed by (n, 6)."""
        return replace(self, coefficients=self.coefficients + change)


@dataclass(frozen=True)
class AntennaFixes:
    """RTK-fixed positions as single measurements.

    ``times`` (m,), ``antenna`` (m,) which receiver, ``positions`` (m, 3) as recorded, metres.
    """

    times: Array
    antenna: Ints
    positions: Array

    def select(self, rows: Bools) -> "AntennaFixes":
        """The chosen fixes."""
        return AntennaFixes(self.times[rows], self.antenna[rows], self.positions[rows])


@dataclass(frozen=True)
class Vehicle:
    """What turns poses into recorded positions.

    ``offsets`` (r, 3) to be added to recorded positions, ``antennas`` (r, 3) on the vehicle,
    ``by_distance`` (3 r, p) their derivative by the distances.
    """

    offsets: Array
    antennas: Array
    by_distance: Array

    @property
    def size(self) -> int:
        """Number of unknown offsets and distances."""
        return 3 * (len(self.offsets) - 1) + int(self.by_distance.shape[1])

    def moved(self, change: Array) -> "Vehicle":
        """With offsets of all but the first receiver, and distances, changed."""
        k = 3 * (len(self.offsets) - 1)
        offsets = self.offsets.copy()
        offsets[1:] += change[:k].reshape(-1, 3)
        antennas = self.antennas + (self.by_distance @ change[k:]).reshape(-1, 3)
        return replace(self, offsets=offsets, antennas=antennas)


@dataclass(frozen=True)
class Trajectory:
    """The smooth path with what it was made of.

    ``akaike`` is the criterion of each knot spacing tried, ``sigma_ratio`` the root mean square
    of the normalised residuals: 1 where the curves can follow the vehicle.
    """

    spline: Spline
    vehicle: Vehicle
    fixes: AntennaFixes
    noise: GpsNoise
    akaike: dict[float, float]
    sigma_ratio: float


def smooth_trajectory(
    steps: Steps,
    path: VehiclePath,
    offsets: Offsets,
    antennas: Antennas,
    noise: GpsNoise,
    max_gap: float,
    spacings: Sequence[float] = KNOT_SPACINGS,
) -> Trajectory:
    """Smooth curves through all fixes within the unbroken stretches of a path.

    Parameters
    ----------
    steps : Steps
        As recorded; receivers need not be fixed together.
    path : VehiclePath
        Its poses, where the curves start from.
    offsets, antennas, noise
        As the path was made with.
    max_gap : float
        Longest pause in seconds that is not a gap.
    spacings : sequence of float
        Knot spacings to be tried, seconds.

    Raises
    ------
    GtvalError
        If no stretch has four poses.
    """
    vehicle = Vehicle(offsets.offsets.within(steps.frame), antennas.positions, antennas.by_distance)
    step, antenna = np.nonzero(steps.kinds == RTK_FIXED)
    fixes = AntennaFixes(steps.times[step], antenna, steps.positions[step, antenna])
    tried: dict[float, tuple[float, Spline, AntennaFixes, float]] = {}
    for spacing in spacings:
        spline = _start(path, max_gap, spacing)
        used = fixes.select(spline.covers(fixes.times))
        spline, good, squares = _fitted(spline, vehicle, used, noise)
        # False fixes count as just tolerable: leaving them out must not look like a good fit.
        cost = float(squares[good].sum()) + FALSE_FIX**2 * int((~good).sum())
        ratio = float(np.sqrt(squares[good].sum() / max(3 * int(good.sum()), 1)))
        tried[spacing] = (cost + 2 * spline.coefficients.size, spline, used.select(good), ratio)
    best = min(tried, key=lambda spacing: tried[spacing][0])
    _, spline, used, ratio = tried[best]
    return Trajectory(
        spline, vehicle, used, noise, {key: value[0] for key, value in tried.items()}, ratio
    )


def _start(path: VehiclePath, max_gap: float, spacing: float) -> Spline:
    """Curves fitted to the poses of the path."""
    stretches = [rows for rows in segments(path.times, max_gap) if len(rows) >= _SHORTEST]
    if not stretches:
        raise GtvalError("no stretch of the path has four poses in a row")
    poses = path.poses.copy()
    poses[:, 3:] = np.unwrap(poses[:, 3:], axis=0)
    starts = np.array([path.times[rows[0]] for rows in stretches])
    spans = np.array([path.times[rows[-1]] for rows in stretches]) - starts
    rows = np.concatenate(stretches)
    return _through(path.times[rows], poses[rows], starts, spans, spacing)


def _through(times: Array, poses: Array, starts: Array, spans: Array, spacing: float) -> Spline:
    """Curves over stretches fitted to poses, with knots about ``spacing`` seconds apart."""
    counts = np.maximum(np.round(spans / spacing).astype(np.int64), 1)
    total = int((counts + 3).sum())
    spline = Spline(starts, spans / counts, counts, np.zeros((total, 6)))
    at, weights = spline.basis(times)
    A = sparse.csr_matrix(
        (weights.ravel(), (np.repeat(np.arange(len(times)), 4), at.ravel())), (len(times), total)
    )
    smooth, third = third_differences(spline)
    D = smooth.multiply(0.05 / third[:, None])
    solve = splu((A.T @ A + D.T @ D).tocsc())
    return replace(spline, coefficients=solve.solve(A.T @ poses))


def with_knots(trajectory: Trajectory, spacing: float) -> Trajectory:
    """The same curves, to a millimetre or so, with knots no more than ``spacing`` seconds apart.

    What chooses the knots sees only fixes; scans of a path also show what is between them.
    """
    old = trajectory.spline
    if (old.spacings <= spacing).all():
        return trajectory
    spans = old.spacings * old.counts
    times = np.concatenate(
        [
            np.linspace(start, start + span, max(round(span / (0.2 * spacing)), 2))
            for start, span in zip(old.starts, spans, strict=True)
        ]
    )
    return replace(trajectory, spline=_through(times, old.poses(times), old.starts, spans, spacing))


def third_differences(spline: Spline) -> tuple["sparse.csr_matrix", Array]:
    """Matrix (k, n) of third differences of the coefficients, and (k,) spacing cubed."""
    rows, cubes = [], []
    for first, count, spacing in zip(spline.firsts, spline.counts, spline.spacings, strict=True):
        rows.append(first + np.arange(count))
        cubes.append(np.full(count, spacing**3))
    begin = np.concatenate(rows)
    k = len(begin)
    columns = begin[:, None] + np.arange(4)
    values = np.tile([-1.0, 3.0, -3.0, 1.0], k)
    place = (np.repeat(np.arange(k), 4), columns.ravel())
    matrix = sparse.csr_matrix((values, place), (k, len(spline.coefficients)))
    return matrix, np.concatenate(cubes)


def roughness_information(spline: Spline) -> "tuple[sparse.csc_matrix, Array]":
    """Information (6 n, 6 n) of `ROUGHNESS` on the coefficients, and its gradient (6 n,)."""
    D, cubes = third_differences(spline)
    scaled = D.multiply(1 / cubes[:, None]).tocsr()
    one = scaled.T @ scaled
    information = sparse.kron(one, np.diag(ROUGHNESS**-2), format="csc")
    return information, np.asarray((one @ spline.coefficients / ROUGHNESS**2).ravel())


def point_rows(poses: Array, own: Array) -> Array:
    """Derivative (m, 3, 6) of points (m, 3) fixed on the vehicle by the pose components."""
    arms = np.einsum("mij,mj->mi", matrix_of(poses[:, 3:]), own)
    J = np.zeros((len(poses), 3, 6))
    J[:, :, :3] = np.eye(3)
    # d(R p) = omega x (R p), with omega = E d(angles).
    axes = np.swapaxes(rotation_rates(poses[:, 3:]), 1, 2)
    J[:, :, 3:] = np.swapaxes(np.cross(axes, arms[:, None, :]), 1, 2)
    return J


def antenna_equations(
    spline: Spline, vehicle: Vehicle, fixes: AntennaFixes
) -> tuple[Array, Array, Array]:
    """Residuals (m, 3), fitted minus recorded, and their derivatives by pose and by vehicle."""
    poses = spline.poses(fixes.times)
    own = vehicle.antennas[fixes.antenna]
    R = matrix_of(poses[:, 3:])
    residual = np.einsum("mij,mj->mi", R, own) + poses[:, :3]
    residual -= fixes.positions + vehicle.offsets[fixes.antenna]
    m, r = len(own), len(vehicle.offsets)
    by_vehicle = np.zeros((m, 3, vehicle.size))
    for row in range(1, r):
        mine = fixes.antenna == row
        by_vehicle[mine, :, 3 * row - 3 : 3 * row] = -np.eye(3)
    places = vehicle.by_distance.reshape(r, 3, -1)
    by_vehicle[:, :, 3 * (r - 1) :] = R @ places[fixes.antenna]
    return residual, point_rows(poses, own), by_vehicle


def pose_columns(
    spline: Spline, times: Array, by_pose: Array, derivative: int = 0
) -> "sparse.csr_matrix":
    """Sparse derivative by the coefficients of rows (m, k, 6) that depend on the pose."""
    at, weights = spline.basis(times, derivative)
    m, k = by_pose.shape[:2]
    values = by_pose[:, :, None, :] * weights[:, None, :, None]
    columns = 6 * at[:, None, :, None] + np.arange(6)
    columns = np.broadcast_to(columns, values.shape)
    pointer = np.arange(m * k + 1) * 24
    shape = (m * k, spline.coefficients.size)
    return sparse.csr_matrix((values.ravel(), columns.ravel(), pointer), shape)


def fix_sigmas(noise: GpsNoise) -> Array:
    """(3,) standard deviations of a fix."""
    return np.sqrt(np.diagonal(noise.covariance))


def _fitted(
    spline: Spline, vehicle: Vehicle, fixes: AntennaFixes, noise: GpsNoise
) -> tuple[Spline, Bools, Array]:
    """The curves through the fixes, which fixes are good, and normalised squares of each."""
    sigmas = fix_sigmas(noise)
    good = np.ones(len(fixes.times), dtype=bool)
    for turn in range(_ROUNDS):
        residual, by_pose, _ = antenna_equations(spline, vehicle, fixes)
        scaled = residual / sigmas
        weight = np.where(good, 1.0, 0.0)
        if turn < 3:  # before false fixes are told apart, nothing large pulls
            weight = 1 / (1 + np.square(scaled).sum(1) / 9)
        J = pose_columns(spline, fixes.times, by_pose / sigmas[:, None])
        H, gradient = roughness_information(spline)
        W = sparse.diags(np.repeat(weight, 3))
        H = H + J.T @ W @ J
        gradient = gradient + J.T @ (W @ scaled.ravel())
        change = splu(H.tocsc()).solve(-gradient)
        spline = spline.moved(change.reshape(-1, 6))
        if turn >= 2:
            residual = antenna_equations(spline, vehicle, fixes)[0]
            good = np.abs(residual / sigmas).max(1) < FALSE_FIX
        if turn > 3 and np.abs(change).max() < 1e-5:
            break
    residual = antenna_equations(spline, vehicle, fixes)[0]
    return spline, good, np.square(residual / sigmas).sum(1)
