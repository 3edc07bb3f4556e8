"""A whole run: solve what the campaign has data for, compare, and write the results."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from validation.campaign.folder import Campaign
from validation.campaign.provenance import input_hashes, relative
from validation.campaign.toml_files import line_of
from validation.errors import FaultyResultError, GtvalError, InputError, Problem
from validation.explain.telling.folded import folded
from validation.explain.telling.section import ExplainParts, explain_campaign
from validation.explain.telling.sizes import told_once
from validation.in_time import TimeParts, time_parts
from validation.pieces.processes import give_back_memory, shared_processes
from validation.poses.pose_table import SPATIAL, PoseTable
from validation.published.systems import published_systems
from validation.results import AS_PUBLISHED, VALIDATION_SYSTEM, Finding, Section, SystemResult
from validation.shown import Shown
from validation.solving import (
    SolvedSystem,
    failed_system,
    joined,
    not_written,
    solve_system,
    solved_system,
    starts_from_survey,
    unexpected,
)
from validation.statements import Statements, make_statements
from validation.statistics.conclusions import conclusions
from validation.statistics.error_statistics import IntervalMethod
from validation.statistics.evaluation import Evaluation, evaluate
from validation.statistics.result_files import errors_csv, statistics_csv
from validation.systems import Progress, System, installed_systems, needed_inputs, no_progress
from validation.text_files.writing import Content


@dataclass(frozen=True, repr=False)
class RunResult(Shown):
    """All that a run found.

    Parameters
    ----------
    campaign : Campaign
        What was run.
    systems : tuple of SolvedSystem
        The survey first; published tables come as systems too.
    evaluations : tuple of Evaluation
        Each table compared with the validation poses.
    findings : tuple of Finding
        Of the systems and of the comparisons, in the order found.
    inputs : mapping of str to str
        SHA-256 of each input file.
    method : {"student", "normal"}
        Of the intervals of the mean.
    explained : ExplainParts, optional
        Where the errors come from; None where there is nothing to explain.
    in_time : TimeParts, optional
        The trajectories compared in time; None where there are not two.
    failures : tuple of SystemResult
        What stands in for analyses that failed unexpectedly; of systems, see ``systems``.
    comparison_files : mapping of str to str or bytes
        Errors, statistics and statements, by names relative to results/.
    statements : Statements
        What may be claimed: of two systems, of printed statistics, of conclusions.
    """

    campaign: Campaign
    systems: tuple[SolvedSystem, ...]
    evaluations: tuple[Evaluation, ...]
    findings: tuple[Finding, ...]
    inputs: Mapping[str, str]
    method: IntervalMethod
    explained: ExplainParts | None = None
    in_time: TimeParts | None = None
    failures: tuple[SystemResult, ...] = ()
    comparison_files: Mapping[str, Content] = field(default_factory=dict, repr=False)
    statements: Statements = field(default_factory=Statements, repr=False)

    def with_failures(self, failures: Iterable[SystemResult]) -> "RunResult":
        """The run with what stands in for parts of its report that could not be made."""
        new = tuple(failures)
        more = tuple(finding for failure in new for finding in failure.findings)
        return replace(self, failures=self.failures + new, findings=self.findings + more)

    @property
    def failed(self) -> bool:
        """Whether a part of the run failed unexpectedly."""
        return bool(self.failures) or any(system.failed for system in self.systems)

    @property
    def tables(self) -> tuple[PoseTable, ...]:
        """Poses of all systems, the validation poses first."""
        return tuple(table for system in self.systems for table in system.result.tables)

    @property
    def validation(self) -> PoseTable | None:
        """The validation poses; None if the campaign has none."""
        return next((table for table in self.tables if table.system == VALIDATION_SYSTEM), None)

    @property
    def sections(self) -> tuple[Section, ...]:
        """The systems' own sections of the report."""
        return tuple(section for system in self.systems for section in system.result.sections)

    @property
    def landmarks(self) -> dict[str, tuple[float, float]]:
        """Named points of the room map, in the GTV frame."""
        return {
            name: point
            for system in self.systems
            for name, point in system.result.landmarks.items()
        }

    @property
    def validation_is_faulty(self) -> bool:
        """Whether the survey itself found errors, so that no number may be used yet."""
        return any(
            finding.severity == "error"
            for system in self.systems
            if system.name == VALIDATION_SYSTEM
            for finding in system.result.findings
        )


