import numpy as np
import pytest
from trials.typing_errors import TYPING_ERRORS, mistyped

from survey.entry.record.numbers import parse_distance
from survey.entry.room.slips import SLIPS, fitting_originals, possible_originals
from validation.campaign.folder import Instrument

LASER = Instrument()


def originals(text):
    return {h.metres: h.slip for h in possible_originals(parse_distance(text, LASER), LASER)}


@pytest.mark.parametrize(
    ("typed", "shown", "slip"),
    [
        ("5.378", 3.578, "two digits exchanged"),
        ("5.378", 5.738, "two digits exchanged"),
        ("5.38", 5.378, "a digit left out"),
        ("538", 5.378, "a digit left out"),
        ("5.3378", 5.378, "a digit typed twice"),
        ("53.78 mm", 5.378, "the decimal point misplaced"),
        ("5.278", 5.378, "one digit wrong"),
    ],
)
def test_each_slip_is_undone(typed, shown, slip):
    assert originals(typed)[shown] == slip


@pytest.mark.parametrize("kind", TYPING_ERRORS)
def test_whatever_is_mistyped_the_shown_value_is_among_the_originals(kind):
    rng = np.random.default_rng(1)
    seen = 0
    for millimetres in rng.integers(1000, 20_000, 60):
        shown = f"{millimetres / 1000:.3f}"
        for text in mistyped(shown, kind):
            try:
                typed = parse_distance(text, LASER)
            except ValueError:
                continue
            if typed.metres != float(shown):
                seen += 1
                assert float(shown) in originals(text), (shown, text)
    # Misplaced points mostly leave the range, and are refused before anything is guessed.
    assert seen > (5 if kind == "misplaced" else 50)


def test_only_values_that_fit_are_offered_the_likeliest_slip_first():
    typed = parse_distance("5.378", LASER)
    fitting = fitting_originals(typed, LASER, lambda value: abs(value - 3.578) / 0.004, 3.29)
    assert [h.metres for h in fitting] == [3.578]
    both = fitting_originals(typed, LASER, lambda _: 0.0, 3.29)
    order = [SLIPS.index(h.slip) for h in both]
    assert order == sorted(order)
    assert 5.378 not in [h.metres for h in both]
