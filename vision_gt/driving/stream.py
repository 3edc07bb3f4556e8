"""What one camera says of a robot that drives: a pose, or a reason, for each frame."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag

from validation.pieces.results import kept_result
from validation.poses.angles import Array
from validation.poses.trajectory import Clock, Trajectory
from validation.shown import Shown
from vision_gt.images.markers import MarkerView
from vision_gt.network.adjustment import Network
from vision_gt.optics.transforms import planar_jacobian
from vision_gt.robot.marker_poses import Layout
from vision_gt.robot.robot_pose import Floor, RobotPose, Sighting, robot_pose

Verdict = Literal[
    "kept", "nothing seen", "no pose", "ambiguous", "off the floor", "spurious", "clock unknown"
]
"""What became of a frame. 'spurious' is said by the poses before and after, see `drive`; 'clock
unknown' is a pose of which nothing tells when on the common time it was."""

OFF_FLOOR = 1e-6
"""Chance of standing so high or tilted on the floor, below which a pose is not used. A drive has
thousands of frames: with 1e-6 one good frame of an hour of four cameras (144,000) in seven is lost.
What rocks and what is rough is for the covariance."""
EXACT = 1e-14
"""Of the largest variance: below it a direction is exact but for rounding."""
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
    own : (n, 3, 3) array
        Covariance from the noise of the corners, new in each frame. Square metres and radians.
    common : (n, 3, u) array of float32
        Change of a pose by each of u independent errors of variance one, of cameras, lenses and
        markers: the same ones in all frames of all cameras.
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
    common: npt.NDArray[np.float32]
    clock: Clock = field(default_factory=Clock)

    def __len__(self) -> int:
        return len(self.times)

    @property
    def kept(self) -> Mask:
        """(n,) whether a frame has a pose that is used."""
        return np.array([one == "kept" for one in self.verdicts], dtype=bool)

    @property
    def posed(self) -> Mask:
        """(n,) whether a frame has a pose that nothing contradicts, on the camera's own clock."""
        return np.array([one in {"kept", "clock unknown"} for one in self.verdicts], dtype=bool)

    @property
    def shared(self) -> Array:
        """(n, 3, 3) covariance from what all frames share."""
        return np.asarray(np.einsum("niu,nju->nij", self.common, self.common, dtype=float))

    def count(self, verdict: Verdict) -> int:
        """Frames with a verdict."""
        return self.verdicts.count(verdict)

    def trajectory(self, *, whole: bool = True) -> Trajectory | None:
        """The poses that nothing contradicts, on the camera's own clock; None where too few.

        Parameters
        ----------
        whole : bool
            With all of the covariance; without, only what is new in each frame.
        """
        posed = self.posed
        if posed.sum() < FEWEST:
            return None
        covariances = self.own + self.shared if whole else self.own
        return Trajectory(
            f"vision_{self.camera}",
            self.times[posed],
            self.poses[posed],
            "plane",
            covariances[posed],
            epoch=self.epoch,
            clock=self.clock,
        )

    def part(self, rows: Mask) -> "Stream":
        """Some of the frames."""
        which = np.flatnonzero(rows)
        return replace(
            self,
            times=self.times[which],
            verdicts=tuple(self.verdicts[row] for row in which),
            numbers=tuple(self.numbers[row] for row in which),
            poses=self.poses[which],
            own=self.own[which],
            common=self.common[which],
        )

    def judged(self, which: Mask, verdict: Verdict = "spurious") -> "Stream":
        """The stream with another verdict for some of its frames, one a pose of `trajectory`."""
        verdicts = list(self.verdicts)
        for row in np.flatnonzero(self.posed)[which]:
            verdicts[row] = verdict
        return replace(self, verdicts=tuple(verdicts))


@kept_result()
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
    own = np.full((n, 3, 3), np.nan)
    common = np.full((n, 3, shared.count), np.nan, dtype=np.float32)
    for row, views in enumerate(seen):
        verdict: Verdict = "nothing seen"
        if views:
            sighting = Sighting(camera, tuple(views))
            found = robot_pose([sighting], network, layout, floor, on_floor=on_floor)
            verdict = _verdict(found, on_floor=on_floor)
            if found is not None and verdict == "kept":
                poses[row], whole = found.planar
                by = shared.of(found)
                common[row], own[row] = by, whole - by @ by.T
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
    """The errors of cameras and markers, which all frames share, as independent ones."""

    def __init__(self, network: Network, layout: Layout) -> None:
        self.root = block_diag(_root(network.covariance), _root(layout.covariance))
        self.count = self.root.shape[1]

    def of(self, pose: RobotPose) -> Array:
        """(3, u) change of a planar pose by each."""
        return np.asarray(planar_jacobian(pose.best.R) @ pose.sensitivity @ self.root)


def _root(covariance: Array) -> Array:
    """(k, u) columns whose squares sum to a covariance; those of what is exact are left out."""
    values, vectors = np.linalg.eigh(covariance)
    some = values > EXACT * max(float(values.max(initial=0.0)), 1e-300)
    return np.asarray(vectors[:, some] * np.sqrt(values[some]))
