"""Solving, writing and provenance, done once for all systems.

A system says whether a campaign holds its data and turns them into a `SystemResult`. All that
follows is here: what an unexpected failure becomes, which files a result is, and how results/
says which inputs and which step made each of them.
"""

import contextlib
import platform
import re
import traceback
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from validation.campaign.banner import marked_report
from validation.campaign.folder import Campaign, load_campaign
from validation.campaign.provenance import (
    RECORD,
    OutOfDate,
    Step,
    below,
    digest_of,
    earlier_outputs,
    earlier_record,
    earlier_steps,
    input_hashes,
    out_of_date,
    relative,
    sources_of,
)
from validation.errors import FaultyResultError, GtvalError, shown
from validation.pieces.processes import shared_processes
from validation.pieces.results import results_kept_in
from validation.pieces.store import LIBRARIES
from validation.poses.pose_files import pose_files
from validation.poses.pose_table import PoseTable
from validation.published.systems import published_systems
from validation.results import VALIDATION_SYSTEM, Finding, Section, SystemResult, Table
from validation.stopping import go_on_after
from validation.systems import (
    Progress,
    System,
    inputs_of,
    installed_system,
    installed_systems,
    no_progress,
    untold_inputs,
)
from validation.text_files.json_text import json_text
from validation.text_files.writing import Content, LargeText, write_files

TRACEBACKS = "tracebacks"

_RESERVED = re.compile(
    rf"({RECORD}|errors\.csv|(printed_)?statistics\.csv|paired\.csv|conclusions\.csv)$|(explain|{TRACEBACKS})(/|$)"
)
"""Files of the run itself under results/."""

MOST_BYTES = 200
"""Of a file's name: of the 255 that file systems take, its temporary neighbours need 30."""


@dataclass(frozen=True)
class SolvedSystem:
    """What one system made of the campaign.

    Parameters
    ----------
    name : str
        The system.
    result : SystemResult
        Poses, findings, sections, files. Of a system that failed: the finding that says so.
    files : mapping of str to str or bytes
        All that it leaves under results/: poses, joint covariances, its own.
    choices : mapping of str to object
        Of the command line, where they differ from the settings.
    failed : bool
        Whether it ended in an exception that nobody expected.
    """

    name: str
    result: SystemResult
    files: Mapping[str, Content]
    choices: Mapping[str, object] = field(default_factory=dict)
    failed: bool = False


def solved_system(
    name: str, result: SystemResult, choices: Mapping[str, object] | None = None
) -> SolvedSystem:
    """A system's result with its files, checked to be what others take it for.

    Raises
    ------
    FaultyResultError
        If two files have one name, or one that no file under results/ can have.
    Exception
        If a plug-in gives something else than it promises, or facts that JSON cannot hold.
    """
    promised: list[tuple[Iterable[object], tuple[type, ...]]] = [
        (result.tables, (PoseTable,)),
        (result.findings, (Finding,)),
        (result.sections, (Section,)),
        (result.overview, (Table,)),
        (result.files.values(), (str, bytes, LargeText)),
        ((finding.text for finding in result.findings), (str,)),
        ((result.facts, result.landmarks), (Mapping,)),
    ]
    for parts, kinds in promised:
        for part in parts:
            if not isinstance(part, kinds):
                names = " or ".join(kind.__name__ for kind in kinds)
                raise TypeError(f"'{name}' gives {part!r} where {names} is expected")
    json_text([result.facts, *(table.provenance for table in result.tables)])
    files: dict[str, Content] = dict(pose_files(result.tables))
    for file, content in result.files.items():
        parts = file.split("/")
        if {"", ".", ".."} & {*parts} or "\\" in file or not file.isprintable():
            raise FaultyResultError(f"'{name}' wants to write outside results/: {shown(file)}")
        if max(len(part.encode()) for part in parts) > MOST_BYTES:
            raise FaultyResultError(
                f"'{name}' wants to write a file of too long a name: {shown(file)}"
            )
        if file in files or _RESERVED.match(file):
            raise FaultyResultError(f"'{name}' writes results/{file}, which is written already")
        files[file] = content
    return SolvedSystem(name, result, files, choices or {})


def joined(own: SolvedSystem, published: SolvedSystem) -> SolvedSystem:
    """What a system without poses says of printed tables, with its poses as published."""
    one, other = own.result, published.result
    return replace(
        own,
        result=replace(
            one,
            tables=other.tables,
            findings=[*one.findings, *other.findings],
            sections=[*one.sections, *other.sections],
            files={**one.files, **other.files},
            facts={**one.facts, **other.facts},
            trajectories=other.trajectories,
        ),
        files={**own.files, **published.files},
        failed=own.failed or published.failed,
    )


def failed_system(name: str, error: BaseException) -> SolvedSystem:
    """What stands in for a system that failed unexpectedly; called while that is handled."""
    result = unexpected(name, error)
    return SolvedSystem(name, result, result.files, failed=True)


