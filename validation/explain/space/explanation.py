"""Which parts of the chain explain the errors of poses in space, or of positions."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt
from scipy import special

from validation.errors import GtvalError
from validation.explain.space.chain import (
    PARAMETERS,
    PARTS,
    WORDS,
    SpacePairs,
    State,
    begin,
    look,
    space_pairs,
    unit_of,
)
from validation.poses.angles import Array
from validation.poses.pose_table import PoseTable
from validation.shown import Shown
from validation.statistics.hypotheses import LOST, RIVAL, Parameter
from validation.statistics.neighbours import is_said, weigh
from validation.statistics.robust import sigma_from_median

FALSE_ALARM = 0.02
"""Chance that any cause is claimed in a clean table, as for planar poses."""
FEWEST_LEFT = 4
"""Degrees of freedom below which nothing is fitted: the noise is then known to a factor of two."""
FLAG = 4.5
"""Standard deviations from which on a cell is left out: one good one of 100,000."""
SMALLEST = np.array([1e-6, 1e-7])
"""Metres and radians: noise is never taken as less, so that rounding is no cause."""
MOST_SCALE = 0.25
"""No instrument's scale is wrong by more."""
ITERATIONS = 30
MANY = 2000
"""Stops beyond which a fit begins at that of all parts alone."""
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, repr=False)
class SpaceExplanation(Shown):
    """What explains the errors of one system in space, or of its positions.

    Parameters
    ----------
    pairs : SpacePairs
        What was looked at.
    parts : tuple of str
        Those that are there; empty if none is shown.
    rivals : tuple of tuple of str
        Other sets of parts that explain the errors as well.
    parameters : tuple of Parameter
        Of the parts.
    not_told : tuple of str
        Parameters that these stops do not determine; they are held at zero.
    unasked : tuple of str
        Parts that these tables cannot speak of, as they lack times or orientations.
    cells : (n, 2) array of bool
        Positions and orientations that fit.
    before, after : (2,) array
        Root mean square of the errors that fit: length of the position, and of the turn; NaN
        without orientations.
    effective : (2,) array
        Independent stops that tell as much: fewer where neighbours depend on each other.
    misfit : float
        Root mean square of what is left of the positions over the stated uncertainty; NaN where
        it is not stated.
    credible : bool
        Whether what is left is as small as stated; True where nothing is stated.
    confidence : float
        Of the intervals of the parameters.
    """

    pairs: SpacePairs
    parts: tuple[str, ...]
    rivals: tuple[tuple[str, ...], ...]
    parameters: tuple[Parameter, ...]
    not_told: tuple[str, ...]
    unasked: tuple[str, ...]
    cells: Mask
    before: Array
    after: Array
    effective: Array
    misfit: float
    credible: bool
    confidence: float

    @property
    def system(self) -> str:
        """Its name."""
        return self.pairs.system

    @property
    def name(self) -> str:
        """'frame_mount', or 'none'."""
        return "_".join(self.parts) or "none"

    @property
    def words(self) -> str:
        """'a wrong frame and a wrong mount', or 'no systematic error'."""
        return words_of(self.parts)


def words_of(parts: tuple[str, ...]) -> str:
    """Parts in words; a mount without orientation is a lever arm."""
    return " and ".join(WORDS[one] for one in parts) or "no systematic error"


@dataclass(frozen=True)
class _Fit:
    """A chain fitted with fixed weights: its free columns, and squares in units of the noise."""

    state: State
    columns: tuple[int, ...]
    squares: float
    residuals: Array
    slopes: Array
    covariance: Array


