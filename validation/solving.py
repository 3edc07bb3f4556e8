"""Solving, writing and provenance, done once for all systems.

A system says whether a campaign holds its data and turns them into a `SystemResult`. All that
follows is here: what an unexpected failure becomes, which files a result is, and how results/
says which inputs and which step made each of them.
"""

import contextlib
import platform
import traceback
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from validation.campaign.banner import marked_report
from validation.campaign.folder import Campaign, load_campaign
from validation.campaign.provenance import (
    RECORD,
    Step,
    digest_of,
    earlier_record,
    earlier_steps,
    input_hashes,
    out_of_date,
    relative,
)
from validation.errors import GtvalError
from validation.poses.pose_files import pose_files
from validation.results import VALIDATION_SYSTEM, Finding, SystemResult
from validation.systems import (
    Progress,
    System,
    inputs_of,
    installed_system,
    installed_systems,
    no_progress,
)
from validation.text_files.json_text import json_text
from validation.text_files.writing import write_files

LIBRARIES = ("numpy", "scipy", "opencv-contrib-python-headless", "filterpy", "kiss-icp")
TRACEBACKS = "tracebacks"


@dataclass(frozen=True)
class SolvedSystem:
    """What one system made of the campaign.

    Parameters
    ----------
    name : str
        The system.
    result : SystemResult
        Poses, findings, sections, files. Of a system that failed: the finding that says so.
    choices : mapping of str to object
        Of the command line, where they differ from the settings.
    failed : bool
        Whether it ended in an exception that nobody expected.
    """

    name: str
    result: SystemResult
    choices: Mapping[str, object] = field(default_factory=dict)
    failed: bool = False


def unexpected(part: str, error: Exception) -> SystemResult:
    """What an exception that nobody expected in one part becomes: a finding and a traceback.

    Parameters
    ----------
    part : str
        A system or an analysis, as people call it: 'laser', 'explain'.
    error : Exception
        What was raised; being handled.
    """
    name = f"{TRACEBACKS}/{part}.txt"
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
        return SolvedSystem(system.name, system.solve(campaign, progress, **chosen), chosen)
    except GtvalError:
        raise
    except Exception as error:  # noqa: BLE001  (one system must not take the others)
        return SolvedSystem(system.name, unexpected(system.name, error), chosen, failed=True)


def solve_validation(campaign: Campaign, systems: Iterable[System]) -> Campaign:
    """The campaign with the system solved whose poses the others are compared with.

    A system that starts from surveyed stops finds them in ``campaign.solved``, whether it is
    solved by itself or in a run.

    Raises
    ------
    GtvalError
        If the survey's data are bad.
    """
    first = next((s for s in systems if s.name == VALIDATION_SYSTEM and s.has_data(campaign)), None)
    if first is None or first.name in campaign.solved:
        return campaign
    solved = solve_system(campaign, first)
    return replace(campaign, solved={first.name: solved.result})


def system_files(result: SystemResult) -> dict[str, str | bytes]:
    """Every file that a system leaves under results/: poses, joint covariances, its own.

    Raises
    ------
    GtvalError
        If two files have one name, or one leads out of the folder.
    """
    return merged([("poses", dict(pose_files(result.tables))), ("the system", result.files)])


def merged(parts: Iterable[tuple[str, Mapping[str, str | bytes]]]) -> dict[str, str | bytes]:
    """All files of several owners together.

    Parameters
    ----------
    parts : iterable of (str, mapping)
        Owner, and its files by their names relative to results/.

    Raises
    ------
    GtvalError
        If two owners write the same file, or a name leads out of the folder.
    """
    files: dict[str, str | bytes] = {}
    owners: dict[str, str] = {}
    for owner, contents in parts:
        for name, content in contents.items():
            if name.startswith("/") or "\\" in name or ".." in name.split("/"):
                raise GtvalError(f"'{owner}' wants to write outside results/: {name}")
            if name in files:
                raise GtvalError(f"'{owner}' and '{owners[name]}' both write results/{name}")
            files[name], owners[name] = content, owner
    return files


def step_of(
    campaign: Campaign,
    sources: Iterable[Path],
    files: Mapping[str, str | bytes],
    uses: Mapping[str, str] | None = None,
    choices: Mapping[str, object] | None = None,
    hashes: Mapping[str, str] | None = None,
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
    uses : mapping of str to str, optional
        SHA-256 of results of earlier steps that it used.
    choices : mapping of str to object, optional
        Of the command line.
    hashes : mapping of str to str, optional
        SHA-256 of all files of the campaign, where they are known.
    """
    known = list(sources)
    if hashes is None:
        hashes = input_hashes(campaign.folder, known)
    names = [relative(path, campaign.folder) for path in known]
    return Step(
        sources=tuple(names),
        inputs={file: one for file, one in hashes.items() if _below(file, names)},
        uses=uses or {},
        outputs={name: digest_of(content) for name, content in files.items()},
        choices=choices or {},
    )


def _below(file: str, sources: Iterable[str]) -> bool:
    """Whether a file is one of the sources or lies in one."""
    return any(name in {".", file} or file.startswith(f"{name}/") for name in sources)


def write_system(campaign: Campaign, system: System, solved: SolvedSystem) -> tuple[Finding, ...]:
    """Write what one system made, and mark what no longer belongs to it.

    results/run.json keeps what the last whole run recorded; the step of this system is new.
    Errors, statistics and the report of an earlier run stay where they are, and run.json, the
    report itself and the findings returned say that they are out of date.

    Raises
    ------
    GtvalError
        If the files cannot be written; the old ones are then untouched.
    """
    files = system_files(solved.result)
    record = earlier_record(campaign)
    steps = earlier_steps(record)
    uses = validation_poses(campaign, system.name)
    steps[system.name] = step_of(campaign, inputs_of(system, campaign), files, uses, solved.choices)
    digests = steps[system.name].outputs
    old = out_of_date(campaign, steps, digests)
    record |= made_with()
    record["systems"] = {**record.get("systems", {}), system.name: solved.result.facts}
    record["steps"] = steps
    record["out_of_date"] = old
    record["outputs"] = sorted({*record.get("outputs", ()), *files, RECORD})
    contents = {f"{campaign.results.name}/{name}": content for name, content in files.items()}
    contents[f"{campaign.results.name}/{RECORD}"] = json_text(record)
    contents |= marked_report(campaign, f"'{system.name}' was solved again after it was made")
    report = [name for name in contents if name.startswith(campaign.report.name)]
    write_files(campaign.folder, contents)
    late = [*(one.file for one in old), *report]
    if not late:
        return ()
    text = f"Out of date now: {', '.join(late)}. `gtval run` makes them anew."
    return (Finding("warning", text, system.name, "out_of_date"),)


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
    if getattr(system, "starts_from_survey", False):
        campaign = solve_validation(campaign, installed_systems())
    solved = solve_system(campaign, system, progress, choices)
    findings = tuple(solved.result.findings)
    if not write:
        return solved, findings, None
    return solved, findings + write_system(campaign, system, solved), campaign.results


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
