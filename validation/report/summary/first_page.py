"""The first page: one row a system, three sentences, and the tables for a paper."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from validation.explain.analysis import Explanation
from validation.explain.sources.equivalence import good_enough
from validation.poses.angles import Array
from validation.results import Figure, Section, Table, Text
from validation.statistics.evaluation import Evaluation
from validation.statistics.paired import POSITION, paired_errors

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

    from validation.figures.errors import Landmarks, Walls

MILLI = 1e3
ALSO_ASKED = 0.02
"""Metres: what halls ask of a ground truth most often, judged beside the campaign's own d."""
FEWEST_IN_COMMON = 3
"""Stops that all systems must share to be ranked by them. A judgement: with fewer, by their own."""
NOT_SHOWN = "not shown"
MOST_DIGITS = 3
"""Decimals of millimetres: micrometres, a thousandth of what a hand laser shows."""
MOST_MAPS = 4
"""Systems on the picture of the first page: more would be too small to see an arrow."""


@dataclass(frozen=True)
class Line:
    """One system on the first page.

    Parameters
    ----------
    evaluation : Evaluation
        Its errors.
    rms : float
        Of the length of the position error, or of the first component, in metres or radians.
    verdicts : tuple of str
        'yes', 'no' or 'not shown': is it good enough for d, and for 20 mm?
    cause : str
        What explains its errors.
    left : tuple of float
        What is left of positions and headings, in metres and radians; empty if unknown.
    """

    evaluation: Evaluation
    rms: float
    verdicts: tuple[str, str]
    cause: str
    left: tuple[float, ...] = ()


def first_lines(
    evaluations: Sequence[Evaluation], explanation: Explanation | None = None
) -> list[Line]:
    """What the first page says of each system.

    Parameters
    ----------
    evaluations : sequence of Evaluation
        All systems.
    explanation : Explanation, optional
        For the cause, and for what is left.
    """
    told = {one.system: one for one in explanation.systems} if explanation is not None else {}
    lines = []
    for one in evaluations:
        known = told.get(one.system)
        settled = known.settled if known is not None else None
        left: tuple[float, ...] = ()
        cause = "not analysed"
        if settled is not None:
            left = float(np.hypot(*settled.noise[:2])), float(settled.noise[2])
            parts = settled.fit.model.parts
            cause = settled.fit.model.words if parts else "no cause shown"
        asked = tuple(s.bias.limit for s in one.statistics)
        also = tuple(ALSO_ASKED if s.component.kind == "length" else np.inf for s in one.statistics)
        verdicts = verdict(one, asked), verdict(one, also)
        lines.append(Line(one, _rms(one), verdicts, cause, left))
    return lines


def verdict(evaluation: Evaluation, limits: Sequence[float]) -> str:
    """Whether bias and standard deviation are both shown to be below d, or one to be above it.

    Parameters
    ----------
    evaluation : Evaluation
        Its bias bounds allow for errors that depend on their neighbours.
    limits : sequence of float
        The d of each component; infinite where nothing is asked.

    Returns
    -------
    str
        'yes', 'no' or 'not shown', each at the confidence of the statistics.
    """
    held, broken = True, False
    for errors, one, limit in zip(
        evaluation.comparison.errors.T, evaluation.statistics, limits, strict=True
    ):
        if np.isinf(limit):
            continue
        spread = good_enough(errors, limit, one.confidence).deviation_below
        held &= bool(one.bias.smallest_limit < limit and spread < limit)
        broken |= bool(one.ci_low > limit or one.ci_high < -limit)
        # As far below the estimate as the bound is above it, in ratio: wider than exact.
        broken |= bool(one.std > 0 and np.isfinite(spread) and one.std**2 / spread > limit)
    return "no" if broken else "yes" if held else NOT_SHOWN


def _lengths(evaluation: Evaluation) -> list[int]:
    components = evaluation.comparison.components
    return [k for k, one in enumerate(components) if one.kind == "length"]


def _rms(evaluation: Evaluation, rows: Sequence[int] | None = None) -> float:
    """Of the position errors (of all errors, where there are no lengths)."""
    columns = _lengths(evaluation) or list(range(len(evaluation.comparison.components)))
    errors: Array = evaluation.comparison.errors[:, columns]
    chosen = errors if rows is None else errors[list(rows)]
    return float(np.sqrt(np.square(chosen).sum(axis=1).mean())) if len(chosen) else np.nan


def _size(value: float, unit: str) -> str:
    """'83 mm'; three digits at least."""
    milli = MILLI * value
    return f"{milli:.{0 if milli >= 100 else 1}f} m{unit}"


def _asked(lines: Sequence[Line]) -> str:
    """'50 mm': the d of the campaign."""
    first = lines[0].evaluation.statistics[0]
    return f"{MILLI * first.bias.limit:.3g} m{first.component.unit}"


