"""What a lab has to state of its hardware."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from validation.errors import Problem
from vision_gt.example_settings import EXAMPLES
from vision_gt.settings import VisionSettings


def missing_facts(
    toml: Path, settings: VisionSettings, needed: Mapping[str, str]
) -> Iterator[Problem]:
    """What a lab has to state of its hardware and did not: nothing here has a default.

    Parameters
    ----------
    toml : Path
        The campaign's.
    settings : VisionSettings
        As read.
    needed : mapping of str to str
        Keys or tables, such as 'vision.bar', and what they are needed for.
    """
    for table, keys in EXAMPLES.items():
        found: Any = settings
        for part in table.split(".")[1:]:
            found = getattr(found, part)
        for key, example in keys.items():
            name = f"{table}.{key}"
            why = needed.get(name) or needed.get(table)
            if why and getattr(found, key) in (None, "", {}):
                said = f"needed for {why}; write in [{table}] a line such as: {key} = {example}"
                yield Problem(toml, said, field=name)
