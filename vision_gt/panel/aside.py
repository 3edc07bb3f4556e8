"""What is made of one image in a process beside the page: decoded, made smaller, looked at."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from validation.poses.angles import Array
from vision_gt.images.files import read_image

QUALITY = 85
"""Of JPEG files that only eyes look at."""
MOST_WIDTH = 4096
"""Pixels: more, and a telephone draws nothing."""
DECIMALS = 2


def picture(file: str, width: int) -> bytes:
    """An image as a JPEG file, its larger side made as small as asked.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    image = read_image(Path(file))
    most = min(width, MOST_WIDTH)
    share = most / max(image.shape)
    if share < 1:
        image = np.asarray(
            cv2.resize(image, None, fx=share, fy=share, interpolation=cv2.INTER_AREA)
        )
    _, encoded = cv2.imencode(".jpg", image, (cv2.IMWRITE_JPEG_QUALITY, QUALITY))
    return encoded.tobytes()


def look_told(folder: str, image: str) -> dict[str, Any]:
    """What was found in an image and what was expected, as plain values; pixels.

    Raises
    ------
    GtvalError
        If the campaign or the image is bad.
    """
    from validation.campaign.folder import load_campaign  # noqa: PLC0415  (not for a picture)
    from vision_gt.commands.looking import Looking  # noqa: PLC0415  (the same)
    from vision_gt.images.kept import detect_new  # noqa: PLC0415  (the same)

    campaign = load_campaign(Path(folder))
    looking = Looking(campaign, workers=1)
    path = campaign.folder / image
    height, width = read_image(path).shape
    told: dict[str, Any] = {"size": [width, height], "verdict": "", "outlines": [], "left": []}
    for look in looking.looks((), (), [path], everything=True)[:1]:
        told["verdict"] = look.became
        told["outlines"] = [
            {
                "name": one.name,
                "found": _listed(one.found),
                "expected": _listed(one.expected),
                "corners": _listed(one.corners),
                "axes": _listed(one.axes),
                "off": None if np.isnan(one.off) else round(one.off, DECIMALS),
            }
            for one in look.outlines
        ]
        told["left"] = [
            {
                "kind": one.kind,
                "number": one.number,
                "reason": one.reason,
                "outline": _listed(one.outline),
                "place": _listed(one.place[None])[0] if np.isfinite(one.place).all() else None,
            }
            for one in look.rejections
        ]
    for purpose, camera, own, moment in looking.given.board_images():
        if purpose == "reference" and own == path:
            job = looking.given.board_job(purpose, camera, own, moment)
            [found] = detect_new([job], looking.given.kept, 1)
            readings = [one for view in found.boards for one in view.readings()]
            told["readings"] = [_listed(one.ends) for one in readings]
    return told


def _listed(places: Array) -> list[list[float]]:
    """Places (k, 2) as lists; none where one of them is nowhere."""
    if not np.isfinite(places).all():
        return []
    rounded: list[list[float]] = np.round(places, DECIMALS).tolist()
    return rounded
