"""Digits of the logs that are coarse beside the noise, and what follows from it."""

from collections.abc import Iterator, Sequence

from rtk_gt.campaign.outcome import RtkOutcome
from rtk_gt.lasting.causes import SMALLEST
from rtk_gt.receivers.digits import COARSE, UNIFORM, coarsest, coarsest_level
from rtk_gt.receivers.fixes import Fixes
from rtk_gt.settings import RtkSettings
from validation.results import Finding, Size

TOO_COARSE = 2 * SMALLEST
"""Metres of the last digit of level positions from which on no error that lasts is looked for.
Rounding is off by up to half a digit, and stays so while a vehicle hardly moves: it then makes the
smallest errors that are told. Six decimals of degrees have 11 cm, seven 1."""


def too_coarse(records: Sequence[Fixes]) -> bool:
    """Whether rounding makes errors that last by itself."""
    return coarsest_level(records)[1] >= TOO_COARSE


def coarse_positions(records: Sequence[Fixes], sigma: float | None = None) -> Iterator[Finding]:
    """That level positions are rounded so coarsely that it counts.

    Parameters
    ----------
    records : sequence of Fixes
        Of all receivers.
    sigma : float, optional
        Level noise that was found, in which rounding is contained.
    """
    name, step = coarsest_level(records)
    text = (
        f"Latitudes and longitudes of receiver {name} have a last digit of {100 * step:.2g} cm: "
        f"rounding alone is off by up to {50 * step:.2g} cm, and stays so while the vehicle hardly "
        "moves. "
    )
    more = (
        "Let the receiver write eight decimals of degrees or six of minutes (u-blox: "
        "high-precision NMEA)."
    )
    size = (Size("last digit", step, "m"),)
    if too_coarse(records):
        text += (
            "Such positions are no ground truth of RTK, whatever their noise. Errors that last "
            "were not looked for: none can be told from rounding. "
        )
        yield Finding("error", text + more, name, "coarse_positions", size)
    elif sigma is not None and UNIFORM * step >= COARSE * sigma:
        text += (
            f"The noise found, {1000 * sigma:.0f} mm, holds {1000 * UNIFORM * step:.0f} mm of it. "
        )
        yield Finding("warning", text + more, name, "coarse_positions", size)


def coarse_heights(outcome: RtkOutcome) -> Iterator[Finding]:
    """That heights are rounded so coarsely that it counts as noise."""
    stated = outcome.campaign.section("rtk", RtkSettings).eta
    if outcome.settings.eta <= stated:
        return
    name, step = coarsest(outcome.records)
    text = (
        f"The heights of receiver {name} have a last digit of {1000 * step:g} mm: rounding alone "
        f"is off by {1000 * UNIFORM * step:.0f} mm. Vertical noise is taken as "
        f"{outcome.settings.eta:.1f} times the horizontal one instead of {stated:g}. Heights that "
        "are rounded alike err together for seconds: pitch and roll are poor all the same. Let the "
        "receiver write three decimals of altitude."
    )
    yield Finding("warning", text, name, "coarse_heights", (Size("last digit", step, "m"),))
