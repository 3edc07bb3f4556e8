"""What the surveyed stops say of a hypothesis: how likely they are, were it true.

A hypothesis H was solved from the images alone, so that p(images, survey | H) is p(images | H)
times p(survey | images, H). The last is a normal density: with the poses v of the stops under H,
of joint covariance C_v, and the surveyed poses s, of C_s, the differences d = s - v have the
covariance C = C_v + C_s, and

    -2 log p = d' C^-1 d + log det C,

but for a constant. C_v holds what all stops have in common, the place of the reference pattern; it
grows where H leaves the poses less well known. Nothing of the survey enters the solution.

Two things keep it from saying more than it knows. The stops may be surveyed in another frame than
the reference pattern was laid in: with a common shift and turn known to `FRAME_RANGE` only, the
covariance is C + G F G', and the likelier of the two counts. And poses may scatter more than
stated, by blunders or by what no hypothesis knows: the chi-squared counts as any other
(`scattered`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from validation.poses.angles import Array, wrap
from validation.poses.pose_table import PoseTable
from validation.statistics.hypotheses import scattered

FRAME_RANGE = np.array([0.5, 0.5, 0.1])
"""Metres, metres, radians by which the frames of survey and reference pattern may differ, where
somebody laid one of them differently. A judgement: a pattern read from another corner is."""


@dataclass(frozen=True)
class Surveyed:
    """Stops that were surveyed.

    Parameters
    ----------
    ids : tuple of str
        n names.
    poses : (n, 3) array
        x, y, theta in the GTV frame, metres and radians.
    covariance : (3 n, 3 n) array
        Of all of them.
    """

    ids: tuple[str, ...] = ()
    poses: Array = field(default_factory=lambda: np.zeros((0, 3)))
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))

    @classmethod
    def of(cls, table: PoseTable | None) -> Self:
        """The stops of a table whose covariance is stated."""
        if table is None:
            return cls()
        stated = np.flatnonzero(np.isfinite(table.covariances).all((1, 2)))
        table = table.select([table.ids[row] for row in stated])
        n = len(table.ids)
        joint = table.joint_covariance
        if joint is None:
            joint = np.zeros((n, 3, n, 3))
            joint[np.arange(n), :, np.arange(n)] = table.covariances
        return cls(table.ids, table.poses, joint.reshape(3 * n, 3 * n))

    def common(self, stops: Sequence[str]) -> list[str]:
        """Names of those among some stops that were surveyed."""
        return [name for name in self.ids if name in set(stops)]

    def misfit(self, stops: Sequence[str], poses: Array, covariance: Array) -> float:
        """-2 log of the likelihood of the surveyed stops, but for a constant.

        Parameters
        ----------
        stops : sequence of str
            Names of m stops, of which some were surveyed.
        poses, covariance : (m, 3) array, (3 m, 3 m) array
            Where the robot is there by a hypothesis, and how well that is known.
        """
        place = {name: i for i, name in enumerate(stops)}
        if not (common := self.common(stops)):
            return 0.0
        mine = np.array([self.ids.index(name) for name in common])
        theirs = np.array([place[name] for name in common])
        off = self.poses[mine] - poses[theirs]
        off[:, 2] = wrap(off[:, 2])
        C = self.covariance[np.ix_(_slots(mine), _slots(mine))]
        C = C + covariance[np.ix_(_slots(theirs), _slots(theirs))]
        G = _of_frame(poses[theirs])
        other = C + (G * FRAME_RANGE**2) @ G.T
        return min(_deviance(off.ravel(), one) for one in (C, other))


def _slots(rows: Array) -> Array:
    """(3 n,) places of the numbers of poses (n,)."""
    return np.asarray((3 * rows[:, None] + np.arange(3)).ravel())


def _of_frame(poses: Array) -> Array:
    """(3 n, 3) derivative of poses by a shift and a turn of their frame."""
    G = np.tile(np.eye(3), (len(poses), 1, 1))
    G[:, 0, 2], G[:, 1, 2] = -poses[:, 1], poses[:, 0]
    return G.reshape(-1, 3)


def _deviance(off: Array, covariance: Array) -> float:
    """-2 log of the density of differences (k,), which may all scatter more."""
    chi_squared = float(off @ np.linalg.solve(covariance, off))
    return scattered(chi_squared, len(off)) + float(np.linalg.slogdet(covariance)[1])
