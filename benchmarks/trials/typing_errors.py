"""Numbers as people mistype them: digits exchanged, left out, doubled, the point misplaced."""

from itertools import pairwise
from typing import Literal, get_args

import numpy as np

TypingError = Literal["exchanged", "left out", "doubled", "misplaced"]
TYPING_ERRORS: tuple[TypingError, ...] = get_args(TypingError)


def mistyped(shown: str, kind: TypingError) -> list[str]:
    """All texts that one typing error makes of a number.

    Parameters
    ----------
    shown : str
        As the instrument shows it, metres with a decimal point: '5.321'.
    kind : {"exchanged", "left out", "doubled", "misplaced"}
        5.321 becomes 3.521, 5.231 or 5.312; .321, 5.21, 5.31 or 5.32; 55.321, 5.3321, ...;
        53.21, 532.1, 5321, 0.5321 and so on ('5321' is millimetres, hence no error).

    Returns
    -------
    list of str
        Different from what is shown as numbers.
    """
    digits = [place for place, character in enumerate(shown) if character.isdigit()]
    if kind == "exchanged":
        texts = [_exchanged(shown, a, b) for a, b in pairwise(digits)]
    elif kind == "left out":
        texts = [shown[:place] + shown[place + 1 :] for place in digits]
    elif kind == "doubled":
        texts = [shown[:place] + shown[place] + shown[place:] for place in digits]
    else:
        bare = shown.replace(".", "")
        texts = [f"{bare[:place]}.{bare[place:]}" for place in range(1, len(bare))]
        texts += [f"0.{bare}", f"{bare}0"]
    return sorted({text for text in texts if float(text) != float(shown)})


def draw_mistyped(shown: str, rng: np.random.Generator) -> str:
    """A number with one typing error of a kind drawn at random."""
    choices: list[str] = []
    while not choices:
        kind = TYPING_ERRORS[int(rng.integers(len(TYPING_ERRORS)))]
        choices = mistyped(shown, kind)
    return choices[int(rng.integers(len(choices)))]


def _exchanged(text: str, a: int, b: int) -> str:
    """The text with two characters exchanged."""
    typed = list(text)
    typed[a], typed[b] = typed[b], typed[a]
    return "".join(typed)