def not_written(failed: SolvedSystem) -> str:
    """What is said of a system that failed, where its traceback is not written."""
    said = failed.result.findings[0].text
    return f"{said} `gtval {failed.name} CAMPAIGN` alone writes it" if failed.files else said


def unexpected(part: str, error: BaseException) -> SystemResult:
    """What an exception that nobody expected in one part becomes: a finding and a traceback.

    Parameters
    ----------
    part : str
        A system, an analysis or a part of the report, as people call it: 'laser', 'explain'.
    error : BaseException
        What was raised; being handled.

    Raises
    ------
    KeyboardInterrupt
        If the command is to end.
    """
    go_on_after(error)
    name = f"{TRACEBACKS}/{re.sub('[^A-Za-z0-9_-]+', '_', part)}.txt"
    text = (
        f"'{part}' failed unexpectedly and gives no result ({type(error).__name__}: {error}). "
        f"All other parts are done. The traceback is in results/{name}; please report it"
    )
    trace = "".join(traceback.format_exception(error))
    finding = Finding("error", text + ".", part, "unexpected")
    return SystemResult(findings=[finding], files={name: trace})


def solve_system(
    campaign: Campaign,
    system: System,
    progress: Progress = no_progress,
    choices: Mapping[str, object] | None = None,
) -> SolvedSystem:
    """What a system makes of a campaign, also where it fails unexpectedly.

    Raises
    ------
    GtvalError
        If the data are bad or do not determine the poses.
    """
    chosen = {name: value for name, value in (choices or {}).items() if value is not None}
    try:
        with shared_processes(), results_kept_in(campaign.folder):
            result = system.solve(campaign, progress, **chosen)
        solved = solved_system(system.name, result, chosen)
    except (Exception, SystemExit) as error:
        if isinstance(error, GtvalError) and not isinstance(error, FaultyResultError):
            raise
        return failed_system(system.name, error)  # one must not take the others
    told = untold_inputs(system, campaign)
    findings = [*solved.result.findings, *told]
    return replace(solved, result=replace(solved.result, findings=findings)) if told else solved


def solve_validation(campaign: Campaign, systems: Iterable[System]) -> Campaign:
    """The campaign with the system solved whose poses the others are compared with.

    A system that starts from surveyed stops finds them in ``campaign.solved``, whether it is
    solved by itself or in a run.

    Raises
    ------
    GtvalError
        If the survey's data are bad, or it fails unexpectedly.
    """
    first = next((s for s in systems if s.name == VALIDATION_SYSTEM and s.has_data(campaign)), None)
    if first is None or first.name in campaign.solved:
        return campaign
    solved = solve_system(campaign, first)
    if solved.failed:
        raise GtvalError(not_written(solved))
    return replace(campaign, solved={first.name: solved.result})


def step_of(
    campaign: Campaign,
    sources: Iterable[Path],
    files: Mapping[str, Content],
    hashes: Mapping[str, str],
    uses: Mapping[str, str] | None = None,
    choices: Mapping[str, object] | None = None,
) -> Step:
    """What a step read and wrote, by the hashes of the files.

    Parameters
    ----------
    campaign : Campaign
        The folder.
    sources : iterable of Path
        Files and folders that it read.
    files : mapping of str to str or bytes
        What it writes, by names relative to results/.
    hashes : mapping of str to str
        SHA-256 of the files of the campaign, these sources among them.
    uses : mapping of str to str, optional
        SHA-256 of results of earlier steps that it used.
    choices : mapping of str to object, optional
        Of the command line.
    """
    names = [relative(path, campaign.folder) for path in sources]
    return Step(
        sources=tuple(names),
        inputs=below(hashes, names),
        uses=uses or {},
        outputs={name: digest_of(content) for name, content in files.items()},
        choices=choices or {},
    )


def write_system(campaign: Campaign, system: System, solved: SolvedSystem) -> tuple[Finding, ...]:
    """Write what one system made; see `write_step`."""
    published = [
        campaign.folder / file
        for one in campaign.settings.published
        if one.system == system.name
        for file in (one.file, one.stops)
        if file
    ]
    return write_step(
        campaign,
        system.name,
        [*inputs_of(system, campaign), *published],
        solved.files,
        validation_poses(campaign, system.name),
        solved.choices,
        {system.name: solved.result.facts},
    )


