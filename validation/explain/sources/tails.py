"""How heavy the tails of errors are, by the table itself.

Normal errors of more than five standard deviations do not happen; errors with heavy tails have
them now and then without anything being wrong. A table of a few stops does not say for certain
which it is, so several tails are weighed by all its cells, and p-values are their mixture. A gross
error now and then is allowed for beside each tail, so that a wrong pose is not taken for one.
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from validation.explain.fitting.noise import DIMENSIONS, GROSS_SHARE, WIDTHS, Mask
from validation.poses.angles import Array

TAILS = (np.inf, 4.0, 2.5)
"""Degrees of freedom of Student's distribution that are weighed, the normal one first."""
NORMAL, STATED = 0.1, 0.3
"""Weight of normal errors before any is seen, where no noise is stated and where all is: who states
covariances has looked at the errors."""
HEAVY = 0.5
"""Weight of tails that are not normal from which on a table is said to have heavy tails."""
TOLD = 0.35
"""The same from which on the rate of flags is told for them. The three are set by that rate, with
errors of Student's distribution of three degrees of freedom, 60 tables a kind. Without covariances,
of 12 stops of two, three and four sources 40, 63 and 68 % of the tables have a flag, and 36, 57 and
53 % are told; of 20 stops of four 87 and 71 %. With covariances of the true variance stated: 22 and
28 % (12 stops of two), 58 and 49 % (40 of two), 67 and 57 % (20 of four). The price is that of 12
stops of two sources with normal errors 5 % have a flag and 29 % are told."""
_ROUNDS = 10
"""Of estimating a scale, from the median: it decides by tenths, and is then within a percent."""


@dataclass(frozen=True)
class Tails:
    """Tails weighed, with the scale of each suspect under each.

    Parameters
    ----------
    weights : (t,) array
        Of belief in each of `TAILS`.
    scales : (t, G, 2) array
        Mean square of each suspect's gain in units of the noise level taken, for each tail.
    """

    weights: Array
    scales: Array

    @property
    def heavy(self) -> float:
        """Weight of tails that are not those of normal errors."""
        return float(1 - self.weights[0])

    @property
    def freedom(self) -> float:
        """Typical degrees of freedom (harmonic mean); infinite for normal errors."""
        inverse = float(self.weights @ (1 / np.array(TAILS)))
        return 1 / inverse if inverse > 0 else np.inf

    def chance(self, kind: int, gain: Array, dof: Array) -> Array:
        """(G, m) chance of gains so large.

        Parameters
        ----------
        kind : int
            0 for positions, 1 for headings.
        gain : (G, m) array
            Of each suspect at m stops.
        dof : (G, m) array
            Degrees of freedom of the noise level.
        """
        d, result = float(DIMENSIONS[kind]), np.zeros(gain.shape)
        for weight, freedom, scale in zip(self.weights, TAILS, self.scales[..., kind], strict=True):
            with np.errstate(divide="ignore"):
                both = 1 / (1 / freedom + 1 / np.maximum(dof, 1.0))
            scaled = gain / scale[:, None]
            exact = np.isinf(both)
            tail = special.fdtrc(d, np.where(exact, 1.0, both), scaled / d)
            result += weight * np.where(exact, special.chdtrc(d, scaled), tail)
        return result

    def rate(self, limits: Array, asked: Array, normal: float) -> float:
        """Chance that any gain passes its limit, with heavy tails if the table has them.

        Parameters
        ----------
        limits : (G, n, 2) array
            Of the gains, for which the chance is ``normal`` if errors are normal.
        asked : (G, n, 2) array
            How often each is asked; a half where two suspects are one question.
        normal : float
            Chance that any passes if errors are normal.
        """
        if self.heavy <= TOLD:
            return normal
        total = 0.0
        for row, freedom in enumerate(TAILS[1:], 1):
            missed = 0.0
            for kind in range(2):
                d = float(DIMENSIONS[kind])
                scaled = limits[..., kind] / (d * self.scales[row, :, None, kind])
                tail = np.minimum(special.fdtrc(d, freedom, scaled), 0.999)
                missed += float((asked[..., kind] * np.log1p(-tail)).sum())
            total += self.weights[row] * max(1 - np.exp(missed), normal)
        return float(total / self.heavy)


def weigh_tails(gains: Array, valid: Mask, sources: int, normal: float = NORMAL) -> Tails:
    """Tails weighed by the gains of single sources.

    Parameters
    ----------
    gains : (G, n, 2) array
        Chi-squared of positions and headings that each suspect explains.
    valid : (G, n, 2) array of bool
        Which of them there are.
    sources : int
        The first so many suspects are single sources: of these, one less is independent.
    normal : float
        Weight of normal errors before any is seen.
    """
    logs = np.zeros(len(TAILS))
    scales = np.ones((len(TAILS), len(gains), 2))
    share = (sources - 1) / sources
    for kind in range(2):
        d, there, values = float(DIMENSIONS[kind]), valid[..., kind], gains[..., kind]
        scale = _scales(values, there, d)
        scales[..., kind] = scale
        _, density = _densities(values / scale[..., None], d)
        density -= 0.5 * d * np.log(scale)[..., None]
        logs += share * (density * there)[:, :sources].sum((1, 2))
    logs[0] += np.log(normal)
    logs[1:] += np.log((1 - normal) / (len(TAILS) - 1))
    weights = np.exp(logs - logs.max())
    return Tails(weights / weights.sum(), scales)


_FREEDOM = np.array(TAILS[1:])[:, None, None]


def _cores(squares: Array, d: float) -> Array:
    """(t, G, n) log densities of d numbers of which the squares add up to this, scale one."""
    normal = -squares[0] / 2 - d / 2 * np.log(2 * np.pi)
    constant = special.gammaln((_FREEDOM + d) / 2) - special.gammaln(_FREEDOM / 2)
    constant = constant - d / 2 * np.log(_FREEDOM * np.pi)
    rest = constant - (_FREEDOM + d) / 2 * np.log1p(squares[1:] / _FREEDOM)
    return np.concatenate([normal[None], rest])


def _densities(squares: Array, d: float) -> tuple[Array, Array]:
    """(t, G, n) chance that each is no gross error, and the log densities beside which one may be.

    A gross error is as likely in each of the wider normal distributions of the fits' noise.
    """
    wide = WIDTHS[1:]
    parts = np.exp(-squares[..., None] / (2 * wide**2)) / wide**d
    gross = GROSS_SHARE / len(wide) * parts.sum(-1) / (2 * np.pi) ** (d / 2)
    core = (1 - GROSS_SHARE) * np.exp(_cores(squares, d))
    total = np.maximum(core + gross, 1e-300)
    return core / total, np.log(total)


def _scales(squares: Array, there: Mask, d: float) -> Array:
    """(t, G) mean square of a number that makes the gains of each suspect likeliest."""
    count = np.maximum(there.sum(1), 1)
    known = np.where(there, squares, np.nan)
    known[~there.any(1)] = 1.0
    start = np.maximum(np.nanmedian(known, axis=1) / (1.39 if d > 1 else 0.455), 1e-12)
    scale = np.tile(start, (len(TAILS), 1))
    for _ in range(_ROUNDS):
        ratio = squares / scale[..., None]
        good = _densities(ratio, d)[0] * there
        pull = np.concatenate([np.ones((1, *squares.shape)),
                               (_FREEDOM + d) / (_FREEDOM + ratio[1:])])  # fmt: skip
        total = (good * pull * squares).sum(-1)
        scale = np.maximum(total / np.maximum(d * good.sum(-1), 0.3 * d * count), 1e-12)
    return np.asarray(scale)
