"""A whole run: solve what the campaign has data for, compare, and write the results."""

import contextlib
import json
import platform
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from validation.campaign import Campaign
from validation.conclusions import conclusions
from validation.errors import GtvalError, InputError, Problem
from validation.evaluation import Evaluation, evaluate
from validation.explain.section import ExplainParts, explain_campaign
from validation.files import write_files
from validation.inputs import input_hashes
from validation.json_text import json_text
from validation.poses import SPATIAL, PoseTable
from validation.published import published_tables
from validation.result_files import errors_csv, merged, pose_files, statistics_csv
from validation.results import Finding, Section, SystemResult
from validation.statistics import IntervalMethod
from validation.systems import VALIDATION_SYSTEM, Progress, installed_systems, no_progress

LIBRARIES = ("numpy", "scipy", "opencv-contrib-python-headless", "filterpy", "kiss-icp")


@dataclass(frozen=True)
class SolvedSystem:
    """What one system made of the campaign."""

    name: str
    result: SystemResult


@dataclass(frozen=True)
class RunResult:
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
    """

    campaign: Campaign
    systems: tuple[SolvedSystem, ...]
    evaluations: tuple[Evaluation, ...]
    findings: tuple[Finding, ...]
    inputs: Mapping[str, str]
    method: IntervalMethod
    explained: ExplainParts | None = None

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
        run; if two systems give poses of the same name.
    """
    systems = _solve_all(campaign, progress)
    _check_names(campaign, systems)
    progress("comparing", 0.9)
    findings = [finding for system in systems for finding in system.result.findings]
    evaluations, more = _evaluate_all(campaign, systems, method)
    findings += more
    progress("explaining", 0.93)
    explained, more = _explain(campaign, systems, evaluations)
    findings += more
    progress("hashing the inputs", 0.95)
    inputs = input_hashes(campaign.folder)
    progress("done", 1.0)
    return RunResult(
        campaign=campaign,
        systems=tuple(systems),
        evaluations=tuple(evaluations),
        findings=tuple(findings),
        inputs=inputs,
        method=method,
        explained=explained,
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
        table for system in systems for table in system.result.tables if table.system in compared
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
    wanted = [system for system in installed_systems() if system.has_data(campaign)]
    faults: list[GtvalError] = []
    solved: list[SolvedSystem] = []
    for number, system in enumerate(wanted):
        known = replace(campaign, solved={before.name: before.result for before in solved})
        start, width = 0.9 * number / len(wanted), 0.9 / len(wanted)

        def report(what: str, share: float, start: float = start, width: float = width) -> None:
            progress(what, start + width * share)

        report(system.name, 0.0)
        try:
            solved.append(SolvedSystem(system.name, system.solve(known, report)))
        except GtvalError as error:
            faults.append(error)
    try:
        tables = published_tables(campaign)
    except GtvalError as error:
        faults.append(error)
        tables = []
    _raise_together(faults)
    solved += [SolvedSystem(table.system, SystemResult(tables=[table])) for table in tables]
    if not solved:
        raise InputError(
            [Problem(campaign.folder, "the campaign holds no data for any installed system")]
        )
    return solved


def _raise_together(faults: list[GtvalError]) -> None:
    """Raise what went wrong in all systems as one error."""
    if not faults:
        return
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


def _check_names(campaign: Campaign, systems: Iterable[SolvedSystem]) -> None:
    """Raise if two tables have one name: their results would overwrite each other."""
    names = [table.system for system in systems for table in system.result.tables]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(
            Problem(campaign.toml, "poses of this system come twice; rename one", value=name)
            for name in twice
        )


def _evaluate_all(
    campaign: Campaign, systems: Iterable[SolvedSystem], method: IntervalMethod
) -> tuple[list[Evaluation], list[Finding]]:
    """Each table compared with the validation poses, and what follows in words."""
    tables = [table for system in systems for table in system.result.tables]
    validation = next((table for table in tables if table.system == VALIDATION_SYSTEM), None)
    if validation is None:
        return [], [_no_validation(tables)]
    evaluations, findings = [], []
    for table in tables:
        if table.system == VALIDATION_SYSTEM:
            continue
        try:
            evaluation = evaluate(validation, table, campaign.settings.comparison, method)
        except GtvalError as error:
            text = f"Not compared with the validation poses: {error}"
            findings.append(Finding("error", text, table.system, "not_comparable"))
            continue
        evaluations.append(evaluation)
        findings += conclusions(evaluation)
    return evaluations, findings


def _no_validation(tables: Iterable[PoseTable]) -> Finding:
    """What it means that nothing could be compared: less for a path outdoors than for stops."""
    text = "There are no validation poses, so nothing could be compared."
    if all(table.components == SPATIAL for table in tables):
        text += " What is said of these poses rests on their system's own checks."
        return Finding("note", text, VALIDATION_SYSTEM, "no_validation")
    return Finding("warning", text + " Survey the stops.", VALIDATION_SYSTEM, "no_validation")


def result_files(run: RunResult) -> dict[str, str | bytes]:
    """Every file of results/ but run.json, by its name relative to results/.

    Raises
    ------
    GtvalError
        If two systems write the same file, or one outside of results/.
    """
    confidence = run.campaign.settings.comparison.confidence
    parts: list[tuple[str, Mapping[str, str | bytes]]] = [
        ("poses", dict(pose_files(run.tables))),
        *((system.name, system.result.files) for system in run.systems),
    ]
    if run.evaluations:
        statistics = statistics_csv(run.evaluations, confidence)
        compared = {"errors.csv": errors_csv(run.evaluations), "statistics.csv": statistics}
        parts.append(("comparison", dict(compared)))
    if run.explained is not None:
        parts.append(("explain", run.explained.files))
    return merged(parts)


def run_record(run: RunResult, outputs: Iterable[str]) -> dict[str, object]:
    """What run.json holds: everything needed to tell where the numbers came from.

    It holds no time of day: the same inputs give the same bytes.
    """
    return {
        "gtval": version("gtval"),
        "python": platform.python_version(),
        "libraries": _library_versions(),
        "settings": {**run.campaign.settings.model_dump(), **run.campaign.extra},
        "interval_method": run.method,
        "inputs": run.inputs,
        "systems": {system.name: system.result.facts for system in run.systems},
        "provenance": {table.system: table.provenance for table in run.tables},
        "comparisons": {
            evaluation.system: {
                "poses": evaluation.comparison.ids,
                "missing_in_gt": evaluation.comparison.missing_in_gt,
                "missing_in_validation": evaluation.comparison.missing_in_validation,
                "nees_test": evaluation.comparison.test,
                "nees_not_available": evaluation.comparison.unavailable,
            }
            for evaluation in run.evaluations
        },
        "findings": run.findings,
        "outputs": sorted(outputs),
    }


def _library_versions() -> dict[str, str]:
    versions = {}
    for name in LIBRARIES:
        with contextlib.suppress(PackageNotFoundError):
            versions[name] = version(name)
    return versions


def write_results(run: RunResult, report: Mapping[str, str | bytes] | None = None) -> list[Path]:
    """Write all results, and the report if there is one, or nothing at all.

    Files that the run before this one made and this one did not are removed, as far as its
    run.json lists them; nothing else is touched.

    Parameters
    ----------
    run : RunResult
        What to write.
    report : mapping of str to str or bytes, optional
        Files of the report by their names relative to report/.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    GtvalError
        If they cannot be written; the old files are then untouched.
    """
    folder, results = run.campaign.folder, run.campaign.results
    files = result_files(run)
    before = _earlier_outputs(results / "run.json")
    files["run.json"] = json_text(run_record(run, [*files, "run.json"]))
    contents = {f"{results.name}/{name}": content for name, content in files.items()}
    for name, content in (report or {}).items():
        contents[f"{run.campaign.report.name}/{name}"] = content
    written = write_files(folder, contents)
    for name in before - set(files):
        with contextlib.suppress(OSError):
            (results / name).unlink()
    return written


def _earlier_outputs(path: Path) -> set[str]:
    """Names that an earlier run.json says it wrote; only such as stay inside results/."""
    try:
        listed = json.loads(path.read_bytes())["outputs"]
    except (OSError, ValueError, KeyError, TypeError):
        return set()
    if not isinstance(listed, list):
        return set()
    root = path.parent.resolve()
    return {
        name
        for name in listed
        if isinstance(name, str) and "\0" not in name and root in (root / name).resolve().parents
    }
