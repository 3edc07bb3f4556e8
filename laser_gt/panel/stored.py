"""What the last run left of its matches: how many are held up, without loading any scan."""

from pathlib import Path

from validation.errors import GtvalError
from validation.text_files.csv_tables import Column, read_csv


def stored_held_up(results: Path) -> int | None:
    """Matches that may be wrong, by the table of the last run; None where there is none."""
    path = results / "laser_matches_scanmatch.csv"
    if not path.is_file():
        return None
    try:
        verdicts = read_csv(path, [Column("verdict")]).text["verdict"]
    except GtvalError:
        return None
    return sum(verdict == "may be wrong" for verdict in verdicts)
