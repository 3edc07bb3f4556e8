"""Explanations tried against each other: numbers of a cause, limits, and the odds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from scipy.special import ndtri

LOST = 5.0
"""A combination of parameters is undetermined if it is known this many times worse than a
single pose: pooling the poses has then gained nothing. A judgement: between 1, the knowledge of
one pose, and the tens to thousands of directions that the poses do not show at all."""
TAKES_PART = 0.2
"""Share of a combination from which on a parameter is named as part of it. A judgement: it decides
the words only."""
RIVAL = 6.0
"""A difference of the information criterion below this does not rule out: odds of 20 to
1, as 2 log 20 = 5.99."""
TIE = 2 * math.log(3.0)
"""A difference below this speaks for neither: odds of 3 to 1, "not worth more than a bare mention"
(Kass and Raftery, Bayes Factors, J. Am. Stat. Assoc. 90, 1995, section 3.2)."""
T = TypeVar("T")
ANY_NOISE = 2 * math.log(20.0)
"""What it costs to say that all scatter more than stated: one number, known to some per cent, from
a range of e."""


@dataclass(frozen=True)
class Parameter:
    """One number of an explanation, with its interval."""

    name: str
    unit: str
    value: float
    sigma: float
    low: float
    high: float
    p_value: float
    cost: float = 0.0


def parameter(
    name: str,
    unit: str,
    value: float,
    sigma: float,
    width: float,
    *,
    interval: tuple[float, float] | None = None,
    cost_sigma: float | None = None,
) -> Parameter:
    """A number with its 95 % interval, and what it costs to have been free.

    Parameters
    ----------
    name, unit : str
        Of it.
    value, sigma : float
        Estimate and its standard deviation.
    width : float
        Length of the range in which it lay before the data.
    interval : (float, float), optional
        Where it is not symmetric.
    cost_sigma : float, optional
        Standard deviation that decides the cost, where the number goes together with others.

    Notes
    -----
    2 log(width / (sqrt(2 pi) sigma)): the share of its range that the data leave (MacKay,
    Information Theory, Inference, and Learning Algorithms, 2003, chapter 28).
    """
    reach = float(ndtri(0.975)) * sigma
    low, high = interval or (value - reach, value + reach)
    p_value = math.erfc(abs(value) / sigma / math.sqrt(2)) if sigma > 0 else 0.0
    left = math.sqrt(2 * math.pi) * max(cost_sigma or sigma, 1e-12)
    cost = 2 * math.log(max(width / left, 1.0))
    return Parameter(name, unit, value, sigma, low, high, p_value, cost)


def scattered(chi_squared: float, freedom: int) -> float:
    """A misfit that counts by its logarithm where all may scatter more than stated.

    Parameters
    ----------
    chi_squared : float
        Of the observations.
    freedom : int
        Observations less parameters.
    """
    dof = max(freedom, 1)
    scatter = max(chi_squared / dof, 1.0)
    return min(chi_squared, dof * (1 + math.log(scatter)) + ANY_NOISE)


@dataclass(frozen=True)
class Tried(Generic[T]):
    """A hypothesis solved.

    Parameters
    ----------
    what : T
        The hypothesis.
    chi_squared : float
        Of all observations, at its own best parameters.
    freedom : int
        Observations less parameters.
    parameters : tuple of Parameter
        Its numbers.
    places : float
        Number of places of its kind that were searched (look-elsewhere).
    cost : float
        Of freedom that is in no parameter.
    """

    what: T
    chi_squared: float
    freedom: int
    parameters: tuple[Parameter, ...] = ()
    places: float = 1.0
    cost: float = 0.0

    @property
    def criterion(self) -> float:
        """-2 log of the evidence, but for a constant: the least is the best.

        Observations that scatter more than stated may do so under any hypothesis, at the cost of
        one more number, the scatter.
        """
        misfit = scattered(self.chi_squared, self.freedom)
        return misfit + self.cost + 2 * math.log(self.places) + sum(p.cost for p in self.parameters)

    @property
    def m0(self) -> float:
        """Standard deviation of unit weight."""
        return math.sqrt(self.chi_squared / max(self.freedom, 1))


@dataclass(frozen=True)
class Ranking(Generic[T]):
    """Hypotheses in the order of what speaks for them, the best first.

    Parameters
    ----------
    tried : tuple of Tried
        All of them.
    """

    tried: tuple[Tried[T], ...]

    @property
    def best(self) -> Tried[T]:
        """The one with the least criterion."""
        return self.tried[0]

    def odds(self, other: Tried[T]) -> float:
        """How many times likelier the best is than another, at equal odds before."""
        gap = other.criterion - self.best.criterion
        return math.exp(min(gap / 2, 700.0))

    def rivals(self) -> list[Tried[T]]:
        """Others that cannot be ruled out (`RIVAL`)."""
        limit = self.best.criterion + RIVAL
        return [one for one in self.tried[1:] if one.criterion < limit]

    def ties(self) -> list[Tried[T]]:
        """Others that are as likely as the best, as far as the observations tell (`TIE`)."""
        limit = self.best.criterion + TIE
        return [one for one in self.tried[1:] if one.criterion < limit]


def ranked(tried: Sequence[Tried[T]]) -> Ranking[T]:
    """Hypotheses compared."""
    return Ranking(tuple(sorted(tried, key=lambda one: one.criterion)))
