"""Which campaigns there are, and on which day each was."""

import re
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path

TOML = "campaign.toml"
_DAY = re.compile(r"(?<!\d)(\d{4})-?(\d\d)-?(\d\d)(?:[T _](\d\d):?(\d\d)(?::?(\d\d))?)?(?!\d)")
_MONTH = re.compile(r"(\d{4})(?:-(\d\d))?$")
_DIGITS = re.compile(r"(\d+)")


def campaign_folders(paths: Iterable[Path]) -> list[Path]:
    """The campaign folders that are named, each once, in the order named.

    A folder without campaign.toml stands for the campaigns that lie in it, by their names; where
    there are none it stays, so that whoever reads it says what is missing.
    """
    found: dict[Path, Path] = {}
    for path in paths:
        inside: list[Path] = []
        if path.is_dir() and not (path / TOML).exists():
            inside = [one.parent for one in path.glob(f"*/{TOML}")]
        for folder in sorted(inside, key=lambda one: by_name(one.name)) or [path]:
            own = folder.parent if folder.name == TOML else folder
            found.setdefault(own.absolute(), own)
    return list(found.values())


def by_name(name: str) -> list[tuple[int, str]]:
    """Key of the order of names: 'day 2' before 'day 10'."""
    parts = _DIGITS.split(name.casefold())
    return [(int(one), one) if one.isdecimal() else (-1, one) for one in parts]


def moment_of(text: str) -> datetime | None:
    """The day that a text states as YYYY-MM-DD, with the time of day if it states one.

    Also '20260311', and '2026-03' or '2026' alone, which stand for their first day. None where
    there is no such day.
    """
    found = _DAY.search(text)
    month = _MONTH.match(text.strip())
    if found:
        parts = [int(one) for one in found.groups(default="0")]
    elif month:
        parts = [int(month[1]), int(month[2] or 1), 1]
    else:
        return None
    try:
        return datetime(*parts, tzinfo=UTC)  # type: ignore[misc,arg-type]
    except ValueError:
        return None


def in_order(names: Sequence[str], moments: Sequence[datetime | None]) -> list[int]:
    """Places of the days in the order of time, or of their names where one states no day.

    Parameters
    ----------
    names : sequence of str
        Of the folders; days of the same date are in the order of their names.
    moments : sequence of datetime or None
        What each states.
    """
    dated = all(one is not None for one in moments)
    first = [one.timestamp() if dated and one is not None else 0.0 for one in moments]
    return sorted(range(len(names)), key=lambda place: (first[place], by_name(names[place])))