def write_step(
    campaign: Campaign,
    name: str,
    sources: Sequence[Path],
    files: Mapping[str, Content],
    uses: Mapping[str, str],
    choices: Mapping[str, object] | None = None,
    facts: Mapping[str, object] | None = None,
) -> tuple[Finding, ...]:
    """Write what one step made, and mark what no longer belongs to it.

    results/run.json keeps what the last whole run recorded; this step is new. Errors,
    statistics and the report of an earlier run stay where they are, and run.json, the report
    itself and the findings returned say that they are out of date.

    Parameters
    ----------
    campaign : Campaign
        The folder.
    name : str
        Of the step: a system or an analysis.
    sources, files, uses, choices
        As of `step_of`.
    facts : mapping of str to object, optional
        What ``systems`` of run.json says anew.

    Raises
    ------
    GtvalError
        If the files cannot be written; the old ones are then untouched.
    """
    record = earlier_record(campaign)
    steps = earlier_steps(record)
    gone = set(steps[name].outputs) - set(files) if name in steps else set()
    known = [*sources, *sources_of(campaign, steps.values())]
    hashes = input_hashes(campaign.folder, known)
    listed, old = earlier_outputs(campaign), list[OutOfDate]()

    def told() -> dict[str, Content]:
        """The record, and what it makes of the report, once large files are written."""
        steps[name] = step_of(campaign, sources, files, hashes, uses, choices)
        old.extend(out_of_date(campaign, steps, steps[name].outputs, hashes))
        before = record.get("systems")
        new = record | made_with()
        new["systems"] = {**(before if isinstance(before, dict) else {}), **(facts or {})}
        new |= {"steps": steps, "out_of_date": old}
        new["outputs"] = sorted({*listed - gone, *files, RECORD})
        return {f"{campaign.results.name}/{RECORD}": json_text(new), **marked_report(campaign, old)}

    contents = {f"{campaign.results.name}/{file}": one for file, one in files.items()}
    write_files(campaign.folder, contents, then=told)
    remove_results(campaign, gone & listed)
    return late_finding(name, old)


def late_finding(subject: str, old: Sequence[OutOfDate]) -> tuple[Finding, ...]:
    """A warning that names the files that are out of date; nothing where there are none."""
    if not old:
        return ()
    text = f"Out of date now: {', '.join(one.file for one in old)}; `gtval run` makes them anew."
    return (Finding("warning", text, subject, "out_of_date"),)


def remove_results(campaign: Campaign, names: Iterable[str]) -> None:
    """Remove files that a step wrote before and writes no longer; what is gone is passed over."""
    for name in names:
        with contextlib.suppress(OSError):
            (campaign.results / name).unlink()


def system_output(
    folder: Path,
    name: str,
    progress: Progress,
    choices: Mapping[str, object],
    *,
    write: bool,
) -> tuple[SolvedSystem, tuple[Finding, ...], Path | None]:
    """One system of a campaign folder solved by itself, and its files written.

    Parameters
    ----------
    folder : Path
        The campaign folder, or its campaign.toml.
    name : str
        An installed system.
    progress : callable
        Called with what is being done and the share done.
    choices : mapping of str to object
        For the system's `solve`; those that are None are left out.
    write : bool
        Whether to write files.

    Returns
    -------
    solved : SolvedSystem
        What it made.
    findings : tuple of Finding
        Its own, and what is out of date now.
    results : Path or None
        Where the files are; None where none were written.

    Raises
    ------
    GtvalError
        If the data are bad or do not determine the poses.
    """
    campaign = load_campaign(folder)
    system = installed_system(name)
    if starts_from_survey(system):
        campaign = solve_validation(campaign, installed_systems())
    solved = _with_published(campaign, solve_system(campaign, system, progress, choices))
    findings = tuple(solved.result.findings)
    if not write:
        return solved, findings, None
    return solved, findings + write_system(campaign, system, solved), campaign.results


def _with_published(campaign: Campaign, solved: SolvedSystem) -> SolvedSystem:
    """A system without poses of its own with those that are published under its name, if any."""
    entries = [one for one in campaign.settings.published if one.system == solved.name]
    if solved.result.tables or solved.failed or not entries:
        return solved
    settings = campaign.settings.model_copy(update={"published": entries})
    for name, result in published_systems(replace(campaign, settings=settings)).items():
        solved = joined(solved, solved_system(name, result))
    return solved


def starts_from_survey(system: System) -> bool:
    """Whether a system says that it needs the surveyed stops."""
    return bool(getattr(system, "starts_from_survey", False))


def validation_poses(campaign: Campaign, system: str) -> dict[str, str]:
    """SHA-256 of the validation poses that a system started from, as results/ holds them."""
    known = campaign.solved.get(VALIDATION_SYSTEM)
    if known is None or system == VALIDATION_SYSTEM:
        return {}
    return {
        name: digest_of(content)
        for name, content in pose_files(known.tables).items()
        if name.endswith(".csv")
    }


def made_with() -> dict[str, object]:
    """Versions of what the numbers were computed with."""
    versions = {}
    for name in LIBRARIES:
        with contextlib.suppress(PackageNotFoundError):
            versions[name] = version(name)
    return {
        "gtval": version("gtval"),
        "python": platform.python_version(),
        "libraries": versions,
    }
