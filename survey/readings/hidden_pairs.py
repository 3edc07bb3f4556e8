"""Pairs of points that do not see one another, as a campaign folder lists them."""

from collections.abc import Collection
from pathlib import Path

from survey.settings import PlanSettings
from validation.campaign.folder import Campaign
from validation.text_files.csv_tables import Column, read_csv

Pair = frozenset[str]


def load_hidden_pairs(
    campaign: Campaign, settings: PlanSettings, names: Collection[str]
) -> dict[Pair, str]:
    """Pairs that cannot be read, with the reason where one is given; none without a file.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    settings : PlanSettings
        Names the file: columns from, to and, if wanted, reason.
    names : collection of str
        All points. '7/*' in the file stands for all marks of stop 7.

    Raises
    ------
    InputError
        Naming file, line, field and value of every bad place.
    """
    path: Path = campaign.folder / settings.not_visible
    if not path.exists():
        return {}
    table = read_csv(
        path, [Column("from"), Column("to"), Column("reason", required=False, blank=True)]
    )
    hidden: dict[Pair, str] = {}
    for row in range(len(table)):
        ends = []
        for column in ("from", "to"):
            meant = _meant(table.text[column][row], names)
            if not meant and table.text[column][row]:
                table.flag(row, column, "no such point in the plan")
            ends.append(meant)
        reason = table.text["reason"][row]
        hidden |= {frozenset((a, b)): reason for a in ends[0] for b in ends[1]}
    table.raise_problems()
    return hidden


def _meant(name: str, names: Collection[str]) -> list[str]:
    """The points that a name of the file stands for."""
    if name.endswith("/*"):
        return [point for point in names if point.startswith(name[:-1])]
    return [name] if name in names else []