def explain_in_space(
    validation: PoseTable,
    gt: PoseTable,
    times: Mapping[str, float] | None = None,
    confidence: float = 0.95,
    false_alarm: float = FALSE_ALARM,
) -> SpaceExplanation:
    """What explains the errors of poses in space, or of positions with or without orientation.

    Parameters
    ----------
    validation, gt : PoseTable
        Both with positions in the plane or in space.
    times : mapping of str to float, optional
        Seconds of the stops of a moving robot.
    confidence : float
        Of the intervals.
    false_alarm : float
        Chance that any part is claimed in a clean table.

    Raises
    ------
    GtvalError
        With too few stops in common.

    Notes
    -----
    All parts are fitted, without cells that are far off; then every set of parts, with the noise
    that the first fit leaves. A set costs what its parts would gain by chance, by an F test each
    with the false alarms shared among the parts; the least sum is chosen. Where neighbours depend
    on each other, squares count by the effective number of stops.
    """
    pairs = space_pairs(validation, gt, times)
    everything = pairs.parameters(pairs.parts)
    rows = _rows(pairs)
    if len(pairs) * sum(rows) - len(everything) < FEWEST_LEFT:
        raise GtvalError(f"'{gt.system}' has too few stops in common with the validation")
    full, cells, sigmas = _robust(pairs, everything)
    kept, lost = _told(pairs, full, cells, sigmas, everything)
    full = _fit(pairs, kept, cells, sigmas, full.state)
    effective = _effective(pairs, full, cells)
    used = cells.sum(0)
    shrink = np.where(used > 0, np.minimum(effective / np.maximum(used, 1), 1.0), 1.0)
    freedom = max(float(effective[: len(rows)] @ np.array(rows)) - len(kept), 3.0)
    sigmas = sigmas / np.sqrt(shrink)
    level = false_alarm / len(pairs.parts)
    # Of thousands of stops one start is enough, and takes half the time.
    starts = (full.state,) if len(pairs) > MANY else (None, full.state)
    tried: list[tuple[float, tuple[str, ...], _Fit]] = []
    for count in range(len(pairs.parts) + 1):
        for parts in combinations(pairs.parts, count):
            columns, _ = _told(pairs, full, cells, sigmas, pairs.parameters(parts))
            sizes = [sum(PARAMETERS[c] in PARTS[part] for c in columns) for part in parts]
            if not all(sizes):
                continue
            found = min(
                (_fit(pairs, columns, cells, sigmas, start) for start in starts),
                key=lambda one: one.squares,
            )
            price = sum(k * special.fdtri(k, freedom, 1 - level) for k in sizes)
            tried.append((found.squares + float(price), parts, found))
    tried.sort(key=lambda one: one[0])
    cost, parts, best = tried[0]
    rivals = tuple(
        other
        for value, other, _ in tried[1:]
        if value < cost + RIVAL and not set(parts) <= set(other) and not set(other) <= set(parts)
    )
    misfit, credible = _credible(validation, gt, pairs, best.residuals, cells)
    at_none, _ = look(pairs, State.none())
    return SpaceExplanation(
        pairs=pairs,
        parts=parts,
        rivals=rivals,
        parameters=_parameters(best, freedom, confidence),
        not_told=tuple(PARAMETERS[c] for c in lost),
        unasked=tuple(part for part in PARTS if part not in pairs.parts),
        cells=cells,
        before=_sizes(pairs, at_none, cells),
        after=_sizes(pairs, best.residuals, cells),
        effective=effective,
        misfit=misfit,
        credible=credible,
        confidence=confidence,
    )


def _rows(pairs: SpacePairs) -> tuple[int, ...]:
    """Numbers of a position, and of an orientation where both are known."""
    turns = 3 if pairs.width == 3 else 1
    return (pairs.width, turns) if pairs.oriented else (pairs.width,)


