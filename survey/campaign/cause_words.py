"""One cause in one line: what it is, how large, how sure, what it spoils, how to confirm it."""

from collections.abc import Iterator, Sequence

import numpy as np

from survey.campaign.hypothesis_words import MM, named, said, short
from survey.campaign.outcome import SurveyOutcome
from survey.causes.diagnosis import Diagnosis, blunders
from survey.causes.lead import Lead
from survey.causes.search import SINGLE, Causes
from survey.readings.readings import Readings
from validation.poses.angles import Array, wrap
from validation.results import Finding, Size
from validation.statistics.hypotheses import Parameter, Tried

SPOILT = 1.0
"""Shift of a pose, in its standard deviations, from which it is called spoilt: more than chance
moves it."""
FOLDED = frozenset(
    {"frame-shape", "world-point-misfit", "pose-misfit", "blunder", "m0"}
    | {"pose-open", "world-point-open", "readings-left-out"}
)
"""Findings about single readings, points and stops, which a common cause explains."""


def folded(
    outcome: SurveyOutcome, findings: Sequence[Finding]
) -> tuple[list[Finding], list[Finding]]:
    """Findings with the common causes in front, and those that follow from them, taken out."""
    diagnosis = outcome.diagnosis
    if diagnosis is None or not diagnosis.found:
        return list(findings), []
    others = [
        one for one in findings if one.code in FOLDED and one.severity in {"warning", "error"}
    ]
    others += [one for one in findings if one.code == "readings-left-out"]
    kept = [one for one in findings if one not in others]
    lines = [_line(outcome, diagnosis, k, len(others)) for k in range(len(diagnosis.found))]
    return [*lines, *_single(outcome, diagnosis), *kept], others


def _line(outcome: SurveyOutcome, diagnosis: Diagnosis, k: int, others: int) -> Finding:
    causes = diagnosis.found[k]
    best, used = causes.ranking.best, _used(outcome, causes)
    text = f"{'besides, ' if k else ''}{_as_likely(causes, used)}. "
    rivals = _others(causes, causes.ranking.rivals())[len(ties(causes)) :]
    if rivals:
        text += "These readings cannot tell it from another cause: "
        text += "; or ".join(
            f"{said(one, used)} (odds {_odds(causes.ranking.odds(one))})" for one in rivals[:2]
        )
        text += ". "
    text += (
        f"{_against(causes, used)}. m0 would be {best.m0:.2f} instead of {causes.plain.m0:.2f}. "
    )
    if k == 0:
        text += _spoils(outcome, diagnosis)
        if others:
            text += f"{others} other findings follow from it (others, under causes in the JSON). "
    text += f"To confirm it: {_confirm(best.what)}"
    sizes = tuple(_size_of(one, one.name) for one in best.parameters)
    return Finding("error", text, _subject(best.what), "cause", sizes)


def _size_of(one: Parameter, of: str) -> Size:
    """A parameter as the size of a finding."""
    return Size(of, one.value, one.unit, one.low, one.high, 0.95)


def _others(causes: Causes, some: Sequence[Tried[Lead]]) -> list[Tried[Lead]]:
    """Those of some hypotheses that are another common cause than the best."""
    best = causes.ranking.best.what
    return [one for one in some if one.what.kind not in SINGLE and not _alike(one.what, best)]


def ties(causes: Causes) -> list[Tried[Lead]]:
    """Other common causes that are as likely as the best, as far as the readings tell."""
    return _others(causes, causes.ranking.ties())


def _as_likely(causes: Causes, used: Readings) -> str:
    """The best hypothesis, and those that are as likely, as one statement."""
    equal = ties(causes)
    text = "; or ".join(said(one, used) for one in (causes.ranking.best, *equal[:MOST_TIES]))
    return f"{text} (as likely: the readings cannot tell which)" if equal else text


MOST_TIES = 2
"""Causes as likely as the best that its line names; all are in the JSON."""


def cause_of_failure(diagnosis: Diagnosis, readings: Readings) -> str | None:
    """The cause for which a survey cannot be solved, in one sentence; None if there is none."""
    if not diagnosis.found:
        return None
    causes = diagnosis.found[0]
    best = causes.ranking.best
    used = readings.select(causes.rows)
    text = _as_likely(causes, used)
    return (
        f"the survey cannot be solved, and one cause explains it: {text}. "
        f"{_against(causes, used)}. m0 would be {best.m0:.2f}. To confirm it: {_confirm(best.what)}"
    )


