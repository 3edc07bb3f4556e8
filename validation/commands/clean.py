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

    FOLDER is a campaign, a folder of campaigns, or where a study's results are. Only FOLDER/kept is
    removed; results and reports stay. The next run does all work again.
    """
    from validation.campaign.cleaning import folders_of, kept_files, remove_kept

    told = []
    for folder in [one for given in folders for one in folders_of(given)]:
        files = kept_files(folder)
        size = sum(files.values())
        told.append({"folder": folder, "files": len(files), "bytes": size, "removed": not dry_run})
        if not dry_run:
            remove_kept(folder)
        if not as_json:
            many = "1 file" if len(files) == 1 else f"{len(files)} files"
            verb = "would be removed" if dry_run else "removed"
            click.echo(f"{folder}: {many}, {size / 1e6:.1f} MB, {verb}")
    if as_json:
        from validation.report.terminal import print_json

        print_json({"folders": told})
