"""What one receiver's record says of where it was."""

from dataclasses import dataclass

import numpy as np

from rtk_gt.lasting.jumps import SeenSizes
from rtk_gt.lasting.lasting_error import LastingError
from rtk_gt.path.coverage import Coverage
from rtk_gt.positions.heading import Headings
from rtk_gt.positions.odometry import Overlay
from rtk_gt.positions.scatter import Scatter
from rtk_gt.receivers.fixes import Bools, Fixes
from rtk_gt.receivers.host_clock import HostClock
from rtk_gt.receivers.quality import AreaQuality, KindQuality
from rtk_gt.receivers.steps import Steps
from rtk_gt.settings import RtkSettings
from validation.campaign.folder import Campaign
from validation.poses.angles import Array
from validation.poses.earth_frames import LocalFrame


@dataclass(frozen=True)
class PositionsOutcome:
    """All that one receiver's record gives.

    Parameters
    ----------
    campaign : Campaign
        What was solved.
    settings : RtkSettings
        Its [rtk] table.
    record : Fixes
        Of the receiver; of two the first one's.
    records : tuple of Fixes
        Of all.
    frame : LocalFrame
        The local frame.
    positions : (n, 3) array
        All fixes in it, metres.
    coverage : Coverage
        What of the record is RTK-fixed.
    kinds : tuple of KindQuality
        Each kind of fix; epochs without one are the last.
    clock : HostClock, optional
        Of the computer that wrote the log.
    areas : tuple of AreaQuality
        Quality by named areas.
    steps : Steps
        The receivers brought together, as recorded.
    lasting : tuple of LastingError
        Errors that begin with a jump: those that stay are taken out of the positions, fixes with
        those that end are left out.
    left_out : (n,) bool array
        Fixes that are said to be RTK-fixed and are left out.
    jump_covariances : (n, 3, 3) array
        Of the jumps that were taken out of each position, m^2.
    seen_of_all : SeenSizes
        Sizes of jumps that are seen.
    headings : Headings, optional
        Positions with headings, of two receivers.
    without_heading : str
        Why two receivers give none; empty otherwise.
    overlay : Overlay, optional
        Odometry laid over the positions.
    without_overlay : str
        Why the odometry is not; empty otherwise.
    scatter : Scatter, optional
        How the receiver scatters where it stands, beside what it states.
    """

    campaign: Campaign
    settings: RtkSettings
    record: Fixes
    records: tuple[Fixes, ...]
    frame: LocalFrame
    positions: Array
    coverage: Coverage
    kinds: tuple[KindQuality, ...]
    clock: HostClock | None
    steps: Steps
    lasting: tuple[LastingError, ...]
    left_out: Bools
    jump_covariances: Array
    seen_of_all: SeenSizes
    areas: tuple[AreaQuality, ...] = ()
    headings: Headings | None = None
    without_heading: str = ""
    overlay: Overlay | None = None
    without_overlay: str = ""
    scatter: Scatter | None = None

    @property
    def fixed(self) -> Bools:
        """(n,) True where the position is ground truth."""
        return np.asarray(self.record.fixed & ~self.left_out)

    @property
    def remarks(self) -> tuple[str, ...]:
        """(n,) 'false fix that lasts' or 'jump taken out' where that is so, else empty."""
        starts = [one.start for one in self.lasting if one.stays]
        first = min(starts, default=np.inf) - 1e-6
        after = (self.record.times >= first).tolist()
        out = (self.record.fixed & self.left_out).tolist()
        said = zip(out, after, strict=True)
        return tuple(
            "false fix that lasts" if a else "jump taken out" if b else "" for a, b in said
        )

    @property
    def fixed_share(self) -> float:
        """Share of the epochs that the receiver calls RTK-fixed."""
        return float(self.record.fixed.sum()) / max(self.record.epochs, 1)

    @property
    def covariances(self) -> Array:
        """(n, 3, 3) of the positions as the receiver states them, m^2; NaN where it does not.

        Those of RTK-fixed positions are larger where it scatters more than it states.

        Receivers state east, north and up at the place; over the kilometres of a drive these are
        the axes of the local frame to a thousandth.
        """
        stated = self.record.covariances
        if self.scatter is not None:
            factors = self.scatter.factors[[0, 0, 1]]
            larger = stated * np.outer(factors, factors)
            stated = np.where(self.record.fixed[:, None, None], larger, stated)
        return np.asarray(stated + self.jump_covariances)
