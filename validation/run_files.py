"""What a run writes: its files, and run.json, which says where the numbers came from."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from validation.campaign.banner import marked_report
from validation.campaign.provenance import (
    RECORD,
    REPORT,
    OutOfDate,
    Step,
    digest_of,
    earlier_outputs,
    earlier_record,
    earlier_steps,
    out_of_date,
)
from validation.run import COMPARISON, EXPLANATION, IN_TIME, RunResult
from validation.solving import (
    TRACEBACKS,
    made_with,
    remove_results,
    starts_from_survey,
    step_of,
)
from validation.systems import inputs_of, installed_systems
from validation.text_files.json_text import json_text
from validation.text_files.writing import Content, write_files


def result_files(run: RunResult) -> dict[str, Mapping[str, Content]]:
    """Every file of results/ but run.json: by the step that made it, and by its name."""
    steps = {system.name: system.files for system in run.systems}
    if run.comparison_files:
        steps[COMPARISON] = run.comparison_files
    if run.explained is not None:
        steps[EXPLANATION] = run.explained.files
    if run.in_time is not None and run.in_time.files:
        steps[IN_TIME] = run.in_time.files
    failures = {name: one for failure in run.failures for name, one in failure.files.items()}
    if failures:
        steps[TRACEBACKS] = failures
    return steps


LeftOver = tuple[dict[str, Step], list[OutOfDate]]


def left_over(run: RunResult, *, report: bool) -> LeftOver:
    """What earlier runs made and this one leaves as it is, and what of it is out of date now.

    That is the report, unless there is a new one.
    """
    earlier = earlier_steps(earlier_record(run.campaign))
    names = [] if report else [REPORT]
    kept = {name: earlier[name] for name in names if name in earlier}
    now = {n: digest_of(one) for step in result_files(run).values() for n, one in step.items()}
    return kept, out_of_date(run.campaign, kept, now, run.inputs)


def _steps(run: RunResult, files: Mapping[str, Mapping[str, Content]]) -> dict[str, Step]:
    """Which inputs and which results each step started from."""
    campaign = run.campaign
    installed = {system.name: system for system in installed_systems()}
    choices = {system.name: system.choices for system in run.systems}
    written = {name: digest_of(one) for step in files.values() for name, one in step.items()}
    poses = {
        name: one
        for name, one in written.items()
        if name.startswith("poses_") and name.endswith(".csv")
    }
    surveyed = {name: one for name, one in poses.items() if name == "poses_survey.csv"}
    steps = {}
    published = {
        one.system: [campaign.folder / file for file in (one.file, one.stops) if file]
        for one in campaign.settings.published
    }
    for step, contents in files.items():
        sources, uses = [campaign.folder], poses if step in {COMPARISON, EXPLANATION} else {}
        system = installed.get(step)
        if step in published:
            sources = [campaign.toml, *published[step]]
        if system is not None:
            own = inputs_of(system, campaign)
            sources = [*dict.fromkeys([*sources, *own])] if step in published else own
            uses = surveyed if starts_from_survey(system) else {}
        steps[step] = step_of(campaign, sources, contents, run.inputs, uses, choices.get(step))
    steps[REPORT] = step_of(campaign, [campaign.folder], {}, run.inputs, written)
    return steps


def run_record(
    run: RunResult, files: Mapping[str, Mapping[str, Content]], left: LeftOver
) -> dict[str, Any]:
    """What run.json holds: everything needed to tell where the numbers came from.

    It holds no time of day: the same inputs give the same bytes.
    """
    kept, old = left
    names = [n for step in (*files.values(), *(one.outputs for one in kept.values())) for n in step]
    return {
        **made_with(),
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
        "steps": {**_steps(run, files), **kept},
        "out_of_date": old,
        "outputs": sorted({RECORD, *names}),
    }


class Written(NamedTuple):
    """Files that a run has written, and what others are out of date now."""

    files: list[Path]
    old: list[OutOfDate]


def write_results(run: RunResult, report: Mapping[str, Content] | None = None) -> Written:
    """Write all results, and the report if there is one, or nothing at all.

    Files that the run before this one made and this one did not are removed, as far as its
    run.json lists them; nothing else is touched.

    Parameters
    ----------
    run : RunResult
        What to write.
    report : mapping of str to str or bytes, optional
        Files of the report by their names relative to report/.

    Raises
    ------
    GtvalError
        If they cannot be written; the old files are then untouched.
    """
    folder, results = run.campaign.folder, run.campaign.results
    steps = result_files(run)
    before = earlier_outputs(run.campaign)
    listed: list[str] = []
    old: list[OutOfDate] = []

    def then() -> dict[str, Content]:
        """What tells of the files, and the report."""
        left = left_over(run, report=bool(report))
        record = run_record(run, steps, left)
        listed.extend(record["outputs"])
        old.extend(left[1])
        more: dict[str, Content] = {f"{results.name}/{RECORD}": json_text(record)}
        more |= marked_report(run.campaign, left[1])
        return more | {f"{run.campaign.report.name}/{n}": one for n, one in (report or {}).items()}

    contents = {f"{results.name}/{n}": one for step in steps.values() for n, one in step.items()}
    written = write_files(folder, contents, then=then)
    remove_results(run.campaign, before.difference(listed))
    return Written(written, old)
