"""One photo: poses of the markers, or of the board, that it shows."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import RigidTransform

from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array
from validation.results import Table, TableColumn
from vision_gt.images.files import read_picture
from vision_gt.images.jobs import BoardJob, Found, MarkerJob, detect_in
from vision_gt.looks.boards import outline_at
from vision_gt.looks.look import Look, Outline, closed
from vision_gt.network.single_board import board_in_camera
from vision_gt.optics.camera import Camera, project
from vision_gt.patterns.boards import Board
from vision_gt.patterns.dictionaries import Family
from vision_gt.patterns.rejections import Rejection
from vision_gt.robot.alone import marker_in_camera
from vision_gt.robot.marker_poses import marker_corners

MM = 1e3


@dataclass(frozen=True)
class Posed:
    """Something in the frame of the camera.

    Parameters
    ----------
    name : str
        'marker 6', 'board'.
    T : RigidTransform
        From its own frame to the camera's.
    covariance : (6, 6) array
        Metres, then radians, in the axes of the camera.
    p_value : float
        How likely so bad a fit is by chance.
    other : RigidTransform or None
        Another pose that fits nearly as well.
    """

    name: str
    T: RigidTransform
    covariance: Array
    p_value: float
    other: RigidTransform | None = None


@dataclass(frozen=True)
class Photo:
    """What a photo shows.

    Parameters
    ----------
    path : Path
        The file.
    posed : tuple of Posed
        Markers, or the board.
    look : Look
        To be drawn.
    remarks : tuple of str
        What is odd about it.
    """

    path: Path
    posed: tuple[Posed, ...]
    look: Look = field(repr=False)
    remarks: tuple[str, ...] = ()

    @property
    def table(self) -> Table:
        """Poses with their standard deviations."""
        T = [one.T for one in self.posed]
        turns = np.rad2deg([one.rotation.as_rotvec() for one in T]).reshape(-1, 3)
        sigmas = np.sqrt([np.diagonal(one.covariance) for one in self.posed]).reshape(-1, 6)
        columns: list[TableColumn] = [("", "", [one.name for one in self.posed])]
        for k, name in enumerate("xyz"):
            columns.append((f"{name} [m]", ".4f", [float(one.translation[k]) for one in T]))
        columns += [(f"r{name} [deg]", ".2f", turns[:, k]) for k, name in enumerate("xyz")]
        columns.append(("largest sigma [mm]", ".2f", MM * sigmas[:, :3].max(1, initial=0.0)))
        columns.append(
            ("largest sigma [deg]", ".3f", np.rad2deg(sigmas[:, 3:].max(1, initial=0.0)))
        )
        columns.append(("p of the fit", ".2g", [one.p_value for one in self.posed]))
        alike = ["no" if one.other is None else "yes" for one in self.posed]
        columns.append(("ambiguous", "", alike))
        note = (
            "In the camera's frame: x right, y down, z ahead; r: rotation vector. A marker's axes: "
            "x to the right of the print, y up, z towards the viewer. A board's: from its first "
            "inner corner along the columns and rows."
        )
        return Table.of_columns(f"Poses in {self.path.name}", columns, note)

    @property
    def facts(self) -> dict[str, object]:
        """For scripts."""
        return {
            "photo": str(self.path),
            "remarks": list(self.remarks),
            "poses": [
                {
                    "of": one.name,
                    "translation": one.T.translation.tolist(),
                    "rotation_vector": one.T.rotation.as_rotvec().tolist(),
                    "covariance": one.covariance.tolist(),
                    "p_value": one.p_value,
                    "ambiguous": one.other is not None,
                    "other": None
                    if one.other is None
                    else {
                        "translation": one.other.translation.tolist(),
                        "rotation_vector": one.other.rotation.as_rotvec().tolist(),
                    },
                }
                for one in self.posed
            ],
        }


def photo_of_markers(path: Path, camera: Camera, family: Family, side: float) -> Photo:
    """Poses of all markers of a family in a photo.

    Parameters
    ----------
    path : Path
        The photo.
    camera : Camera
        That took it.
    family : Family
        Of the markers.
    side : float
        Of each, metres.

    Raises
    ------
    GtvalError
        If the photo is bad, not of the camera's size, or shows no marker of the family.
    """
    every = tuple(range(len(family.dictionary.bytesList)))
    found, remarks = _looked_at(path, camera, MarkerJob(path, family, every, camera))
    posed, outlines = [], []
    for view in found.markers.views:
        pose = marker_in_camera(camera, view, side)
        if pose is None:
            continue
        T = pose.T_gtv_robot
        other = None
        if pose.ambiguous and pose.second is not None:
            turned = np.vstack([np.column_stack([pose.second.R, pose.second.t]), [0, 0, 0, 1]])
            other = RigidTransform.from_matrix(turned)
        posed.append(Posed(f"marker {view.number}", T, pose.covariance, pose.p_value, other))
        rim = project(T.apply(closed(marker_corners(side))), camera.parameters)
        outlines.append(Outline(str(view.number), view.corners, rim))
    return _photo(path, (posed, outlines), found.rejected, remarks, f"marker of {family.name}")


def photo_of_board(path: Path, camera: Camera, board: Board) -> Photo:
    """The pose of a board in a photo.

    Raises
    ------
    GtvalError
        If the photo is bad, not of the camera's size, or does not show the board.
    """
    job = BoardJob(path, camera.name, path.stem, [(0, board)])
    found, remarks = _looked_at(path, camera, job)
    posed, outlines = [], []
    for view in found.boards:
        one = board_in_camera(view, camera)
        if one is not None:
            other = one.T_camera_board * board.half_turn if board.looks_the_same_turned else None
            pose = Posed("board", one.T_camera_board, one.covariance, one.p_value, other)
            posed.append(pose)
            outlines.append(outline_at(view, "board", camera, one.T_camera_board))
    what = f"board of {board.columns} x {board.rows} squares"
    return _photo(path, (posed, outlines), found.rejected, remarks, what)


def _looked_at(
    path: Path, camera: Camera, job: BoardJob | MarkerJob
) -> tuple[Found, tuple[str, ...]]:
    """What a photo shows, and what is odd about it."""
    picture = read_picture(path)
    height, width = picture.grey.shape
    if (width, height) != camera.size:
        said = f"{width} x {height} pixels, but the lens is of images of {camera.size[0]} x "
        raise InputError([Problem(path, f"{said}{camera.size[1]}")])
    found = detect_in(picture.grey, job)
    return found, (*([found.note] if found.note else []), *picture.remarks)


def _photo(
    path: Path,
    shown: tuple[list[Posed], list[Outline]],
    rejected: tuple[Rejection, ...],
    remarks: tuple[str, ...],
    what: str,
) -> Photo:
    """What was found; an error that says why where it is nothing."""
    posed, outlines = shown
    if not posed:
        told = " ".join(remarks)
        left = (one.reason for one in rejected if one.reason not in told)
        reasons = dict.fromkeys([*remarks, *left])
        why = f" ({'; '.join(reasons)})" if reasons else ""
        raise GtvalError(f"{path}: no {what} gives a pose{why}")
    look = Look(
        str(path), path.name, ", ".join(one.name for one in posed), tuple(outlines), rejected
    )
    return Photo(path, tuple(posed), look, remarks)
