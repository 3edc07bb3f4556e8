"""Who is at a page or a terminal."""

from dataclasses import dataclass

MAX_NAME = 80
"""Characters kept of a name. A judgement: more is a mistake of a program."""


@dataclass(frozen=True)
class Person:
    """Who does something, and on what.

    Parameters
    ----------
    name : str
        The person: the observer of the readings, who decided about a match.
    device : str
        'terminal', or the name of a phone.
    second : bool
        Whether this person makes the blind second entries.
    """

    name: str
    device: str = "terminal"
    second: bool = False


def clean_text(text: str, most: int) -> str:
    """The text on one line, shortened, without unprintable characters."""
    kept = "".join(c if c.isprintable() else " " for c in text)
    return " ".join(kept.encode("utf-8", "ignore").decode().split())[:most]
