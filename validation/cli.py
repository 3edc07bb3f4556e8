"""The ``gtval`` command: a click group whose commands are found by entry points.

Nothing heavy is imported here or when the commands are loaded; a command imports what it needs
when it is called.
"""

import os
import sys
from collections.abc import Iterable
from typing import Any

import click

from validation.commands.later import Later
from validation.commands.output import BAD_INPUT, INTERRUPTED, UNEXPECTED
from validation.errors import GtvalError, InputError
from validation.plugins import EntryPoint, entry_points
from validation.report.characters import never_fail
from validation.stopping import ended_as_interrupted

WANTS_JSON = "gtval.json"
"""Key of the click context's meta: whether an error, too, is to be told as JSON."""


class DiscoveredGroup(click.Group):
    """A group with the commands of all installed packages; known errors end plainly."""

    def __init__(self, **settings: object) -> None:
        super().__init__(**settings)  # type: ignore[arg-type]
        self._found = self._listing = False

    def _discover(self) -> None:
        if self._found:
            return
        self._found = True
        self._load(sorted(entry_points(group="gtval.commands"), key=lambda e: e.name))

    def _load(self, entries: Iterable[EntryPoint]) -> None:
        for entry in entries:
            try:
                for command in entry.load():
                    self.add_command(command)
            except (Exception, SystemExit) as error:  # noqa: BLE001  (it must not take the rest)
                click.echo(f"Warning: plug-in '{entry.name}' cannot be loaded: {error}", err=True)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands."""
        self._discover()
        return super().list_commands(ctx)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The named command; one whose entry point has its name needs none of the others."""
        if not self._found:
            self._load(e for e in entry_points(group="gtval.commands") if e.name == cmd_name)
        if cmd_name not in self.commands:
            self._discover()
        command = super().get_command(ctx, cmd_name)
        return command.load() if isinstance(command, Later) and not self._listing else command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands, without importing what they need."""
        self._listing = True
        try:
            super().format_commands(ctx, formatter)
        finally:
            self._listing = False

    def main(self, *arguments: Any, **settings: Any) -> Any:
        """Run the program; no character that the terminal lacks is an error.

        Output that cannot be written is one, told in a line; a pipe that its reader has closed
        is an end like any other.
        """
        never_fail()
        # Most matrices here are small: threads that wait for one another take more processor
        # time than the products. numpy is not loaded yet; who sets the variable decides.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        if sys.stdout is None:
            click.echo("Error: the standard output is closed", err=True)
            sys.exit(UNEXPECTED)
        try:
            try:
                with ended_as_interrupted():
                    return super().main(*arguments, **settings)
            finally:
                sys.stdout.flush()
        except OSError as error:
            if not isinstance(error, BrokenPipeError):
                click.echo(f"Error: the output cannot be written: {error.strerror}", err=True)
            # What is still to be written goes nowhere.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            sys.exit(UNEXPECTED)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """The arguments; whether JSON is asked for is known before any of them is wrong."""
        ctx.meta[WANTS_JSON] = "--json" in args
        return super().parse_args(ctx, args)

    def invoke(self, ctx: click.Context) -> object:
        """Run the command; whatever goes wrong ends in a plain sentence and its exit status."""
        try:
            return super().invoke(ctx)
        except GtvalError as error:
            problems = error.problems if isinstance(error, InputError) else ()
            _tell(ctx, f"Error: {error}", problems)
            ctx.exit(BAD_INPUT)
        except (KeyboardInterrupt, click.Abort):
            if sys.stderr.isatty():
                click.echo(err=True)  # the terminal's own ^C stays on a line of its own
            _tell(ctx, "Interrupted; no file is half-written.")
            ctx.exit(INTERRUPTED)
        except click.ClickException as error:
            _tell_json(ctx, error.format_message())
            raise
        except (click.exceptions.Exit, BrokenPipeError):
            raise
        except Exception as error:
            if isinstance(error, OSError) and _stdout_fails():
                raise
            import traceback  # noqa: PLC0415

            said = f"Error: unexpected: {type(error).__name__}: {error}. Please report it"
            click.echo("".join(traceback.format_exception(error)), err=True, nl=False)
            _tell(ctx, said)
            ctx.exit(UNEXPECTED)


def _stdout_fails() -> bool:
    """Whether what is printed cannot be written; an empty line, where it can, harms nobody."""
    try:
        sys.stdout.write("\n")
        sys.stdout.flush()
    except OSError:
        return True
    return False


def _tell(ctx: click.Context, message: str, problems: Iterable[object] = ()) -> None:
    """What went wrong on stderr, and where JSON was asked for as an object on stdout."""
    click.echo(message, err=True)
    _tell_json(ctx, message.removeprefix("Error: "), problems)


def _tell_json(ctx: click.Context, message: str, problems: Iterable[object] = ()) -> None:
    if ctx.meta.get(WANTS_JSON):
        from validation.report.terminal import print_json  # noqa: PLC0415

        error = {"message": message, "problems": list(problems)}
        print_json({"command": ctx.invoked_subcommand or "", "error": error})


STATUSES = """Exit status of every command: 0 done; 1 a part failed unexpectedly, or
what is printed cannot be written; 2 bad input or
usage, or a file cannot be written; 3 with --strict, a finding is an error; 130 interrupted."""


@click.command(
    cls=DiscoveredGroup,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=STATUSES,
)
@click.version_option(package_name="gtval", prog_name="gtval")
def main() -> None:
    """Prove how good a ground truth is.

    Start with `gtval demo`, then `gtval run CAMPAIGN` on a campaign folder of your own.
    """
