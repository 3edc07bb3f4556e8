"""Which inputs and which step made the files under results/, and which no longer belong together.

A step is one system, the comparison or the explanation. results/run.json holds, under ``steps``,
what each step read and wrote, as SHA-256 of every file. What a step wrote is out of date when an
input has changed since, when results that it used have changed, or when somebody else has
changed the file.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from validation.campaign.folder import Campaign
from validation.errors import GtvalError
from validation.pieces.store import FOLDER
from validation.text_files.writing import Content, LargeText, pieces_of

COMPUTED = frozenset({"results", "report", FOLDER})
"""Folders of a campaign that hold nothing a person typed or a sensor recorded."""

RECORD = "run.json"

REPORT, REPORT_FILE = "report", "report/report.html"
"""The step that makes the report, and its file. It uses all results."""

REPORT_FILES = (
    REPORT_FILE,
    *(f"report/{name}" for name in ("tables.md", "tables.tex", "to_do.json", "report.pdf")),
    *(f"report/{name}" for name in ("tables_paper.md", "tables_paper.tex")),
)
"""All that this step may write."""


@dataclass(frozen=True)
class Step:
    """What one step read and wrote.

    Parameters
    ----------
    sources : sequence of str
        Files and folders that it reads, relative to the campaign folder; '.' for all of it.
    inputs : mapping of str to str
        SHA-256 of what was there, by its path relative to the campaign folder.
    uses : mapping of str to str
        SHA-256 of results of earlier steps that were used, by their names under results/.
    outputs : mapping of str to str
        SHA-256 of what was written, by its name under results/.
    choices : mapping of str to object
        Choices of the command line that differ from the settings.
    """

    sources: Sequence[str]
    inputs: Mapping[str, str]
    uses: Mapping[str, str] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)
    choices: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class OutOfDate:
    """A file under results/ or report/ that no longer belongs to the rest.

    Parameters
    ----------
    file : str
        Its path relative to the campaign folder.
    reason : str
        What has changed since it was made.
    """

    file: str
    reason: str


def input_hashes(folder: Path, among: Iterable[Path] | None = None) -> dict[str, str]:
    """SHA-256 of files of a campaign folder, by their paths relative to the folder.

    Left out are computed folders, hidden files (version control, editors) and temporary ones.

    Parameters
    ----------
    folder : Path
        The campaign folder.
    among : iterable of Path, optional
        Files and folders to look at, those that do not exist being left out; everything by
        default.

    Raises
    ------
    GtvalError
        If a file cannot be read.
    """
    found: set[Path] = set()
    for path in [folder] if among is None else among:
        found |= {path} if path.is_file() else set(path.rglob("*"))
    return {
        relative(path, folder): digest_of(path)
        for path in sorted(found)
        if path.is_file() and not _passed_over(path, folder)
    }


def _passed_over(path: Path, folder: Path) -> bool:
    """Whether a file is no input: computed, hidden or temporary."""
    if not path.is_relative_to(folder):
        return False
    parts = path.relative_to(folder).parts
    hidden = any(part.startswith(".") for part in parts)
    return hidden or parts[0] in COMPUTED or path.suffix == ".tmp"


def relative(path: Path, folder: Path) -> str:
    """The path from the folder, or as it is where it lies elsewhere."""
    return (path.relative_to(folder) if path.is_relative_to(folder) else path).as_posix()


def digest_of(source: Path | Content) -> str:
    """SHA-256 of a file, or of a content that is to be written.

    Raises
    ------
    GtvalError
        If the file cannot be read.
    """
    if isinstance(source, LargeText):
        return source.digest
    if isinstance(source, str | bytes):
        digest = hashlib.sha256()
        for piece in pieces_of(source):
            digest.update(piece)
        return digest.hexdigest()
    try:
        with source.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise GtvalError(f"cannot read {source}: {error.strerror or error}") from error


def earlier_record(campaign: Campaign) -> dict[str, Any]:
    """What run.json holds; nothing where there is none, or it cannot be read."""
    try:
        found = json.loads((campaign.results / RECORD).read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def earlier_outputs(campaign: Campaign) -> set[str]:
    """Names that an earlier run.json says were written; only such as stay inside results/."""
    listed = earlier_record(campaign).get("outputs")
    root = campaign.results.resolve()
    return {
        name
        for name in (listed if isinstance(listed, list) else ())
        if isinstance(name, str) and "\0" not in name and root in (root / name).resolve().parents
    }


def earlier_steps(record: Mapping[str, Any]) -> dict[str, Step]:
    """The steps of a run.json; those that are no longer to be read are left out."""
    steps = record.get("steps")
    found = {}
    for name, one in steps.items() if isinstance(steps, dict) else ():
        if not isinstance(one, dict):
            continue
        sources = one.get("sources")
        parts: list[Any] = [one.get(f.name) for f in fields(Step)[1:]]
        if isinstance(sources, list) and all(isinstance(part, dict) for part in parts):
            found[name] = Step(tuple(map(str, sources)), *parts)
    return found


def sources_of(campaign: Campaign, steps: Iterable[Step]) -> list[Path]:
    """Files and folders that steps read; folders only inside the campaign's, or it itself."""
    root = campaign.folder.resolve()
    paths = {campaign.folder / name for step in steps for name in step.sources if "\0" not in name}
    return sorted(path for path in paths if path.is_file() or path.resolve().is_relative_to(root))


