"""What is known of a room besides the readings of the hand laser."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from validation.poses.angles import Array


@dataclass(frozen=True)
class Evidence:
    """Coordinates from elsewhere, which can tell a labelling from its mirror image.

    Parameters
    ----------
    published, hand : mapping of str to (2,) array
        World points as published, and as measured roughly by hand, metres.
    hand_sigma : float
        Standard deviation of the rough coordinates, metres.
    guesses : mapping of str to (3,) array
        Hand-measured poses.
    """

    published: Mapping[str, Array] = field(default_factory=dict)
    hand: Mapping[str, Array] = field(default_factory=dict)
    hand_sigma: float = 0.2
    guesses: Mapping[str, Array] = field(default_factory=dict)
