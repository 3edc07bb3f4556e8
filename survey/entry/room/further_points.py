"""World points that are put on the walls while the readings are taken."""

import re
import tomllib

from validation.campaign.folder import Campaign, load_campaign
from validation.errors import GtvalError
from validation.text_files.writing import write_files

_LIST = re.compile(
    r"(^[ \t]*(?:survey\s*\.\s*)?world_points\s*=\s*\[[^\]]*?)(,?\s*)\]", re.MULTILINE
)


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
