"""Jumps that stay, from what the whole drive says of the offsets before and after.

A base station that restarts changes the offsets of its receivers for good. Turns and slopes show
offsets to millimetres over minutes, and so a change of them that is too small to be seen within a
second. Who it was, and the second, the motion about it tells.
"""

import numpy as np

from rtk_gt.lasting.contrasts import contrasts, sides_of
from rtk_gt.lasting.jumps import ALIKE, GAIN, SMALLEST, USUAL, Jump, fit_of, tempered, turned
from rtk_gt.offsets.estimate import Offsets
from rtk_gt.offsets.noise import pair_incidence
from rtk_gt.offsets.robust import autocorrelation_time
from rtk_gt.receivers.steps import pair_differences
from validation.poses.angles import Array

EDGE = 20
"""Epochs at both ends at which no change is looked for: fewer tell no offsets."""
_FALSE = 10.0
"""Standard deviations to which a residual counts: a false fix is no change."""
SLOW, WANDERING = 3.0, 1.25
"""Epochs that one independent one is worth, above which errors wander by themselves (white noise of
five records came to 1.1 at most, slow errors of 30 and 60 s at 1 Hz to 6 and more), and times the
gain that a jump needs there: of sixty clean records with such errors one came to 48 where the jump
was sharp, too."""
SHARP, SHARP_IN_WHITE = 25.0, 9.0
"""Gain that a jump must have between two epochs, where errors wander and where they do not: of
three normal numbers at a hundred epochs chance makes the first in one of 600 drives."""
_NEAR = 30.0
"""Gain below the greatest within which the jump may be elsewhere: 5 standard deviations."""


def find_restart(times: Array, positions: Array, headings: Array, offsets: Offsets) -> Jump | None:
    """The likeliest jump of one receiver against the others that stays; None if none is sure.

    Parameters
    ----------
    times : (n,) array
        Seconds.
    positions : (n, r, 3) array
        Of the antennas, offsets added, metres.
    headings : (n,) array
        Of something fixed to the vehicle, radians.
    offsets : Offsets
        That were added, with the distances.

    Notes
    -----
    At each epoch least squares of a jump there, with offsets and distances free; the residuals that
    are then left tell noise and correlation, so that errors that are slow by themselves pass for
    no jump. Sums from the end on serve all epochs at once.
    """
    n, r = positions.shape[:2]
    if n < 4 * EDGE:
        return None
    rods = pair_differences(positions)
    lengths = np.linalg.norm(rods, axis=-1, keepdims=True)
    along = rods / lengths
    residuals = lengths[..., 0] - offsets.distances
    spread = 1.4826 * np.median(np.abs(residuals - np.median(residuals, axis=0)), axis=0) + 1e-6
    residuals = np.clip(residuals, -_FALSE * spread, _FALSE * spread)
    incidence = pair_incidence(r)
    p = along.shape[1]
    by_receiver = incidence[None, :, :, None] * along[:, :, None, :]
    own = np.concatenate(
        [by_receiver[:, :, 1:].reshape(n, p, -1), np.broadcast_to(-np.eye(p), (n, p, p))], axis=2
    )
    each = [_gains(own, by_receiver[:, :, k], residuals) for k in range(r)]
    who = max(range(r), key=lambda k: each[k][0].max())
    gains, tau = each[who]
    wander = tau > SLOW
    if gains.max() < (WANDERING if wander else 1.0) * GAIN:
        return None
    found = _placed(times, positions, headings, who, gains)
    sharp = SHARP if wander else SHARP_IN_WHITE
    return found if found is not None and found.gain > sharp else None


def _gains(own: Array, jump: Array, residuals: Array) -> tuple[Array, float]:
    """Gains (n,) of a jump at each epoch, and how many epochs one independent one is worth."""
    n, p = residuals.shape
    weight = np.linalg.inv(np.atleast_2d(np.cov(residuals.T)) + 1e-12 * np.eye(p))
    for _ in range(2):
        left = own.transpose(0, 2, 1) @ weight
        oo = np.tensordot(left, own, ((0, 2), (0, 1)))
        oo = oo + 1e-9 * np.trace(oo) * np.eye(len(oo))
        weighed = jump.transpose(0, 2, 1) @ weight
        os = np.cumsum((left @ jump)[::-1], axis=0)[::-1]
        ss = np.cumsum((weighed @ jump)[::-1], axis=0)[::-1]
        # A jump of the position is one of the opposite sign in what has to be added.
        right = np.cumsum((weighed @ residuals[..., None])[::-1, :, 0], axis=0)[::-1]
        rest = np.linalg.solve(oo, (left @ residuals[..., None]).sum(0)[:, 0])
        solved = np.linalg.solve(oo, os)
        information = ss - np.swapaxes(os, 1, 2) @ solved + np.eye(3) * USUAL**-2
        score = right - np.einsum("nka,k->na", os, rest)
        sizes = np.linalg.solve(information, score[..., None])[..., 0]
        gains = np.einsum("na,na->n", sizes, score)
        gains[:EDGE] = gains[-EDGE:] = 0.0
        at = int(gains.argmax())
        after = (np.arange(n) >= at)[:, None]
        change = rest - solved[at] @ sizes[at]
        fitted = residuals - own @ change - after * (jump @ sizes[at])
        weight = np.linalg.inv(np.atleast_2d(np.cov(fitted.T)) + 1e-12 * np.eye(p))
        tau = autocorrelation_time(fitted)
        weight = weight / tau
    gains = tempered(gains, n * p / tau)
    return np.where(np.linalg.norm(sizes, axis=1) > SMALLEST, gains, 0.0), tau


def _placed(times: Array, positions: Array, headings: Array, who: int, gains: Array) -> Jump | None:
    """The jump at the interval, and of the receivers, that motion and distances about it say."""
    views = [contrasts(times, positions, headings, sides) for sides in sides_of(times)]
    seen = views[0] if views else None
    rows = np.flatnonzero(gains > gains.max() - _NEAR) - 1
    rows = rows[rows >= 0]
    if seen is None or len(rows) == 0:
        return None
    others = tuple(k for k in range(positions.shape[1]) if k != who)
    found = []
    for cause in ((who,), others):
        gain, sizes, spreads = fit_of(seen, cause, rows)
        at = int((gain + gains[rows + 1]).argmax())
        found.append((float(gain[at] + gains[rows[at] + 1]), cause, at, sizes[at], spreads[at]))
    found.sort(key=lambda one: -one[0])
    (total, cause, at, size, spread), (second, rival, *_) = found
    row = int(rows[at])
    east = turned(headings[row : row + 2])
    alike = (rival,) if total - second < ALIKE else ()
    if np.linalg.norm(size) < SMALLEST:
        return None
    sharp = total - float(gains[row + 1])
    return Jump(row, cause, east @ size, east @ spread @ east.T, sharp, alike)