def run_campaign(
    campaign: Campaign, progress: Progress = no_progress, method: IntervalMethod = "student"
) -> RunResult:
    """What all installed systems make of a campaign, compared with the survey.

    Parameters
    ----------
    campaign : Campaign
        The folder and its settings.
    progress : callable
        Called with what is being done and the share done.
    method : {"student", "normal"}
        Of the intervals of the mean.

    Raises
    ------
    GtvalError
        If any data are bad, with the faults of all systems at once; if there is nothing to
        run; if published poses have the name of a system.
    """
    with shared_processes():
        systems = _solve_all(campaign, progress)
    progress("comparing", 0.9)
    findings = [finding for system in systems for finding in system.result.findings]
    evaluations, more, failures = _evaluate_all(campaign, systems, method)
    findings += more
    comparison_files: dict[str, Content] = {}
    try:
        comparison_files = _comparison_files(campaign, evaluations)
    except Exception as error:  # noqa: BLE001  (the poses stand without them)
        failures.append(unexpected(COMPARISON, error))
    progress("explaining", 0.93)
    explained, more = None, []
    try:
        explained, more = _explain(campaign, systems, evaluations)
    except GtvalError:
        raise
    except Exception as error:  # noqa: BLE001  (what is compared stands without its explanation)
        failures.append(unexpected(EXPLANATION, error))
    findings = told_once(
        [*findings, *more], evaluations, explained.explanation if explained else None
    )
    progress("comparing in time", 0.94)
    in_time = None
    try:
        moving = [one for system in systems for one in system.result.trajectories]
        in_time = time_parts(campaign, moving)
    except GtvalError:
        raise
    except Exception as error:  # noqa: BLE001  (what is compared at stops stands without it)
        failures.append(unexpected(IN_TIME, error))
    findings += in_time.findings if in_time is not None else ()
    statements = Statements()
    told = explained.explanation if explained is not None else None
    own = {table.system: one.result.findings for one in systems for table in one.result.tables}
    try:
        statements = make_statements(campaign, evaluations, findings, told)
        comparison_files |= statements.files
    except GtvalError:
        raise
    except Exception as error:  # noqa: BLE001  (the rest stands without them)
        failures.append(unexpected(STATEMENTS, error))
    findings += statements.findings
    findings += [finding for failure in failures for finding in failure.findings]
    give_back_memory()
    progress("hashing the inputs", 0.95)
    inputs = input_hashes(campaign.folder)
    progress("done", 1.0)
    return RunResult(
        campaign=campaign,
        systems=tuple(systems),
        evaluations=tuple(evaluations),
        findings=tuple(folded(findings, own, told)),
        inputs=inputs,
        method=method,
        explained=explained,
        in_time=in_time,
        failures=tuple(failures),
        comparison_files=comparison_files,
        statements=statements,
    )


def _explain(
    campaign: Campaign, systems: Iterable[SolvedSystem], evaluations: Iterable[Evaluation]
) -> tuple[ExplainParts | None, list[Finding]]:
    """Where the errors come from; a table that cannot be explained is a finding, not a failure.

    Raises
    ------
    InputError
        If the table [explain] of campaign.toml or a file it names is bad.
    """
    compared = {VALIDATION_SYSTEM, *(evaluation.system for evaluation in evaluations)}
    tables = [
        table
        for system in systems
        for table in system.result.tables
        if table.system in compared and not table.system.endswith(AS_PUBLISHED)
    ]
    if len(tables) < 2:
        return None, []
    try:
        parts = explain_campaign(campaign, tables)
    except InputError:
        raise
    except GtvalError as error:
        return None, [Finding("warning", f"Not explained: {error}", "explain", "not_explained")]
    return parts, list(parts.findings)


