"""What the explanations of stops and of poses in time share: numbers of a cause, and limits."""

from dataclasses import dataclass

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
