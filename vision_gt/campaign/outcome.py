"""All that the vision system makes of a campaign, before it is told to anyone."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import RigidTransform

from vision_gt.campaign.checks import Checks
from vision_gt.campaign.detections import SeenMarkers
from vision_gt.causes.diagnosis import Diagnosis
from vision_gt.causes.reference import ReferenceTurn
from vision_gt.images.files import Image
from vision_gt.images.markers import Detection
from vision_gt.network.intrinsics import Calibration
from vision_gt.network.solution import NetworkSolution
from vision_gt.network.steadiness import Steadiness
from vision_gt.patterns.board_views import BoardView
from vision_gt.patterns.rejections import Rejection
from vision_gt.robot.layout import LayoutFit
from vision_gt.robot.robot_pose import RobotPose
from vision_gt.settings import VisionSettings
from vision_gt.stages.lacks import Lack


@dataclass(frozen=True)
class StopPose:
    """What is known of one stop.

    Parameters
    ----------
    pose : str
        Its name.
    by_camera : mapping of str to RobotPose
        From each camera that saw markers.
    chosen : RobotPose or None
        What the result has: the best camera's, or that of all cameras merged; None where no
        pose is sure.
    """

    pose: str
    by_camera: Mapping[str, RobotPose]
    chosen: RobotPose | None

    @property
    def best_first(self) -> list[tuple[str, RobotPose]]:
        """Cameras and their poses, those that are sure before others, the best known first."""
        return sorted(
            self.by_camera.items(),
            key=lambda one: (one[1].ambiguous, float(np.trace(one[1].planar[1]))),
        )


@dataclass(frozen=True)
class VisionOutcome:
    """The vision system's results.

    Parameters
    ----------
    settings : VisionSettings
        Of the campaign.
    calibrations : mapping of str to Calibration
        By camera; empty where camera files were given.
    network : NetworkSolution
        The cameras.
    layout : LayoutFit
        The markers.
    stops : tuple of StopPose
        In the order that people count.
    detections : mapping of (str, str) to Detection
        By camera and stop: every image of the robot.
    published : mapping of str to sequence of (str, RigidTransform), or None
        The document's way from the same images: for each stop in the order that people count,
        cameras and T_gtv_robot by each. None where it was not asked for.
    steadiness : tuple of Steadiness
        A verdict for each camera that was checked.
    oddities : sequence of (str, str)
        Images and what is odd about them.
    printed : SeenMarkers or None
        Which markers a report of this network printed as recognised, where there is one.
    examples : mapping of str to (Image, BoardView)
        By camera: an image of its calibration, and the board in it.
    checks : Checks
        Of the cameras by things at known places, and of the survey.
    rejections : sequence of (str, Rejection)
        Images, and what was seen in them and not used, or is rough.
    diagnosis : Diagnosis or None
        What is wrong, and what was thought of; None where it could not be looked for.
    reference_turn : ReferenceTurn or None
        How the reference pattern lies, where it is not as stated.
    boards : mapping of str to sequence of BoardView
        All views of boards by what their image was taken for.
    lacks : tuple of Lack
        What could not be solved, or only in another way.
    """

    settings: VisionSettings
    calibrations: Mapping[str, Calibration]
    network: NetworkSolution
    layout: LayoutFit
    stops: tuple[StopPose, ...]
    detections: Mapping[tuple[str, str], Detection]
    published: Mapping[str, Sequence[tuple[str, RigidTransform]]] | None
    steadiness: tuple[Steadiness, ...] = ()
    oddities: Sequence[tuple[str, str]] = field(default=())
    printed: SeenMarkers | None = None
    examples: Mapping[str, tuple[Image, BoardView]] = field(default_factory=dict)
    checks: Checks = field(default_factory=Checks)
    rejections: Sequence[tuple[str, Rejection]] = ()
    diagnosis: Diagnosis | None = field(default=None, repr=False)
    reference_turn: ReferenceTurn | None = None
    boards: Mapping[str, Sequence[BoardView]] = field(default_factory=dict, repr=False)
    lacks: tuple[Lack, ...] = ()
