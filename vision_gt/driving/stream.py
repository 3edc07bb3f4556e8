"""What one camera says of a robot that drives: a pose, or a reason, for each frame."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from validation.poses.angles import Array
from validation.poses.trajectory import Clock, Trajectory
from validation.shown import Shown
from vision_gt.images.markers import MarkerView
from vision_gt.network.adjustment import Network
from vision_gt.optics.transforms import planar_jacobian
from vision_gt.robot.marker_poses import Layout
from vision_gt.robot.robot_pose import Floor, RobotPose, Sighting, robot_pose

Verdict = Literal["kept", "nothing seen", "no pose", "ambiguous", "off the floor", "spurious"]
"""What became of a frame. 'spurious' is said by the poses before and after, see `drive`."""

OFF_FLOOR = 1e-6
"""Chance of standing so high or tilted on the floor, below which a pose is not used. A drive has
thousands of frames: with 1e-6 one good frame of an hour of four cameras (144,000) in seven is lost.
What rocks and what is rough is for the covariance."""
FEWEST = 3
"""Poses that are a trajectory."""
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, repr=False)
class Stream(Shown):
    """The frames of one camera, n of them.

    Parameters
    ----------
    camera : str
        Its name.
    times : (n,) array
        Seconds since ``epoch``, increasing, on the camera's own clock.
    epoch : int
        Whole seconds.
    verdicts : tuple of str
        What became of each frame.
    numbers : tuple of tuple of int
        Markers that each frame shows.
    poses : (n, 3) array
        x, y, theta; NaN where there is none.
    own, shared : (n, 3, 3) array
        Covariance from the noise of the corners, new in each frame; and from cameras, lenses and
        markers, the same in all frames alike. Square metres and radians.
    clock : Clock
        What the stamps are.
    """

    camera: str
    times: Array
    epoch: int
    verdicts: tuple[Verdict, ...]
    numbers: tuple[tuple[int, ...], ...]
    poses: Array
    own: Array
    shared: Array
    clock: Clock = field(default_factory=Clock)

    def __len__(self) -> int:
        return len(self.times)

    @property
    def kept(self) -> Mask:
        """(n,) whether a frame has a pose that is used."""
        return np.array([one == "kept" for one in self.verdicts], dtype=bool)

    def count(self, verdict: Verdict) -> int:
        """Frames with a verdict."""
        return self.verdicts.count(verdict)

    def trajectory(self, *, whole: bool = True) -> Trajectory | None:
        """The poses that are kept, on the camera's own clock; None where they are too few.

        Parameters
        ----------
        whole : bool
            With all of the covariance; without, only what is new in each frame.
        """
        kept = self.kept
        if kept.sum() < FEWEST:
            return None
        covariances = self.own + self.shared if whole else self.own
        return Trajectory(
            f"vision_{self.camera}",
            self.times[kept],
            self.poses[kept],
            "plane",
            covariances[kept],
            epoch=self.epoch,
            clock=self.clock,
        )

    def judged(self, spurious: Mask) -> "Stream":
        """The stream with some of its kept frames, one a pose of `trajectory`, called spurious."""
        verdicts = list(self.verdicts)
        for row in np.flatnonzero(self.kept)[spurious]:
            verdicts[row] = "spurious"
        return replace(self, verdicts=tuple(verdicts))


def camera_stream(
    camera: str,
    times: Array,
    seen: Sequence[Sequence[MarkerView]],
    network: Network,
    layout: Layout,
    floor: Floor,
    *,
    epoch: int = 0,
    clock: Clock | None = None,
    on_floor: bool = True,
) -> Stream:
    """A pose from each frame of a camera, or why there is none.

    Parameters
    ----------
    camera : str
        One of the network's.
    times : (n,) array
        Seconds since the epoch, increasing.
    seen : sequence of sequences of MarkerView
        The markers of each frame.
    network : Network
        Cameras with their covariance.
    layout : Layout
        Markers with their covariance.
    floor : Floor
        How even it is.
    epoch : int
        Whole seconds that the times count from.
    clock : Clock, optional
        What the stamps are.
    on_floor : bool
        Take the robot as standing on the floor, which tells most of the two solutions of a marker
        apart; whether it does is tested.
    """
    n = len(times)
    shared = _Shared(network, layout)
    verdicts: list[Verdict] = []
    poses = np.full((n, 3), np.nan)
    own, common = np.full((2, n, 3, 3), np.nan)
    for row, views in enumerate(seen):
        verdict: Verdict = "nothing seen"
        if views:
            sighting = Sighting(camera, tuple(views))
            found = robot_pose([sighting], network, layout, floor, on_floor=on_floor)
            verdict = _verdict(found, on_floor=on_floor)
            if found is not None and verdict == "kept":
                poses[row], whole = found.planar
                common[row] = shared.of(found)
                own[row] = whole - common[row]
        verdicts.append(verdict)
    numbers = tuple(tuple(sorted(view.number for view in views)) for views in seen)
    return Stream(
        *(camera, np.asarray(times, dtype=float), epoch, tuple(verdicts), numbers),
        *(poses, own, common, clock or Clock()),
    )


def _verdict(found: RobotPose | None, *, on_floor: bool) -> Verdict:
    """What becomes of a frame that shows markers."""
    if found is None:
        return "no pose"
    if found.ambiguous:
        return "ambiguous"
    return "off the floor" if on_floor and found.floor_p < OFF_FLOOR else "kept"


class _Shared:
    """The covariance of cameras and markers, which all frames share."""

    def __init__(self, network: Network, layout: Layout) -> None:
        self.cameras = len(network.covariance)
        self.network, self.layout = network.covariance, layout.covariance

    def of(self, pose: RobotPose) -> Array:
        """(3, 3) what it makes of the covariance of a planar pose."""
        by = planar_jacobian(pose.best.R) @ pose.sensitivity
        first, second = by[:, : self.cameras], by[:, self.cameras :]
        return np.asarray(first @ self.network @ first.T + second @ self.layout @ second.T)
