"""Which readings the readings file may lack without anybody having taken them out."""

import contextlib
from collections.abc import Iterable
from pathlib import Path


class LateRows:
    """A note beside the readings file of readings that it was not given yet.

    A file that was saved in another form, or that another process writes as well, may lack
    readings of the journal older than others that it has. Were that not noted, they would be
    taken for rows that somebody deleted. The note outlives a kill.

    Parameters
    ----------
    path : Path
        Where it lies. A line '17' is reading 17, '17+' this one and all after it.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def add(self, number: int, *, and_after: bool = False) -> None:
        """Note a reading, or all from one on."""
        with contextlib.suppress(OSError), self._path.open("a", encoding="ascii") as stream:
            stream.write(f"{number}{'+' if and_after else ''}\n")

    def not_among(self, numbers: Iterable[int]) -> tuple[int, ...]:
        """Those of the readings that are not noted."""
        try:
            lines = self._path.read_text(encoding="ascii", errors="replace").split()
        except OSError:
            return tuple(numbers)
        single = {int(line) for line in lines if line.isdecimal()}
        open_ended = [int(line[:-1]) for line in lines if line[:-1].isdecimal() and line[-1] == "+"]
        first = min(open_ended, default=None)
        return tuple(n for n in numbers if n not in single and (first is None or n < first))

    def clear(self) -> None:
        """All are in the file now."""
        with contextlib.suppress(OSError):
            self._path.unlink(missing_ok=True)