def _robust(pairs: SpacePairs, columns: tuple[int, ...]) -> tuple[_Fit, Mask, Array]:
    """All parts, the cells that fit, and the noise of positions and orientations."""
    cells = np.ones((len(pairs), 2), dtype=bool)
    cells[:, 1] = pairs.oriented
    state, sigmas = begin(pairs), np.ones(2)
    soft: Array = np.ones((len(pairs), 2))
    for _ in range(4):
        found = _fit(pairs, columns, cells, sigmas, state, soft)
        state = found.state
        sizes = _lengths(found.residuals)
        for kind in range(1 + pairs.oriented):
            # Least absolute deviations first, so that no gross error decides which are gross.
            soft[:, kind] = 1 / np.maximum(sizes[:, kind], 0.1 * np.median(sizes[:, kind]) + 1e-9)
            soft[:, kind] /= soft[:, kind].max()
    for _ in range(3):
        for kind, number in enumerate(_rows(pairs)):
            block = found.residuals[:, 3 * kind : 3 * kind + 3]
            used = block[:, -1:] if kind and number == 1 else block[:, :number]
            sigma = max(float(sigma_from_median(used)), SMALLEST[kind])
            cells[:, kind] = (np.abs(used) < FLAG * sigma).all(1)
            left = max(cells[:, kind].sum() * number - len(columns) / len(_rows(pairs)), 1)
            square = float(np.square(used[cells[:, kind]]).sum())
            sigmas[kind] = max(np.sqrt(square / left), SMALLEST[kind])
        found = _fit(pairs, columns, cells, sigmas, state)
        state = found.state
    return found, cells, sigmas


def _lengths(residuals: Array) -> Array:
    """(n, 2) of positions and of turns."""
    return np.stack([np.linalg.norm(residuals[:, s], axis=1) for s in (slice(3), slice(3, 6))], 1)


def _fit(
    pairs: SpacePairs,
    columns: tuple[int, ...],
    cells: Mask,
    sigmas: Array,
    start: State | None = None,
    soft: Array | None = None,
) -> _Fit:
    """Gauss-Newton steps of some parameters, the others at zero."""
    state = State.none()
    if start is not None:
        inside = np.zeros(len(PARAMETERS))
        inside[list(columns)] = start.values[list(columns)]
        state = State.none().moved(inside)
    weight = np.asarray(cells / np.square(sigmas) * (1.0 if soft is None else soft), dtype=float)
    weights = np.repeat(weight, 3, axis=1)
    free = list(columns)
    covariance: Array = np.zeros((len(free), len(free)))
    for _ in range(ITERATIONS if free else 0):
        residuals, slopes = look(pairs, state)
        own = slopes[:, :, free]
        information = np.einsum("nrk,nr,nrl->kl", own, weights, own)
        pull = np.einsum("nrk,nr,nr->k", own, weights, residuals)
        covariance = np.asarray(np.linalg.pinv(_scaled(information), rcond=1e-12, hermitian=True))
        size = np.sqrt(np.maximum(np.diagonal(information), 1e-300))
        covariance = covariance / np.outer(size, size)
        step = np.zeros(len(PARAMETERS))
        step[free] = covariance @ pull
        step[6] = np.clip(state.scale + step[6], -MOST_SCALE, MOST_SCALE) - state.scale
        state = state.moved(step)
        if float(np.abs(step[free] * size).max()) < 1e-4:
            break
    residuals, slopes = look(pairs, state)
    squares = float((weights * residuals**2).sum())
    return _Fit(state, columns, squares, residuals, slopes, covariance)


def _scaled(information: Array) -> Array:
    size = np.sqrt(np.maximum(np.diagonal(information), 1e-300))
    return np.asarray(information / np.outer(size, size))


