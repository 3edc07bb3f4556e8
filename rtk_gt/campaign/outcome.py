"""What the RTK system makes of a campaign."""

from dataclasses import dataclass

import numpy as np

from rtk_gt.lasting.jumps import SeenSizes
from rtk_gt.lasting.lasting_error import LastingError
from rtk_gt.offsets.checks import PriorCheck
from rtk_gt.offsets.estimate import Offsets
from rtk_gt.offsets.noise import GpsNoise
from rtk_gt.offsets.prior import OffsetPrior
from rtk_gt.offsets.slow_errors import ErrorModel
from rtk_gt.path.antennas import Antennas
from rtk_gt.path.clocks import Clocks
from rtk_gt.path.common_errors import CommonErrors
from rtk_gt.path.consistency import Consistency
from rtk_gt.path.coverage import Coverage
from rtk_gt.path.interpolation import HoldOut
from rtk_gt.path.motion_check import MotionCheck
from rtk_gt.path.vehicle_path import VehiclePath
from rtk_gt.receivers.fixes import Bools, Fixes
from rtk_gt.receivers.quality import AreaQuality
from rtk_gt.receivers.steps import Steps
from rtk_gt.settings import RtkSettings, Sensor
from validation.campaign.folder import Campaign
from validation.poses.angles import Array


@dataclass(frozen=True)
class RtkOutcome:
    """All that the RTK system makes of a campaign.

    Parameters
    ----------
    campaign : Campaign
        What was solved.
    settings : RtkSettings
        Its [rtk] table.
    records : tuple of Fixes
        Of all receivers.
    steps : Steps
        The same, brought together, without the errors that last.
    lasting : tuple of LastingError
        Errors that begin with a jump: taken out of the steps where they stay; where they end, the
        fixes that have them are left out.
    clocks : Clocks, optional
        By how much the receivers' clocks were off; None where they were not.
    seen_of_all, seen_of_some : SeenSizes
        Sizes of jumps of all receivers, and of some, that are seen within seconds.
    prior : OffsetPrior
        What campaign.toml states of offsets and distances.
    stated : PriorCheck, optional
        The stated offsets beside those of the drive alone; None if none are stated.
    offsets : Offsets
        Offsets and distances from the drive and the prior.
    antennas : Antennas
        Their positions on the vehicle.
    left : tuple of Offsets
        Other solutions that fit as well; there the nose points against the motion.
    noise : GpsNoise
        Of one receiver, used for the covariances.
    model : ErrorModel, optional
        Its slow part, where there is one.
    common : CommonErrors
        What is taken of errors that all receivers share.
    path : VehiclePath
        The ground truth.
    leaps : (n,) bool array
        Poses that leap against their neighbours; they are flagged, not taken out.
    reference : (6, 6) array
        W* of these antennas and this noise.
    consistency : Consistency
        The measure q_t of the poses; steps with a false fix have none.
    motion : MotionCheck, optional
        Where the vehicle moves, seen from itself; None where it hardly moves.
    coverage : Coverage
        What of the drive has ground truth.
    hold_out : HoldOut, optional
        Which interpolation does best; None where the path is too short to tell.
    sensors : dict of str to Sensor
        The sensors of campaign.toml; their paths are made when they are needed.
    areas : dict of str to tuple of AreaQuality
        Of each receiver how its fixes are in each named area.
    """

    campaign: Campaign
    settings: RtkSettings
    records: tuple[Fixes, ...]
    steps: Steps
    lasting: tuple[LastingError, ...]
    clocks: Clocks | None
    seen_of_all: SeenSizes
    seen_of_some: SeenSizes
    prior: OffsetPrior
    stated: PriorCheck | None
    offsets: Offsets
    antennas: Antennas
    left: tuple[Offsets, ...]
    noise: GpsNoise
    model: ErrorModel | None
    common: CommonErrors
    path: VehiclePath
    leaps: Bools
    reference: Array
    consistency: Consistency
    motion: MotionCheck | None
    coverage: Coverage
    hold_out: HoldOut | None
    sensors: dict[str, Sensor]
    areas: dict[str, tuple[AreaQuality, ...]]

    @property
    def corrected(self) -> Bools:
        """(n,) True at poses from which a jump was taken out."""
        starts = [error.start for error in self.lasting if error.stays]
        first = min(starts, default=np.inf)
        return np.asarray(self.path.times >= first - 1e-6)
