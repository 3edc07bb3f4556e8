"""Errors of a ground truth: validation poses minus GT poses, stop by stop."""

from dataclasses import dataclass, field, replace

import numpy as np

from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.poses.common_origin import CONSTRUCTED_MEAN, apart, joint_of
from validation.poses.factored import Factored
from validation.poses.follows import Follows
from validation.poses.pose_table import (
    PLANAR,
    SPATIAL,
    Component,
    PoseTable,
    in_common,
    pose_difference,
)
from validation.shown import Shown
from validation.statistics.consistency import (
    ConsistencyTest,
    Interval,
    chi_squared_interval,
    joint_square,
    nees,
    normalised_errors,
    square_of_factored,
    sum_test,
    whitened,
)


@dataclass(frozen=True, repr=False)
class Comparison(Shown):
    """What a system's poses differ by from the validation poses.

    Parameters
    ----------
    validation, gt : PoseTable
        Both at the n stops that they have in common, in the order of the validation, with the
        covariances of their independent parts (`validation.poses.common_origin.apart`).
    errors : (n, k) array
        Validation minus GT, metres and radians, angles in (-pi, pi], in the GTV frame.
    covariances : (n, k, k) array
        Of the errors; NaN where one of both is not stated.
    nees : (n,) array
        Normalised error squared; NaN where not available.
    nees_interval : Interval
        Where a single NEES falls with the confidence asked for.
    missing_in_gt, missing_in_validation : tuple of str
        Stops that only the other has.
    unavailable : str
        Why some or all stops have no NEES; empty where all have one.
    test : ConsistencyTest, optional
        All NEES taken together; None where there is none.
    left_out : tuple of str
        Components that only one of both has: "z of 'survey'".
    constructed : tuple of str
        Stops whose error is zero by construction, as the system took its pose over.
    mean_share : (k,) array
        Share of its variance that a mean error keeps where the system took its frame over from
        the validation; NaN where it did not.
    """

    validation: PoseTable
    gt: PoseTable
    errors: Array
    covariances: Array
    nees: Array
    nees_interval: Interval
    missing_in_gt: tuple[str, ...]
    missing_in_validation: tuple[str, ...]
    unavailable: str
    test: ConsistencyTest | None
    left_out: tuple[str, ...] = ()
    constructed: tuple[str, ...] = ()
    mean_share: Array = field(default_factory=lambda: np.empty(0))

    @property
    def follows(self) -> Follows | None:
        """What the system took over from the validation, where that is known."""
        return self.gt.follows if np.isfinite(self.mean_share).any() else None

    @property
    def constructed_means(self) -> tuple[str, ...]:
        """Components whose mean error is zero by construction."""
        shares = zip(self.components, self.mean_share, strict=False)
        return tuple(one.name for one, share in shares if share < CONSTRUCTED_MEAN)

    @property
    def system(self) -> str:
        """Name of the GT system."""
        return self.gt.system

    @property
    def ids(self) -> tuple[str, ...]:
        """Names of the stops compared."""
        return self.validation.ids

    @property
    def components(self) -> tuple[Component, ...]:
        """What the columns of ``errors`` are."""
        return self.validation.components

    @property
    def normalised(self) -> Array:
        """(n, k) errors in units of their combined standard deviations; NaN if not available."""
        return normalised_errors(self.errors, self.covariances)

    @property
    def distances(self) -> Array:
        """(n,) length of the position error, in metres."""
        lengths = [component.kind == "length" for component in self.components]
        return np.asarray(np.linalg.norm(self.errors[:, lengths], axis=1))

    @property
    def mean_sigmas(self) -> Array:
        """(k,) standard deviation that the stated covariances give the mean error.

        It holds what all stops have in common, as an error of the Vframe, which the scatter of
        the errors cannot show. NaN unless both tables state all covariances.
        """
        n, k = self.errors.shape
        if self.unavailable:
            return np.full(k, np.nan)
        total = np.zeros(k)
        for table in (self.validation, self.gt):
            if table.joint is not None:
                total += np.einsum("ikjk->k", table.joint.reshape(n, k, n, k))
                continue
            total += np.einsum("ikk->k", table.covariances)
            shared, signs = table.shared_part()  # the covariances have its own part already
            together = np.square(shared.sum(0)) - np.square(shared).sum(0)
            total += (together * signs).sum(1)
            if table.net is not None:
                ones = np.broadcast_to(np.eye(k), (n, k, k))
                apart = table.net.times(ones) - table.net.blocks
                total += np.einsum("nkk->k", apart)
        return np.asarray(np.sqrt(total) / n)

    def __len__(self) -> int:
        return len(self.ids)