def _told(
    pairs: SpacePairs, full: _Fit, cells: Mask, sigmas: Array, asked: tuple[int, ...]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Of the columns asked for, those that the stops determine beside those before, and the others.

    A column counts if it is known at least as well as a `LOST`-th of what a single pose would
    tell, once all before it are known; the frame comes first, so that what frame and mount share
    (their heights, on a level floor) is the frame's.
    """
    weights = np.repeat(cells / np.square(sigmas), 3, axis=1).ravel()
    extent = max(float(np.linalg.norm(pairs.given.std(0))), 1e-3)
    unit = {"m": sigmas[0], "": sigmas[0] / extent, "rad": sigmas[0] / extent, "s": None}
    basis: list[Array] = []
    kept, lost = [], []
    for column in asked:
        name = PARAMETERS[column]
        vector = full.slopes[:, :, column].ravel() * np.sqrt(weights)
        whole = float(np.linalg.norm(vector))
        for other in basis:
            vector = vector - (other @ vector) * other
        left = float(np.linalg.norm(vector))
        size = unit[unit_of(name)]
        if pairs.oriented and name.startswith("mount_r"):
            size = sigmas[1]
        # Of a time: the share that nothing before it takes away, as its size has no measure.
        enough = left > 0.2 * whole if size is None else left * size > 1 / LOST
        if enough and left > 1e-6 * whole:
            basis.append(vector / left)
            kept.append(column)
        else:
            lost.append(column)
    return tuple(kept), tuple(lost)


def _effective(pairs: SpacePairs, found: _Fit, cells: Mask) -> Array:
    """(2,) stops that tell as much, by the memory of what the full fit leaves."""
    told: Array = cells.sum(0).astype(float)
    for kind, number in enumerate(_rows(pairs)):
        used = np.flatnonzero(cells[:, kind])
        rows = [5] if kind and number == 1 else list(range(3 * kind, 3 * kind + number))
        residuals = found.residuals[used][:, rows]
        if len(used) < 8 or (np.ptp(residuals, axis=0) < 1e-12).any():
            continue
        slopes = found.slopes[used][:, rows][:, :, list(found.columns)]
        memory = weigh(used.astype(float), residuals, slopes)
        if is_said(memory.gain, len(used)):
            told[kind] = min(memory.effective(), told[kind])
    return np.asarray(told)


def _parameters(found: _Fit, freedom: float, confidence: float) -> tuple[Parameter, ...]:
    """Values with Student intervals."""
    reach = float(special.stdtrit(freedom, (1 + confidence) / 2))
    told = []
    for place, column in enumerate(found.columns):
        name, value = PARAMETERS[column], float(found.state.values[column])
        sigma = float(np.sqrt(max(found.covariance[place, place], 0.0)))
        p = 2 * float(special.stdtr(freedom, -abs(value) / sigma)) if sigma > 0 else 0.0
        low, high = value - reach * sigma, value + reach * sigma
        told.append(Parameter(name, unit_of(name), value, sigma, low, high, p))
    return tuple(told)


def _sizes(pairs: SpacePairs, residuals: Array, cells: Mask) -> Array:
    """(2,) root mean square lengths of positions and turns."""
    lengths = _lengths(residuals)
    found = np.full(2, np.nan)
    for kind in range(1 + pairs.oriented):
        if cells[:, kind].any():
            found[kind] = np.sqrt(np.square(lengths[cells[:, kind], kind]).mean())
    return found


def _credible(
    validation: PoseTable, gt: PoseTable, pairs: SpacePairs, residuals: Array, cells: Mask
) -> tuple[float, bool]:
    """What is left of the positions over what is stated, and whether chance leaves as much."""
    used = np.flatnonzero(cells[:, 0])
    stated = 0.0
    for table in (validation, gt):
        one = table.select(pairs.ids)
        columns = [
            [c.name for c in one.components].index(a) for a in ("x", "y", "z")[: pairs.width]
        ]
        variances = np.diagonal(one.covariances, axis1=1, axis2=2)[used][:, columns]
        stated = stated + float(variances.sum())
    if not np.isfinite(stated) or stated <= 0:
        return float("nan"), True
    dof = len(used) * pairs.width
    ratio = float(np.square(residuals[used, : pairs.width]).sum()) / stated
    return float(np.sqrt(ratio)), bool(special.chdtrc(dof, ratio * dof) > 0.005)
