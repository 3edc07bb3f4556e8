"""From readings to validation poses: the whole chain, without files."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from survey.estimation.adjustment import Adjustment, UnsettledError, adjust
from survey.estimation.evidence import Evidence
from survey.estimation.labelling import DECISIVE, LabellingVerdict, judge_labelling
from survey.estimation.network import build_network, start_parameters
from survey.estimation.reliability import (
    BlunderSuspicion,
    Reliability,
    blunders_one_by_one,
    reading_tests,
)
from survey.estimation.robot_frames import NotPosed, RobotFrameFit
from survey.estimation.vframe import VframeEstimate, estimate_vframe
from survey.estimation.whole.search import Located, Search
from survey.estimation.whole.units import capped
from survey.estimation.world_points import WorldPoints, locate_world_points
from survey.readings.point_names import robot_point
from survey.readings.readings import Mask, Readings
from validation.campaign.folder import RobotFrame, Vframe
from validation.errors import GtvalError
from validation.pieces.results import kept_result
from validation.poses.angles import Array
from validation.poses.joint import LARGEST_WHOLE
from validation.poses.pose_table import PoseTable
from validation.shown import Shown
from validation.systems import Progress, no_progress

_DECIMALS = 12
"""Decimals, in metres and radians, of the factor of a joint covariance: a millionth of a
micrometre, and half the file that all digits would make."""
BAD_FIT = 4.0
"""Mean square of the standardised residuals from which a solution is looked for elsewhere, too. A
judgement: twice the stated scatter; a place on the wrong side costs thousands."""


@dataclass(frozen=True, repr=False)
class SurveySolution(Shown):
    """Everything that the readings give.

    Parameters
    ----------
    vframe : VframeEstimate
        The frame.
    labelling : LabellingVerdict
        Whether the labels of the Vframe points are what they say.
    world : WorldPoints
        World points from the Vframe alone.
    frames : tuple of RobotFrameFit
        Each pose from the world points alone.
    not_posed : tuple of NotPosed
        Poses left open.
    from_marks : mapping of str to (2,) array
        World points that the Vframe leaves open and all readings together do not: where the joint
        adjustment starts for them.
    together : mapping of str to (3,) array
        The same for poses that the world points located from the Vframe leave open.
    used : Readings
        Readings in the joint adjustment, in its order.
    left_out : Readings
        The others: an end of each is a point or a stop without a position. ``world.missing``
        and ``not_posed`` say why it has none.
    adjustment : Adjustment
        The joint adjustment.
    reliability : Reliability
        Tests of its readings.
    suspicions : tuple of BlunderSuspicion
        Suspected blunders.
    """

    vframe: VframeEstimate
    labelling: LabellingVerdict
    world: WorldPoints
    frames: tuple[RobotFrameFit, ...]
    not_posed: tuple[NotPosed, ...]
    from_marks: Mapping[str, Array]
    together: Mapping[str, Array]
    used: Readings
    left_out: Readings
    adjustment: Adjustment
    reliability: Reliability
    suspicions: tuple[BlunderSuspicion, ...]

    @property
    def joint_names(self) -> tuple[str, ...]:
        """World points of the joint adjustment."""
        return (*self.world.names, *self.from_marks)

    @property
    def poses(self) -> tuple[str, ...]:
        """Ids of the poses of the joint adjustment."""
        return self.adjustment.network.poses

    def pose_table(self) -> PoseTable | None:
        """The validation poses of the joint adjustment, with their joint covariance."""
        return self._pose_table

    @cached_property
    def _pose_table(self) -> PoseTable | None:
        poses = self.adjustment.network.poses
        if not poses:
            return None
        rows, cofactors = self.adjustment.pose_rows(poses), self.adjustment.cofactors
        n = len(poses)
        small = len(rows) <= LARGEST_WHOLE or cofactors.middle is not None
        return PoseTable(
            system="survey",
            ids=poses,
            poses=self.adjustment.parameters.poses,
            covariances=cofactors.blocks(rows.reshape(-1, 3)),
            sources=("joint adjustment",) * n,
            joint=cofactors.block(rows) if small else None,
            factor=None if small else np.round(cofactors.shared[rows], _DECIMALS),
        )


@kept_result("progress")
def solve_survey(
    vframe: Vframe,
    rig: RobotFrame,
    readings: Readings,
    world_points: Sequence[str],
    evidence: Evidence | None = None,
    *,
    robust: bool = False,
    progress: Progress = no_progress,
) -> SurveySolution:
    """Validation poses and all that is known about them.

    Parameters
    ----------
    vframe : Vframe
        Nominal frame.
    rig : RobotFrame
        Nominal robot frame.
    readings : Readings
        Distances between Vframe points, world points and marks ('7/O': point O of the rig at
        stop 7).
    world_points : sequence of str
        Names of the world points.
    evidence : Evidence, optional
        Coordinates from elsewhere.
    robust : bool
        Huber weights in the joint adjustment.
    progress : callable
        Told what is being done.

    Raises
    ------
    GtvalError
        If readings name unknown points, the labels are contradicted, nothing can be located, or
        the adjustment fails.
    """
    _need_known_names(vframe, rig, readings, world_points)
    evidence = evidence or Evidence()
    progress("Vframe", 0.0)
    frame = estimate_vframe(vframe, readings)
    world = locate_world_points(world_points, readings, frame)
    labelling = None
    if world.points and not world.missing:
        progress("labels", 0.15)
        labelling = judge_labelling(vframe, rig, readings, world, evidence)
    progress("robot frames", 0.3)
    search = Search(frame, rig, readings, tuple(world_points), evidence)
    located = search.separately(world)
    if search.leaves_open(located):
        progress("the whole network", 0.45)
        # What single steps leave open in a large survey is sought among what they found: only
        # where all that does not fit is everything sought anew.
        located = search.together(located, trusting=len(readings) > _LARGE)
    if not located.places:
        reasons = "; ".join(f"{p.name}: {p.reason}" for p in located.world.missing[:5])
        raise UnsettledError(f"no world point can be located ({reasons or 'no readings'})")
    if labelling is None:
        labelling = judge_labelling(vframe, rig, readings, located.all_points(), evidence)
    progress("joint adjustment", 0.6)
    located, adjustment, inside = _adjusted(vframe, search, located, robust=robust)
    progress("tests of the readings", 0.9)
    located = located.agreeing(adjustment, frame)
    solution = SurveySolution(
        vframe=frame,
        labelling=labelling,
        world=located.world,
        frames=located.frames,
        not_posed=located.not_posed,
        from_marks=located.from_marks,
        together=located.late_poses,
        used=readings.select(inside),
        left_out=readings.select(~inside),
        adjustment=adjustment,
        reliability=reading_tests(adjustment),
        suspicions=tuple(blunders_one_by_one(adjustment)),
    )
    progress("done", 1.0)
    return solution


def _adjusted(
    vframe: Vframe, search: Search, located: Located, *, robust: bool
) -> tuple[Located, Adjustment, Mask]:
    """The joint adjustment, and which readings are in it, from where it fits best."""
    first, fault = None, None
    try:
        first = _adjusted_from(vframe, search, located, robust=robust)
    except GtvalError as error:
        fault = error
    if located.is_whole or (first and _fits(first[0], located)):
        if first is None:
            raise _unsettled(fault)
        return located, *first
    whole = search.together(located)
    second = _adjusted_from(vframe, search, whole, robust=robust) if whole.places else None
    if second is None or (first and not _better(first[0], second[0])):
        if first is None:
            raise _unsettled(fault)
        return located, *first
    return whole, *second


def _unsettled(fault: GtvalError | None) -> UnsettledError:
    """What fails where all was located: readings that contradict leave too few of the others."""
    return UnsettledError(str(fault or "the joint adjustment fails"))


def _fits(found: Adjustment, located: Located) -> bool:
    """Whether a solution is where the readings are, but for single ones that are wrong.

    In a large survey some always are. A point or a stop in a wrong place has most of its readings
    off by far; one that was sought by itself, all others being known, is no better sought again.
    """
    n = len(found.network.distance)
    if found.chi_squared < BAD_FIT * len(found.residual):
        return True
    if n < _LARGE:
        return False
    net = found.network
    off = np.abs(found.residual[:n]) > _ASTRAY
    unit = np.arange(len(net.points))
    unit[net.mark] = len(net.points) + net.mark_pose
    ends = unit[np.concatenate([net.first, net.second])]
    of_unit = np.bincount(ends)
    astray = np.bincount(ends, np.tile(off, 2)) >= _MOSTLY * np.maximum(of_unit, 1)
    names = (*net.points, *net.poses)
    late = {**located.from_marks, **located.late_poses}
    return all(names[k] in late for k in np.flatnonzero(astray))


_LARGE = 3000
"""Readings from which single wrong ones are told from wrong places: the search elsewhere takes
longer than all else. A judgement."""
_ASTRAY = 20.0
"""Standardised residual that no wrong reading gives its neighbours: one of a metre among the 48 of
a stop shifts it by 9 sigmas."""
_MOSTLY = 0.3
"""Share of such readings of a point or stop in a wrong place, at least. A judgement: where one of
three rig points is wrong it is a third."""


def _adjusted_from(
    vframe: Vframe, search: Search, located: Located, *, robust: bool
) -> tuple[Adjustment, Mask]:
    """The joint adjustment from given places and poses."""
    poses = [pose for pose in search.readings.poses if pose in located.poses]
    network, inside = build_network(
        vframe, search.rig, search.readings, list(located.places), poses
    )
    start = start_parameters(network, search.frame.points, located.places, located.poses)
    return adjust(network, start, robust=robust), inside


def _better(now: Adjustment, other: Adjustment) -> bool:
    """Whether another adjustment of as many points and poses fits decisively better."""
    same = now.network.points == other.network.points and now.network.poses == other.network.poses
    return same and capped(now.residual) - capped(other.residual) > DECISIVE


def _need_known_names(
    vframe: Vframe, rig: RobotFrame, readings: Readings, world_points: Sequence[str]
) -> None:
    """Raise, naming every end of a reading that is no point of the survey."""
    known = {*vframe.points, *world_points}
    unknown: Counter[str] = Counter()
    for name in (*readings.start, *readings.end):
        mark = robot_point(name)
        if name not in known and (mark is None or mark[1] not in rig.points):
            unknown[name] += 1
    if unknown:
        named = ", ".join(f"'{name}' ({count})" for name, count in unknown.items())
        raise GtvalError(
            f"readings end at unknown points: {named}. Known are the Vframe points "
            f"{', '.join(vframe.points)}, the world points {', '.join(world_points)}, and marks "
            f"of stops, written STOP/POINT with a point of the rig: {', '.join(rig.points)}. In "
            "brackets: how many readings end there"
        )
