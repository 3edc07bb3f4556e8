"""The command ``gtval study``."""

from pathlib import Path
from tempfile import TemporaryFile

import click

from validation.commands.options import (
    AS_JSON,
    EVERYTHING,
    PATH,
    SCHEDULER,
    WORKERS,
    progress_bar,
)


@click.command()
@click.argument("plan", type=PATH)
@click.option("--folder", type=PATH, help="Of results and kept trials; beside PLAN by default.")
@WORKERS
@SCHEDULER
@AS_JSON
@EVERYTHING
def study(
    plan: Path,
    folder: Path | None,
    workers: int | None,
    scheduler: str | None,
    as_json: bool,
    everything: bool,
) -> None:
    """Draw many synthetic rooms and tell how often what gtval says of them is true.

    PLAN is a TOML file: what the rooms are, what is varied, how many seeds. Told is, for each
    setting, how far off the poses of each system are, how many of their errors lie inside the
    interval that they state, and how often each finding comes up, all with intervals.

    Each room is kept as soon as it is done: a study that is stopped goes on where it was, and one
    with more seeds or settings works out only what is new.
    """
    from data_samples.studies.plan import read_plan
    from data_samples.studies.study import run_study
    from data_samples.studies.tables import (
        honesty_table,
        power_table,
        rooms_table,
        study_files,
        study_json,
    )
    from validation.pieces.cluster import on_cluster
    from validation.pieces.store import counted
    from validation.report.terminal import print_json, print_table
    from validation.text_files.writing import write_files

    asked = read_plan(plan)
    where = plan.with_suffix("") if folder is None else folder
    own_folder(where)
    with on_cluster(scheduler), counted() as pieces, progress_bar("rooms") as report:
        done = run_study(asked, where, report, workers)
    write_files(where, study_files(done))
    if as_json:
        print_json({**study_json(done), "folder": where, "pieces": pieces.kinds})
        return
    click.echo(f"{asked.name}\n")
    if everything or any(done.refused(label) for label in done.trials):
        print_table(rooms_table(done))
    print_table(honesty_table(done))
    print_table(power_table(done, notes=everything))
    click.echo(f"Results: {where}")
    click.echo(pieces.text(), nl=False)


def own_folder(where: Path) -> None:
    """Make the folder of a study, or raise where it holds or is something else."""
    from data_samples.studies.tables import FILES, MARK
    from validation.errors import GtvalError

    try:
        where.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=where):
            pass
    except OSError as error:
        said = f"the results of the study cannot be written to {where}: {error.strerror}"
        raise GtvalError(f"{said}. Give another place with --folder") from None
    others = [name for name in FILES if (where / name).exists()]
    if others and not (where / MARK).exists():
        raise GtvalError(
            f"{where / others[0]} is not of a study, and would be replaced; nothing was done. Give "
            "another place with --folder"
        )
