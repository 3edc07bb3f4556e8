"""Steps that lead prints to where their grey levels are those of an image."""

from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt
from scipy.special import log_ndtr

from validation.poses.angles import Array
from validation.statistics.robust import SIGMA_OF_MEDIAN
from vision_gt.prints.grey_fits import (
    AMOUNT_INFORMATION,
    BEND_INFORMATION,
    BLUR_INFORMATION,
    LEAST_BLUR,
    MOST_AMOUNT,
    MOST_BEND,
    MOST_BLUR,
    SATURATED,
    START_BLUR,
    Floats,
    inverses,
    tukey_of_filled,
)
from vision_gt.prints.pixels import (
    SQUARE,
    Seen,
    mapped,
    white_rims,
)
from vision_gt.prints.print_look import (
    Places,
    Whiteness,
    boundaries,
    contrast_of_light,
    fill_by_light,
    places_in_print,
    toned,
    whiteness,
)

Ints = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]

_CORNERS_BY_CHANGE = np.array(
    [
        [[x, y, 1, 0, 0, 0, -x * x, -x * y], [0, 0, 0, x, y, 1, -x * y, -y * y]]
        for x, y in SQUARE.tolist()
    ]
)
"""Derivative (4, 2, 8) of the corners in the print by a change D of H (1 + D)."""
BLUR = 8
"""Eight of the homography, the blur, three of the light on black, three of that on white, and for a
large marker how that bends (three more); for an image that was sharpened, how much; and for one
whose grey levels do not go with the light, how their curve bends."""
_MOST_STEPS, _MOST_SHARPENED = 8, 25
"""A judgement: one that has not ended by then has found no print. Amount and blur go together, and
more so where white and black are cut off: there it takes up to twenty."""
_CONVERGED, _DIVERGED = 0.05, 3.0
"""Pixels that a corner moves: as steps shrink fast, the one after would be far smaller; and more
than the start is off, which is a pixel or two."""
_NEAR = 0.06
"""The same for a step from where a fit to some of the pixels came to rest: blur and light are known
by then, and what is not linear in such a step is below a thousandth."""
_NEARLY, _BLURS = 0.15, 0.1
"""The same for a fit to some of the pixels, which are off by half as much: what is left is a few
hundredths of a pixel, and the fit to all of them goes on from there; and by how much the width of
the blur still changes, pixels."""
_ALL_TOGETHER = 4
"""Steps until which those to some of the pixels go on until every print is at rest: what is no
print, or is covered, may never be."""
_BENDS = 0.1
"""Change of the bend of the tone curve that is still to come, as of a tenth of a usual one."""
_SAME_RIM, _MOST_ROUNDS = 0.03, 2
"""Share of the pixels that may still come or go, and how often it is judged at most."""
_LIKE_OTHERS = 3.0
"""Standard deviations below the model from which on a cut-off pixel is as any other."""
_SETTLED = 0.3
"""Pixels that a corner moves when it is good enough to judge what lies beyond the rim."""


@dataclass(frozen=True)
class State:
    """Homographies (m, 3, 3) from prints to undistorted pixels, and how these look.

    Blur (m,) in pixels, light (m, 6 or 9), amounts (m,) of sharpening, its radii (m,) in pixels
    where such is sought, bends (m,) of the tone curve where it is not straight, and shapes
    (m, 2, 2) of the blur where it is not round: what makes its ellipse of a circle.
    """

    H: Array
    blur: Array
    light: Array
    amount: Array
    radius: Array | None
    bend: Array | None = None
    shape: Array | None = None

    @property
    def contrast(self) -> Array:
        """Grey levels (m,) between white and black, in the middle of the print."""
        return np.asarray(self.light[:, 3] - self.light[:, 0])

    def of(self, rows: Ints | Mask) -> "State":
        """Those of some prints."""
        radius = None if self.radius is None else self.radius[rows]
        bend = None if self.bend is None else self.bend[rows]
        shape = None if self.shape is None else self.shape[rows]
        plain = self.H[rows], self.blur[rows], self.light[rows], self.amount[rows]
        return State(*plain, radius, bend, shape)

    @property
    def unknowns(self) -> int:
        """How many a fit has."""
        more = (self.radius is not None) + (self.bend is not None)
        return BLUR + 1 + int(self.light.shape[1]) + more


