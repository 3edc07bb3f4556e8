"""Findings in words, made from the numbers of an evaluation and from nothing else."""

import numpy as np

from validation.results import Finding, Severity, Size, listed_ids
from validation.statistics.comparison import Comparison
from validation.statistics.consistency import ConsistencyTest
from validation.statistics.error_statistics import (
    ComponentStatistics,
    by_magnitude,
    two_sided_quantile,
)
from validation.statistics.evaluation import Evaluation
from validation.statistics.neighbours import RATE
from validation.statistics.units import unit_of_points


def conclusions(evaluation: Evaluation) -> list[Finding]:
    """What a reader should take from a system's errors: bias, consistency, coverage, extremes."""
    comparison = evaluation.comparison
    return [
        *_units(comparison),
        *_left_out(comparison),
        *(
            _bias(statistics, float(stated), evaluation.system)
            for statistics, stated in zip(
                evaluation.statistics, comparison.mean_sigmas, strict=True
            )
            if statistics.component.name not in comparison.constructed_means
        ),
        *_constructed_means(evaluation),
        *_neighbours(evaluation),
        _consistency(comparison),
        _coverage(comparison),
        _largest(evaluation),
        *_zero_errors(comparison),
    ]


def _left_out(comparison: Comparison) -> list[Finding]:
    """What only one of the two tables knows."""
    if not comparison.left_out:
        return []
    text = f"Compared is what both tables have; left out: {', '.join(comparison.left_out)}."
    count = Size("components left out", len(comparison.left_out), "components")
    return [Finding("note", text, comparison.system, "components_left_out", (count,))]


def _units(comparison: Comparison) -> list[Finding]:
    """Whether one of the two tables is in another unit than metres."""
    lengths = [component.kind == "length" for component in comparison.components]
    gt, validation = (one.poses[:, lengths] for one in (comparison.gt, comparison.validation))
    own, other = unit_of_points(gt, validation), unit_of_points(validation, gt)
    if not (own or other):
        return []
    whose = "this system" if own else "the validation"
    text = f"Write the positions of {whose} in metres: they are in {own or other}."
    return [Finding("error", text, comparison.system, "unit")]


def _neighbours(evaluation: Evaluation) -> list[Finding]:
    """Whether errors depend on their neighbours, and what that does to the intervals."""
    told = evaluation.neighbours
    if told is None or not told.dependent:
        return []
    widened = [one for one in evaluation.statistics if one.method == "dependent"]
    text = (
        f"Errors depend on those of their neighbours in the order of the stops: {told.words}. "
        f"{RATE}."
    )
    if told.withheld:
        text += (
            " These stops are too few correlation lengths to tell a mean error from what lasts: "
            "no interval is given. Repeat stops at another time, in another order."
        )
    elif widened:
        said = ", ".join(f"{one.component.name} {one.effective:.2g}" for one in widened)
        text += (
            f" The {len(evaluation.comparison)} stops tell a mean as well as so many "
            f"independent ones: {said}. Intervals and tests allow for that."
        )
    alike = tuple(
        Size(f"correlation of neighbouring {name}", one.neighbours)
        for name, (one, _) in told.kinds.items()
    )
    return [Finding("warning", text, evaluation.system, "dependent_errors", alike)]


def interval_name(statistics: ComponentStatistics) -> str:
    """How the interval of the mean was found, in words: '95 % interval, Student's t, n = 20'."""
    named = {
        "student": "Student's t",
        "normal": "normal",
        "dependent": "wider than Student's t, as neighbours depend on each other",
    }[statistics.method]
    return f"{100 * statistics.confidence:.3g} % interval, {named}, n = {statistics.n}"


def _bias(statistics: ComponentStatistics, stated: float, system: str) -> Finding:
    """Whether there is a bias, and below what it is.

    ``stated`` is the standard deviation of the mean by the stated covariances, or NaN.
    """
    name, unit = statistics.component.name, statistics.component.unit
    ends = statistics.ci_low, statistics.ci_high
    size = Size(f"mean error in {name}", statistics.mean, unit, *ends, statistics.confidence)
    if statistics.reason:
        text = (
            f"The bias in {name} cannot be judged: {statistics.reason} (n = {statistics.n}). "
            "Survey more stops."
        )
        return Finding("warning", text, system, "bias_unknown", (size,))
    measured = (
        f"{statistics.mean:+.4f} {unit} ({interval_name(statistics)}: "
        f"{statistics.ci_low:+.4f} to {statistics.ci_high:+.4f} {unit})"
    )
    significant, bias = statistics.bias_is_significant, statistics.bias
    first = (
        f"There is a bias in {name}: {measured}."
        if significant
        else f"No bias in {name} is shown: the interval of the mean contains zero, {measured}."
    )
    share = f"{100 * bias.confidence:.3g} % confidence"
    if bias.holds:
        p_value = f"p = {bias.p_value:.2g}" if bias.p_value >= 0.001 else "p < 0.001"
        second = f"It is below {bias.limit:g} {unit} with {share} ({p_value})."
    else:
        second = (
            f"It cannot be claimed with {share} that it is below {bias.limit:g} {unit}, only that "
            f"it is below {bias.smallest_limit:.4f} {unit}."
        )
    severity: Severity = "note" if bias.holds or not significant else "warning"
    if bias.holds and not significant:
        severity = "good"
    code = "bias" if significant else "no_bias_shown"
    if significant and abs(statistics.mean) <= two_sided_quantile(statistics.confidence) * stated:
        severity, code = "note", "bias_within_stated"
        second += (
            f" The stated covariances allow a mean of this size (its standard deviation is "
            f"{stated:.4f} {unit}): it may be an error that all validation poses share, such as "
            "one of the Vframe, and not an error of the system."
        )
    return Finding(severity, f"{first} {second}", system, code, (size,))


