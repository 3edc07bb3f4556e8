"""Whether surveyed poses fit the shape that the scans give, and what is wrong where they do not."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal, NamedTuple

import numpy as np
from scipy import special

from laser_gt.placing.graph import GraphSolution
from laser_gt.placing.mounts import mount_hint
from laser_gt.scans.planar import (
    compose,
    compose_jacobians,
    inverse,
    inverse_jacobian,
    wrapped,
)
from laser_gt.scans.scan import Indices
from validation.poses.angles import Array
from validation.poses.factored import Factored
from validation.results import Severity, Size

RARE = 1e-6
"""Probability of a contradiction by chance below which it is told: standard deviations that are a
sixth too small make of it one in a thousand, for three to ten stops."""
CLEAR = 10.0
"""By which twice the logarithm of the likelihood a cause must be better than another to be told
alone: odds of 150 to 1."""
STEPS, SMALL = 30, 1e-7
"""Bound on the steps of a fit, and the step, in metres and radians, that ends it."""
LIKELIEST = 16
"""Single stops, and pairs that are exchanged, that are tried where there are more. A judgement: the
one that is off stands out among all by its residual."""
_LOOSE = 1e-9
"""Factor on the information of a mount that may be anything."""

Kind = Literal["stop", "exchanged", "mount", "open"]


@dataclass(frozen=True)
class Shape:
    """Robot poses of p surveyed stops as the scans alone have them, in any frame.

    Parameters
    ----------
    poses : (p, 3) array
        x, y, theta.
    covariance : Factored
        Of all together, for a known mount.
    mount : (3,) array
        With which they follow from those of the laser.
    mount_covariance : (3, 3) array
        Of the mount as it was measured.
    """

    poses: Array
    covariance: Factored
    mount: Array
    mount_covariance: Array

    def with_mount(self, more: Array) -> tuple[Array, Array]:
        """(p, 3) poses with more, (3,), on the mount, and their derivatives, (p, 3, 3), by that."""
        mount = self.mount + more
        laser = compose(self.poses, self.mount)
        back = np.broadcast_to(inverse(mount), laser.shape)
        by_back = compose_jacobians(laser, back)[1]
        return compose(laser, back), by_back @ inverse_jacobian(mount)


def shape_of(solution: GraphSolution, rows: Indices) -> Shape:
    """The shape of some poses of a graph whose own surveyed stop had a negligible covariance."""
    spread = solution.spread
    alone = spread.for_known_mount(np.tile(np.eye(3), (len(solution.poses), 1, 1)))
    return Shape(solution.poses[rows], alone.select(rows), solution.mount, spread.mount)


@dataclass(frozen=True)
class SurveyDoubt:
    """What contradicts the scans.

    Parameters
    ----------
    kind : {'stop', 'exchanged', 'mount', 'open'}
        One surveyed pose, two exchanged ones, the mount; or several that explain it alike.
    stops : tuple of str
        Which.
    size : (3,) array
        Surveyed pose less that by the scans and the others, or the stated mount less the one that
        fits; NaN for the other kinds.
    sigmas : (3,) array
        Standard deviations of it.
    chi_squared, freedom : float, int
        Of all surveyed poses as they are stated.
    explained : bool
        Whether what the cause leaves is within chance.
    likely : tuple of (str, tuple of str)
        Where several explain it alike, these.
    hint : str
        The slip of the pen that makes such a mount, in words; or nothing.
    assumed : bool
        Whether somebody has said how good the survey is, or that was assumed.
    """

    kind: Kind
    stops: tuple[str, ...]
    size: Array
    sigmas: Array
    chi_squared: float
    freedom: int
    explained: bool
    likely: tuple[tuple[Kind, tuple[str, ...]], ...] = ()
    hint: str = ""
    assumed: bool = False

    @property
    def severity(self) -> Severity:
        """An error, or a warning where it may be the assumption that is wrong."""
        return "warning" if self.assumed else "error"


@dataclass(frozen=True)
class _Tried:
    """A cause, what it leaves in squared standard deviations, and what that counts for."""

    kind: Kind
    stops: tuple[int, ...]
    left: float
    freedom: int
    criterion: float


def contradiction(shape: Shape, surveyed: Array, covariance: Factored) -> tuple[float, int, bool]:
    """Squared standard deviations, degrees of freedom, and whether chance makes that.

    Parameters
    ----------
    shape : Shape
        Of p stops.
    surveyed : (p, 3) array
        Their poses in the GTV frame.
    covariance : Factored
        Of these together.
    """
    freedom = 3 * len(surveyed) - 3
    if freedom <= 0:
        return 0.0, 0, False
    squares = _fit(shape, surveyed, covariance).squares
    return squares, freedom, bool(special.chdtrc(freedom, squares) < RARE)


def survey_doubt(
    names: Sequence[str], shape: Shape, surveyed: Array, covariance: Factored
) -> SurveyDoubt | None:
    """What is wrong, if chance does not explain how surveyed poses and scans differ.

    One surveyed pose that is off, two that are exchanged, and a wrong mount are held against each
    other by likelihood, with Schwarz's price for what each may choose. Parameters as of
    `contradiction`; ``names`` are of the stops.
    """
    squares, freedom, told = contradiction(shape, surveyed, covariance)
    if not told:
        return None
    tried = sorted(_causes(shape, surveyed, covariance), key=lambda one: one.criterion)
    alike = [one for one in tried if one.criterion < tried[0].criterion + CLEAR]
    best = tried[0]
    explained = bool(best.freedom > 0 and special.chdtrc(best.freedom, best.left) > RARE)
    named = tuple((one.kind, tuple(names[row] for row in one.stops)) for one in alike)
    nothing = np.full(3, np.nan)
    if len(alike) > 1:
        return SurveyDoubt("open", (), nothing, nothing, squares, freedom, explained, named)
    size, sigmas = _size(best, shape, surveyed, covariance)
    hint = mount_hint(shape.mount, shape.mount - size) if best.kind == "mount" else ""
    return SurveyDoubt(best.kind, named[0][1], size, sigmas, squares, freedom, explained, hint=hint)


def with_mount(doubt: SurveyDoubt) -> SurveyDoubt:
    """The doubt where a wrong mount may have bent the shape as well: it is one of the causes."""
    others = doubt.likely or ((doubt.kind, doubt.stops),)
    likely = (("mount", ()), *(one for one in others if one[0] != "mount"))
    nothing = np.full(3, np.nan)
    return replace(doubt, kind="open", stops=(), size=nothing, sigmas=nothing, likely=likely)


def _causes(shape: Shape, surveyed: Array, covariance: Factored) -> Iterator[_Tried]:
    """All single causes; of many stops the `LIKELIEST` of each kind."""
    count = len(surveyed)
    price = 3 * np.log(3 * count)
    fitted = _fit(shape, surveyed, covariance)
    for row in _likeliest_stops(fitted, covariance):
        rest = np.delete(np.arange(count), row)
        left = _fit(*_of(rest, shape, surveyed, covariance)).squares
        yield _Tried("stop", (row,), left, 3 * count - 6, left + price + 2 * np.log(count))
    for pair in _likeliest_pairs(fitted, surveyed):
        order = np.arange(count)
        order[list(pair)] = pair[::-1]
        _, poses, spread = _of(order, shape, surveyed, covariance)
        left = _fit(shape, poses, spread).squares
        choice = 2 * np.log(count * (count - 1) / 2)
        yield _Tried("exchanged", pair, left, 3 * count - 3, left + choice)
    free = replace(shape, mount_covariance=shape.mount_covariance / _LOOSE)
    left = _fit(free, surveyed, covariance).squares
    yield _Tried("mount", (), left, 3 * count - 6, left + price)


def _likeliest_stops(fitted: "_Fitted", covariance: Factored) -> list[int]:
    """The stops whose poses may be off, in their order.

    Without a stop of weighed residual v the squares are v' C v less, C being its covariance given
    all others: at least what its survey has alone.
    """
    weighed = fitted.weighed
    less = np.einsum("ni,nij,nj->n", weighed, covariance.own, weighed)
    return sorted(np.argsort(-less, kind="stable")[:LIKELIEST].tolist())


def _likeliest_pairs(fitted: "_Fitted", surveyed: Array) -> list[tuple[int, int]]:
    """The pairs of stops that may be exchanged, in their order.

    An exchange moves the residual at one of two stops by the difference of their surveyed places,
    and that at the other by its opposite: those for which that leaves least, of the stops that are
    farthest off.
    """
    count = len(surveyed)
    if count * (count - 1) // 2 <= LIKELIEST * (LIKELIEST - 1) // 2:
        return list(combinations(range(count), 2))
    before = np.square(fitted.off[:, :2]).sum(1)
    far = np.sort(np.argsort(-before, kind="stable")[: 4 * LIKELIEST])
    pairs = list(combinations(far.tolist(), 2))
    first, second = np.array(pairs, dtype=np.intp).T
    moved = surveyed[second, :2] - surveyed[first, :2]
    after = fitted.off[first, :2] + moved, fitted.off[second, :2] - moved
    gain = before[first] + before[second] - sum(np.square(one).sum(1) for one in after)
    best = np.argsort(-gain, kind="stable")[:LIKELIEST]
    return sorted(pairs[row] for row in best.tolist())


def _size(
    cause: _Tried, shape: Shape, surveyed: Array, covariance: Factored
) -> tuple[Array, Array]:
    """By how much the cause is off, (3,), and standard deviations."""
    if cause.kind == "exchanged":
        return np.full(3, np.nan), np.full(3, np.nan)
    if cause.kind == "mount":
        free = replace(shape, mount_covariance=shape.mount_covariance / _LOOSE)
        found = _fit(free, surveyed, covariance)
        return -found.mount, np.sqrt(np.diagonal(found.known)[-3:])
    (row,) = cause.stops
    rest = np.delete(np.arange(len(surveyed)), row)
    found = _fit(*_of(rest, shape, surveyed, covariance))
    poses, by_mount = shape.with_mount(found.mount)
    pose = poses[row]
    by_frame, by_pose = compose_jacobians(found.frame, pose)
    lever = np.hstack([by_frame, by_pose @ by_mount[row]])
    own = covariance.blocks[row] + by_pose @ shape.covariance.blocks[row] @ by_pose.T
    spread = own + lever @ found.known @ lever.T
    return wrapped(surveyed[row] - compose(found.frame, pose)), np.sqrt(np.diagonal(spread))


def _of(
    rows: Indices, shape: Shape, surveyed: Array, covariance: Factored
) -> tuple[Shape, Array, Factored]:
    """Shape and survey of some stops."""
    some = replace(shape, poses=shape.poses[rows], covariance=shape.covariance.select(rows))
    return some, surveyed[rows], covariance.select(rows)


class _Fitted(NamedTuple):
    """Squares left, frame (3,), error of the mount (3,), and the covariance (6, 6) of both.

    ``off`` and ``weighed``, (p, 3), are residuals, and these times the inverse of their covariance.
    """

    squares: float
    frame: Array
    mount: Array
    known: Array
    off: Array
    weighed: Array


def _fit(shape: Shape, surveyed: Array, covariance: Factored) -> _Fitted:
    """The frame and the error of the mount with which a shape fits its surveyed poses best."""
    frame, mount = compose(surveyed[0], inverse(shape.poses[0])), np.zeros(3)
    prior = np.zeros((6, 6))
    prior[3:, 3:] = np.linalg.inv(shape.mount_covariance)
    for _ in range(STEPS):
        poses, by_mount = shape.with_mount(mount)
        by_frame, by_pose = compose_jacobians(np.broadcast_to(frame, poses.shape), poses)
        lever = np.concatenate([by_frame, by_pose @ by_mount], axis=2)
        off = wrapped(surveyed - compose(frame, poses))
        both = covariance.beside(shape.covariance.turned(by_pose))
        weighed = both.solve(np.concatenate([lever, off[..., None]], axis=2))
        known = np.linalg.inv(np.einsum("npi,npj->ij", lever, weighed[..., :6]) + prior)
        step = known @ (np.einsum("npi,np->i", lever, weighed[..., 6]) - prior[:, 3:] @ mount)
        frame, mount = wrapped(frame + step[:3]), wrapped(mount + step[3:])
        if np.abs(step).max() < SMALL:
            break
    poses, _ = shape.with_mount(mount)
    off = wrapped(surveyed - compose(frame, poses))
    weighed = both.solve(off[..., None])[..., 0]
    squares = float((off * weighed).sum() + mount @ prior[3:, 3:] @ mount)
    return _Fitted(squares, frame, mount, known, off, weighed)


def doubt_text(doubt: SurveyDoubt, whose: str) -> str:
    """The doubt in words; ``whose`` is what the scans give, such as 'to the drive'."""
    text = _said(doubt, whose)
    if doubt.assumed:
        text += ". Standard deviations of the survey are assumed: state them if they are larger"
    return text


def off_text(size: Array, sigmas: Array) -> str:
    """An error of a pose, (3,), with its standard deviations, (3,), in words."""
    x, y = np.round(size[:2] * 1e3) + 0.0  # no minus before a zero
    theta = round(float(size[2]) * 1e3, 1) + 0.0
    sx, sy, st = sigmas * 1e3
    return (
        f"{x:+.0f} mm, {y:+.0f} mm, {theta:+.1f} mrad (standard deviations "
        f"{sx:.1f} mm, {sy:.1f} mm, {st:.1f} mrad)"
    )


def _said(doubt: SurveyDoubt, whose: str) -> str:
    off = off_text(doubt.size, doubt.sigmas)
    start = f"the surveyed poses contradict the shape that the scans give {whose}: "
    if doubt.kind == "stop":
        return (
            f"{start}the surveyed pose of stop {doubt.stops[0]} is off by {off} from where the "
            "others and the scans have it. Measure it again, or leave it out"
        )
    if doubt.kind == "exchanged":
        first, second = doubt.stops
        return (
            f"{start}the surveyed stops {first} and {second} are exchanged, or their times or "
            "scans are. Put them right"
        )
    if doubt.kind == "mount":
        return (
            f"{start}the stated mount of the laser is off by {off}, stated less found. "
            f"{doubt.hint}Measure it again"
        )
    what = " or ".join(_named(kind, stops) for kind, stops in doubt.likely[:6])
    return f"{start}{what}; which, these stops do not say. Check them, or survey one more stop"


def _named(kind: Kind, stops: tuple[str, ...]) -> str:
    if kind == "mount":
        return "the mount of the laser is wrong"
    if kind == "exchanged":
        return f"stops {stops[0]} and {stops[1]} are exchanged"
    return f"stop {stops[0]} is off"


def doubt_sizes(doubt: SurveyDoubt) -> tuple[Size, ...]:
    """How large the doubt is, for scripts."""
    ratio = float(np.sqrt(doubt.chi_squared / doubt.freedom))
    contradiction_size = Size("contradiction over the stated one", ratio)
    if doubt.kind not in {"stop", "mount"}:
        return (contradiction_size,)
    numbers = zip(("x", "y", "theta"), doubt.size.tolist(), ("m", "m", "rad"), strict=True)
    return (*(Size(f"off in {name}", size, unit) for name, size, unit in numbers),
            contradiction_size)  # fmt: skip
