"""What to tell a person about a reading the moment it is entered."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from survey.entry.record.numbers import TypedDistance, signed_mm
from survey.entry.room.knowledge import Judged, RoomKnowledge
from survey.entry.room.prediction import Prediction
from survey.entry.room.slips import Hypothesis, fitting_originals, shown_decimals
from survey.readings.levels import CRITICAL
from validation.campaign.folder import Instrument

Status = Literal["fits", "unchecked", "doubtful"]
MOST_HYPOTHESES = 3
"""Values suggested. A judgement: what a person can look at between two readings."""
SHARP = 0.02
"""Standard deviation, in metres, up to which a prediction is believed by itself. A judgement:
most slips, a wrong digit or two digits exchanged, are larger than three times this."""


@dataclass(frozen=True)
class Verdict:
    """What the check of a reading says.

    Parameters
    ----------
    status : {"fits", "unchecked", "doubtful"}
        'unchecked' where too little is known to check it.
    text : str
        The same in a sentence.
    predicted, sigma : float or None
        What was expected, metres; None where nothing was.
    off : float or None
        Reading less prediction, metres.
    suspects : tuple of int
        Journal entries of the readings that may be wrong instead, or too.
    hypotheses : tuple of Hypothesis
        Values that would fit.
    other_ends : tuple of str
        World points whose distance this would be.
    """

    status: Status
    text: str
    predicted: float | None = None
    sigma: float | None = None
    off: float | None = None
    suspects: tuple[int, ...] = ()
    hypotheses: tuple[Hypothesis, ...] = ()
    other_ends: tuple[str, ...] = ()


def verdict(
    typed: TypedDistance,
    metres: float,
    prediction: Prediction,
    suspects: tuple[int, ...],
    number: int,
    instrument: Instrument,
) -> Verdict:
    """What to say of a reading.

    Parameters
    ----------
    typed : TypedDistance
        As typed.
    metres : float
        The distance that it stands for.
    prediction : Prediction
        What the readings before it say.
    suspects : tuple of int
        Entries that may be wrong now that it is known, itself among them perhaps.
    number : int
        Its own entry.
    instrument : Instrument
        Resolution and range.
    """
    said, sigma, off = _difference(metres, prediction)
    misfit = prediction.misfit(metres)
    if sigma is not None and sigma > SHARP and number not in suspects:
        # Circles that touch at a small angle bend a lot within such a sigma; the fit of all
        # readings together, which knows how they bend, has found nothing wrong.
        misfit = prediction.sides.misfit(metres)
    too_fine = has_too_many_decimals(typed, instrument)
    if misfit <= CRITICAL and number not in suspects and not too_fine:
        if not prediction.checks and not suspects:
            return Verdict("unchecked", "nothing to check it with yet")
        text = f"fits {prediction.basis}" if prediction.checks else "plausible"
        return Verdict("fits", text, said, sigma, off, suspects)
    originals = fitting_originals(
        typed,
        instrument,
        lambda value: prediction.misfit(instrument.offset + instrument.scale * value),
        CRITICAL,
    )
    hypotheses = tuple(originals[:MOST_HYPOTHESES]) if prediction.checks else ()
    text = _why_doubtful(metres, prediction, misfit)
    if not suspects:
        suspects = prediction.sides.broken(metres, CRITICAL)
    if too_fine and misfit <= CRITICAL:
        text = "has more decimals than the instrument shows"
    return Verdict("doubtful", text, said, sigma, off, suspects, hypotheses)


def has_too_many_decimals(typed: TypedDistance, instrument: Instrument) -> bool:
    """Whether a number is finer than the instrument shows: some digit was typed twice."""
    steps = typed.metres * 10 ** shown_decimals(instrument)
    return typed.metric and instrument.resolution > 0 and abs(steps - round(steps)) > 1e-3


def _difference(
    metres: float, prediction: Prediction
) -> tuple[float | None, float | None, float | None]:
    """Prediction, its sigma, and how far off the reading is."""
    if not prediction.checks:
        return None, None, None
    said, sigma = prediction.nearest(metres)
    return said, sigma, metres - said


def _why_doubtful(metres: float, prediction: Prediction, misfit: float) -> str:
    """Why a reading is doubtful, in words."""
    if prediction.checks and misfit > CRITICAL:
        said, sigma = prediction.nearest(metres)
        return (
            f"does not fit {prediction.basis}: expected {said:.3f} m ± {1000 * sigma:.0f} mm, "
            f"this is {signed_mm(metres - said)} off"
        )
    if misfit > CRITICAL:
        return "cannot be: with the readings so far it closes no triangle"
    return "together with this one the readings no longer fit"


def other_ends(
    knowledge: RoomKnowledge, start: str, end: str, metres: float, ends: Iterable[str]
) -> tuple[str, ...]:
    """Other points that a reading fits sharply: perhaps the laser pointed there."""
    found = []
    for other in ends:
        if other == end:
            continue
        prediction = knowledge.predict(start, other)
        # A prediction as wide as a hand would fit by chance.
        sharp = prediction.checks and float(prediction.sigmas.min()) < SHARP
        if sharp and prediction.misfit(metres) <= CRITICAL:
            found.append(other)
    return tuple(found[:MOST_HYPOTHESES])


def suspects_of(judged: Iterable[Judged]) -> tuple[int, ...]:
    """Journal entries of all readings that may be wrong."""
    return tuple(
        dict.fromkeys(number for one in judged for number in one.entries_of(one.judgement.suspects))
    )
