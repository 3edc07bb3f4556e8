"""Pairs of a validation pose and a GT pose, as the fits take them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from validation.errors import GtvalError
from validation.explain.fitting.angle_unit import angle_unit_doubt
from validation.explain.fitting.conventions import (
    AS_STATED,
    NONE,
    Convention,
    CovarianceUnit,
    convention_of,
    covariance_unit,
)
from validation.explain.fitting.models import Motion
from validation.poses.angles import Array
from validation.poses.common_origin import apart, own_part
from validation.poses.follows import Follows
from validation.poses.pose_table import PLANAR, PoseTable, in_common, pose_difference
from validation.poses.shared_errors import SharedErrors, shared_errors

CONSTRUCTED = np.array([2e-4, 2e-4, 2e-4])
"""An error below this (metres, radians) at the reference pose is one of rounding in print:
tables are printed to 0.1 mm and 0.1 mrad, and the difference of two rounded numbers is off by up
to 0.1; twice that allows for a frame that was rounded too."""


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
    motion : Motion, optional
        At the GT poses, where times are known.
    between : SharedErrors, optional
        What errors of different stops have in common, where the tables state it.
    unit_doubt : str
        Why the headings of one table are perhaps in degrees, in words; empty if nothing says so.
    convention : Convention
        How the GT table was read; its poses here are in the convention of the validation.
    covariance_unit : CovarianceUnit
        How the covariances were read, where they are in another unit than the positions.
    steps : (n,) array, optional
        Where the poses are along their time, or their order in the validation, in steps.
    follows : Follows, optional
        What the system took over from the validation: covariances allow for it.
    contradicted : bool
        Whether errors are of another size than the stated covariances say: their level is
        estimated then, and only their shapes count.
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
    motion: Motion | None = None
    between: SharedErrors | None = None
    unit_doubt: str = ""
    convention: Convention = NONE
    covariance_unit: CovarianceUnit = AS_STATED
    steps: Array | None = None
    follows: Follows | None = None
    contradicted: bool = False

    @property
    def estimated(self) -> bool:
        """Whether the level of the noise is estimated."""
        return self.contradicted or not self.stated

    @property
    def order(self) -> Array:
        """(n,) steps of the poses; their number where nothing else is known."""
        return np.arange(len(self), dtype=float) if self.steps is None else self.steps

    @property
    def places(self) -> Array:
        """(n,) places between the first pose and the last, from -1/2 to 1/2."""
        span = float(np.ptp(self.order)) if len(self) else 0.0
        return (self.order - self.order.min()) / span - 0.5 if span else np.zeros(len(self))

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
            motion=None if self.motion is None else self.motion.select(chosen),
            between=None if self.between is None else self.between.select(chosen),
            steps=self.order[chosen],
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
        or the angles are certainly in degrees.
    """
    for table in (validation, gt):
        if table.components != PLANAR:
            raise GtvalError(
                f"'{table.system}': only planar poses (x, y, theta) can be explained so far"
            )
    ids = in_common([validation, gt])
    ours, theirs, copied, *_ = apart(validation, gt)
    if reference:  # what it took over is a parameter of its own: the slip
        ours, theirs, copied = validation.select(ids), own_part(validation, gt).select(ids), ()
    stated = bool(ours.has_covariance.all() and theirs.has_covariance.all())
    unit_doubt = angle_unit_doubt(ours, theirs)
    steps = _steps(ids, validation, times)
    walk = np.argsort(steps, kind="stable")
    convention = convention_of(ours.poses[walk], theirs.poses[walk])
    read = convention.read(theirs.poses)
    between = shared_errors([ours, theirs]) if stated else None
    unit, nothing = np.broadcast_to(np.eye(3), (len(ids), 3, 3)), np.zeros((len(ids), 3, 3))
    first, second = (
        (ours.covariances, convention.read_covariances(theirs.covariances))
        if stated
        else (unit, nothing)
    )
    slip = AS_STATED
    if stated and between is None:
        slip = covariance_unit(ours.poses, read, first, second, convention.shrink)
    pairs = Pairs(
        system=gt.system,
        ids=tuple(ids),
        validation=ours.poses,
        gt=read,
        validation_covariances=slip.read(first, slip.validation),
        gt_covariances=slip.read(second, slip.gt),
        stated=stated,
        motion=None if times is None else _motion(ids, read, times),
        between=between,
        unit_doubt=unit_doubt,
        convention=convention,
        covariance_unit=slip,
        steps=steps,
        follows=gt.follows if gt.follows and gt.follows.system == validation.system else None,
    )
    if copied:
        kept = [name not in copied for name in ids]
        pairs = replace(pairs.select(kept), constructed=copied)
    return _with_reference(pairs, validation, reference) if reference else pairs


def own_reference(validation: PoseTable, gt: PoseTable) -> str:
    """The one stop of the validation that placed a system, as its table says; else empty."""
    follows = gt.follows
    if follows is None or follows.system != validation.system or len(follows.ids) != 1:
        return ""
    return follows.ids[0] if follows.ids[0] in validation.ids else ""


def _with_reference(pairs: Pairs, validation: PoseTable, reference: str) -> Pairs:
    """The pairs with the reference pose, and without its own pair if that is zero by design."""
    if reference not in validation.ids:
        raise GtvalError(
            f"'{pairs.system}': the reference pose {reference} has no validation pose; "
            f"there are {', '.join(validation.ids)}"
        )
    row = validation.ids.index(reference)
    slip, covariance = pairs.covariance_unit, np.eye(3)
    if pairs.stated:
        covariance = slip.read(validation.covariances[row], slip.validation)
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


def _steps(ids: list[str], validation: PoseTable, times: Mapping[str, float] | None) -> Array:
    """(n,) where the poses are along their time if it is known, else along the validation's order.

    In median steps of time, so that neighbours are one apart.
    """
    if times is None or any(name not in times for name in ids):
        row = {name: number for number, name in enumerate(validation.ids)}
        return np.array([row[name] for name in ids], dtype=float)
    stamp = np.array([times[name] for name in ids])
    apart = np.diff(np.sort(stamp))
    apart = apart[apart > 0]
    return stamp / float(np.median(apart)) if apart.size else np.arange(len(ids), dtype=float)


def _motion(ids: list[str], poses: Array, times: Mapping[str, float]) -> Motion:
    """How the robot moves at each pose.

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
    path = poses.copy()
    path[order, 2] = np.unwrap(poses[order, 2])
    return Motion.along(stamp, path)
