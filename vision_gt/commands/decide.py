"""A decision about an image, made at the command line."""

import os
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import numpy as np

from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError, Problem
from vision_gt.images.decisions import ImageDecision, append_image_decisions, image_decisions
from vision_gt.images.files import ENDINGS
from vision_gt.settings import VisionSettings
from vision_gt.stages.decided import decisions_path


def decide_by_hand(
    campaign: Campaign, image: Path, kind: str, pixels: Sequence[float], by: str, note: str
) -> tuple[Path, str]:
    """Record a decision; its file, and the image as that names it.

    Raises
    ------
    GtvalError
        If there is no such image, the pixels are not those that a decision has, or the file is
        bad.
    """
    if len(pixels) not in {0, 2, 4}:
        raise GtvalError(f"{len(pixels)} numbers; expected X Y, or X Y AXIS_X AXIS_Y, in pixels")
    name = image_in(campaign.folder, image)
    path = decisions_path(campaign, campaign.section("vision", VisionSettings))
    image_decisions(path)
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    places = np.array(pixels, dtype=float).reshape(-1, 2)
    append_image_decisions(path, [ImageDecision(name, kind, places, by, note)], now)
    return path, name


def image_in(folder: Path, image: Path) -> str:
    """An image by its name relative to the campaign, which it lies in.

    Raises
    ------
    InputError
        If there is no such image in the campaign folder.
    """
    root = folder.absolute()
    for one in (root / image, image.absolute()):
        where = Path(os.path.normpath(one))
        if where.is_file() and where.suffix.lower() in ENDINGS and where.is_relative_to(root):
            return where.relative_to(root).as_posix()
    raise InputError([Problem(image, "there is no such image in the campaign")])
