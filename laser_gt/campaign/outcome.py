"""What laser GT makes of a campaign."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from laser_gt.campaign.inputs import LaserInputs
from laser_gt.campaign.slips import Slip
from laser_gt.placing.anchors import Surveyed
from laser_gt.placing.engines import Engine, Matching
from laser_gt.placing.guesses import Trajectory
from laser_gt.placing.mounts import MountCheck
from laser_gt.placing.published import Published
from laser_gt.placing.solution import LaserSolution
from laser_gt.scans.noise import RangeNoise
from laser_gt.settings import LaserSettings


@dataclass(frozen=True)
class LaserOutcome:
    """Everything that laser GT makes of a campaign.

    Parameters
    ----------
    settings, inputs, trajectory
        What it started from.
    survey, surveyed : Surveyed
        All surveyed poses; those that place the laser frame.
    matchings : mapping of str to Matching
        One for each engine.
    solutions : mapping of str to LaserSolution
        One for each engine that placed any stop.
    failures : mapping of str to str
        Why an engine placed nothing.
    mount_check : MountCheck or None
        Where the survey allows one.
    mount_note : str
        Why not, else.
    published : Published or None
        Where it was asked for.
    noise : mapping of str to RangeNoise
        Of the scanners that neighbouring stops show it of.
    keys : mapping of str to str
        Hash of all that the matches of each engine depend on.
    slip : Slip or None
        What was mixed up in the files, where that explains why hardly any match is accepted.
    assumed_guesses : (float, float) or None
        Standard deviations of the guesses that were assumed before the matches showed more.
    """

    settings: LaserSettings
    inputs: LaserInputs
    trajectory: Trajectory
    survey: Surveyed
    surveyed: Surveyed
    matchings: Mapping[Engine, Matching]
    solutions: Mapping[Engine, LaserSolution]
    failures: Mapping[Engine, str]
    mount_check: MountCheck | None
    mount_note: str
    published: Published | None
    noise: Mapping[str, RangeNoise] = field(default_factory=dict)
    keys: Mapping[Engine, str] = field(default_factory=dict)
    slip: Slip | None = None
    assumed_guesses: tuple[float, float] | None = None
