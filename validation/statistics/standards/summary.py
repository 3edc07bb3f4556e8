"""A system's errors in the words of standards: all of it for one comparison."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from validation.campaign.folder import Comparison as ComparisonSettings
from validation.poses.angles import Array
from validation.shown import Shown
from validation.statistics.comparison import Comparison
from validation.statistics.evaluation import Evaluation
from validation.statistics.standards.budget import Budget, Contribution, budget
from validation.statistics.standards.from_errors import Errors, errors_of, tolerances
from validation.statistics.standards.laboratories import Agreement, agreement, en_numbers
from validation.statistics.standards.repeats import PoseRepeats, pose_repeats, same_places
from validation.statistics.standards.success import Success, success
from validation.statistics.standards.tolerance import Tolerance

CONTENT = 0.95
"""Share of errors that tolerance intervals hold, and probability of success that is asked for: the
one that certificates mostly state."""
ERRORS = "errors"
"""Data of the lines that are estimated from the errors."""
TOGETHER = "frame, mount and clock"


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
        A trial is a stop; it succeeds within both limits. Its bound is NaN where it does not hold.
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
    errors = errors_of(evaluation)
    independent = all(one.independent for one in errors)
    angles = np.array([one.kind == "angle" for one in comparison.components])
    good = comparison.distances <= limits[0]
    good &= (np.abs(comparison.errors[:, angles]) <= limits[1]).all(axis=1)
    done = success(len(good), int(good.sum()), confidence, content)
    numbers = _en_numbers(comparison)
    agreed = [
        agreement(one.name, numbers[:, column], comparison.ids)
        for column, one in enumerate(comparison.components)
    ]
    return Standards(
        evaluation.system,
        content,
        confidence,
        tuple(tolerances(errors, content, confidence)),
        done if independent else done._replace(low=float("nan")),
        limits,
        independent,
        tuple(_repeats(comparison)),
        tuple(one for one in agreed if one is not None),
        tuple(budgets) or _budgets(comparison, errors, confidence),
    )


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


def _budgets(
    comparison: Comparison, errors: Sequence[Errors], confidence: float
) -> tuple[Budget, ...]:
    """Of the error of one pose that is corrected for the mean: frame, mount and clock in one."""
    stated = np.diagonal(comparison.validation.covariances, axis1=1, axis2=2)
    found = []
    for column, one in enumerate(errors):
        # NaN, where nobody knows how many errors these are worth, is no number above one.
        if not one.effective > 1 or one.std == 0:
            continue
        freedom = max(one.effective - 1, 1.0)
        mean = one.std / np.sqrt(one.effective)
        shared = Contribution(TOGETHER, mean, freedom, "A", ERRORS)
        lines, missing = noise_lines(stated[:, column], one.std**2, freedom)
        every = [*lines[:-1], shared, lines[-1]]
        name, unit = one.component.name, one.component.unit
        found.append(budget(name, unit, every, confidence, missing))
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