def _solve_all(campaign: Campaign, progress: Progress) -> list[SolvedSystem]:
    """Every system with data, then the published tables."""
    faults: list[GtvalError] = []
    solved: list[SolvedSystem] = []
    wanted = _with_data(campaign, solved, faults)
    if absent := _without_files(campaign, wanted, solved):
        faults.append(InputError(absent))
    for number, system in enumerate(wanted):
        known = replace(campaign, solved={before.name: before.result for before in solved})
        start, width = 0.9 * number / len(wanted), 0.9 / len(wanted)

        def report(what: str, share: float, start: float = start, width: float = width) -> None:
            progress(what, start + width * share)

        report(system.name, 0.0)
        try:
            solved.append(_apart(solve_system(known, system, report), solved))
        except GtvalError as error:
            if lost := _without_survey(system, solved, error):
                solved.append(lost)
            else:
                faults.append(error)
    try:
        tables = (table for system in solved for table in system.result.tables)
        validation = next((one for one in tables if one.system == VALIDATION_SYSTEM), None)
        for name, result in published_systems(campaign, validation).items():
            faults += _add_published(campaign, solved_system(name, result), solved)
    except GtvalError as error:
        faults.append(error)
    except Exception as error:  # noqa: BLE001  (the systems' poses are there)
        solved.append(failed_system("published", error))
    _raise_together(faults, solved)
    if not solved:
        said = (
            "the campaign holds no data for any installed system; looked for "
            f"{_missing_files(campaign, installed_systems())}. Put what you have there, or name a "
            f"table of poses under [[published]] in {campaign.toml.name}"
        )
        raise InputError([Problem(campaign.folder, said)])
    return solved


def _add_published(
    campaign: Campaign, published: SolvedSystem, solved: list[SolvedSystem]
) -> list[GtvalError]:
    """Add published poses to what is solved; the problem where a system has such poses."""
    name = published.name
    own = next((one for one in solved if one.name == name and not one.result.tables), None)
    if own is not None and not own.failed:  # no poses, but something to say of what was printed
        solved[solved.index(own)] = joined(own, published)
        return []
    twice = _apart(published, solved) is not published
    solved.append(published)
    said = "poses of this system come twice; rename one"
    problem = Problem(campaign.toml, said, None, "published", name)
    return [InputError([problem])] if twice else []


def _apart(system: SolvedSystem, others: Iterable[SolvedSystem]) -> SolvedSystem:
    """The system, or that it failed where it writes a file of another: its poses, say."""
    owners = {file: other.name for other in others for file in other.files}
    twice = next((file for file in system.files if file in owners), None)
    if twice is None:
        return system
    said = f"'{system.name}' and '{owners[twice]}' both write results/{twice}"
    return failed_system(system.name, FaultyResultError(said))


def _without_files(
    campaign: Campaign, wanted: Iterable[System], failed: Iterable[SolvedSystem]
) -> list[Problem]:
    """A problem for each system that campaign.toml has a table of, and whose files are missing."""
    there = {system.name for system in wanted} | {system.name for system in failed}
    return [
        Problem(
            campaign.toml,
            f"there is a table [{system.name}], but the files that this system starts from are "
            f"missing ({_missing_files(campaign, [system])}); put them there, or take the table "
            "out",
            line_of(campaign.toml, (system.name,)),
            system.name,
        )
        for system in installed_systems()
        if system.name in campaign.extra and system.name not in there
    ]


def _missing_files(campaign: Campaign, systems: Iterable[System]) -> str:
    """Files that systems would read and that are not there, as a list in words."""
    places = {
        relative(path, campaign.folder)
        for system in systems
        for path in needed_inputs(system, campaign)
        if not path.exists()
    }
    return ", ".join(sorted(places)) or "what it reads"


def _with_data(
    campaign: Campaign, solved: list[SolvedSystem], faults: list[GtvalError]
) -> list[System]:
    """The installed systems that have data; what goes wrong is added to what is solved and bad."""
    wanted: list[System] = []
    for system in installed_systems():
        try:
            wanted += [system] if system.has_data(campaign) else []
        except GtvalError as error:
            faults.append(error)
        except Exception as error:  # noqa: BLE001  (one system must not take the others)
            solved.append(failed_system(system.name, error))
    return wanted


