"""Clocks of receivers that are off by tenths of a second: seen where the speed changes.

A receiver whose stamps are late is, at a stamp, where it was before: the vehicle seems longer or
shorter, the more the faster it drives. At one speed all the way that looks like another vehicle.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from rtk_gt.offsets.estimate import Offsets, estimate_offsets
from rtk_gt.offsets.noise import pair_incidence
from rtk_gt.receivers.fixes import RTK_FIXED
from rtk_gt.receivers.steps import Steps, pair_differences
from validation.errors import GtvalError
from validation.poses.angles import Array

SUSPECT = 0.015
"""Metres of noise above which clocks are tried: twice what makers state of RTK."""
SHIFTS = np.arange(-15, 16) / 10
"""Seconds by which each clock is tried to be off; more is seen as receivers that do not move
together."""
FEW = 400
"""Epochs that suffice for a trial."""
BETTER = 0.5
"""Share of the noise that must be left with another clock: a judgement, chance makes percents."""
SURE, LEAST = 5.0, 0.01
"""Standard deviations, and seconds, that a clock must be off by to be told: at 8 m/s ten
milliseconds are 8 cm."""
SLOWEST = 0.3
"""Metres a second on average below which noise of the positions passes for motion."""
VARIED = 0.15
"""Spread of the speed over its mean that tells clocks: at one speed it is another vehicle."""
DETERMINED = 0.05
"""Metres of sigma of the level offsets: on a straight road clocks and offsets exchange."""
_LONGEST = 1.6
"""Usual intervals over which positions are interpolated at most."""
_ROUNDS = 6


@dataclass(frozen=True)
class Clocks:
    """How many seconds each receiver's stamps are late, by the first one's.

    Parameters
    ----------
    late : (r,) array
        Seconds; 0 for the first.
    sigmas : (r,) array
        Their standard deviations.
    """

    late: Array
    sigmas: Array


def right_clocks(steps: Steps, eta: float) -> tuple[Steps, Clocks | None]:
    """The steps with the receivers at one time, and by how much their clocks were off.

    Parameters
    ----------
    steps : Steps
        As recorded.
    eta : float
        Ratio of the vertical to the horizontal sigma of a position.

    Notes
    -----
    Tenths of a second are tried for each receiver beside the first, of which that with the least
    noise of the distances is taken; Gauss-Newton of all clocks, offsets and distances together
    refines them. None where no clock is surely off.
    """
    if _spread_of_speed(steps) < VARIED:
        return steps, None
    try:
        at_once = _estimate(steps, eta)
        late = np.zeros(len(steps.receivers))
        refined = _refined(steps, late, eta)
        off = np.abs(refined.late) > np.maximum(SURE * refined.sigmas, LEAST)
        if at_once.known and at_once.sigma < SUSPECT and not off.any():
            return steps, None
        if not at_once.known or at_once.sigma > SUSPECT:
            late = np.array([_tried(steps, k, eta) for k in range(len(late))])
        for _ in range(_ROUNDS):
            refined = _refined(steps, late, eta)
            late = refined.late
        shifted = shifted_steps(steps, late)
        after = _estimate(shifted, eta)
    except GtvalError:  # too few epochs, or none that are seen together: no clock can be told
        return steps, None
    off = np.abs(late) > np.maximum(SURE * refined.sigmas, LEAST)
    turned = after.known and after.offset_sigmas[:, :2].max() < DETERMINED
    if not (turned and off.any() and after.sigma < BETTER * at_once.sigma):
        return steps, None
    late = np.where(off, late, 0.0)
    return shifted_steps(steps, late), replace(refined, late=late)


def shifted_steps(steps: Steps, late: Array) -> Steps:
    """The steps with each receiver where it was at the stamp; fixed where its neighbours are.

    Parameters
    ----------
    steps : Steps
        As recorded.
    late : (r,) array
        Seconds by which the stamps of each receiver are late.
    """
    positions, kinds = steps.positions.copy(), steps.kinds.copy()
    for k in np.flatnonzero(late):
        own = np.flatnonzero(steps.kinds[:, k] == RTK_FIXED)
        times = steps.times[own]
        wanted = steps.times[own] + late[k]
        right = np.clip(np.searchsorted(times, wanted), 1, len(times) - 1)
        pause = times[right] - times[right - 1]
        inside = (wanted >= times[0]) & (wanted <= times[-1])
        good = inside & (pause <= _LONGEST * np.median(np.diff(times)))
        # The spline sees each unbroken stretch and what is beside it: pauses bend it no farther.
        positions[own[good], k] = CubicSpline(times, steps.positions[own, k])(wanted[good])
        kinds[own[~good], k] = -1
    return replace(steps, positions=positions, kinds=kinds)


def _spread_of_speed(steps: Steps) -> float:
    """Standard deviation of the first receiver's speed over its mean; 0 where it stands."""
    speed = np.linalg.norm(_speeds(steps)[steps.complete, 0, :2], axis=-1)
    if len(speed) < FEW / 4 or speed.mean() < SLOWEST:
        return 0.0
    return float(speed.std() / speed.mean())


