"""Camera files of other programs: one table of the formats that are read.

All put the centre of the top-left pixel at (0, 0) but COLMAP, and share Brown's lens of
`vision_gt.optics.camera`; Kalibr's 'radtan' ends after p2. The lenses of `vision_gt.optics.lenses`
are read where a file names them; others are refused by their names.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from validation.errors import GtvalError
from vision_gt.optics.camera import Camera
from vision_gt.optics.formats import bouguet, colmap, kalibr, opencv, realsense, slam
from vision_gt.optics.formats.fields import bad
from vision_gt.optics.formats.source import Source, source_of


class Format(NamedTuple):
    """A format of camera files."""

    name: str
    """As docs/vision.md has it; '' for one that is named and refused."""
    known: Callable[[Source], bool]
    read: Callable[[Source, str | None], list[Camera]]


FORMATS = (
    # Those that a suffix or a line of text tells; what is named inside is not looked at.
    Format("", bouguet.is_program, bouguet.refuse_program),
    Format("", colmap.is_binary_colmap, colmap.refuse_binary_colmap),
    Format("Bouguet's toolbox", bouguet.is_bouguet, bouguet.read_bouguet),
    Format("COLMAP", colmap.is_colmap, colmap.read_colmap),
    Format("ROS, .ini", opencv.is_ros_ini, opencv.read_ros_ini),
    # Those that fields tell.
    Format("Kalibr", kalibr.is_kalibr, kalibr.read_kalibr),
    Format("EuRoC", kalibr.is_euroc, kalibr.read_euroc),
    Format("Basalt", kalibr.is_basalt, kalibr.read_basalt),
    Format("camodocal, VINS", slam.is_camodocal, slam.read_camodocal),
    Format("ORB-SLAM2, ORB-SLAM3", slam.is_orb_slam, slam.read_orb_slam),
    Format("RealSense", realsense.is_realsense, realsense.read_realsense),
    Format("ROS", opencv.is_ros, opencv.read_ros),
    Format("OpenCV, numpy", opencv.has_matrix, opencv.read_opencv),
)
"""In the order in which they are tried: the first that knows a file reads it."""


def read_cameras(path: Path, name: str | None = None) -> list[Camera]:
    """The cameras of a file; its contents tell the format.

    Parameters
    ----------
    path : Path
        A file of one of the `FORMATS`.
    name : str, optional
        The only one wanted of a file of several: others may have lenses that are not read.

    Raises
    ------
    InputError
        If the file is missing, cannot be parsed, or lacks something.
    """
    source = source_of(path)
    for one in FORMATS:
        if one.known(source):
            return one.read(source, name)
    names = "; ".join(one.name for one in FORMATS if one.name)
    said = f"the camera file lacks this, and is of no other format that is read: {names}"
    raise bad(path, said, "camera_matrix")


def camera_of(path: Path, name: str | None = None) -> Camera:
    """The camera of a file, or the one of this name where there are several.

    Raises
    ------
    GtvalError
        If there are several or none, with their names.
    """
    found = read_cameras(path, name)
    chosen = [one for one in found if name is None or one.name == name]
    if len(chosen) != 1:
        names = ", ".join(one.name for one in found)
        raise GtvalError(f"{path} has the cameras {names}; choose one with --camera")
    return chosen[0]
