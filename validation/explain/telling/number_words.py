"""Numbers of an explanation as people read them."""

from collections.abc import Iterable

import numpy as np

from validation.results import Size, Table
from validation.statistics.hypotheses import Parameter

ALL_ODDS = 1e6
"""Odds beyond this are not told in figures: they rest on the tails of the noise model, which no
table shows."""


SHOWN = 0.05
"""p-value above which a number whose interval is withheld may as well be zero, and is told so: one
in twenty, the level of all intervals."""


def number_text(value: float, unit: str) -> str:
    """A value as people read it: mm and mrad below a metre or radian, per mille for scale."""
    if unit in {"m", "rad"}:
        return f"{1000 * value:+.1f} m{unit}"
    if unit in {"m/s", "rad/s"}:
        return f"{1000 * value:+.3f} m{unit}"
    if unit == "s/s":
        return f"{1e6 * value:+.0f} ppm"
    return f"{1000 * value:+.2f} per mille" if not unit else f"{value:+.4f} {unit}"


def parameter_text(one: Parameter) -> str:
    """'mount x -89.3 mm (-92.8 to -85.8)'."""
    if np.isnan(one.low):  # withheld, as errors last
        chance = f" (p = {one.p_value:.1g} by errors that last)" if one.p_value > SHOWN else ""
        return f"{one.name.replace('_', ' ')} {number_text(one.value, one.unit)}{chance}"
    low, high = (number_text(value, one.unit).split(" ")[0] for value in (one.low, one.high))
    return f"{one.name.replace('_', ' ')} {number_text(one.value, one.unit)} ({low} to {high})"


def sizes_of(parameters: Iterable[Parameter], confidence: float) -> tuple[Size, ...]:
    """Parameters as the sizes of a finding."""
    return tuple(
        Size(one.name.replace("_", " "), one.value, one.unit, one.low, one.high, confidence)
        for one in parameters
    )


def noise_sizes(values: Iterable[float], what: str) -> tuple[Size, ...]:
    """Noise or rms in x, y and theta as the sizes of a finding."""
    units = zip(("x", "y", "theta"), ("m", "m", "rad"), values, strict=True)
    return tuple(Size(f"{what} in {name}", float(value), unit) for name, unit, value in units)


def times_text(odds: float) -> str:
    """'21000 times', as far as figures mean something."""
    if odds >= ALL_ODDS:
        return "more than a million times"
    return f"{odds:.{'0f' if odds > 3 else '1f'}} times"


def table_of_parameters(
    system: str, explanation: str, parameters: Iterable[Parameter], note: str, form: str = ".6f"
) -> Table:
    """Numbers of what explains a system's errors."""
    return Table(
        f"{system}: parameters of '{explanation}'",
        ["parameter", "unit", "value", "sigma", "low", "high", "p"],
        [[p.name, p.unit, p.value, p.sigma, p.low, p.high, p.p_value] for p in parameters],
        ["", "", *[form] * 4, ".1g"],
        note=note,
    )
