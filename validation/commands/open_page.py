"""The command ``gtval open``."""

from pathlib import Path

import click

from validation.commands.options import AS_JSON, CAMPAIGN

PORT = 8766


@click.command("open")
@CAMPAIGN
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to serve at.")
@click.option("--port", default=PORT, show_default=True, type=click.IntRange(0, 65535))
@click.option("--tls", is_flag=True, help="Encrypted, so that phones keep their screens awake.")
@click.option("--no-browser", is_flag=True, help="Open no browser on this machine.")
@click.option("--status", is_flag=True, help="Only say what waits for a person.")
@AS_JSON
def open_page(
    *,
    campaign: Path,
    host: str,
    port: int,
    tls: bool,
    no_browser: bool,
    status: bool,
    as_json: bool,
) -> None:
    """Open one page for everything that needs a person, in the browser.

    What to do, readings, matches, images and trajectories to look at, the report. This machine
    alone can reach it, unless --host says otherwise; each device types a code that is shown here.
    Ctrl-C ends it, and loses nothing. --status and --json only look.
    """
    from validation.page.whole import page_status, serve_page

    if not (status or as_json):
        serve_page(campaign, host, port, tls=tls, browser=not no_browser)
        return
    found, waiting = page_status(campaign)
    if as_json:
        from validation.report.terminal import print_json

        print_json({"waiting": waiting, "failed": found.failed})
        return
    titles = {panel.name: panel.title for panel in found.panels}
    for name, some in waiting.items():
        for one in some:
            click.echo(f"{titles[name]}: {one.text}")
    if not any(waiting.values()):
        click.echo("nothing waits for a person")