def _few(steps: Steps) -> Steps:
    rows = np.flatnonzero(steps.complete)
    return steps.select(rows[:: max(len(rows) // FEW, 1)])


def _estimate(steps: Steps, eta: float) -> Offsets:
    return estimate_offsets(_few(steps), eta=eta, bent="never")


def _tried(steps: Steps, k: int, eta: float) -> float:
    """The one of `SHIFTS` with which a receiver goes best with the first."""
    if k == 0:
        return 0.0
    pair = replace(
        steps,
        receivers=(steps.receivers[0], steps.receivers[k]),
        positions=steps.positions[:, [0, k]],
        kinds=steps.kinds[:, [0, k]],
    )
    noise = [_estimate(shifted_steps(pair, np.array([0.0, shift])), eta).sigma for shift in SHIFTS]
    return float(SHIFTS[int(np.argmin(noise))])


def _refined(steps: Steps, late: Array, eta: float) -> Clocks:
    """One step of Gauss-Newton of the clocks from how late they are taken to be."""
    shifted = shifted_steps(steps, late)
    speeds = _speeds(shifted)
    rows = np.flatnonzero(shifted.complete)
    rows = rows[:: max(len(rows) // FEW, 1)]
    used = shifted.select(rows)
    offsets = estimate_offsets(used, eta=eta, bent="never")
    good = offsets.weights > 0
    rods = pair_differences(used.positions[good] + offsets.offsets.values)
    along = rods / np.linalg.norm(rods, axis=-1, keepdims=True)
    incidence = pair_incidence(len(late))
    n, p = along.shape[:2]
    by_receiver = incidence[None, :, 1:, None] * along[:, :, None, :]
    by_clock = np.einsum("tpra,tra->tpr", by_receiver, speeds[rows][good][:, 1:])
    design = np.concatenate(
        [by_clock, by_receiver.reshape(n, p, -1), np.broadcast_to(-np.eye(p), (n, p, p))], axis=2
    )
    flat, left = design.reshape(n * p, -1), offsets.residuals[good].reshape(-1)
    information = flat.T @ flat + 1e-9 * np.eye(flat.shape[1])
    solved = np.linalg.solve(information, flat.T @ left)
    rest = left - flat @ solved
    spread = np.linalg.inv(information) * rest.var() * offsets.correlation_time
    r = len(late) - 1
    # A receiver that is too far ahead by its speed times some seconds is at a later time.
    change = np.clip(-solved[:r], -0.2, 0.2)
    return Clocks(
        late + np.concatenate([[0.0], change]),
        np.concatenate([[0.0], np.sqrt(np.diagonal(spread)[:r])]),
    )


def _speeds(steps: Steps) -> Array:
    """(t, r, 3) velocities of the receivers between their neighbouring fixes, m/s; 0 at pauses."""
    found = np.zeros(steps.positions.shape)
    for k in range(len(steps.receivers)):
        own = np.flatnonzero(steps.kinds[:, k] == RTK_FIXED)
        if len(own) < 3:
            continue
        span = steps.times[own[2:]] - steps.times[own[:-2]]
        way = steps.positions[own[2:], k] - steps.positions[own[:-2], k]
        near = span <= 2 * _LONGEST * np.median(span) / 2
        found[own[1:-1], k] = np.where(near[:, None], way / span[:, None], 0.0)
    return found
