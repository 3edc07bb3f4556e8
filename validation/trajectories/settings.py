"""The table [time] of campaign.toml: how trajectories are compared."""

from validation.campaign.folder import Positive, Settings


class TimeSettings(Settings):
    """How the trajectories of a campaign are compared in time.

    ``reference`` is the system whose trajectory the others are compared with, ``align`` what is
    fitted before that ('none', 'frame', 'frame+time', ...), ``limit`` and ``limit_angle`` (metres,
    radians) what is asked of the errors and of the clocks, ``window`` the largest delay that is
    looked for, in seconds, ``odometry`` the system whose headings the others' are correlated with,
    as AD2.3 did.
    """

    reference: str = ""
    align: str = "none"
    limit: Positive = 0.05
    limit_angle: Positive = 0.05
    window: Positive = 60.0
    odometry: str = ""