def _subject(lead: Lead) -> str:
    if lead.extent == "station" or lead.kind in {"rig_mark", "stop_number"}:
        return f"pose {lead.subject[0]}"
    if lead.kind == "moved" or (lead.kind, lead.extent) == ("height", "point"):
        return f"world point {lead.subject[0]}"
    return "vframe" if lead.kind == "vframe_point" else "survey"


def _used(outcome: SurveyOutcome, causes: Causes) -> Readings:
    file = outcome.inputs.file
    return file.used.select(causes.rows)  # type: ignore[union-attr]


def _odds(value: float) -> str:
    return "more than 1e9 to 1" if value > 1e9 else f"{value:.2g} to 1"


def _against(causes: Causes, used: Readings) -> str:
    """Odds against independent blunders, against none, and against the next cause."""
    ranking = causes.ranking
    told = []
    alone = blunders(ranking)
    if alone is not None:
        count = alone.what.subject[0]
        told.append(f"{_odds(ranking.odds(alone))} against {count} independent blunders")
    close = [ranking.best, *ranking.rivals()]
    following = [
        one
        for one in ranking.tried
        if one.what.kind not in SINGLE and not any(_alike(one.what, other.what) for other in close)
    ]
    if following:
        name = short(following[0].what, used)
        told.append(f"{_odds(ranking.odds(following[0]))} against the next ({name})")
    none = next(one for one in ranking.tried if one.what.kind == "none")
    if alone is None:
        told.append(f"{_odds(ranking.odds(none))} against nothing wrong")
    return "Odds " + ", ".join(told)


def _alike(a: Lead, b: Lead) -> bool:
    """Whether two hypotheses are one but for a few readings."""
    shared = len(np.intersect1d(a.rows, b.rows))
    most = max(len(a.rows), len(b.rows))
    return a is b or (a.kind == b.kind and most > 0 and shared > ALIKE * most)


ALIKE = 0.8
"""Share of the readings that two hypotheses of a kind have in common from which on they are one: a
block that begins some readings later is no other cause."""


def _confirm(lead: Lead) -> str:
    """What to do in the room."""
    name = lead.subject[0] if lead.subject else ""
    if lead.kind == "offset":
        return (
            "look which edge the instrument measures from, and read one of these pairs and a pole "
            "of known length again"
        )
    return {
        "scale": "read a known length of some metres again with the same instrument or tape, and "
        "look at its unit",
        "height": "measure the heights of the spot and of the instrument above the floor",
        "moved": f"look whether the mark of {name} was replaced, and read {name} from two Vframe "
        "points again",
        "vframe_point": f"measure the sides of the Vframe that end at {name} with poles or a tape, "
        "and mark it anew or state its coordinates",
        "rig_mark": f"lay the rig on the marks of stop {name} again: they must fit",
        "rig_point": "measure the sides of the rig",
        "exchanged_targets": "read one of the two targets from there again, or correct the names "
        "in the file",
        "exchanged_rig_points": f"look at the letters on the floor at stop {name}, or read one of "
        "them again, and correct the names in the file",
        "stop_number": "look at the number on the floor, and correct it in the file",
        "exchanged_rows": "read one of the pairs again, or look at the form, and correct the file",
    }.get(lead.kind, "read these pairs again")


def pose_shifts(outcome: SurveyOutcome, diagnosis: Diagnosis) -> dict[str, Array]:
    """What the causes do to each pose (3,): as solved less as it would be, metres and radians."""
    table = outcome.solution.pose_table() if outcome.solution else None
    fit = diagnosis.fit
    there = dict(zip(fit.trial.network.poses, fit.at.poses, strict=True))
    if table is None:
        return {}
    shifts = {}
    for name, pose in zip(table.ids, table.poses, strict=True):
        if name in there:
            off = pose - there[name]
            shifts[name] = np.array([off[0], off[1], float(wrap(off[2]))])
    return shifts


def spoilt_poses(outcome: SurveyOutcome, diagnosis: Diagnosis) -> dict[str, Array]:
    """Those that are moved by more than `SPOILT` of their standard deviations."""
    table = outcome.solution.pose_table() if outcome.solution else None
    if table is None:
        return {}
    sigma = dict(
        zip(table.ids, np.sqrt(np.diagonal(table.covariances, axis1=1, axis2=2)), strict=True)
    )
    shifts = pose_shifts(outcome, diagnosis)
    return {k: v for k, v in shifts.items() if (np.abs(v) > SPOILT * sigma[k]).any()}