def _without_survey(
    system: System, solved: Iterable[SolvedSystem], error: GtvalError
) -> SolvedSystem | None:
    """What stands in for a system that cannot start, as the survey failed; None where it did not.

    The survey's failure comes first and leaves its traceback; this is only what follows from it.
    """
    survey = next((one for one in solved if one.name == VALIDATION_SYSTEM), None)
    bad = isinstance(error, InputError) or not starts_from_survey(system)
    if survey is None or not survey.failed or bad:
        return None
    text = (
        f"'{system.name}' starts from surveyed stops and gives no result, as '{survey.name}' "
        f"failed: mend that first. ({error})"
    )
    result = SystemResult(findings=[Finding("error", text, system.name, "without_survey")])
    return SolvedSystem(system.name, result, {}, failed=True)


def _raise_together(faults: list[GtvalError], solved: Iterable[SolvedSystem]) -> None:
    """Raise what went wrong in all systems as one error, what failed unexpectedly first."""
    if not faults:
        return
    faults = [*(GtvalError(not_written(one)) for one in solved if one.failed), *faults]
    if all(isinstance(fault, InputError) for fault in faults):
        # The same shared file may have been found bad by several systems.
        problems = {
            problem: None
            for fault in faults
            if isinstance(fault, InputError)
            for problem in fault.problems
        }
        raise InputError(problems)
    raise GtvalError("\n".join(str(fault) for fault in faults))


def _evaluate_all(
    campaign: Campaign, systems: Iterable[SolvedSystem], method: IntervalMethod
) -> tuple[list[Evaluation], list[Finding], list[SystemResult]]:
    """Each table compared with the validation poses, what follows in words, and what failed."""
    tables = [table for system in systems for table in system.result.tables]
    validation = next((table for table in tables if table.system == VALIDATION_SYSTEM), None)
    if validation is None:
        return [], [_no_validation(tables)], []
    evaluations: list[Evaluation] = []
    findings: list[Finding] = []
    failures: list[SystemResult] = []
    settings = campaign.settings.comparison
    for table in tables:
        if table.system == VALIDATION_SYSTEM:
            continue
        try:
            evaluation = evaluate(validation, table, settings, method)
            findings += conclusions(evaluation)
            evaluations.append(evaluation)
        except GtvalError as error:
            text = f"Not compared with the validation poses: {error}"
            findings.append(Finding("error", text, table.system, "not_comparable"))
        except Exception as error:  # noqa: BLE001  (one table must not take the others)
            failures.append(unexpected(f"comparison of {table.system}", error))
    _refuse_other_units(campaign, findings)
    return evaluations, findings, failures


def _refuse_other_units(campaign: Campaign, findings: Iterable[Finding]) -> None:
    """Raise where the file of a published system is in another unit than metres."""
    files = {one.system: campaign.folder / one.file for one in campaign.settings.published}
    problems = [
        Problem(files[one.subject], one.text)
        for one in findings
        if one.code == "unit" and one.subject in files
    ]
    if problems:
        raise InputError(problems)


def _no_validation(tables: Iterable[PoseTable]) -> Finding:
    """What it means that nothing could be compared: less for a path outdoors than for stops."""
    text = "There are no validation poses, so nothing could be compared."
    if all(table.components == SPATIAL for table in tables):
        text += " What is said of these poses rests on their system's own checks."
        return Finding("note", text, VALIDATION_SYSTEM, "no_validation")
    return Finding("warning", text + " Survey the stops.", VALIDATION_SYSTEM, "no_validation")


COMPARISON, EXPLANATION, IN_TIME, STATEMENTS = "comparison", "explain", "time", "statements"
"""Steps of a run besides the systems."""


def _comparison_files(campaign: Campaign, evaluations: Sequence[Evaluation]) -> dict[str, Content]:
    """Errors and statistics of all systems; nothing where nothing was compared."""
    if not evaluations:
        return {}
    confidence = campaign.settings.comparison.confidence
    return {
        "errors.csv": errors_csv(evaluations),
        "statistics.csv": statistics_csv(evaluations, confidence),
    }
