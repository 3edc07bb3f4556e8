"""The command ``gtval enter``."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from validation.commands.options import AS_JSON, CAMPAIGN, PATH

if TYPE_CHECKING:
    from survey.entry.dialogue.entry_session import EntrySession
    from validation.campaign.folder import Campaign
    from validation.page.people import Person


@click.command()
@CAMPAIGN
@click.option("--by", default="", help="Who is at the laser; noted with every reading.")
@click.option("--second", is_flag=True, help="Blind second entry, by the other person.")
@click.option("--web", is_flag=True, help="Serve a page for phones and tablets in the room.")
@click.option("--host", default="127.0.0.1", show_default=True, help="With --web: address.")
@click.option("--port", default=8765, show_default=True, type=click.IntRange(0, 65535))
@click.option("--tls", is_flag=True, help="With --web: encrypted, so that screens stay awake.")
@click.option("--adopt", is_flag=True, help="Take over what was changed by hand in the file.")
@click.option(
    "--stops",
    type=click.IntRange(1, 1000),
    help="Write so many stops to a campaign.toml that plans none.",
)
@click.option("--status", is_flag=True, help="Only say how far the work is.")
@AS_JSON
def enter(
    *,
    campaign: Path,
    by: str,
    second: bool,
    web: bool,
    host: str,
    port: int,
    tls: bool,
    adopt: bool,
    stops: int | None,
    status: bool,
    as_json: bool,
) -> None:
    """Enter hand-laser readings, one number and Enter at a time.

    The plan follows from CAMPAIGN/campaign.toml: world points, stops, pairs that cannot be seen.
    Every reading is safe in survey/journal.jsonl before it is acknowledged; survey/readings.csv
    follows from it. Also takes a list from a pipe. --status and --json only look.
    """
    _read_what_is_no_text()
    with _nothing_collected():
        from survey.entry.dialogue.entry_session import EntrySession
        from validation.campaign.folder import load_campaign
        from validation.errors import GtvalError
        from validation.page.people import Person

        loaded = _with_stops(load_campaign(campaign), stops, ask=not (web or status or as_json))
        if second and not by:
            raise GtvalError("say who makes the second entry: --second --by NAME")
        look = status or as_json
        entry_session = (
            EntrySession.look(loaded) if look else EntrySession.open(loaded, by, adopt=adopt)
        )
    if look:
        _print_status(entry_session, as_json=as_json)
        return
    try:
        if web:
            from survey.entry.screens.serving import serve

            exit_status = serve(entry_session, host, port, tls=tls)
        else:
            exit_status = _at_terminal(entry_session, Person(by, "terminal", second))
    finally:
        entry_session.close()
    if exit_status:
        raise click.exceptions.Exit(exit_status)


def _with_stops(campaign: "Campaign", count: int | None, *, ask: bool) -> "Campaign":
    """The campaign; where it plans no stops, that is said, and they are written if wanted."""
    import sys

    from survey.entry.room.planned_stops import lacks_stops, lines_to_write, write_stops

    if count is None and not lacks_stops(campaign):
        return campaign
    if count is None:
        click.echo(lines_to_write(campaign), err=True)
        if ask and sys.stdin.isatty():
            said = "How many stops shall be written there (0: none)?"
            count = click.prompt(said, default=0, type=click.IntRange(0, 1000))
            if count and not click.confirm(f"Write {count} stops to campaign.toml?"):
                count = 0
    return write_stops(campaign, count) if count else campaign


def _read_what_is_no_text() -> None:
    """A byte that is no text ends nothing."""
    import io
    import sys

    if isinstance(sys.stdin, io.TextIOWrapper):
        sys.stdin.reconfigure(errors="replace")


@contextmanager
def _nothing_collected() -> Iterator[None]:
    """Without looking for garbage: a start makes thousands of objects, and all of them stay."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def _at_terminal(entry_session: "EntrySession", person: "Person") -> int:
    """Exit status of the terminal front end."""
    import sys

    from survey.entry.screens.terminal import TerminalEntry

    if sys.stdin.isatty():
        import readline  # noqa: F401  (arrow keys in the line that is typed)
    entry_session.begin(person)
    status = TerminalEntry(entry_session, person, sys.stdin).run()
    entry_session.end(person)
    return status


def _print_status(entry_session: "EntrySession", *, as_json: bool) -> None:
    """How far the work is, what is next, what is doubtful."""
    from survey.entry.dialogue.words import (
        doubts_text,
        pair_text,
        progress_text,
        unchecked_text,
    )
    from validation.page.people import Person

    progress = entry_session.guide.progress()
    target = entry_session.guide.next_target(Person(""))
    doubtful = entry_session.doubtful()
    changes = entry_session.readings_file.changes_by_hand(entry_session.state)
    waiting = 0 if changes is None else len(changes.added)
    if as_json:
        from validation.report.terminal import print_json

        entries = [entry_session.state.entries[number] for number in doubtful]
        said = {
            "done": progress.done,
            "left": progress.left,
            "skipped": progress.skipped,
            "not_in_journal": waiting,
            "next": None if target is None else {"from": target.start, "to": target.end},
            "doubtful": [
                {"entry": e.number, "from": e.start, "to": e.end, "distance": e.metres}
                for e in entries
            ],
            "unchecked": entry_session.unchecked(),
        }
        print_json(said)
        return
    click.echo(progress_text(progress))
    if waiting:
        name = entry_session.readings_file.path.name
        click.echo(f"{name} has {waiting} reading(s) that the journal does not have yet")
    open_still = doubtful or entry_session.disagreeing()
    if target is not None:
        click.echo(f"next: {pair_text(target)}")
    elif not open_still:
        click.echo("all done")
    if doubtful:
        click.echo(f"{len(doubtful)} doubtful: {doubts_text(entry_session, doubtful)}")
    if unchecked_text(entry_session):
        click.echo(unchecked_text(entry_session))


@click.command("journal-merge")
@CAMPAIGN
@click.argument("others", nargs=-1, type=PATH)
@AS_JSON
def journal_merge(*, campaign: Path, others: tuple[Path, ...], as_json: bool) -> None:
    """Merge the journals of two entries that did not see one another.

    Where two `gtval enter` wrote to one journal at the same moment, on a share that knows no locks,
    CAMPAIGN alone is named; where a share made a second file of it, that is one of OTHERS. All that
    either wrote is kept, in the order of time; the journal of before stays beside it.
    """
    from survey.entry.dialogue.journal_merge import merge
    from validation.campaign.folder import load_campaign

    merged, kept = merge(load_campaign(campaign), others)
    if as_json:
        from validation.report.terminal import print_json

        print_json({"entries": len(merged.entries), "writers": merged.branches, "kept": kept})
        return
    click.echo(f"{len(merged.entries)} entries of {merged.branches} writer(s) are in the journal")
    click.echo(f"the journal of before is {kept}")
