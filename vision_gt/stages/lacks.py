"""What the images of a campaign do not allow, as far as their names tell."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from vision_gt.images.files import CampaignImages


@dataclass(frozen=True)
class Lack:
    """A part that the images do not allow.

    Parameters
    ----------
    part : str
        Which: 'camera 3', 'frame', 'network', 'markers'.
    text : str
        What is missing, what it costs, and what would supply it.
    costs_poses : bool
        Whether some or all poses of the robot are missing for it.
    """

    part: str
    text: str
    costs_poses: bool = True


def lacking(
    images: CampaignImages, cameras: Sequence[str], known: Collection[str], *, robot: bool
) -> Iterator[Lack]:
    """What is missing for poses of the robot, or of a camera.

    Parameters
    ----------
    images : CampaignImages
        By what they were taken for.
    cameras : sequence of str
        All that took images.
    known : collection of str
        Those whose lenses are known from files.
    robot : bool
        Whether there are images of the robot.
    """
    for name in cameras:
        if name not in images.calibration and name not in known:
            yield Lack(
                f"camera {name}",
                f"Camera {name} has neither calibration images (calibration/{name}/*) nor an entry "
                "in vision.camera_files, so that nothing can be measured in its images.",
            )
    if robot and not images.reference:
        yield Lack(
            "frame",
            "There is no image of the reference pattern (reference/CAMERA.png), so that poses of "
            "the robot are known in the frame of a camera only.",
        )
    if robot and not images.movie:
        yield Lack(
            "layout",
            "There is no walk around the robot (layout/CAMERA/*.png), so that the places of the "
            "markers on it come of the images of the stops that show two and more.",
            costs_poses=False,
        )
