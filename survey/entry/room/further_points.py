"""World points that are put on the walls while the readings are taken."""

import re
import tomllib

from survey.entry.room.targets import Names
from validation.campaign.folder import Campaign, load_campaign
from validation.errors import GtvalError
from validation.text_files.writing import write_files

_LIST = re.compile(
    r"(^[ \t]*(?:survey\s*\.\s*)?world_points\s*=\s*\[[^\]]*?)(,?\s*)\]", re.MULTILINE
)


def check_point_name(name: str, names: Names) -> str:
    """The name of a further world point.

    Raises
    ------
    GtvalError
        If it cannot be one.
    """
    if not name or any(c in name for c in '/,;"\\') or not name.isprintable() or " " in name:
        raise GtvalError(f"'{name}' cannot be the name of a mark: no blanks, no / \\ , ; or quotes")
    if name in names.points:
        raise GtvalError(f"{name} is there already")
    return name


def with_world_point(campaign: Campaign, name: str) -> Campaign:
    """The campaign with a further world point, which its campaign.toml then lists.

    Only the list is changed; comments and all else stay as they are.

    Raises
    ------
    GtvalError
        If the list is not found as usual, or the file cannot be written.
    """
    path = campaign.toml
    old = path.read_text(encoding="utf-8")
    new, count = _LIST.subn(lambda found: f'{found[1]}, "{name}"]', old, count=1)
    wanted = tomllib.loads(old)
    survey = wanted.get("survey", {})
    survey["world_points"] = [*survey.get("world_points", []), name]
    try:
        is_right = count == 1 and tomllib.loads(new) == wanted
    except tomllib.TOMLDecodeError:
        is_right = False
    if not is_right:
        raise GtvalError(f'add "{name}" to world_points under [survey] in {path}, and start again')
    write_files(path.parent, {path.name: new})
    return load_campaign(campaign.folder)
