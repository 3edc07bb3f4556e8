"""The causes of a moving source's errors, with sizes and what they spoil."""

from dataclasses import dataclass

import numpy as np
from scipy import special

from validation.poses.angles import Array, wrap
from validation.poses.trajectory import Trajectory
from validation.shown import Shown
from validation.statistics.hypotheses import Parameter
from validation.trajectories.causes.chain import (
    CAUSES,
    PARAMETERS,
    UNITS,
    WORDS,
    columns,
    corrected,
    reference_times,
)
from validation.trajectories.causes.fit import Weights, fit_all
from validation.trajectories.causes.matching import Matched, match
from validation.trajectories.causes.noise import Noise
from validation.trajectories.causes.weighing import (
    FALSE_ALARM,
    Choice,
    Set,
    choose,
    prices,
)


@dataclass(frozen=True)
class Cause:
    """One cause of the errors.

    Parameters
    ----------
    name : str
        Of `chain.CAUSES`.
    words : str
        What it says, for a sentence.
    parameters : tuple of Parameter
        Its numbers.
    spoils, turns : float
        Root mean square of what it moves positions (m) and headings (rad) by on this drive.
    """

    name: str
    words: str
    parameters: tuple[Parameter, ...]
    spoils: float
    turns: float


@dataclass(frozen=True, repr=False)
class TimeExplanation(Shown):
    """What explains the errors of one source in time.

    Parameters
    ----------
    system, reference : str
        Names.
    causes : tuple of Cause
        Those that are there; empty if none is shown.
    rivals : tuple of tuple of str
        Other sets of causes that explain the errors as well.
    alike : tuple of (str, str)
        Pairs of causes that this drive could not tell apart.
    unseen : tuple of str
        Causes that would not show on this drive.
    smallest : mapping of str to float
        For each parameter by itself: the size shown in 95 % of drives like this one.
    position, heading : Noise
        What is left.
    effective : (2,) array
        Independent positions and headings that would tell a mean as well.
    poses, left_out : int
        Poses looked at, and those of them with a cell that does not fit.
    typical_speed : float
        Metres a second, root mean square.
    before, after : (2,) array
        Root mean square of the errors of positions (m) and headings (rad), cells that fit.
    covariance : (k, k) array
        Of all parameters of the causes, in their order.
    confidence, false_alarm : float
        Of the intervals; chance that a cause is claimed where there is none.
    """

    system: str
    reference: str
    causes: tuple[Cause, ...]
    rivals: tuple[Set, ...]
    alike: tuple[Set, ...]
    unseen: Set
    smallest: dict[str, float]
    position: Noise
    heading: Noise
    effective: Array
    poses: int
    left_out: int
    typical_speed: float
    before: Array
    after: Array
    covariance: Array
    confidence: float
    false_alarm: float

    @property
    def name(self) -> str:
        """'frame_delay', or 'none'."""
        return "_".join(one.name for one in self.causes) or "none"

    @property
    def words(self) -> str:
        """'a wrong frame and a delay', or 'no systematic error'."""
        return " and ".join(one.words for one in self.causes) or "no systematic error"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Of all causes."""
        return tuple(value for cause in self.causes for value in cause.parameters)


def time_causes(
    reference: Trajectory,
    source: Trajectory,
    confidence: float = 0.95,
    false_alarm: float = FALSE_ALARM,
) -> TimeExplanation:
    """The causes of the errors of a source, from all its poses at times the reference knows.

    Poses in space are seen from above.

    Parameters
    ----------
    reference, source : Trajectory
        With headings; the frames, clocks and mounts may differ.
    confidence : float
        Of the intervals.
    false_alarm : float
        Chance that any cause is claimed where there is none.

    Raises
    ------
    GtvalError
        Without headings, or with too few poses at common times.
    """
    matched, delay = match(reference, source)
    everything, weights = fit_all(matched, delay)
    choice = choose(matched, everything, weights, false_alarm)
    chosen = choice.chosen
    values = _parameters(choice, confidence)
    causes = tuple(
        _cause(matched, weights, chosen.fit.parameters, name, values) for name in chosen.causes
    )
    at_none, seen = matched.residuals(np.zeros(len(PARAMETERS)))
    return TimeExplanation(
        source.system,
        reference.system,
        causes,
        choice.rivals,
        choice.alike,
        choice.unseen,
        _smallest(choice, everything.information, false_alarm),
        weights.position,
        weights.heading,
        weights.effective,
        len(matched.stamps),
        int((~weights.both).sum()),
        float(np.sqrt(np.mean(np.abs(seen.velocities) ** 2))),
        _sizes(at_none, weights),
        _sizes(chosen.fit.residuals, weights),
        chosen.fit.covariance,
        confidence,
        false_alarm,
    )


def _parameters(choice: Choice, confidence: float) -> dict[str, Parameter]:
    """Values with Student intervals of the effective degrees of freedom."""
    found = choice.chosen.fit
    sigmas = np.sqrt(np.diagonal(found.covariance)) if found.columns else np.zeros(0)
    reach = float(special.stdtrit(choice.freedom, 0.5 + confidence / 2))
    told = {}
    for column, sigma in zip(found.columns, sigmas, strict=True):
        name, value, s = PARAMETERS[column], float(found.parameters[column]), float(sigma)
        if name in {"frame_theta", "mount_theta"}:
            value = float(wrap(value))
        p = 2 * float(special.stdtr(choice.freedom, -abs(value) / s)) if s > 0 else 0.0
        told[name] = Parameter(name, UNITS[name], value, s, value - reach * s, value + reach * s, p)
    return told


def _cause(
    matched: Matched,
    weights: Weights,
    parameters: Array,
    name: str,
    values: dict[str, Parameter],
) -> Cause:
    """One cause and what it moves poses by: the corrected poses with it, minus those without."""
    without = parameters.copy()
    without[list(columns([name]))] = 0.0
    if name in {"delay", "clock_drift"}:
        late = [reference_times(p, matched.stamps, matched.since) for p in (parameters, without)]
        a, b = (matched.reference.moving(times) for times in late)
        moved, turned = np.abs(a.places - b.places), a.headings - b.headings
    else:
        c, d = (corrected(p, matched.poses, matched.since) for p in (parameters, without))
        moved, turned = np.hypot(*(c - d)[:, :2].T), wrap((c - d)[:, 2])
    size, angle = (
        float(np.sqrt(np.mean(one[cells] ** 2))) if cells.any() else 0.0
        for one, cells in ((moved, weights.cells[:, 0]), (turned, weights.cells[:, 1]))
    )
    return Cause(name, WORDS[name], tuple(values[one] for one in CAUSES[name]), size, angle)


def _sizes(residuals: Array, weights: Weights) -> Array:
    """(2,) root mean square of position and heading errors."""
    place = np.hypot(*residuals[weights.cells[:, 0], :2].T)
    turned = residuals[weights.cells[:, 1], 2]
    return np.array([np.sqrt(np.mean(one**2)) if len(one) else np.nan for one in (place, turned)])


def _smallest(choice: Choice, information: Array, false_alarm: float) -> dict[str, float]:
    """What each parameter must be, alone, to be claimed in 95 % of drives like this one."""
    price = prices(choice.freedom, false_alarm)
    reach = {name: np.sqrt(price[cause]) for cause, names in CAUSES.items() for name in names}
    reach["mount_theta"] = np.sqrt(price["turn"])
    alone = 1 / np.sqrt(np.maximum(np.diagonal(information), 1e-300))
    more = float(special.stdtrit(choice.freedom, 0.95))
    return {
        name: float((reach[name] + more) * sigma)
        for name, sigma in zip(PARAMETERS, alone, strict=True)
    }
