"""Errors of a ground truth, where they come from, and how a notebook shows both."""

from collections.abc import Iterable, Mapping, Sequence

from gtval.arguments import said_plainly
from gtval.tables import PoseTable
from validation.campaign.folder import Comparison as ComparisonSettings
from validation.explain.analysis import Explanation, Question
from validation.explain.analysis import explain as explain_tables
from validation.explain.telling.tables import (
    before_after_table,
    parameter_table,
    suspect_table,
    verdict_table,
)
from validation.explain.telling.words import findings as explanation_findings
from validation.report.evaluation_tables import pose_table, statistics_table
from validation.report.html import html_blocks
from validation.results import Finding, Table
from validation.shown import html_of
from validation.statistics.conclusions import conclusions
from validation.statistics.evaluation import Evaluation, evaluate

__all__ = ["Evaluation", "Explanation", "compare", "explain", "findings"]


@said_plainly
def compare(
    validation: PoseTable,
    gt: PoseTable,
    *,
    acceptable_bias: tuple[float, float] = (0.05, 0.05),
    confidence: float = 0.95,
) -> Evaluation:
    """The errors of a ground truth, validation minus GT, and their statistics.

    Parameters
    ----------
    validation : PoseTable
        What is taken as true.
    gt : PoseTable
        The system under test, in the same frame; its stops are paired by their names.
    acceptable_bias : (float, float)
        The d of 'the bias is below d': of lengths in metres, of angles in radians.
    confidence : float
        Of all intervals.

    Returns
    -------
    Evaluation
        ``comparison`` has the errors stop by stop, ``statistics`` each component's.

    Raises
    ------
    GtvalError
        If the tables have other components, or no stop in common.

    Notes
    -----
    AD2.3, tables "valid - GTvis" and "valid - SICK".

    Examples
    --------
    >>> survey = gtval.pose_table("survey", [[0.0, 0.0, 0.0], [1.0, 0.5, 1.6], [2.0, 1.0, 3.1]])
    >>> rig = gtval.pose_table("rig", survey.poses + [0.1, 0.0, 0.0])
    >>> errors = gtval.compare(survey, rig)
    >>> round(errors.statistics[0].mean, 6)
    -0.1
    """
    length, angle = acceptable_bias
    settings = ComparisonSettings(
        acceptable_bias_length=length, acceptable_bias_angle=angle, confidence=confidence
    )
    return evaluate(validation, gt, settings)


@said_plainly
def explain(
    validation: PoseTable,
    systems: PoseTable | Sequence[PoseTable],
    *,
    references: Mapping[str, str] | None = None,
    sensors: Mapping[str, Sequence[str]] | None = None,
    times: Mapping[str, float] | None = None,
    witnesses: Sequence[PoseTable] = (),
    confidence: float = 0.95,
) -> Explanation:
    """Where the errors of ground truths come from: a mount, a frame, a few wrong poses, and whose.

    Parameters
    ----------
    validation : PoseTable
        The validation poses, planar.
    systems : PoseTable or sequence of PoseTable
        The ground truths.
    references : mapping of str to str, optional
        The stop whose validation pose tied a system to the GTV frame; '?' where one did and it is
        not known which.
    sensors : mapping of str to sequence of str, optional
        Systems that share a sensor, by the sensor's name.
    times : mapping of str to float, optional
        Seconds at which a moving robot was at each stop: a time offset can then show.
    witnesses : sequence of PoseTable
        Rough poses from elsewhere that only help to decide who is wrong.
    confidence : float
        Of all intervals.

    Raises
    ------
    GtvalError
        If the tables are not planar or share no stop, or a name does not exist.

    Examples
    --------
    >>> room = gtval.testing.make_room(folder, seed=2, bias=(0.1, 0.0, 0.0))
    >>> survey, rig = gtval.run_campaign(folder).tables
    >>> gtval.explain(survey, rig).system("example_gt").name
    'frame'
    """
    tables = [systems] if isinstance(systems, PoseTable) else systems
    question = Question(references or {}, sensors or {}, times, witnesses, confidence=confidence)
    return explain_tables(validation, tables, question)


@said_plainly
def findings(result: Evaluation | Explanation) -> tuple[Finding, ...]:
    """What a person should take from errors or from their explanation, in sentences.

    Parameters
    ----------
    result : Evaluation or Explanation
        Of `compare` or `explain`. A run has its ``findings`` itself.

    Examples
    --------
    >>> room = gtval.testing.make_room(folder, seed=2, bias=(0.1, 0.0, 0.0))
    >>> survey, rig = gtval.run_campaign(folder).tables
    >>> gtval.findings(gtval.compare(survey, rig))[0].code
    'bias'
    """
    if isinstance(result, Evaluation):
        return tuple(conclusions(result))
    return tuple(explanation_findings(result))


def findings_table(found: Iterable[Finding]) -> Table:
    """Findings as a table."""
    rows = [[one.severity, one.subject, one.text] for one in found]
    return Table("Findings", ["severity", "about", "finding"], rows)


@html_of.register
def _(result: Evaluation) -> str:
    """Statistics, then every pose."""
    return html_blocks([statistics_table(result), pose_table(result.comparison)], "errors")


@html_of.register
def _(result: Explanation) -> str:
    """In sentences; then what was fitted, what it changes, and the poses that do not fit."""
    confidence = result.question.confidence
    fitted = [one for one in result.systems if one.settled and one.settled.fit.model.fitted]
    tables = [
        findings_table(findings(result)),
        *(parameter_table(one, confidence) for one in fitted),
        before_after_table(result.systems),
        verdict_table(result),
        suspect_table(result),
    ]
    return html_blocks([one for one in tables if one is not None and one.rows], "explanation")