def below(hashes: Mapping[str, str], sources: Iterable[str]) -> dict[str, str]:
    """Those of the files that are one of the sources or lie in one."""
    folders = tuple(f"{name}/" for name in sources)
    exact = {name.removesuffix("/") for name in folders}
    return {
        file: digest
        for file, digest in hashes.items()
        if "." in exact or file in exact or file.startswith(folders)
    }


def out_of_date(
    campaign: Campaign,
    steps: Mapping[str, Step],
    written: Mapping[str, str] | None = None,
    hashes: Mapping[str, str] | None = None,
) -> list[OutOfDate]:
    """Files under results/, and the report, that no longer belong to the inputs or each other.

    Parameters
    ----------
    campaign : Campaign
        The folder.
    steps : mapping of str to Step
        Who made what.
    written : mapping of str to str, optional
        SHA-256 of results that are about to be written.
    hashes : mapping of str to str, optional
        SHA-256 of the sources of all steps, where they are known.

    Raises
    ------
    GtvalError
        If a file cannot be read.
    """
    now = dict(written or {})
    if hashes is None:
        hashes = input_hashes(campaign.folder, sources_of(campaign, steps.values()))
    found, ever = [], {name for made in steps.values() for name in made.outputs}
    for step, made in steps.items():
        for name in (*made.uses, *made.outputs):
            if name not in now and (campaign.results / name).is_file():
                now[name] = digest_of(campaign.results / name)
        changed = _different(made.inputs, below(hashes, made.sources))
        # What a step computed for itself, and no step has written, cannot have changed.
        used = [name for name in made.uses if name in now or name in ever]
        changed += [f"results/{name}" for name in _different(made.uses, now, only=used)]
        reason = f"it is not as the step '{step}' left it"
        if changed:
            more = f" and {len(changed) - 3} more files" if len(changed) > 3 else ""
            reason = f"changed after the step '{step}': {', '.join(changed[:3])}{more}"
        found += [
            OutOfDate(f"results/{name}", reason)
            for name, was in made.outputs.items()
            if name in now and (changed or now[name] != was)
        ]
        if step == REPORT and changed:
            there = [name for name in REPORT_FILES if (campaign.folder / name).is_file()]
            found += [OutOfDate(name, reason) for name in there]
    return found


def _different(
    before: Mapping[str, str], now: Mapping[str, str], only: Iterable[str] | None = None
) -> list[str]:
    """Names whose hashes differ, or that only one of both has."""
    names = sorted({*before, *now}) if only is None else only
    return [name for name in names if before.get(name) != now.get(name)]