@dataclass(frozen=True)
class Rest:
    """Where the steps of some prints came to rest, ``rows`` of those that were fitted together.

    Parameters
    ----------
    rows : (m,) array of int
        Which prints.
    state : State
        After the last step.
    lit : (m, 3, n) array
        1 and the places of pixels in the prints.
    told : (m, n) array of bool
        Which pixels tell something.
    jacobian, weighted : (m, u, n) array
        Of the last step, without and with the weights.
    inverse : (m, u, u) array
        Of its normal matrix.
    weights, left : (m, n) array
        Of the grey levels, and what is left of them.
    at, look
        The places of pixels in the prints, and how these look there.
    """

    rows: Ints
    state: State
    lit: Floats
    told: Mask
    jacobian: Floats
    weighted: Floats
    inverse: Array
    weights: Floats
    left: Floats
    at: Places
    look: Whiteness

    def of(self, chosen: Mask) -> "Rest":
        """That of some of the prints."""
        parts = {
            one.name: getattr(self, one.name)[chosen]
            for one in fields(Rest)
            if one.name not in ("state", "at", "look")
        }
        at = Places(*(getattr(self.at, one.name)[chosen] for one in fields(Places)))
        look = Whiteness(*(getattr(self.look, one.name)[chosen] for one in fields(Whiteness)))
        return Rest(state=self.state.of(chosen), at=at, look=look, **parts)


def steps_to_rest(
    seen: Seen, state: State, *, together: bool = False, rims_judged: bool = False
) -> list[Rest]:
    """Where steps from a state come to rest; those that find none are in no rest.

    Parameters
    ----------
    seen : Seen
        The pixels.
    state : State
        Where to begin. One without light is the very first.
    together : bool
        Whether this is a fit to some of the pixels: steps go on until every print is nearly at
        rest, or some more have been made.
    rims_judged : bool
        Whether the state was fitted without what is beyond the rims.
    """
    enough = _NEARLY if together else _NEAR if rims_judged else _CONVERGED
    fresh = not state.light.any()
    rests: list[Rest] = []
    rows = np.arange(len(seen.grey))
    plain = np.asarray(~seen.zone.any(1))
    rounds, settled = np.full(len(rows), int(rims_judged)), np.full(len(rows), not fresh)
    used, single = seen.counts, seen.grey.dtype
    jacobian, weighted = _room(seen, state), _room(seen, state)
    for step in range(1, (_MOST_STEPS if state.radius is None else _MOST_SHARPENED) + 1):
        at, lit = places_in_print(state.H, seen.places, seen.origin, state.shape)
        look, more = _look(state, seen.cells, at)
        by_light = jacobian[:, BLUR + 1 : BLUR + 1 + state.light.shape[1]]
        fill_by_light(lit, look.white, by_light)
        if step == 1 and fresh:
            # Neither the light nor the amount has a start of its own: the first look tells them.
            state = _lit(state, by_light, more.amount, seen)
            if more.amount is not None:
                look, more = _look(state, seen.cells, at)
                fill_by_light(lit, look.white, by_light)
        residual = seen.grey - (state.light[:, None].astype(single) @ by_light)[:, 0]
        _jacobian(look, lit, state.light, more, jacobian)
        judge = settled & ~plain & (rounds < _MOST_ROUNDS)
        if judge.any():
            white = np.where(judge[:, None], white_rims(seen.zone, residual, seen.counts), used)
            changed = (white != used).sum(1) / np.maximum(seen.counts.sum(1), 1)
            judged = np.where(changed < _SAME_RIM, _MOST_ROUNDS, rounds + 1)
            rounds = np.where(judge, judged, rounds)
            used = np.asarray(white)
        told, weights = _weighed(seen.grey, used, residual, state, step + (not fresh))
        np.multiply(jacobian, weights[:, None], out=weighted)
        inverse, change = _solved(jacobian, weighted, residual, state)
        moved = np.abs((corners_of(state.H)[1] @ change[:, None, :BLUR, None])[..., 0]).max((1, 2))
        state = _changed(state, change)
        settled = moved < _SETTLED
        alive = np.asarray(moved < _DIVERGED)
        done = _small(moved, enough, change, state) & (plain | (rounds >= _MOST_ROUNDS))
        if together:
            done &= bool((done | ~alive).all()) or step >= _ALL_TOGETHER
        if done.any():
            # The last step was small: what it changed is linear.
            left = residual - (change[:, None].astype(single) @ jacobian)[:, 0]
            last = Rest(
                rows, state, lit, told, jacobian, weighted, inverse, weights, left, at, look
            )
            rests.append(last if done.all() else last.of(done))
        go = np.asarray(alive & ~done)
        if not go.any():
            break
        if not go.all():
            seen, state, used = seen.of(go), state.of(go), used[go]
            rows, plain, rounds, settled = rows[go], plain[go], rounds[go], settled[go]
        if not go.all() or done.any():
            jacobian, weighted = _room(seen, state), _room(seen, state)
    return rests