def _spoils(outcome: SurveyOutcome, diagnosis: Diagnosis) -> str:
    """Which poses are wrong, and by how much."""
    shifts = spoilt_poses(outcome, diagnosis)
    table = outcome.poses
    there = () if table is None else table.ids
    lost = [name for name in diagnosis.fit.trial.network.poses if name not in there]
    text = ""
    if shifts:
        size = [MM * float(np.hypot(*v[:2])) for v in shifts.values()]
        turn = [MM * abs(float(v[2])) for v in shifts.values()]
        names = list(shifts)
        shown = ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
        by = f"{min(size):.1f} to {max(size):.1f} mm" if len(size) > 1 else f"{size[0]:.1f} mm"
        text = f"It spoils the poses {shown} by {by} and up to {max(turn):.1f} mrad. "
    if lost:
        text += f"Because of it there is no pose of {', '.join(lost)}. "
    return text or "No pose is off by more than its standard deviation. "


def _single(outcome: SurveyOutcome, diagnosis: Diagnosis) -> Iterator[Finding]:
    """Blunders that remain beside the common causes, one line each."""
    best, used = diagnosis.rest.ranking.best, _used(outcome, diagnosis.rest)
    if best.what.kind != "blunders":
        return
    for row, size in zip(best.what.rows, best.parameters, strict=True):
        text = f"besides, probable blunder in {named(used, int(row))}: {used.distance[row]:.3f} m, "
        text += f"off by {MM * size.value:+.0f} mm. Measure it again"
        off = _size_of(size, "off by")
        yield Finding("error", text, used.start[row], "blunder", (off,))


def cause_facts(outcome: SurveyOutcome, others: Sequence[Finding]) -> dict[str, object] | None:
    """The hypotheses for scripts: the first is the best."""
    diagnosis = outcome.diagnosis
    if diagnosis is None:
        return None
    first = (*diagnosis.found, diagnosis.rest)[0]
    used = _used(outcome, first)
    return {
        "found": [
            _as_facts(c, c.ranking.best, _used(outcome, c))
            | {"ties": _tie_facts(c, _used(outcome, c))}
            for c in diagnosis.found
        ],
        "hypotheses": [_as_facts(first, one, used) for one in first.ranking.tried],
        "m0": diagnosis.plain.m0,
        "m0_without": diagnosis.fit.m0,
        "poses_spoilt": {
            name: [float(v) for v in shift]
            for name, shift in spoilt_poses(outcome, diagnosis).items()
        }
        if diagnosis.found
        else {},
        "others": [f"{one.subject}: {one.text}" for one in others],
    }


def _tie_facts(causes: Causes, used: Readings) -> list[dict[str, object]]:
    """Causes as likely as the best, and those that are the same readings in other words."""
    equal = ties(causes)
    same = [other for one in (causes.ranking.best, *equal) for other in one.what.equal]
    return [_as_facts(causes, one, used) for one in equal] + [
        {
            "kind": lead.kind,
            "extent": lead.extent,
            "subject": list(lead.subject),
            "lines": _lines([used.line[row] for row in lead.rows]),
            "odds_against": 1.0,
            "text": short(lead, used),
        }
        for lead in same
    ]


MOST_LINES = 300
"""Lines that are listed each for itself; of more, from which to which they go."""


def _lines(lines: list[int]) -> list[int] | str:
    """Lines of readings: '12-24112, 30000' where they are many."""
    if len(lines) <= MOST_LINES:
        return lines
    line = np.unique(lines)
    ends = np.flatnonzero(np.diff(line) > 1)
    runs = zip(line[[0, *(ends + 1)]].tolist(), line[[*ends, -1]].tolist(), strict=True)
    return ", ".join(f"{a}-{b}" if a < b else str(a) for a, b in runs)


def _as_facts(causes: Causes, one: Tried[Lead], used: Readings) -> dict[str, object]:
    lead = one.what
    return {
        "kind": lead.kind,
        "extent": lead.extent,
        "subject": list(lead.subject),
        "same_readings": list(lead.also),
        "tie": any(one is other for other in (causes.ranking.best, *ties(causes))),
        "lines": _lines([used.line[row] for row in lead.rows]) if lead.extent != "all" else "all",
        "sizes": [
            {"name": p.name, "unit": p.unit, "value": p.value, "low": p.low, "high": p.high}
            for p in one.parameters
        ],
        "chi_squared": one.chi_squared,
        "m0": one.m0,
        "criterion": one.criterion,
        "odds_against": causes.ranking.odds(one),
        "text": said(one, used),
    }
