"""Pairs of a validation pose and a GT pose, as the fits take them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import comb

import numpy as np
import numpy.typing as npt

from validation.errors import GtvalError
from validation.poses.angles import Array, wrap
from validation.poses.pose_table import PLANAR, PoseTable, in_common, pose_difference

CONSTRUCTED = np.array([2e-4, 2e-4, 2e-4])
"""An error below this (metres, radians) at the reference pose is one of rounding in print."""


@dataclass(frozen=True)
class Pairs:
    """Validation and GT poses of one system at their n common stops, in the GTV frame.

    Parameters
    ----------
    system : str
        Name of the GT system.
    ids : tuple of str
        The stops.
    validation, gt : (n, 3) array
        x, y in metres, theta in radians.
    validation_covariances, gt_covariances : (n, 3, 3) array
        Of each pose. Where ``stated`` is False: unit matrices and zeros, and the noise level is
        one standard deviation for positions and one for headings, to be estimated.
    stated : bool
        Whether both tables state all their covariances.
    reference : str
        The stop whose validation pose tied the system to the GTV frame; empty if not stated.
    reference_pose : (3,) array, optional
        Its validation pose.
    reference_covariance : (3, 3) array, optional
        Its covariance, unit if not stated.
    constructed : tuple of str
        Stops left out because their error is zero by construction.
    velocities : (n, 3) array, optional
        Of the GT poses, in m/s and rad/s, where times are known.
    between : (n, 3, n, 3) array, optional
        Covariance between the errors of different stops, where the tables state one.
    degrees_hint : str
        That the angles of a table look like degrees, in words; empty where they do not.
    """

    system: str
    ids: tuple[str, ...]
    validation: Array
    gt: Array
    validation_covariances: Array
    gt_covariances: Array
    stated: bool
    reference: str = ""
    reference_pose: Array | None = None
    reference_covariance: Array | None = None
    constructed: tuple[str, ...] = ()
    velocities: Array | None = None
    between: Array | None = None
    degrees_hint: str = ""

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def errors(self) -> Array:
        """(n, 3) validation minus GT, angles wrapped."""
        return pose_difference(self.validation, self.gt)

    def select(self, rows: npt.ArrayLike) -> "Pairs":
        """The pairs in the given rows."""
        chosen = np.arange(len(self))[np.asarray(rows)]
        return replace(
            self,
            ids=tuple(self.ids[row] for row in chosen),
            validation=self.validation[chosen],
            gt=self.gt[chosen],
            validation_covariances=self.validation_covariances[chosen],
            gt_covariances=self.gt_covariances[chosen],
            velocities=None if self.velocities is None else self.velocities[chosen],
            between=None if self.between is None else self.between[chosen][:, :, chosen],
        )


def make_pairs(
    validation: PoseTable,
    gt: PoseTable,
    reference: str = "",
    times: Mapping[str, float] | None = None,
) -> Pairs:
    """The pairs of two tables.

    Parameters
    ----------
    validation, gt : PoseTable
        Planar poses in the same frame.
    reference : str
        Stop whose validation pose tied the GT system to the GTV frame, if known.
    times : mapping of str to float, optional
        Seconds of each stop of a moving robot.

    Raises
    ------
    GtvalError
        If the poses are not planar, no stop is in common, the reference has no validation pose,
        or the angles are certainly degrees.
    """
    for table in (validation, gt):
        if table.components != PLANAR:
            raise GtvalError(
                f"'{table.system}': only planar poses (x, y, theta) can be explained so far"
            )
    ids = in_common([validation, gt])
    ours, theirs = validation.select(ids), gt.select(ids)
    hint = degrees_hint(ours, theirs)
    stated = bool(ours.has_covariance.all() and theirs.has_covariance.all())
    unit, nothing = np.broadcast_to(np.eye(3), (len(ids), 3, 3)), np.zeros((len(ids), 3, 3))
    pairs = Pairs(
        system=gt.system,
        ids=tuple(ids),
        validation=ours.poses,
        gt=theirs.poses,
        validation_covariances=ours.covariances if stated else unit,
        gt_covariances=theirs.covariances if stated else nothing,
        stated=stated,
        velocities=None if times is None else _velocities(ids, theirs.poses, times),
        between=shared_part([ours, theirs]) if stated else None,
        degrees_hint=hint,
    )
    return _with_reference(pairs, validation, reference) if reference else pairs


def _with_reference(pairs: Pairs, validation: PoseTable, reference: str) -> Pairs:
    """The pairs with the reference pose, and without its own pair if that is zero by design."""
    if reference not in validation.ids:
        raise GtvalError(
            f"'{pairs.system}': the reference pose {reference} has no validation pose; "
            f"there are {', '.join(validation.ids)}"
        )
    row = validation.ids.index(reference)
    covariance = validation.covariances[row] if pairs.stated else np.eye(3)
    constructed = np.array([name == reference for name in pairs.ids])
    constructed &= (np.abs(pairs.errors) <= CONSTRUCTED).all(1)
    left_out = tuple(name for name, out in zip(pairs.ids, constructed, strict=True) if out)
    return replace(
        pairs.select(~constructed),
        reference=reference,
        reference_pose=validation.poses[row],
        reference_covariance=covariance,
        constructed=left_out,
    )


CERTAIN = 1e-6
"""Angles that agree when read as degrees are refused where chance does so less often than this:
of a million tables of unrelated headings one would be refused wrongly."""


def degrees_hint(validation: PoseTable, gt: PoseTable) -> str:
    """The sentence that says so if one table's angles fit the other's far better as degrees.

    Parameters
    ----------
    validation, gt : PoseTable
        Planar poses of the same stops. The hint is empty where the angles fit as they are.

    Raises
    ------
    GtvalError
        Where it is certain: chance would make them agree so well less often than `CERTAIN`.
    """
    n, a, b = len(validation), validation.poses[:, 2], gt.poses[:, 2]

    def spread(difference: Array) -> float:
        # About the direction most have in common, so that a frame's rotation does not count.
        turned = np.exp(1j * difference)
        return float(np.median(np.abs(wrap(np.angle(turned / np.median(turned))))))

    if n < 3:
        return ""
    as_is = spread(a - b)
    converted = {
        gt.system: spread(a - np.radians(b)),
        validation.system: spread(np.radians(a) - b),
    }
    system = min(converted, key=lambda name: converted[name])
    if as_is <= 0.2 or converted[system] >= as_is / 5:
        return ""
    hint = (
        f"the angles of '{system}' look like degrees: read so, they agree with the other "
        f"table's to {converted[system]:.3f} rad instead of {as_is:.2f} rad"
    )
    if _by_chance(n, converted[system]) < CERTAIN:
        raise GtvalError(f"{hint}. Angles are in radians; convert them")
    return hint


def _by_chance(n: int, spread: float) -> float:
    """Upper bound on the chance that n unrelated headings agree so well, one table or the other.

    Half of them, m, must lie within ``spread`` of one direction, so that m - 1 lie within twice
    that of one of them, each with the chance 2 spread / pi; there are n to choose that one from,
    the ways to choose the m - 1, and two tables.
    """
    others = (n + 1) // 2 - 1
    return float(2 * n * comb(n - 1, others) * min(1.0, 2 * spread / np.pi) ** others)


def _velocities(ids: list[str], poses: Array, times: Mapping[str, float]) -> Array:
    """(n, 3) velocities from the neighbours in time, in m/s and rad/s.

    Raises
    ------
    GtvalError
        If a stop has no time, or two have the same.
    """
    missing = [name for name in ids if name not in times]
    if missing:
        raise GtvalError(f"no time is given for pose {', '.join(missing)}")
    stamp = np.array([times[name] for name in ids])
    order = np.argsort(stamp, kind="stable")
    if len(ids) < 2 or (np.diff(stamp[order]) <= 0).any():
        raise GtvalError("a time offset needs at least two poses, all at different times")
    path = poses[order].copy()
    path[:, 2] = np.unwrap(path[:, 2])
    result = np.empty_like(path)
    result[order] = np.gradient(path, stamp[order], axis=0)
    return result


def shared_part(tables: Sequence[PoseTable]) -> Array | None:
    """Covariance between different poses, added up over tables of the same n stops.

    Parameters
    ----------
    tables : sequence of PoseTable
        Independent of each other.

    Returns
    -------
    (n, 3, n, 3) array or None
        With zeros between a pose and itself; None where no table states a joint covariance.
    """
    total: Array | None = None
    for table in tables:
        joint = table.joint_covariance
        if joint is None:
            continue
        n, k = table.poses.shape
        between = np.array(joint, dtype=float).reshape(n, k, n, k)
        between[np.arange(n), :, np.arange(n)] = 0.0
        total = between if total is None else total + between
    return total
