"""Poses between the recorded ones: several methods, chosen by what they do on the data.

Where the record has a gap there is no pose: nothing is interpolated across.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from rtk_gt.path.vehicle_path import VehiclePath
from rtk_gt.receivers.fixes import Bools, Ints
from validation.errors import GtvalError
from validation.pieces.results import kept_result
from validation.poses.angles import Array, wrap
from validation.poses.pose_table import SPATIAL

NAMES = tuple(component.name for component in SPATIAL)
METHODS = ("linear", "local line", "local parabola", "spline", "monotone")
"""Straight lines; a line through the 4, a parabola through the 5 nearest poses, both fitted;
cubic spline; monotone cubic."""
PUBLISHED: Mapping[str, str] = dict.fromkeys(NAMES, "local line") | {"x": "spline", "y": "spline"}
"""Blanco 2009, section 4.4: splines in x and y, least-squares lines through four poses else."""
_NEEDED = 5
"""Poses that the parabola needs; every second of twice as many less one is left out."""


@dataclass(frozen=True)
class HoldOut:
    """How well methods predict poses that were left out.

    Parameters
    ----------
    rms : dict of (component, method) to float
        Root mean square error in metres or radians at twice the spacing of the record, the
        noise of the pose left out included.
    chosen : dict of component to method
        The method with the least error of each component.
    count : int
        Poses predicted.
    """

    rms: dict[tuple[str, str], float]
    chosen: dict[str, str]
    count: int


@dataclass(frozen=True)
class Interpolated:
    """Poses at the times asked for.

    Parameters
    ----------
    times : (m,) array
        Seconds since 1970.
    poses : (m, 6) array
        NaN in gaps and outside of the record.
    covariances : (m, 6, 6) array
        Of the neighbouring poses, plus the interpolation's own error; NaN likewise.
    available : (m,) bool array
        False in gaps.
    methods : dict of component to method
        What was used.
    """

    times: Array
    poses: Array
    covariances: Array
    available: Bools
    methods: Mapping[str, str] = field(default_factory=dict)


def segments(times: Array, max_gap: float) -> list[Ints]:
    """Rows of each unbroken stretch: no two neighbours are more than ``max_gap`` seconds apart."""
    breaks = np.flatnonzero(np.diff(times) > max_gap) + 1
    return [np.asarray(part) for part in np.split(np.arange(len(times)), breaks)]


def evaluate(method: str, times: Array, values: Array, wanted: Array) -> Array:
    """Values (m,) of one component at times within an unbroken stretch.

    Parameters
    ----------
    method : str
        One of `METHODS`.
    times, values : (n,) array
        The stretch, at least two; angles unwrapped. Fewer than four use straight lines.
    wanted : (m,) array
        Times within it.
    """
    if method == "linear" or len(times) < 4:
        return np.asarray(np.interp(wanted, times, values))
    if method == "spline":
        return np.asarray(CubicSpline(times, values)(wanted))
    if method == "monotone":
        return np.asarray(PchipInterpolator(times, values)(wanted))
    if method == "local line":
        return _local_line(times, values, wanted)
    if method == "local parabola":
        return _local_parabola(times, values, wanted)
    raise GtvalError(f"'{method}' is no method of interpolation; there are {', '.join(METHODS)}")


def _local_line(times: Array, values: Array, wanted: Array) -> Array:
    """Least-squares lines through the four poses nearest in time."""
    right = np.clip(np.searchsorted(times, wanted), 2, len(times) - 2)
    rows = right[:, None] + np.arange(-2, 2)
    near, known = times[rows], values[rows]
    # Away from the ends these are two on each side, which are the nearest for even spacing.
    middle = near.mean(1, keepdims=True)
    slope = ((near - middle) * known).sum(1) / np.square(near - middle).sum(1)
    return np.asarray(known.mean(1) + slope * (wanted - middle[:, 0]))


def _local_parabola(times: Array, values: Array, wanted: Array) -> Array:
    """Least-squares parabolas through the five poses around each time.

    It averages noise: right where the vehicle moves smoothly and the angles are noisy.
    """
    count = min(5, len(times))
    first = np.clip(np.searchsorted(times, wanted) - (count + 1) // 2, 0, len(times) - count)
    rows = first[:, None] + np.arange(count)
    near = times[rows] - wanted[:, None]
    scale = np.abs(near).max(1, keepdims=True)
    powers = (near / scale)[..., None] ** np.arange(3)
    weights = np.linalg.pinv(powers)[:, 0]  # the value at the time wanted is the constant term
    return np.asarray((weights * values[rows]).sum(1))


@kept_result()
def hold_out(path: VehiclePath, max_gap: float) -> HoldOut:
    """Errors of all methods at poses left out, every second of each unbroken stretch.

    Parameters
    ----------
    path : VehiclePath
        The path.
    max_gap : float
        Longest pause in seconds that is not a gap.

    Raises
    ------
    GtvalError
        If no stretch has nine poses in a row.
    """
    errors: dict[tuple[str, str], list[Array]] = {}
    values = _unwrapped(path.poses)
    for rows in segments(path.times, max_gap):
        if len(rows) < 2 * _NEEDED - 1:
            continue
        kept, left_out = rows[::2], rows[1 : 2 * ((len(rows) - 1) // 2) : 2]
        for column, name in enumerate(NAMES):
            for method in METHODS:
                predicted = evaluate(
                    method, path.times[kept], values[kept, column], path.times[left_out]
                )
                errors.setdefault((name, method), []).append(predicted - values[left_out, column])
    if not errors:
        raise GtvalError("no stretch of the path has nine poses in a row to test interpolation on")
    rms = {key: float(np.sqrt(np.mean(np.concatenate(e) ** 2))) for key, e in errors.items()}
    chosen = {name: min(METHODS, key=lambda m, n=name: rms[n, m]) for name in NAMES}  # type: ignore[misc]
    return HoldOut(rms, chosen, sum(len(e) for e in errors["x", "linear"]))


def interpolate(
    path: VehiclePath,
    wanted: Array,
    *,
    max_gap: float,
    methods: Mapping[str, str] = PUBLISHED,
    errors: HoldOut | None = None,
) -> Interpolated:
    """Poses at any times within the unbroken stretches of the path.

    Parameters
    ----------
    path : VehiclePath
        The path.
    wanted : (m,) array
        Seconds since 1970.
    max_gap : float
        Longest pause in seconds across which is interpolated.
    methods : mapping of component to method
        `PUBLISHED`, or ``chosen`` of a `HoldOut`.
    errors : HoldOut, optional
        Its errors are added to the covariances; they are those at twice the spacing, so they
        are on the safe side.

    Notes
    -----
    Covariances are interpolated linearly between the neighbours, which is on the safe side for
    their noise part: a mean of two has less.
    """
    wanted = np.asarray(wanted, dtype=float)
    poses = np.full((len(wanted), 6), np.nan)
    covariances = np.full((len(wanted), 6, 6), np.nan)
    values, stated = _unwrapped(path.poses), path.covariances
    for rows in segments(path.times, max_gap):
        times = path.times[rows]
        here = np.flatnonzero((wanted >= times[0]) & (wanted <= times[-1]))
        if len(here) == 0:
            continue
        if len(rows) == 1:
            poses[here], covariances[here] = path.poses[rows[0]], stated[rows[0]]
            continue
        for column, name in enumerate(NAMES):
            poses[here, column] = evaluate(methods[name], times, values[rows, column], wanted[here])
        covariances[here] = _between(times, stated[rows], wanted[here])
    poses[:, 3:] = wrap(poses[:, 3:])
    if errors is not None:
        extra = _own_error(path, errors, methods)
        exact = np.isin(wanted, path.times)
        covariances[~exact] += np.diag(extra)
    return Interpolated(wanted, poses, covariances, np.isfinite(poses).all(1), dict(methods))


def path_at(
    path: VehiclePath,
    times: Array,
    *,
    max_gap: float,
    hold_out: HoldOut | None = None,
    published: bool = False,
) -> Interpolated:
    """Vehicle poses at any times, by the methods that did best on the drive, or as published.

    Parameters as in `interpolate`; without ``hold_out`` the methods are those published.
    """
    methods = PUBLISHED if published or hold_out is None else hold_out.chosen
    return interpolate(path, times, max_gap=max_gap, methods=methods, errors=hold_out)


def _unwrapped(poses: Array) -> Array:
    values = poses.copy()
    values[:, 3:] = np.unwrap(values[:, 3:], axis=0)
    return values


def _between(times: Array, covariances: Array, wanted: Array) -> Array:
    right = np.clip(np.searchsorted(times, wanted), 1, len(times) - 1)
    share = ((wanted - times[right - 1]) / (times[right] - times[right - 1]))[:, None, None]
    return np.asarray((1 - share) * covariances[right - 1] + share * covariances[right])


def _own_error(path: VehiclePath, errors: HoldOut, methods: Mapping[str, str]) -> Array:
    """(6,) variance of the interpolation itself: hold-out error less the noise it contains."""
    noise = np.diagonal(path.noise_covariances, axis1=1, axis2=2).mean(0)
    found = np.array([errors.rms[name, methods[name]] ** 2 for name in NAMES])
    return np.asarray(np.maximum(found - noise, 0.0))