def _room(seen: Seen, state: State) -> Floats:
    """(m, u, n) room for derivatives: made once, as fresh memory costs more than filling it."""
    return np.empty((len(seen.grey), state.unknowns, seen.grey.shape[1]), seen.grey.dtype)


def _weighed(
    grey: Floats, used: Mask, residual: Floats, state: State, step: int
) -> tuple[Mask, Floats]:
    """Which pixels tell something, and weights; residuals of cut-off ones are made new."""
    told = used
    bright, dark = grey >= SATURATED, grey <= 255 - SATURATED
    cut = (bright | dark) & used
    if cut.any():
        # Where light is cut off as the model foretells, a pixel is no outlier.
        told = np.asarray(used & ~((bright & (residual < 0)) | (dark & (residual > 0))))
    weights = np.asarray(tukey_of_filled(residual, state.contrast, step) * told)
    # Without sharpening all of the white may be cut off, and bounds lead to its level too slowly.
    if state.radius is not None and cut.any():
        _hold_cut_off(np.where(bright, 1.0, -1.0), cut, used & ~cut, residual, weights)
    return told, weights


def _hold_cut_off(bright: Floats, cut: Mask, free: Mask, residual: Floats, weights: Floats) -> None:
    """Let pixels that are cut off say that the light is at least, or at most, so much.

    With z the standard deviations by which the model is beyond, the likelihood is the normal
    distribution's share below z; one Newton step on its logarithm is a weighted residual. Without
    it, of pixels that would be about as bright as white can be, only those that noise made darker
    would count (Tobin, "Estimation of relationships for limited dependent variables", Econometrica
    26 (1958)).
    """
    for row in np.flatnonzero(cut.any(1) & free.any(1)):
        sign, left = bright[row, cut[row]], residual[row, cut[row]]
        sigma = max(SIGMA_OF_MEDIAN * float(np.median(np.abs(residual[row, free[row]]))), 1.0)
        z = np.clip(-sign * left / sigma, -_LIKE_OTHERS, 8.0)
        ratio = np.exp(-0.5 * z * z - log_ndtr(z)) / np.sqrt(2 * np.pi)
        share = np.maximum(ratio * (ratio + z), 1e-6)
        near = z > -_LIKE_OTHERS
        weights[row, cut[row]] = np.where(near, share, weights[row, cut[row]])
        residual[row, cut[row]] = np.where(near, sign * sigma * ratio / share, left)


def _solved(
    jacobian: Floats, weighted: Floats, residual: Floats, state: State
) -> tuple[Array, Array]:
    """Inverses (m, u, u) of the normal matrices, and steps (m, u); NaN where there are none."""
    normal = (weighted @ np.swapaxes(jacobian, 1, 2)).astype(float)
    right = (weighted @ residual[..., None])[..., 0].astype(float)
    normal[:, BLUR, BLUR] += BLUR_INFORMATION
    right[:, BLUR] += BLUR_INFORMATION * (START_BLUR - state.blur)
    last = BLUR + 1 + state.light.shape[1]
    if state.radius is not None:
        normal[:, last, last] += AMOUNT_INFORMATION
        right[:, last] -= AMOUNT_INFORMATION * state.amount
    if state.bend is not None:
        normal[:, -1, -1] += BEND_INFORMATION
        right[:, -1] -= BEND_INFORMATION * state.bend
    inverse = inverses(normal)
    return inverse, (inverse @ right[..., None])[..., 0]


def _lit(state: State, by_light: Floats, sharper: Floats | None, seen: Seen) -> State:
    """The state with the light, and the amount of sharpening, that explain grey levels best.

    Both are linear: sharpening adds the amount times the contrast times ``sharper`` (m, n).
    """
    rows = by_light
    if sharper is not None:
        rows = np.concatenate([by_light, sharper[:, None]], axis=1)
    counted = rows * seen.counts[:, None]
    normal = (counted @ np.swapaxes(rows, 1, 2)).astype(float)
    if sharper is not None:
        normal[:, -1, -1] += AMOUNT_INFORMATION
    found = inverses(normal) @ (counted @ seen.grey[..., None])
    light = np.asarray(found[:, : by_light.shape[1], 0])
    if sharper is None:
        return replace(state, light=light)
    amount = found[:, -1, 0] / np.maximum(light[:, 3] - light[:, 0], 1.0)
    return replace(state, light=light, amount=np.clip(amount, 0.0, MOST_AMOUNT))