def three_sentences(lines: Sequence[Line], next_thing: str, *, faulty: bool) -> list[Text]:
    """Which system is best, whether it is good enough, and what to do next."""
    said = [_best(lines), _enough(lines)]
    if faulty:
        said[1] += " This may change once the errors in the survey are settled."
    said.append(f"Next: {next_thing}" if next_thing else "Next: nothing asks for action.")
    return [Text(one) for one in said]


def _ranked(lines: Sequence[Line]) -> tuple[list[Line], list[float], int]:
    """Systems by the size of their errors where all have poses, the least first."""
    ids = [one.evaluation.comparison.ids for one in lines]
    common = [name for name in ids[0] if all(name in set(other) for other in ids[1:])]
    shared = len(common) if len(common) >= FEWEST_IN_COMMON else 0
    sizes = [
        _rms(one.evaluation, [own.index(name) for name in common] if shared else None)
        for one, own in zip(lines, ids, strict=True)
    ]
    order = np.argsort(sizes, kind="stable")
    return [lines[k] for k in order], [sizes[k] for k in order], shared


def _best(lines: Sequence[Line]) -> str:
    """The first sentence."""
    ranked, sizes, shared = _ranked(lines)
    best, unit = ranked[0].evaluation, ranked[0].evaluation.comparison.components[0].unit
    if len(lines) == 1:
        return (
            f"{best.system} is the only system compared: its position errors have an rms of "
            f"{_size(sizes[0], unit)} over {len(best.comparison)} stops."
        )
    where = f"the {shared} stops that all systems have" if shared else "their own stops"
    text = (
        f"{best.system} has the smallest position errors: rms {_size(sizes[0], unit)} over "
        f"{where}, against "
        + ", ".join(
            f"{_size(size, unit)} of {one.evaluation.system}"
            for one, size in zip(ranked[1:], sizes[1:], strict=True)
        )
    )
    pairs = paired_errors([one.evaluation for one in lines])
    beaten = {
        (one.first, one.second) for one in pairs
        if one.component == POSITION and not one.without and one.better == best.system
    }  # fmt: skip
    others = [one.evaluation.system for one in ranked[1:]]
    shown = [name for name in others if {(best.system, name), (name, best.system)} & beaten]
    rest = _any_of([name for name in others if name not in shown])
    than = f"less than {rest} is not" if rest else "less is"
    own = ranked[0].evaluation.comparison.follows
    placed = f"; the survey placed its {own.what}, which helps it here" if own is not None else ""
    return f"{text}; that it errs {than} shown{placed}."


def _any_of(names: Sequence[str]) -> str:
    """'a, b or c'."""
    *first, last = names or [""]
    return f"{', '.join(first)} or {last}" if first else last


def _enough(lines: Sequence[Line]) -> str:
    """The second sentence."""
    asked, also = _asked(lines), f"{MILLI * ALSO_ASKED:g} mm"
    places = [(0, asked)] if asked == also else [(0, asked), (1, also)]
    parts = []
    for place, words in places:
        groups = []
        for answer, told in (("yes", "good enough"), ("no", "not good enough")):
            names = [one.evaluation.system for one in lines if one.verdicts[place] == answer]
            every = len(names) == len(lines) > 1
            groups += [f"{told}: {'all' if every else ', '.join(names)}"] if names else []
        unknown = [o.evaluation.system for o in lines if o.verdicts[place] == NOT_SHOWN]
        groups += [f"not shown either way: {', '.join(unknown)}"] if unknown else []
        parts.append(f"For {words}, {'; '.join(groups)}.")
    return f"{' '.join(parts)} (As the systems came, nothing corrected.)"


def first_section(
    lines: Sequence[Line],
    next_thing: str,
    walls: "Walls",
    marks: "Landmarks",
    *,
    faulty: bool = False,
) -> Section:
    """The first page: sentences, the row of each system, and one picture."""
    maps = [one.evaluation for one in lines if len(_lengths(one.evaluation)) >= 2][:MOST_MAPS]
    blocks: list[Table | Figure | Text] = [
        *three_sentences(lines, next_thing, faulty=faulty),
        *first_table(lines),
    ]
    if maps:
        blocks.append(
            Figure(
                "first_map",
                "Errors on the map of the room, all enlarged by the same factor: from each "
                "validation pose (dot) towards the GT pose.",
                f"Maps with an arrow for each pose of {', '.join(one.system for one in maps)}. "
                "The numbers are in the tables of their poses.",
                partial(_draw_maps, maps, walls, marks),
            )
        )
    return Section("In short", blocks)


def _draw_maps(
    evaluations: Sequence[Evaluation], walls: "Walls", marks: "Landmarks"
) -> "MatplotlibFigure":
    from validation.figures.summary import maps  # noqa: PLC0415  (half a second that text does without)

    return maps(evaluations, walls, marks)


