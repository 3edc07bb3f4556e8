"""The command ``gtval rtk noise``."""

from pathlib import Path

import click

from validation.commands.options import AS_JSON, PATH


@click.command()
@click.argument("logs", type=PATH, nargs=-1, required=True, metavar="LOG...")
@AS_JSON
def noise(logs: tuple[Path, ...], as_json: bool) -> None:
    """Tell the noise of receivers that stood, and eta: that upwards over that of one level number.

    Each LOG is of a standing receiver, half an hour or longer. Writes nothing; state what is found
    as `eta` in [rtk].
    """
    import numpy as np

    from rtk_gt.positions.standing import standing_noise
    from rtk_gt.receivers.formats.reading import Stated, read_receiver
    from validation.report.terminal import print_json, print_table
    from validation.results import Table

    found = [standing_noise(read_receiver(log, Stated(log.stem))) for log in logs]
    if as_json:
        print_json({"records": found, "remarks": [one.remark for one in found if one.remark]})
        return
    rows: list[list[str | int | float | None]] = [
        [
            *(one.receiver, one.fixes, one.seconds / 60, *(1000 * one.sigmas).tolist()),
            *(one.eta, one.low, one.high, float(np.max(one.worth))),
        ]
        for one in found
    ]
    columns = ["receiver", "fixes", "minutes", "east [mm]", "north [mm]", "up [mm]"]
    columns += ["eta", "low", "high", "fixes worth one"]
    note = (
        "Standard deviations about the mean, of RTK-fixed positions; eta with its interval of 95 "
        "%. What lasts as long as the record is not in them."
    )
    formats = ["", "", ".1f", ".1f", ".1f", ".1f", ".2f", ".2f", ".2f", ".1f"]
    print_table(Table("Noise of standing receivers", columns, rows, formats, note))
    for one in found:
        if one.remark:
            click.echo(one.remark)


COMMANDS: list[click.Command] = [noise]
