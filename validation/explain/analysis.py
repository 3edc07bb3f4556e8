"""The whole question: where the errors of a set of systems come from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from validation.errors import GtvalError
from validation.explain.fitting.models import FROM_THE_FIRST
from validation.explain.fitting.noise import Mask
from validation.explain.fitting.pairs import Pairs, make_pairs, own_reference
from validation.explain.fitting.selection import FALSE_ALARM as INVENTED
from validation.explain.fitting.selection import Selection, select
from validation.explain.fitting.settled import Settled, settle
from validation.explain.sources.agreement import Agreement, agreement
from validation.explain.sources.arbitration import FALSE_ALARM, judge, judged_by_tails
from validation.explain.sources.copies import find_copies
from validation.explain.sources.gathered import as_one, gathered
from validation.explain.sources.reference import ReferenceEvidence, infer_reference
from validation.explain.sources.verdicts import Arbitration
from validation.poses.angles import Array
from validation.poses.pose_table import PoseTable, refuse_twice
from validation.shown import Shown

FEWEST = 4
"""Poses below which nothing is fitted: a frame takes three numbers of three poses' nine, a frame
and a mount six; with four poses six of twelve are left to judge by."""
UNKNOWN_STOP = "?"
_ROUNDS = 2
"""Fits without the flagged cells at most; in 25 simulated campaigns of four sources, what is
flagged did not change after the first."""


@dataclass(frozen=True)
class Question:
    """What is known beside the poses.

    Parameters
    ----------
    references : mapping of str to str
        The stop whose validation pose tied a system to the GTV frame; '?' where it is known that
        one did but not which.
    sensors : mapping of str to sequence of str
        Systems that share a sensor, by its name.
    times : mapping of str to float, optional
        Seconds of the poses of a moving robot.
    witnesses : sequence of PoseTable
        Rough poses from elsewhere: they take part in the arbitration, but are not explained.
    independent : sequence of sequence of str
        Systems of which it is stated that none is a copy of another.
    confidence : float
        Of all intervals.
    invented : float
        Chance that any systematic error is claimed in a clean campaign.
    false_alarm : float
        Chance that any pose is flagged in a clean campaign.
    """

    references: Mapping[str, str] = field(default_factory=dict)
    sensors: Mapping[str, Sequence[str]] = field(default_factory=dict)
    times: Mapping[str, float] | None = None
    witnesses: Sequence[PoseTable] = ()
    independent: Sequence[Sequence[str]] = ()
    confidence: float = 0.95
    invented: float = INVENTED
    false_alarm: float = FALSE_ALARM


@dataclass(frozen=True, repr=False)
class SystemExplanation(Shown):
    """What was found out about one system.

    Parameters
    ----------
    table : PoseTable
        Its poses.
    selection : Selection, optional
        All explanations; None where there are too few poses to fit any.
    settled : Settled, optional
        The chosen one without the flagged cells.
    reference : ReferenceEvidence, optional
        Where the reference is not stated and the errors look as if there were one.
    unit_doubt : str
        Why headings are perhaps in degrees, in words; empty if nothing says so.
    """

    table: PoseTable
    selection: Selection | None
    settled: Settled | None
    reference: ReferenceEvidence | None
    unit_doubt: str = ""

    @property
    def system(self) -> str:
        """Name of the system."""
        return self.table.system

    @property
    def name(self) -> str:
        """Name of the explanation; 'reference_mount' also where the reference was inferred.

        A convention stands first ('mirrored_y', 'millimetres+frame'); 'drift' is also the name of
        errors that last as long as the table, without an even part.
        """
        if self.selection is None:
            return "unknown"
        name = self.selection.chosen.name.replace(FROM_THE_FIRST, "drift")
        if self.reference is not None and self.reference.accepted:
            name = name.replace("frame_mount", "reference_mount")
        if self.wanders:
            name = "drift"
        read = self.selection.pairs.convention.name
        return "+".join(one for one in (read, name) if one and not (read and one == "none"))

    @property
    def wanders(self) -> bool:
        """Whether errors last as long as the table, and no cause is shown beside them."""
        if self.selection is None or self.settled is None or self.settled.serial is None:
            return False
        plain = not self.selection.chosen.model.parts and self.selection.memory > np.log(DECIDED)
        return plain and bool(self.settled.serial.withheld)

    @property
    def reference_decided(self) -> bool:
        """Whether the errors, or what was stated, leave one stop as the reference."""
        found = self.reference
        if found is None or not found.accepted or len(found.possible) != 1:
            return False
        return found.certain or found.odds > DECIDED

    def credible(self, others: Sequence["SystemExplanation"] = ()) -> bool:
        """Whether what the explanation leaves can be noise.

        Parameters
        ----------
        others : sequence of SystemExplanation
            The other systems of the campaign.

        Notes
        -----
        Against the stated covariances, where there are any; else it must take away half of the
        mean square, or of the headings' where neighbours do not depend on each other (what lasts is
        no noise), and leave no more than three times what the others leave, and no more than
        `MOST_LEFT`.
        """
        settled = self.settled
        if settled is None or not settled.fit.model.parts:
            return False
        if settled.pairs.stated:
            return bool((settled.misfit[:, 1] <= DOUBLE).all())
        left = _left(settled)
        used = settled.cells[:, 0]
        before = np.hypot(*settled.before[used, :2].T)
        turned = settled.spread(settled.before)[2] > 2 * settled.noise[2]
        turned &= settled.serial is None
        taken = left**2 < 0.5 * float((before**2).mean()) or turned
        rest = [_left(one.settled) for one in others if one.settled is not None]
        close = not rest or left <= 3 * float(np.median(rest))
        return bool(taken and close and left < MOST_LEFT)


def _left(settled: Settled) -> float:
    """Root mean square of the positions that are left, in metres."""
    return float(np.hypot(*settled.noise[:2]))


DECIDED = 20.0
"""Odds of a reference over chance from which on it is named: one in twenty, as of all intervals."""
DOUBLE = 2.0
"""Times the stated noise, at the low end of its interval, up to which what is left can be noise. A
judgement: stated covariances are seldom right to a factor below two."""
MOST_LEFT = 0.5
"""Metres. A judgement: a system that is off by more after its cause is taken out was not explained,
whatever it is for."""


@dataclass(frozen=True, repr=False)
class Explanation(Shown):
    """Where the errors of all systems come from.

    Parameters
    ----------
    validation : PoseTable
        The validation poses.
    systems : tuple of SystemExplanation
        One for each GT system.
    arbitration : Arbitration
        Who is wrong at which stop.
    agreements : tuple of Agreement
        Systems that share a sensor.
    question : Question
        What was asked.
    """

    validation: PoseTable
    systems: tuple[SystemExplanation, ...]
    arbitration: Arbitration
    agreements: tuple[Agreement, ...]
    question: Question

    def system(self, name: str) -> SystemExplanation:
        """The one with that name."""
        return next(one for one in self.systems if one.system == name)


def explain(
    validation: PoseTable, systems: Sequence[PoseTable], question: Question | None = None
) -> Explanation:
    """Where the errors of GT systems come from.

    Parameters
    ----------
    validation : PoseTable
        The validation poses.
    systems : sequence of PoseTable
        The GT systems' poses, each with stops in common with the validation.
    question : Question, optional
        What else is known.

    Raises
    ------
    GtvalError
        If the tables are not planar or share no stop, angles are certainly degrees, or a named
        reference or system does not exist.

    Notes
    -----
    1. Each system is explained by itself, robustly. 2. With the systematic parts taken out, the
    sources are held against each other and the cells that do not fit are flagged. 3. The chosen
    explanations are fitted again without these cells, and 2 is repeated. 4. Systems that share a
    sensor are compared and fitted together.
    """
    question = question or Question()
    _check(validation, systems, question)
    pairs = [
        make_pairs(validation, one, _stated_reference(question, one, validation), question.times)
        for one in systems
    ]
    share = question.invented / max(len(systems), 1)
    selections = [select(one, share) if len(one) >= FEWEST else None for one in pairs]
    pairs = [p if one is None else one.pairs for p, one in zip(pairs, selections, strict=True)]
    known = question.sensors, question.witnesses
    everything = [np.ones((len(one), 2), dtype=bool) for one in pairs]
    apart = _settled(pairs, selections, everything, aside=True)
    # The first arbitration takes the robust fits, which no gross error has moved.
    first = gathered(validation, systems, pairs, _robust(selections), apart, *known)
    copies = find_copies(first.names, first.poses, question.independent, pairs)
    judged = judge(as_one(first, copies), question.false_alarm)
    for _ in range(_ROUNDS):
        apart = _settled(pairs, selections, [_cells(p, judged.result) for p in pairs], aside=True)
        before = judged.result
        again = gathered(validation, systems, pairs, apart, apart, *known)
        judged = judge(as_one(again, copies), question.false_alarm)
        same = (before.bad == judged.result.bad).all()
        if same and (before.doubtful == judged.result.doubtful).all():
            break
    result = replace(judged_by_tails(judged), copies=copies)
    settled = _settled(pairs, selections, [_cells(p, before) for p in pairs], aside=False)
    noise = _least_noise(settled)
    explained = tuple(
        SystemExplanation(
            table,
            chosen,
            done,
            _reference(
                chosen,
                done,
                validation,
                noise,
                certain=question.references.get(table.system) == UNKNOWN_STOP,
            ),
            one.unit_doubt,
        )
        for table, one, chosen, done in zip(systems, pairs, selections, settled, strict=True)
    )
    agreements = _agreements(explained, pairs, result, question)
    return Explanation(validation, explained, result, agreements, question)


def _check(validation: PoseTable, systems: Sequence[PoseTable], question: Question) -> None:
    """Raise for names that do not exist and tables that are there twice."""
    names = [one.system for one in systems]
    if not names:
        raise GtvalError("there is no GT system to explain")
    every = [validation.system, *names, *(one.system for one in question.witnesses)]
    refuse_twice(every)
    for name in question.references:
        if name not in names:
            raise GtvalError(
                f"a reference is stated for the system '{name}', which is not there; "
                f"there are {', '.join(names)}"
            )
    for sensor, members in question.sensors.items():
        unknown = [name for name in members if name not in names]
        if unknown:
            raise GtvalError(
                f"the sensor '{sensor}' is said to be shared by {', '.join(unknown)}, which "
                f"is not there; there are {', '.join(names)}"
            )


def _stated_reference(question: Question, table: PoseTable, validation: PoseTable) -> str:
    """The reference stop of a system, as stated or its own; empty where it is not known which."""
    stop = question.references.get(table.system, own_reference(validation, table))
    return "" if stop == UNKNOWN_STOP else stop


def _settled(
    pairs: Sequence[Pairs],
    selections: Sequence[Selection | None],
    cells: Sequence[Mask],
    *,
    aside: bool,
) -> list[Settled | None]:
    """Each explanation without flagged cells: as it is told, or what is set aside to compare."""
    made: list[Settled | None] = []
    for pair, one, used in zip(pairs, selections, cells, strict=True):
        if one is None:
            made.append(None)
            continue
        found = one.taken_out if aside else one.chosen
        made.append(settle(pair, found.fit, used, dependent=one.dependent and not aside))
    return made


def _robust(selections: Sequence[Selection | None]) -> list[Settled | None]:
    """The robust fits in the form of settled ones."""
    return [
        None
        if one is None
        else Settled(
            one.pairs,
            one.taken_out.fit,
            one.taken_out.fit.weights[0] > 0.5,  # more good than bad
            np.zeros(2),
            np.zeros(2),
        )
        for one in selections
    ]


def _cells(pairs: Pairs, result: Arbitration) -> Mask:
    """(n, 2) cells of the pairs in which neither pose is flagged."""
    own = result.sources.index(pairs.system)
    place = {name: row for row, name in enumerate(result.ids)}
    rows = [place[name] for name in pairs.ids]
    usable = result.usable
    return np.asarray(usable[0, rows] & usable[own, rows])


def _reference(
    selection: Selection | None,
    settled: Settled | None,
    validation: PoseTable,
    noise: Array | None,
    *,
    certain: bool,
) -> ReferenceEvidence | None:
    """The evidence for a reference, where none was stated and frame and mount are both wrong."""
    if selection is None or settled is None or selection.pairs.reference:
        return None
    if not {"frame", "mount"} <= set(selection.chosen.model.parts):
        return None
    return infer_reference(settled, validation, noise, certain=certain)


def _least_noise(settled: Sequence[Settled | None]) -> Array | None:
    """(2,) least noise of any system's residuals: the validation poses cannot be noisier."""
    scales = [one.fit.scale[0] for one in settled if one is not None and not one.pairs.stated]
    return np.min(scales, axis=0) if scales else None


def _agreements(
    explained: Sequence[SystemExplanation],
    pairs: Sequence[Pairs],
    result: Arbitration,
    question: Question,
) -> tuple[Agreement, ...]:
    """Each group's mounts compared, with the simplest explanation that holds a mount."""
    by_name = {one.system: (one, pair) for one, pair in zip(explained, pairs, strict=True)}
    found = []
    for sensor, names in question.sensors.items():
        fits = [fit for name in names if (fit := _with_mount(*by_name[name], result)) is not None]
        if len(fits) > 1:
            found.append(agreement(sensor, fits))
    return tuple(found)


def _with_mount(one: SystemExplanation, pairs: Pairs, result: Arbitration) -> Settled | None:
    """A settled fit with a mount: the chosen one, or frame and mount where it has none.

    None where the cells that are not flagged do not determine it.
    """
    if one.selection is None or one.settled is None or pairs.convention.headings_lost:
        return None
    found = one.settled
    if "mount" not in found.fit.model.parts:
        candidate = one.selection.candidate("frame_mount")
        if not candidate.observability.complete:
            return None
        found = settle(
            pairs, candidate.fit, _cells(pairs, result), dependent=one.selection.dependent
        )
    return found if np.isfinite(found.fit.covariance).all() else None