def compare(validation: PoseTable, gt: PoseTable, confidence: float = 0.95) -> Comparison:
    """The errors of a GT system with respect to the validation poses.

    Parameters
    ----------
    validation : PoseTable
        What is taken as true.
    gt : PoseTable
        The system under test, in the same frame. Compared is what both have: positions where one
        of them knows no heading; a pose in space beside one in the plane is seen from above. It is
        taken as independent of the validation but for what it says to have taken over from it.
    confidence : float
        Of the intervals.

    Raises
    ------
    GtvalError
        If no component or no stop is in common.

    Notes
    -----
    AD2.3, tables "valid - GTvis" and "valid - SICK": error = validation minus GT.
    """
    validation, gt = seen_alike(validation, gt)
    shared = [one for one in validation.components if one in gt.components]
    if not shared:
        raise GtvalError(
            f"the poses of '{validation.system}' have the components "
            f"{_named(validation)} and those of '{gt.system}' {_named(gt)}; "
            "only the same components can be compared"
        )
    left_out = tuple(
        f"{one.name} of '{table.system}'"
        for table in (validation, gt)
        for one in table.components
        if one not in shared
    )
    validation, gt = validation.only(shared), gt.only(shared)
    ids = in_common([validation, gt])
    both = set(ids)
    ours, theirs, constructed, share, _ = apart(validation, gt)
    errors = pose_difference(ours.poses, theirs.poses, ours.components)
    covariances = ours.covariances + theirs.covariances
    scores = nees(errors, covariances)
    scores[[ids.index(name) for name in constructed]] = np.nan
    return Comparison(
        validation=ours,
        gt=theirs,
        errors=errors,
        covariances=covariances,
        nees=scores,
        nees_interval=chi_squared_interval(len(ours.components), confidence),
        missing_in_gt=tuple(name for name in validation.ids if name not in both),
        missing_in_validation=tuple(name for name in gt.ids if name not in both),
        unavailable=_why_unavailable(ours, theirs),
        test=_test(ours, theirs, errors, scores, confidence),
        left_out=left_out,
        constructed=constructed,
        mean_share=share,
    )


def seen_alike(validation: PoseTable, gt: PoseTable) -> tuple[PoseTable, PoseTable]:
    """Both from above, with the yaw as heading, where one is in the plane and the other is not."""
    planar = [any(one.name == "theta" for one in table.components) for table in (validation, gt)]
    if planar[0] == planar[1]:
        return validation, gt
    first, second = (_from_above(one) for one in (validation, gt))
    return first, second


def _from_above(table: PoseTable) -> PoseTable:
    """The poses of a table with a yaw in the plane; others as they are."""
    if SPATIAL[3] not in table.components:
        return table
    kept = table.only([SPATIAL[0], SPATIAL[1], SPATIAL[3]])
    return replace(kept, components=PLANAR)


def _named(table: PoseTable) -> str:
    return ", ".join(f"{component.name} [{component.unit}]" for component in table.components)


def _why_unavailable(validation: PoseTable, gt: PoseTable) -> str:
    """Which table states no covariance, and for which stops; empty if both state all."""
    reasons = []
    for table in (validation, gt):
        lacking = [
            name for name, has in zip(table.ids, table.has_covariance, strict=True) if not has
        ]
        if lacking:
            which = "" if len(lacking) == len(table) else f" for pose {', '.join(lacking)}"
            reasons.append(f"'{table.system}' states no covariance{which}")
    return " and ".join(reasons)


def _test(
    validation: PoseTable, gt: PoseTable, errors: Array, scores: Array, confidence: float
) -> ConsistencyTest | None:
    """All stops with a NEES together.

    Where a table states how its poses are correlated (the survey's poses share world points)
    the joint NEES is used: the plain sum would be spread wider than chi-squared.
    """
    stated = np.flatnonzero(np.isfinite(scores))
    if not stated.size:
        return None
    k, n = errors.shape[1], len(stated)
    if not (validation.is_correlated or gt.is_correlated):
        method = "sum of NEES, poses taken as independent"
        return sum_test(float(scores[stated].sum()), n, k, confidence, method)
    ids = [validation.ids[row] for row in stated]
    ours, theirs = validation.select(ids), gt.select(ids)
    method = "joint NEES, with the stated correlations between poses"
    if gt.follows is not None:
        total, freedom = _square(errors[stated], ours, theirs)
        method += f" and with the survey, {n * k - freedom} of {n * k} numbers being fitted"
        return sum_test(total, n, freedom / n, confidence, method) if freedom else None
    try:
        total = _joint_nees(errors[stated], ours, theirs)
    except ValueError:
        raise GtvalError(
            f"the joint covariance of '{validation.system}' and '{gt.system}' over all poses "
            "is not positive definite"
        ) from None
    return sum_test(total, n, k, confidence, method)


def _square(errors: Array, validation: PoseTable, gt: PoseTable) -> tuple[float, int]:
    """Of errors of which some may be zero by construction, with its freedom."""
    if validation.joint is None and gt.joint is None:
        found = square_of_factored(errors, _together(validation, gt))
        if found is not None:
            return found
    joint = joint_of(validation) + joint_of(gt)
    return joint_square(errors.ravel(), joint, every=errors.shape[1])


def _joint_nees(errors: Array, validation: PoseTable, gt: PoseTable) -> float:
    """Of all errors (n, k) together; where the tables have factors, without the whole matrix."""
    tables = (validation, gt)
    if any(table.joint is not None for table in tables):
        return float(nees(errors.ravel(), joint_of(validation) + joint_of(gt)))
    white = whitened(errors[..., None], _together(validation, gt))
    return float(np.square(white).sum())


def _together(validation: PoseTable, gt: PoseTable) -> Factored:
    """The covariance of the errors of tables that have no matrix of all poses."""
    return Factored.of(validation).beside(Factored.of(gt))
