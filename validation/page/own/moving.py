"""Which trajectories a campaign has, without reading one."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from validation.campaign.folder import Campaign, Published


@dataclass(frozen=True)
class Origin:
    """Where a trajectory comes from.

    Parameters
    ----------
    path : Path
        Its file.
    entry : Published or None
        What campaign.toml says of it; None for the result of a run.
    """

    path: Path
    entry: Published | None = None


def origins(campaign: Campaign) -> dict[str, Origin]:
    """The trajectories of a campaign by their systems: published ones, then those of the last run.

    Of files no more than the beginning is read, once. What lies outside the campaign folder is
    left out.
    """
    found = {}
    root = campaign.folder.resolve()
    for entry in campaign.settings.published:
        path = campaign.folder / entry.file
        if not path.resolve().is_relative_to(root) or not path.exists():
            continue
        told = bool(entry.stops or entry.format or not entry.judged)
        if told or _looks_moving(path, changed(path)):
            found[entry.system] = Origin(path, entry)
    for path in sorted(campaign.results.glob("trajectory_*.csv")):
        if path.resolve().is_relative_to(root):
            found.setdefault(path.stem.removeprefix("trajectory_"), Origin(path))
    return found


def changed(path: Path) -> tuple[int, int]:
    """What is another once a file has been written: its time and its size."""
    at = path.stat()
    return at.st_mtime_ns, at.st_size


@lru_cache(maxsize=64)
def _looks_moving(path: Path, _changed: tuple[int, int]) -> bool:
    """Whether a file looks like a trajectory."""
    from validation.trajectories.formats import is_trajectory  # noqa: PLC0415  (scipy)

    return is_trajectory(path)