def variances(rest: Rest) -> Array:
    """Of the grey levels that are left (m,), square levels."""
    freedom = np.maximum(rest.weights.sum(1, dtype=float) - rest.inverse.shape[1], 1.0)
    return np.asarray((rest.weights * rest.left**2).sum(1, dtype=float) / freedom)


@dataclass(frozen=True)
class _More:
    """Derivatives (m, n) of the share of white by amounts of sharpening and by bends, if any."""

    amount: Floats | None = None
    bend: Floats | None = None


def _small(moved: Array, enough: float, change: Array, state: State) -> Mask:
    """Whether (m,) steps are small, in corners, in the blur and in the bend of the tone curve."""
    small = np.asarray(moved < enough)
    if enough == _NEARLY:
        small &= np.abs(change[:, BLUR]) < _BLURS
    return small if state.bend is None else small & (np.abs(change[:, -1]) < _BENDS)


def _look(state: State, cells: Floats, at: Places) -> tuple[Whiteness, _More]:
    """The share of white, through the state's tone curve and sharpened by its amounts."""
    if state.radius is None:
        look = whiteness(cells, at, state.blur, boundaries(at, state.blur, cells))
        if state.bend is None:
            return look, _More()
        look, by_bend = toned(look, state.bend)
        return look, _More(None, by_bend)
    wide = np.hypot(state.blur, state.radius)
    reached = boundaries(at, wide, cells)
    sharp = whiteness(cells, at, state.blur, reached)
    soft = whiteness(cells, at, wide, reached)
    a, narrower = (one[:, None].astype(at.x.dtype) for one in (state.amount, state.blur / wide))
    bend = None
    if state.bend is not None:
        sharp, by_sharp = toned(sharp, state.bend)
        soft, by_soft = toned(soft, state.bend)
        bend = (1 + a) * by_sharp - a * by_soft
    mixed = Whiteness(
        (1 + a) * sharp.white - a * soft.white,
        (1 + a) * sharp.by_x - a * soft.by_x,
        (1 + a) * sharp.by_y - a * soft.by_y,
        (1 + a) * sharp.by_blur - a * soft.by_blur * narrower,
    )
    return mixed, _More(sharp.white - soft.white, bend)


def _jacobian(look: Whiteness, lit: Floats, light: Array, more: _More, full: Floats) -> None:
    """Fill in the derivative (m, u, n) of the grey levels by all unknowns but the light."""
    contrast = contrast_of_light(light, lit)
    places = lit[:, 1:]
    across, down = full[:, 2], full[:, 5]
    np.multiply(-contrast, look.by_x, out=across)
    np.multiply(-contrast, look.by_y, out=down)
    np.multiply(across[:, None], places, out=full[:, :2])
    np.multiply(down[:, None], places, out=full[:, 3:5])
    away = full[:, 0] + full[:, 4]
    np.multiply(-away[:, None], places, out=full[:, 6:8])
    np.multiply(contrast, look.by_blur, out=full[:, BLUR])
    row = BLUR + 1 + light.shape[1]
    for by in (more.amount, more.bend):
        if by is not None:
            np.multiply(contrast, by, out=full[:, row])
            row += 1


def _changed(state: State, change: Array) -> State:
    """The state after steps (m, u)."""
    m, last = len(change), BLUR + 1 + state.light.shape[1]
    D = np.concatenate([change[:, :BLUR], np.zeros((m, 1))], axis=1).reshape(m, 3, 3)
    blur = np.clip(state.blur + change[:, BLUR], LEAST_BLUR, MOST_BLUR)
    amount = state.amount
    if state.radius is not None:
        amount = np.clip(amount + change[:, last], 0.0, MOST_AMOUNT)
    bend = state.bend
    if bend is not None:
        bend = np.clip(bend + change[:, -1], -MOST_BEND, MOST_BEND)
    light = state.light + change[:, BLUR + 1 : last]
    H = state.H @ (np.eye(3) + D)
    return replace(state, H=H, blur=blur, light=light, amount=amount, bend=bend)


def corners_of(H: Array) -> tuple[Array, Array]:
    """Corners (m, 4, 2), and their derivatives (m, 4, 2, 8) by a change D of H (1 + D)."""
    corners = mapped(H, SQUARE)
    ahead = SQUARE @ H[:, 2, :2, None] + H[:, 2, 2, None, None]
    slope = (H[:, None, :2, :2] - corners[..., None] * H[:, None, 2:, :2]) / ahead[..., None]
    return corners, np.asarray(slope @ _CORNERS_BY_CHANGE)
