"""Two scans matched."""

import numpy.typing as npt

from gtval.arguments import said_plainly
from laser_gt.matching.judgement import MatchSettings, match
from laser_gt.matching.verdicts import Match
from laser_gt.scans.evidence import Prepared
from laser_gt.scans.scan import Scan, sweep

__all__ = ["Match", "Scan", "match_scans"]


@said_plainly
def match_scans(
    reference: Scan,
    moving: Scan,
    guess: npt.ArrayLike = (0.0, 0.0, 0.0),
    *,
    guess_length: float = 0.15,
    guess_angle: float = 0.1,
) -> Match:
    """Where one scan was taken, seen from another, with a verdict on the match.

    Parameters
    ----------
    reference, moving : Scan
        Ranges in metres, infinite where nothing came back, and angles in radians.
    guess : (3,) array_like
        x, y, theta of the moving scan's frame in the reference scan's: metres, radians.
    guess_length, guess_angle : float
        Standard deviations of the guess, metres and radians. Three of them are searched where
        they are large.

    Returns
    -------
    Match
        ``pose`` (3,) and ``covariance`` (3, 3) in the reference frame; ``verdict`` 'accepted',
        'imprecise', 'may be wrong' or 'refuted' with its ``reasons``. The first two are
        measurements: what an imprecise one lacks stands in its covariance.

    Raises
    ------
    GtvalError
        If fewer than 10 beams of a scan came back.

    Examples
    --------
    >>> room = gtval.testing.make_scans(seed=1)
    >>> found = gtval.match_scans(room.scans[0], room.scans[1], room.guesses[0])
    >>> found.verdict, bool(abs(found.pose - room.truth[0]).max() < 0.02)
    ('accepted', True)
    """
    settings = MatchSettings(guess_length=guess_length, guess_angle=guess_angle)
    first, second = Prepared(sweep(reference)), Prepared(sweep(moving))
    return match(first, second, guess, settings)
