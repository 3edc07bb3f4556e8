"""Commands whose modules are imported when they are used, not when they are listed."""

from importlib import import_module

import click


class Later(click.Command):
    """A command that is known by its name and the first sentence of its help.

    Parameters
    ----------
    name : str
        Of the command.
    value : str
        Where it is: 'module:attribute'.
    first : str
        The first sentences of its help, as the list of commands shows them.
    """

    def __init__(self, name: str, value: str, first: str) -> None:
        super().__init__(name, help=first)
        self.value = value

    def load(self) -> click.Command:
        """The command itself."""
        module, _, attribute = self.value.partition(":")
        command: click.Command = getattr(import_module(module), attribute)
        return command
