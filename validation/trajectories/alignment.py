"""What is fitted before two trajectories are compared: frame, scale, mount, delay."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import fft
from scipy.spatial.transform import Rotation

from validation.errors import GtvalError
from validation.poses.angles import Array, mean_angle, wrap
from validation.poses.trajectory import Trajectory
from validation.trajectories.association import At, Pairs, associate

PARTS = ("frame", "scale", "mount", "time")
"""What can be fitted, in the order in which it is told."""
COSINES = 8
"""Of the scores, whose spread gives the standard deviations: eight degrees of freedom, after
Lazarus, Lewis, Stock and Watson (2018)."""
MOST_STEPS = 30
"""Of Gauss and Newton; from the closed form of the frame it takes three to six."""
LEAST_SINGULAR = 1e-4
"""Of the largest singular value, below which a combination of what is fitted cannot be told: an
error of a millimetre would move it by ten metres."""
WITHIN_S = 2.0
"""Delays that are looked for, either way, in seconds: those of AD2.3."""
FIRST_STEP_S = 0.05
"""Between the delays tried first. At 1 m/s it is 50 mm, within the reach of the search that
follows; turns take seconds."""

DelayOf = Callable[[Trajectory, Trajectory], tuple[float, float | None]]
"""Seconds to add to the stamps of the second, a source, to have the time of the first, and their
standard deviation; None where that of the positions is taken."""


@dataclass(frozen=True)
class Alignment:
    """What was fitted, and how sure it is.

    A point at p on the robot of the source is, for the reference, at
    ``scale * rotation @ position + translation + rotation @ R_source @ mount``.

    Parameters
    ----------
    parts : tuple of str
        Of `PARTS`; none for a comparison as it stands.
    rotation : (d, d) array
        Of the frame: from the source's coordinates to the reference's.
    translation : (d,) array
        Of the frame, metres.
    scale : float
        Of the source's lengths.
    mount : (d,) array
        Where the reference's origin is on the source's robot, metres.
    mount_rotation : (d, d) array
        Of the reference's axes on the source's robot.
    delay_s : float
        Added to the source's stamps.
    freedoms : int
        Numbers fitted.
    sigmas : mapping of str to float
        Standard deviations of `numbers`, which allow for the correlation of neighbours.
    """

    parts: tuple[str, ...]
    rotation: Array
    translation: Array
    scale: float
    mount: Array
    mount_rotation: Array
    delay_s: float = 0.0
    freedoms: int = 0
    sigmas: Mapping[str, float] = field(default_factory=dict)

    @property
    def numbers(self) -> dict[str, float]:
        """What was fitted, by name: metres, radians, seconds; rotations about the fixed axes."""
        axes = "xyz"[: len(self.translation)]
        found: dict[str, float] = {}
        if "frame" in self.parts:
            found |= {f"frame_{a}_m": float(v) for a, v in zip(axes, self.translation, strict=True)}
            found |= _angles("frame", self.rotation)
        if "scale" in self.parts:
            found["scale"] = self.scale
        if "mount" in self.parts:
            found |= {f"mount_{a}_m": float(v) for a, v in zip(axes, self.mount, strict=True)}
            found |= _angles("mount", self.mount_rotation)
        if "time" in self.parts:
            found["delay_s"] = self.delay_s
        return found


def _angles(what: str, rotation: Array) -> dict[str, float]:
    if len(rotation) == 2:
        return {f"{what}_theta_rad": float(np.arctan2(rotation[1, 0], rotation[0, 0]))}
    turned = Rotation.from_matrix(rotation).as_rotvec()
    return {f"{what}_r{a}_rad": float(v) for a, v in zip("xyz", turned, strict=True)}


def parts_of(text: str) -> tuple[str, ...]:
    """('frame', 'time') for 'frame+time'; none for 'none'.

    Raises
    ------
    GtvalError
        For a part that there is not.
    """
    named = [one.strip() for one in text.split("+")] if text != "none" else []
    for one in named:
        if one not in PARTS:
            raise GtvalError(
                f"'{one}' cannot be aligned; give none, or parts of {', '.join(PARTS)} joined by "
                "'+': frame+time"
            )
    return tuple(one for one in PARTS if one in named)


def umeyama(target: Array, points: Array, *, scale: bool = False) -> tuple[Array, Array, float]:
    """Rotation, translation and scale that bring points onto others with the least squares.

    Parameters
    ----------
    target, points : (n, d) array
        In metres.
    scale : bool
        Whether the scale is fitted; it is 1 if not.

    Raises
    ------
    GtvalError
        If all points coincide or, in space, lie on a line: the rotation cannot be told.

    Notes
    -----
    Umeyama (1991), "Least-squares estimation of transformation parameters between two point
    patterns", equations 40 to 42.
    """
    centre_to, centre = target.mean(0), points.mean(0)
    away = points - centre
    left, sizes, right = np.linalg.svd((target - centre_to).T @ away / len(points))
    d = points.shape[1]
    if not sizes[0] > 0 or sizes[d - 2] <= LEAST_SINGULAR**2 * sizes[0]:
        raise GtvalError(
            "the frame cannot be aligned: all common positions are one point"
            + (" or on a line" if d == 3 else "")
        )
    signs = np.ones(d)
    signs[-1] = np.sign(np.linalg.det(left) * np.linalg.det(right))
    rotation = (left * signs) @ right
    factor = float((sizes * signs).sum() / np.square(away).sum(1).mean()) if scale else 1.0
    return rotation, centre_to - factor * rotation @ centre, factor


def align(pairs: Pairs, parts: Iterable[str]) -> Alignment:
    """Frame, scale and mount by least squares of the positions; a mount's rotation by its mean.

    Parameters
    ----------
    pairs : Pairs
        The source is brought onto the reference.
    parts : iterable of str
        Of `PARTS`; 'time' is taken as found already, and counted.

    Raises
    ------
    GtvalError
        If a part cannot be told from these pairs.
    """
    parts = tuple(one for one in PARTS if one in set(parts))
    ours, theirs = pairs.reference, pairs.source
    d = ours.dimensions
    if "mount" in parts and not ours.has_orientation:
        raise GtvalError("a mount can be aligned only where both have an orientation")
    found = Alignment(parts, np.eye(d), np.zeros(d), 1.0, np.zeros(d), np.eye(d))
    if "frame" in parts:
        # evo takes the frame from positions too, so that the two agree.
        rotation, translation, scale = umeyama(
            ours.positions, theirs.positions, scale="scale" in parts
        )
        found = replace(found, rotation=rotation, translation=translation, scale=scale)
    if "mount" in parts or ("scale" in parts and "frame" not in parts):
        found = _iterated(found, pairs)
    if "mount" in parts:
        found = replace(found, mount_rotation=_mount_rotation(found, pairs))
    names, jacobian = _jacobian(found, pairs, delay="time" in parts)
    sigmas = _sigmas(names, jacobian, ours.positions - moved_positions(found, theirs))
    if "mount" in parts:
        sigmas |= _mount_rotation_sigmas(found, pairs)
    return replace(found, sigmas=sigmas, freedoms=len(found.numbers))


def align_in_time(
    reference: Trajectory,
    source: Trajectory,
    parts: Iterable[str] = (),
    at: At = "sparser",
    delay_of: DelayOf | None = None,
) -> tuple[Pairs, Alignment]:
    """The pairs of two trajectories, the source moved by what is fitted.

    Parameters
    ----------
    reference, source : Trajectory
        The source keeps its own frame and stamps where nothing is fitted.
    parts : iterable of str
        Of `PARTS`.
    at : {"sparser", "reference", "source"}
        Whose times the pairs have.
    delay_of : callable, optional
        Finds the delay, where 'time' is fitted; by default the one within `WITHIN_S` with the
        least squares of the positions after the frame has been fitted.

    Raises
    ------
    GtvalError
        If no times are in common or a part cannot be told.
    """
    parts = tuple(parts)
    delay, sigma = 0.0, None
    if "time" in parts:
        delay, sigma = (delay_of or delay_by_positions)(reference, source)
        source = source.shifted(delay)
    pairs = associate(reference, source, at)
    found = replace(align(pairs, parts), delay_s=delay)
    if sigma is not None:
        found = replace(found, sigmas={**found.sigmas, "delay_s": sigma})
    return replace(pairs, source=moved(found, pairs.source)), found


def moved_positions(found: Alignment, source: Trajectory) -> Array:
    """(n, d) positions of the source, for the reference."""
    positions = found.scale * source.positions
    if "mount" in found.parts:
        positions = positions + _matrices(source) @ found.mount
    return np.asarray(positions @ found.rotation.T + found.translation)


def moved(found: Alignment, source: Trajectory) -> Trajectory:
    """The source with what was fitted, its covariances carried along; its stamps are kept."""
    if not set(found.parts) - {"time"}:
        return source
    poses = source.poses.copy()
    d = source.dimensions
    poses[:, :d] = moved_positions(found, source)
    if source.kind == "plane":
        turn = sum(_angles("_", r)["__theta_rad"] for r in (found.rotation, found.mount_rotation))
        poses[:, 2] = wrap(poses[:, 2] + turn)
    elif source.kind == "space":
        frame, mount = (Rotation.from_matrix(r) for r in (found.rotation, found.mount_rotation))
        poses[:, 3:] = (frame * source.rotations * mount).as_quat()
    return replace(source, poses=poses, covariances=_moved_covariances(found, source))


def _moved_covariances(found: Alignment, source: Trajectory) -> Array:
    """(n, m, m) by the derivatives of `moved_positions` and of the rotation."""
    covariances = np.asarray(source.covariances)
    if not source.has_covariance.any():
        return covariances
    d, m = source.dimensions, covariances.shape[1]
    carried = np.zeros((m, m))
    carried[:d, :d] = found.scale * found.rotation
    if source.kind == "space":
        carried[d:, d:] = found.rotation
    elif source.kind == "plane":
        carried[d:, d:] = 1.0
    if "mount" not in found.parts:
        return np.asarray(carried @ covariances @ carried.T)
    arm = _matrices(source) @ found.mount @ found.rotation.T
    each = np.broadcast_to(carried, covariances.shape).copy()
    each[:, :d, d:] = _turned(arm)
    if source.kind == "space":
        each[:, :d, d:] = each[:, :d, d:] @ found.rotation
    return np.asarray(each @ covariances @ np.swapaxes(each, 1, 2))


def delay_by_positions(reference: Trajectory, source: Trajectory) -> tuple[float, float | None]:
    """The delay within `WITHIN_S` after which the positions fit best, the frame fitted each time.

    Raises
    ------
    GtvalError
        If no delay has pairs.
    """

    def misfit(delay: float) -> float:
        try:
            pairs = associate(reference, source.shifted(delay))
            found = align(pairs, ["frame"])
        except GtvalError:
            return np.inf
        if len(pairs.times) < 3:
            return np.inf
        away = pairs.reference.positions - moved_positions(found, pairs.source)
        return float(np.sqrt(np.square(away).sum(1).mean()))

    tried = np.arange(-WITHIN_S, WITHIN_S + FIRST_STEP_S / 2, FIRST_STEP_S)
    misfits = np.array([misfit(delay) for delay in tried])
    best = int(np.argmin(misfits))
    if not np.isfinite(misfits[best]):
        raise GtvalError(
            f"no delay within {WITHIN_S:g} s brings '{source.system}' and '{reference.system}' "
            "together"
        )
    from scipy import optimize  # noqa: PLC0415  (a tenth of a second that most do without)

    around = (tried[best] - FIRST_STEP_S, tried[best] + FIRST_STEP_S)
    finest = optimize.minimize_scalar(misfit, bounds=around, method="bounded")
    return float(finest.x), None


def _matrices(source: Trajectory) -> Array:
    """(n, d, d) rotations from the robot of the source to its frame."""
    if source.kind == "plane":
        c, s = np.cos(source.poses[:, 2]), np.sin(source.poses[:, 2])
        return np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    return np.asarray(source.rotations.as_matrix())


def _turned(points: Array) -> Array:
    """(n, d, 1 or 3) derivative of points by a small rotation about the fixed axes."""
    if points.shape[1] == 2:
        return np.stack([-points[:, 1], points[:, 0]], -1)[..., None]
    x, y, z = points.T
    o = np.zeros_like(x)
    rows = [np.stack(row, -1) for row in ([o, z, -y], [-z, o, x], [y, -x, o])]
    return np.stack(rows, -2)


def _jacobian(found: Alignment, pairs: Pairs, *, delay: bool) -> tuple[list[str], Array]:
    """Names of the numbers fitted to positions, and (n, d, p) the derivatives of the positions."""
    source = pairs.source
    n, d = source.positions.shape
    axes = "xyz"[:d]
    names: list[str] = []
    columns: list[Array] = []
    turned = moved_positions(found, source) - found.translation
    if "frame" in found.parts:
        names += [f"frame_{a}_m" for a in axes]
        columns.append(np.broadcast_to(np.eye(d), (n, d, d)))
        names += list(_angles("frame", found.rotation))
        columns.append(_turned(turned))
    if "scale" in found.parts:
        names.append("scale")
        columns.append((source.positions @ found.rotation.T)[..., None])
    if "mount" in found.parts:
        names += [f"mount_{a}_m" for a in axes]
        columns.append(found.rotation @ _matrices(source))
    if delay and n > 1:
        names.append("delay_s")
        columns.append(-np.gradient(turned, pairs.times, axis=0)[..., None])
    return names, np.concatenate(columns, axis=-1) if columns else np.empty((n, d, 0))


def _iterated(found: Alignment, pairs: Pairs) -> Alignment:
    """Frame, scale and mount together, by Gauss and Newton."""
    d = pairs.source.dimensions
    for _ in range(MOST_STEPS):
        names, jacobian = _jacobian(found, pairs, delay=False)
        away = pairs.reference.positions - moved_positions(found, pairs.source)
        wide = jacobian.reshape(-1, len(names))
        sizes = np.linalg.svd(wide, compute_uv=False)
        if len(wide) < len(names) or sizes[-1] <= LEAST_SINGULAR * sizes[0]:
            raise GtvalError(
                f"{' and '.join(found.parts)} cannot be told apart from these poses; a mount "
                "needs a robot that turns, in space about two axes"
            )
        step = dict(zip(names, np.linalg.lstsq(wide, away.ravel(), rcond=None)[0], strict=True))
        turn = [
            value for name, value in step.items() if name.startswith("frame_") and "rad" in name
        ]
        if turn:
            rotation = _small_rotation(np.array(turn)) @ found.rotation
            translation = [step[f"frame_{a}_m"] for a in "xyz"[:d]]
            found = replace(found, rotation=rotation, translation=found.translation + translation)
        mount = [step.get(f"mount_{a}_m", 0.0) for a in "xyz"[:d]]
        found = replace(found, mount=found.mount + mount, scale=found.scale + step.get("scale", 0))
        if max(map(abs, step.values())) < 1e-12:
            break
    return found


def _small_rotation(turn: Array) -> Array:
    whole = turn if len(turn) == 3 else np.array([0.0, 0.0, turn[0]])
    d = 3 if len(turn) == 3 else 2
    return np.asarray(Rotation.from_rotvec(whole).as_matrix()[:d, :d])


def _mount_angles(found: Alignment, pairs: Pairs) -> Array:
    """(n, 1 or 3) rotation of the mount by each pair, beside the one found."""
    ours, theirs = pairs.reference, pairs.source
    if ours.kind == "plane":
        frame = _angles("_", found.rotation)["__theta_rad"]
        own = _angles("_", found.mount_rotation)["__theta_rad"]
        return wrap(ours.poses[:, 2] - theirs.poses[:, 2] - frame - own)[:, None]
    frame = Rotation.from_matrix(found.rotation)
    apart = (frame * theirs.rotations).inv() * ours.rotations
    own = Rotation.from_matrix(found.mount_rotation)
    return np.asarray((apart * own.inv()).as_rotvec())


def _mount_rotation(found: Alignment, pairs: Pairs) -> Array:
    """The mean rotation from the source's robot to the reference's."""
    turns = _mount_angles(found, pairs)
    if turns.shape[1] == 1:
        return _small_rotation(np.array([mean_angle(turns[:, 0])]))
    return np.asarray(Rotation.from_rotvec(turns).mean().as_matrix())


def _mount_rotation_sigmas(found: Alignment, pairs: Pairs) -> dict[str, float]:
    turns = _mount_angles(found, pairs)
    names = list(_angles("mount", found.mount_rotation))
    variances = np.diag(_long_run(turns - turns.mean(0))) / len(turns)
    return dict(zip(names, np.sqrt(variances).tolist(), strict=True))


def _sigmas(names: list[str], jacobian: Array, away: Array) -> dict[str, float]:
    """Standard deviations of a least-squares fit whose errors are shared by neighbours.

    Newey and West (1987), "A simple ... covariance matrix", with the equal-weighted cosine estimate
    of the scores in place of their weights.
    """
    n = len(away)
    if not names or n <= len(names):
        return dict.fromkeys(names, float("nan"))
    scores = (away[:, None, :] @ jacobian)[:, 0]
    wide = jacobian.reshape(-1, len(names))
    squares = wide.T @ wide
    size = np.sqrt(np.diag(squares))
    if (size == 0).any():
        return dict.fromkeys(names, float("nan"))
    inverse = np.linalg.pinv(squares / np.outer(size, size))
    spread = inverse @ (n * _long_run(scores) / np.outer(size, size)) @ inverse
    sigmas = np.sqrt(np.maximum(np.diag(spread), 0)) / size
    return dict(zip(names, sigmas.tolist(), strict=True))


def _long_run(series: Array) -> Array:
    """(p, p) long-run covariance of series of mean zero, by their slowest cosines."""
    cosines = max(1, min(COSINES, len(series) // 4))
    slow = fft.dct(series, type=2, axis=0, norm="ortho")[1 : cosines + 1]
    return np.asarray(slow.T @ slow / len(slow))
