"""All patterns that a campaign needs, as files to print."""

import tomllib

from validation.errors import GtvalError
from vision_gt.example_settings import example_tables
from vision_gt.patterns.dictionaries import Family
from vision_gt.patterns.drawing import board_print, marker_print, pattern_bytes
from vision_gt.settings import VisionSettings
from vision_gt.stages.inputs import made_board, sides_of

EXAMPLE = example_tables(["vision", "vision.bar", "vision.reference", "vision.markers"])
"""Tables of campaign.toml for who has no campaign yet."""


def example_settings() -> VisionSettings:
    """The settings that `EXAMPLE` states."""
    return VisionSettings.model_validate(tomllib.loads(EXAMPLE)["vision"])


def pattern_files(settings: VisionSettings, suffix: str) -> dict[str, str | bytes]:
    """Files of the boards and markers that settings state, by name.

    Parameters
    ----------
    settings : VisionSettings
        Which boards and markers.
    suffix : str
        '.svg' or '.pdf'.

    Raises
    ------
    GtvalError
        If they state none.
    """
    boards = {
        "calibration_board": settings.board,
        "reference_board": settings.reference.board,
        "bar_first_board": settings.bar.first,
        "bar_second_board": settings.bar.second,
    }
    files: dict[str, str | bytes] = {
        f"{name}{suffix}": pattern_bytes(suffix, board_print(made_board(board)))
        for name, board in boards.items()
        if board is not None
    }
    family = Family(settings.markers.family, settings.markers.border)
    for number, side in sides_of(settings).items():
        pattern = marker_print(family, number, side)
        files[f"marker_{number}{suffix}"] = pattern_bytes(suffix, pattern)
    if not files:
        raise GtvalError(
            f"campaign.toml states no boards and no markers; for example:\n\n{EXAMPLE}"
        )
    return files
