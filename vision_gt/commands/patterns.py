"""All patterns that a campaign needs, as files to print."""

from vision_gt.campaign.inputs import made_board
from vision_gt.patterns.dictionaries import Family
from vision_gt.patterns.drawing import board_print, marker_print, pattern_bytes
from vision_gt.settings import VisionSettings


def pattern_files(settings: VisionSettings, suffix: str) -> dict[str, str | bytes]:
    """Files of boards and markers, by name.

    Parameters
    ----------
    settings : VisionSettings
        Which boards and markers.
    suffix : str
        '.svg' or '.pdf'.
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
    }
    family = Family(settings.markers.family, settings.markers.border)
    for number, side in settings.markers.side_of.items():
        pattern = marker_print(family, number, side)
        files[f"marker_{number}{suffix}"] = pattern_bytes(suffix, pattern)
    return files