def _constructed_means(evaluation: Evaluation) -> list[Finding]:
    """Means that say nothing, as the survey has placed the frame by the same stops."""
    comparison = evaluation.comparison
    names, follows = comparison.constructed_means, comparison.follows
    if not names or follows is None:
        return []
    found = {one.component.name: one for one in evaluation.statistics}
    said = ", ".join(
        f"{name} {1e3 * found[name].mean:+.2f} m{found[name].component.unit}" for name in names
    )
    text = (
        f"The mean error is next to zero by construction in {', '.join(names)} (it is {said}): the "
        f"{follows.what} of {comparison.system} came from {len(follows.ids)} surveyed stops. It "
        "says nothing about a bias; stops that took no part would."
    )
    means = tuple(
        Size(f"mean error in {name}", found[name].mean, found[name].component.unit)
        for name in names
    )
    return [Finding("note", text, comparison.system, "mean_by_construction", means)]


def nees_size(test: ConsistencyTest) -> Size:
    """Mean square of the errors over the stated one; its interval holds 1 where they agree."""
    mean, expected = test.mean, test.interval
    ratio, low, high = mean / test.per_pose, mean / expected.high, mean / expected.low
    return Size("mean square over the stated one", ratio, "", low, high, test.confidence)


def measured_nees(test: ConsistencyTest) -> str:
    """The mean NEES with the interval in which it should fall."""
    return (
        f"mean NEES {test.mean:.2f} of {test.poses} poses, expected {test.per_pose:.3g}, "
        f"{100 * test.confidence:.3g} % interval {test.interval.low:.2f} to "
        f"{test.interval.high:.2f} ({test.method})"
    )


def _consistency(comparison: Comparison) -> Finding:
    """Whether the errors fit the stated covariances, and in which direction they do not."""
    test = comparison.test
    if test is None:
        text = (
            f"Normalised errors are not available: {comparison.unavailable}. Whether the errors "
            "fit the stated uncertainty cannot be told."
        )
        return Finding("note", text, comparison.system, "nees_unavailable")
    measured, size = measured_nees(test), (nees_size(test),)
    part = f" Left out: {comparison.unavailable}." if comparison.unavailable else ""
    if test.verdict == "above":
        text = (
            f"The errors are larger than the stated covariances allow: {measured}. The "
            "covariances are too small, or there is a systematic error."
        )
        return Finding("warning", text + part, comparison.system, "nees_above", size)
    if test.verdict == "below":
        text = (
            f"The errors are smaller than the stated covariances say: {measured}. The covariances "
            "are too large, or both systems share errors."
        )
        return Finding("note", text + part, comparison.system, "nees_below", size)
    text = f"The errors fit the stated covariances: {measured}."
    return Finding("good", text + part, comparison.system, "nees_inside", size)


def _coverage(comparison: Comparison) -> Finding:
    """How many of the validation poses the system gave."""
    n, missing = len(comparison), comparison.missing_in_gt
    total = n + len(missing)
    extra = comparison.missing_in_validation
    also = (
        f" It gave {len(extra)} without a validation pose, which are not judged: "
        f"{listed_ids(extra)}."
        if extra
        else ""
    )
    lost = Size("poses missing", len(missing), "poses")
    if not missing:
        text = f"There is a pose for each of the {total} validation poses.{also}"
        return Finding("good", text, comparison.system, "coverage", (lost,))
    text = (
        f"Poses were given for {n} of the {total} validation poses; missing: "
        f"{listed_ids(missing)}.{also} The statistics hold only for those given."
    )
    return Finding("note", text, comparison.system, "coverage", (lost,))


def _largest(evaluation: Evaluation) -> Finding:
    """The largest error of each component, and at which pose."""
    comparison = evaluation.comparison
    first = by_magnitude(comparison.errors)[0]
    said = [
        f"{component.name} {comparison.errors[row, column]:+.4f} {component.unit} at pose "
        f"{comparison.ids[row]}"
        for column, (component, row) in enumerate(zip(comparison.components, first, strict=True))
    ]
    text = f"The largest errors: {', '.join(said)}."
    sizes = tuple(
        Size(f"largest error in {one.name}", float(comparison.errors[row, column]), one.unit)
        for column, (one, row) in enumerate(zip(comparison.components, first, strict=True))
    )
    return Finding("note", text, comparison.system, "largest_errors", sizes)


def almost_zero(comparison: Comparison) -> tuple[str, ...]:
    """Poses whose every error is next to nothing: most likely taken over from the validation.

    Next to nothing is a hundredth of the component's median error. Of normal errors 0.5 % are
    as small, so that all three components are by chance in one pose of ten million. Exactly
    zero is too strict: a table printed with fewer digits differs in the last one.
    """
    sizes = np.abs(comparison.errors)
    rows = np.flatnonzero((sizes <= 0.01 * np.median(sizes, axis=0)).all(axis=1))
    return tuple(comparison.ids[row] for row in rows) if len(comparison) >= 3 else ()


def _zero_errors(comparison: Comparison) -> list[Finding]:
    """What it means that poses were probably taken over."""
    poses = almost_zero(comparison)
    if not poses:
        return []
    text = (
        f"The errors of pose {listed_ids(poses)} are zero or almost zero in every component. "
        "Such a pose was "
        "probably taken over from the validation, as the reference of a frame is. It is counted in "
        "the statistics and makes them look better than they are."
    )
    count = Size("poses with next to no error", len(poses), "poses")
    return [Finding("note", text, comparison.system, "zero_error", (count,))]
