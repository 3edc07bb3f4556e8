"""The command ``gtval vision decide``."""

from pathlib import Path

import click

from validation.commands.options import AS_JSON, CAMPAIGN, PATH


@click.command(context_settings={"ignore_unknown_options": True})
@CAMPAIGN
@click.argument("image", type=PATH)
@click.argument("decision", type=click.Choice(["leave-out", "use", "corner", "no-corner"]))
@click.argument("pixels", type=float, nargs=-1)
@AS_JSON
@click.option("--by", default="", help="Who or what decided.")
@click.option("--note", default="", help="Why.")
def decide(
    campaign: Path,
    image: Path,
    decision: str,
    pixels: tuple[float, ...],
    as_json: bool,
    by: str,
    note: str,
) -> None:
    """Record a decision about an IMAGE: leave-out, use, corner X Y [AXIS_X AXIS_Y], no-corner.

    It is added to the campaign's file of decisions, where the last one counts, and the next run
    obeys it. A corner is a pixel near the first inner corner of the reference pattern, and the
    axis another pixel along its rows; 'use' and 'no-corner' take back what was decided before.
    """
    from validation.campaign.folder import load_campaign
    from validation.report.terminal import print_json
    from vision_gt.commands.decide import decide_by_hand

    path, name = decide_by_hand(load_campaign(campaign), image, decision, pixels, by, note)
    if as_json:
        print_json({"decisions": path, "image": name, "decision": decision})
        return
    click.echo(f"Recorded in {path}.")
