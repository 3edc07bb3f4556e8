"""The hand-held laser distance meter: how exact a reading is, and how to check it."""

import numpy as np
import numpy.typing as npt

from validation.campaign.folder import Instrument
from validation.poses.angles import Array


def tolerance_at(instrument: Instrument, distance: npt.ArrayLike) -> Array:
    """Half width that the maker states for a distance, metres.

    Parameters
    ----------
    instrument : Instrument
        Its specification.
    distance : (...) array_like
        Metres.

    Notes
    -----
    AD2.3, "Hand-laser distance measuring device": +-1.5 mm to 30 m, +-5 mm at 50 m.
    """
    beyond = np.maximum(np.asarray(distance, dtype=float) - instrument.tolerance_up_to, 0.0)
    return np.asarray(instrument.tolerance + instrument.tolerance_per_metre * beyond)


def reading_sigma(instrument: Instrument, distance: npt.ArrayLike) -> Array:
    """Standard deviation of a reading.

    Parameters
    ----------
    instrument : Instrument
        Its tolerance is taken as 2 sigma.
    distance : (...) array_like
        Metres.

    Returns
    -------
    (...) array
        Metres.

    Notes
    -----
    The resolution r adds r^2 / 12, the variance of rounding.
    """
    half = tolerance_at(instrument, distance) / 2
    return np.sqrt(half**2 + instrument.setup_sigma**2 + instrument.resolution**2 / 12)


def corrected(instrument: Instrument, reading: npt.ArrayLike) -> Array:
    """Distances that the readings stand for: offset + scale * reading, in metres."""
    return instrument.offset + instrument.scale * np.asarray(reading, dtype=float)
