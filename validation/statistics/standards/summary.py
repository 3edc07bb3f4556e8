"""A system's errors in the words of standards: all of it for one comparison."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from validation.campaign.folder import Comparison as ComparisonSettings
from validation.poses.angles import Array, wrap
from validation.shown import Shown
from validation.statistics.comparison import Comparison
from validation.statistics.dependence import mean_of_stops
from validation.statistics.evaluation import Evaluation
from validation.statistics.standards.budget import Budget, Contribution, budget
from validation.statistics.standards.laboratories import Agreement, agreement, en_numbers
from validation.statistics.standards.repeats import PoseRepeats, pose_repeats, same_places
from validation.statistics.standards.success import Success, success
from validation.statistics.standards.tolerance import (
    NOT_NORMAL,
    FreeBound,
    Tolerance,
    free_bound,
    length_bound,
    normal_tolerance,
    normality_p_value,
)

CONTENT = 0.95
"""Share of errors that tolerance intervals hold, and probability of success that is asked for: the
one that certificates mostly state."""
NAN = float("nan")
_NO_BOUND = FreeBound(NAN, NAN, NAN)
ERRORS = "errors"
"""Data of the lines that are estimated from the errors."""
TOGETHER = "frame, mount and clock"
DEPENDENT = "neighbours in the table depend on each other"


@dataclass(frozen=True, repr=False)
class Standards(Shown):
    """Errors of one system as standards state them.

    Parameters
    ----------
    system : str
        Its name.
    content, confidence : float
        Share of the errors, and the confidence of all statements.
    tolerances : tuple of Tolerance
        Of each component, and of the length of the position error.
    success : Success
        A trial is a stop; it succeeds within both limits.
    limits : (float, float)
        Of position (m) and of every angle (rad).
    success_holds : bool
        Whether stops are independent trials, as far as the table shows.
    repeats : tuple of PoseRepeats
        Of places visited again.
    agreements : tuple of Agreement
        En numbers of each component; empty where uncertainties are not stated.
    budgets : tuple of Budget
        Of each component of the error of one pose.
    """

    system: str
    content: float
    confidence: float
    tolerances: tuple[Tolerance, ...]
    success: Success
    limits: tuple[float, float]
    success_holds: bool
    repeats: tuple[PoseRepeats, ...]
    agreements: tuple[Agreement, ...]
    budgets: tuple[Budget, ...]


def standards_of(
    evaluation: Evaluation,
    settings: ComparisonSettings | None = None,
    budgets: Sequence[Budget] = (),
    content: float = CONTENT,
) -> Standards:
    """A system's errors in the words of standards.

    Parameters
    ----------
    evaluation : Evaluation
        The errors, in the order in which the stops were visited.
    settings : validation.campaign.Comparison, optional
        Confidence, and the limits of position and angle that a stop must keep.
    budgets : sequence of Budget
        Where frame, mount and clock are told apart; otherwise they are one line.
    content : float
        Share of the errors that tolerance intervals hold.
    """
    settings = settings or ComparisonSettings()
    comparison, confidence = evaluation.comparison, settings.confidence
    limits = (settings.acceptable_bias_length, settings.acceptable_bias_angle)
    tolerances = _tolerances(evaluation, content, confidence)
    angles = np.array([one.kind == "angle" for one in comparison.components])
    good = comparison.distances <= limits[0]
    good &= (np.abs(comparison.errors[:, angles]) <= limits[1]).all(axis=1)
    numbers = _en_numbers(comparison)
    agreed = [
        agreement(one.name, numbers[:, column], comparison.ids)
        for column, one in enumerate(comparison.components)
    ]
    return Standards(
        evaluation.system,
        content,
        confidence,
        tolerances,
        success(len(good), int(good.sum()), confidence, content),
        limits,
        all(one.n_effective == one.n for one in tolerances),
        tuple(_repeats(comparison)),
        tuple(one for one in agreed if one is not None),
        tuple(budgets) or _budgets(evaluation, confidence),
    )


def _tolerances(evaluation: Evaluation, content: float, confidence: float) -> tuple[Tolerance, ...]:
    """Of each component, and of the length of the position."""
    comparison, statistics = evaluation.comparison, evaluation.statistics
    errors = comparison.errors.copy()
    for column, one in enumerate(statistics):
        if one.component.kind == "angle":
            errors[:, column] = one.mean + wrap(errors[:, column] - one.mean)
    found = [
        _tolerance(one.component.name, one.component.unit, values, content, confidence)
        for one, values in zip(statistics, errors.T, strict=True)
    ]
    lengths = [i for i, one in enumerate(statistics) if one.component.kind == "length"]
    if len(lengths) > 1:
        found.append(
            _position(
                comparison, errors[:, lengths], [found[i] for i in lengths], content, confidence
            )
        )
    return tuple(found)


def _worth(values: Array) -> tuple[float, str]:
    """Independent values that tell as much, NaN where that is not known, and why so few."""
    n = len(values)
    series = mean_of_stops(values)
    if series.method == "student" and not series.short:
        return float(n), ""
    if series.method == "dependent":
        return series.n_effective, f"{DEPENDENT}: counted as {series.n_effective:.1f} of {n}"
    if n < 2 or np.ptp(values) == 0:
        return float(n), "too few errors, or all the same"
    return NAN, f"does not hold: {DEPENDENT}, and the table is too short to count them"


def _tolerance(name: str, unit: str, values: Array, content: float, confidence: float) -> Tolerance:
    """Of one component."""
    n = len(values)
    effective, reason = _worth(values)
    mean, std = float(values.mean()), float(values.std(ddof=1)) if n > 1 else 0.0
    factor, low, high = NAN, NAN, NAN
    if np.isfinite(effective):
        factor, low, high = normal_tolerance(mean, std, n, effective, content, confidence)
    normality = normality_p_value(values)
    if normality < NOT_NORMAL:
        said = f"errors are not normal (p = {normality:.2g}): use the bound by order"
        reason = f"{reason}; {said}" if reason else said
    free = free_bound(np.abs(values), content, confidence) if effective == n else _NO_BOUND
    bound = max(abs(low), abs(high)) if np.isfinite(low) else NAN
    return Tolerance(name, unit, n, effective, factor, low, high, bound, free, normality, reason)


def _position(
    comparison: Comparison,
    errors: Array,
    parts: Sequence[Tolerance],
    content: float,
    confidence: float,
) -> Tolerance:
    """Of the length of the position error."""
    k, n = len(parts), len(errors)
    each = 1 - (1 - content) / k, 1 - (1 - confidence) / k
    effective = min((one.n_effective for one in parts), key=lambda v: -1 if np.isnan(v) else v)
    reason = next((one.reason for one in parts if one.reason), "")
    bound = NAN
    if np.isfinite(effective):
        means, stds = errors.mean(0), errors.std(0, ddof=1) if n > 1 else np.zeros(k)
        ends = [
            normal_tolerance(float(mean), float(std), n, one.n_effective, *each)
            for one, mean, std in zip(parts, means, stds, strict=True)
        ]
        bound = length_bound(means, *np.array([end[1:] for end in ends]).T)
    sizes = comparison.distances
    free = free_bound(sizes, content, confidence) if effective == n else _NO_BOUND
    normality = min(one.normality_p for one in parts)
    return Tolerance("position", "m", n, effective, NAN, NAN, bound, bound, free, normality, reason)


def _en_numbers(comparison: Comparison) -> Array:
    """(n, k) En numbers, NaN where one of the two states no uncertainty."""
    first, second = (
        np.sqrt(np.diagonal(one.covariances, axis1=1, axis2=2))
        for one in (comparison.validation, comparison.gt)
    )
    return en_numbers(comparison.errors, first, second)


def _repeats(comparison: Comparison) -> list[PoseRepeats]:
    """Of every place to which the robot came back with the same heading."""
    names = [one.name for one in comparison.components]
    lengths = [i for i, one in enumerate(comparison.components) if one.kind == "length"]
    if len(lengths) < 2:
        return []
    turn = next((names.index(one) for one in ("theta", "yaw") if one in names), None)
    poses, errors = comparison.validation.poses, comparison.errors
    headings = None if turn is None else poses[:, turn]
    return [
        # The system attains what the validation commands: minus the error.
        pose_repeats(
            -errors[rows][:, lengths],
            None if turn is None else -errors[rows, turn],
            comparison.ids[rows[0]],
        )
        for rows in same_places(poses[:, lengths], headings)
    ]


def _budgets(evaluation: Evaluation, confidence: float) -> tuple[Budget, ...]:
    """Of the error of one pose that is corrected for the mean: frame, mount and clock in one."""
    comparison = evaluation.comparison
    stated = np.diagonal(comparison.validation.covariances, axis1=1, axis2=2)
    found = []
    for column, one in enumerate(evaluation.statistics):
        if one.reason:
            continue
        worth, _ = _worth(comparison.errors[:, column])
        if np.isnan(worth):
            continue
        shared = Contribution(TOGETHER, one.std / np.sqrt(worth), max(worth - 1, 1), "A", ERRORS)
        lines, missing = noise_lines(stated[:, column], one.std**2, max(worth - 1, 1))
        unit = one.component.unit
        found.append(
            budget(
                one.component.name,
                unit,
                [lines[0], shared, *lines[1:]] if len(lines) > 1 else [shared, *lines],
                confidence,
                missing,
            )
        )
    return tuple(found)


def noise_lines(
    survey_variances: Array, variance: float, freedom: float
) -> tuple[list[Contribution], tuple[str, ...]]:
    """The lines of survey and noise, and what cannot be told apart.

    Parameters
    ----------
    survey_variances : (n,) array
        Stated of the validation poses; NaN where not stated.
    variance : float
        Of what the errors scatter by.
    freedom : float
        By which it is known.

    Returns
    -------
    lines : list of Contribution
        Survey and own noise; the scatter alone, with the survey in it, where that states nothing.
    missing : tuple of str
        'survey', then.
    """
    if not np.isfinite(survey_variances).all():
        name = "noise of system and survey"
        return [Contribution(name, float(np.sqrt(variance)), freedom, "A", ERRORS)], ("survey",)
    survey = float(survey_variances.mean())
    own = float(np.sqrt(max(variance - survey, 0.0)))
    return [
        Contribution("survey", float(np.sqrt(survey))),
        Contribution("own noise", own, freedom, "A", ERRORS),
    ], ()


def standards_json(one: Standards) -> Mapping[str, object]:
    """All numbers of a system, for scripts."""
    return {
        "content": one.content,
        "confidence": one.confidence,
        "tolerance": {
            part.name: {**part._asdict(), "free": part.free._asdict()} for part in one.tolerances
        },
        "success": {
            **one.success._asdict(),
            "limit_position_m": one.limits[0],
            "limit_angle_rad": one.limits[1],
            "holds": one.success_holds,
        },
        "repeats": [{**part._asdict(), "enough": part.enough} for part in one.repeats],
        "en_numbers": {part.name: part._asdict() for part in one.agreements},
        "budget": {
            part.name: {
                **part._asdict(),
                "contributions": [line._asdict() for line in part.contributions],
            }
            for part in one.budgets
        },
    }
