"""The command ``gtval clean``."""

from pathlib import Path

import click

from validation.commands.options import AS_JSON, PATH


@click.command()
@click.argument("folders", type=PATH, nargs=-1, required=True, metavar="FOLDER...")
@click.option("--dry-run", is_flag=True, help="Tell what would be removed, remove nothing.")
@AS_JSON
def clean(folders: tuple[Path, ...], *, dry_run: bool, as_json: bool) -> None:
    """Remove what is kept of earlier runs: detections, matches, trials.

    FOLDER is a campaign, or where a study's results are. Only FOLDER/kept is removed; results and
    reports stay. The next run does all work again.
    """
    from validation.campaign.cleaning import kept_files, remove_kept

    told = []
    for folder in folders:
        files = kept_files(folder)
        size = sum(files.values())
        told.append({"folder": folder, "files": len(files), "bytes": size, "removed": not dry_run})
        if not dry_run:
            remove_kept(folder)
        if not as_json:
            verb = "would be" if dry_run else "were"
            click.echo(f"{folder}: {len(files)} files of {size / 1e6:.1f} MB {verb} removed")
    if as_json:
        from validation.report.terminal import print_json

        print_json({"folders": told})