def first_table(lines: Sequence[Line]) -> list[Table]:
    """Both tables for a paper."""
    return [errors_table(lines), verdicts_table(lines)]


def errors_table(lines: Sequence[Line]) -> Table:
    """n, rms and mean with its interval, a system a row."""
    components = lines[0].evaluation.comparison.components
    first = lines[0].evaluation.statistics[0]
    rows: list[list[str | int | float | None]] = []
    for line in lines:
        statistics = line.evaluation.statistics
        angle = next((one.rms for one in statistics if one.component.kind == "angle"), np.nan)
        own = {one.component.name: one for one in statistics}
        row: list[str | int | float | None] = [
            line.evaluation.system,
            len(line.evaluation.comparison),
        ]
        row += [MILLI * line.rms, MILLI * angle]
        for component in components:
            one = own.get(component.name)
            row.append(None if one is None else mean_text(one.mean, one.ci_low, one.ci_high))
        rows.append(row)
    dependent = [
        line.evaluation.system
        for line in lines
        if any(one.method == "dependent" for one in line.evaluation.statistics)
    ]
    placed = placed_words(lines)
    wider = f"; wider where neighbours depend on each other ({', '.join(dependent)})"
    unit = first.component.unit
    return Table(
        "Errors of the systems",
        [
            *("system", "n", f"rms position [m{unit}]", "rms heading [mrad]"),
            *(f"mean {one.name} [m{one.unit}]" for one in components),
        ],
        rows,
        ["", "d", ".1f", ".1f", *[""] * len(components)],
        f"Validation minus GT. Mean ± half of its {100 * first.confidence:.3g} % interval: "
        f"Student's t, for independent, nearly Gaussian errors{wider if dependent else ''}."
        f"{placed}",
    )


def placed_words(lines: Sequence[Line]) -> str:
    """Which means are zero by construction; empty if none is."""
    said = [
        f"{line.evaluation.system} ({', '.join(line.evaluation.comparison.constructed_means)})"
        for line in lines
        if line.evaluation.comparison.constructed_means
    ]
    if not said:
        return ""
    return f" Zero by construction, as the survey placed the frame: means of {', '.join(said)}."


def mean_text(mean: float, low: float, high: float) -> str:
    """'+80 ± 57': as many digits as the interval lets one know; nothing where it is withheld."""
    if np.isnan(mean):
        return "–"
    half = MILLI * (high - low) / 2
    if np.isnan(half):
        return f"{signed(MILLI * mean, 1)} ± withheld"
    digits = digits_of(half)
    return f"{signed(MILLI * mean, digits)} ± {half:.{digits}f}"


def digits_of(half: float) -> int:
    """Decimals that leave two digits of half an interval (GUM, 7.2.6), three at most.

    Parameters
    ----------
    half : float
        Half of the interval, not negative.
    """
    if half <= 0:
        return MOST_DIGITS
    place = int(np.floor(np.log10(float(f"{half:.1e}"))))
    return min(max(1 - place, 0), MOST_DIGITS)


def signed(value: float, digits: int) -> str:
    """The number with its sign; zero has none."""
    text = f"{value:+.{digits}f}"
    return text if float(text) else text[1:]


def verdicts_table(lines: Sequence[Line]) -> Table:
    """Bound on the bias, verdict, cause, and what is left, a system a row."""
    first, asked = lines[0].evaluation.statistics[0], _asked(lines)
    also = f"{MILLI * ALSO_ASKED:g} mm"
    twice = asked != also
    rows: list[list[str | int | float | None]] = []
    for line in lines:
        bounds = [
            one.bias.smallest_limit
            for one in line.evaluation.statistics
            if one.component.kind == first.component.kind
        ]
        left: list[float | None] = [MILLI * size for size in line.left] or [None, None]
        worst = MILLI * float(np.max(bounds))  # NaN where one is withheld
        answers = line.verdicts if twice else line.verdicts[:1]
        rows.append([line.evaluation.system, worst, *answers, line.cause, *left])
    return Table(
        "Good enough, explained by, and what is left",
        [
            *("system", f"bias below [m{first.component.unit}]", f"good for {asked}?"),
            *([f"good for {also}?"] if twice else []),
            *("explained by", "left [mm]", "left [mrad]"),
        ],
        rows,
        ["", ".1f", "", *([""] if twice else []), "", ".1f", ".1f"],
        f"Bias below: in its worst direction, with {100 * first.confidence:.3g} % confidence (two "
        "one-sided tests, same assumptions). Good: bias and standard deviation are both shown to "
        f"be below d{' (headings too, for the first)' if twice else ''}; no: one is shown to be "
        "above. Left: rms of positions and of headings after what explains the errors is taken "
        "out, poses that do not fit left out.",
    )
