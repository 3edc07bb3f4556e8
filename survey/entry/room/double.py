"""Double entries: when two people's values agree, and who may make the second."""

from survey.entry.record.state import Agree, EntryState, Pair
from survey.readings.levels import CRITICAL
from survey.settings import SurveySettings
from validation.campaign.folder import Instrument
from validation.errors import GtvalError
from validation.page.people import Person


def agreement(instrument: Instrument, survey: SurveySettings) -> Agree:
    """Whether two people's values agree: the same, or within what the instrument allows.

    Two measurements agree if they differ by less than one correct pair in a thousand does.
    """
    half_step = 0.5 * (instrument.resolution or 0.001)
    if survey.entry.second == "type":
        return lambda a, b: abs(a - b) < half_step
    stated = survey.reading_sigma

    def agree(a: float, b: float) -> bool:
        from survey.readings.instrument import reading_sigma  # noqa: PLC0415  (numpy)

        sigma = float(reading_sigma(instrument, max(a, b))) if stated is None else stated
        return instrument.scale * abs(a - b) <= CRITICAL * 2**0.5 * sigma + half_step

    return agree


def check_second(state: EntryState, pair: Pair, person: Person, kind: str) -> None:
    """Raise where a person cannot make the second entry of a pair.

    Parameters
    ----------
    state : EntryState
        What stands.
    pair : frozenset of str
        The two points.
    person : Person
        Who would.
    kind : {"none", "type", "measure"}
        What second entries are in this campaign.

    Raises
    ------
    GtvalError
        If there are none, or the pair has no first, has a second, or has its first from this
        person.
    """
    if kind == "none":
        raise GtvalError("this campaign has no second entries ([survey.entry] second)")
    if state.disagrees(pair):
        return
    entries = [state.entries[n] for n in state.counting(pair)]
    what = "–".join(sorted(pair))
    if not entries:
        raise GtvalError(f"{what} has no first entry yet")
    if any(e.second for e in entries):
        raise GtvalError(f"{what} has its second entry already")
    if any(e.by == person.name for e in entries):
        raise GtvalError(f"the second entry of {what} is for the other person")
