"""What a person should know about a survey, in sentences."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from survey.campaign.cause_words import folded
from survey.campaign.outcome import SurveyOutcome
from survey.estimation.labelling import Labelling, LabellingVerdict
from survey.estimation.reliability import BlunderSuspicion
from survey.estimation.solve import SurveySolution
from survey.published.check import worst
from survey.readings.hardware import assumed_sigmas
from survey.readings.readings import Readings
from validation.results import Finding, Size
from validation.statistics.consistency import unit_weight_interval
from validation.statistics.units import unit_of_points

SUSPECT_FRAME = 0.05
"""Chance that a frame of the stated quality is called off its shape by any of its tests. A
judgement: in one campaign of twenty the poles are measured again for nothing."""
RETURNED = 1e-3
"""Metres from the solution within which a filter has found it: a millimetre is the last digit that
is read; both filters end within 0.03 mm of one another."""
WEAK_REDUNDANCY = 0.1
"""Readings that the others check by less than this are listed: the smallest blunder found in them,
4.13 / sqrt(0.1) = 13 sigma, is 3 cm with the 2.2 mm of a usual reading."""


def survey_findings(outcome: SurveyOutcome) -> list[Finding]:
    """All findings: common causes first, then in the order of the work."""
    return [_sentence(one) for one in folded(outcome, single_findings(outcome))[0]]


def single_findings(outcome: SurveyOutcome) -> list[Finding]:
    """All findings about single readings, points and stops, whatever their common cause."""
    if outcome.solution is None:
        return [_sentence(_only_published(outcome))]
    solution = outcome.solution
    found = [
        *_units(outcome, solution),
        *_labelling(solution.labelling),
        *_frame(solution),
        *_world_points(solution),
        *_published(outcome),
        *_from_origin(outcome),
        *_poses(outcome, solution),
        *_left_out(solution),
        *_unit_weight(solution),
        *_blunders(solution),
        *_set_aside(outcome),
        *_assumed(outcome),
    ]
    return [_sentence(finding) for finding in found]


def _chance(p: float) -> str:
    """A p-value in words; numbers without meaning are not shown."""
    return "p < 1e-9" if p < 1e-9 else f"p = {p:.1g}"


def _sentence(finding: Finding) -> Finding:
    """The finding with a capital letter and a full stop."""
    text = finding.text[:1].upper() + finding.text[1:]
    return replace(finding, text=text if text.endswith(".") else text + ".")


def _only_published(outcome: SurveyOutcome) -> Finding:
    count = 0 if outcome.poses is None else len(outcome.poses)
    return Finding(
        "note",
        f"the {count} validation poses are taken over as published: there are no readings to "
        "check them with",
        "survey",
        "published-poses",
    )


def _labelling(verdict: LabellingVerdict) -> Iterator[Finding]:
    if verdict.status == "unconfirmed":
        mirror = verdict.open_mirrors[0]
        yield Finding(
            "error",
            "the Vframe points are symmetric: with "
            f"{_exchange(mirror)} the readings fit equally well (chi-squared {mirror.cost:.1f} "
            f"and {verdict.given.cost:.1f}) and every point would be a mirror image of where it is "
            "now, metres off. Nothing in the campaign tells the two apart. Measure the rough x "
            "and y of one or two world points with a tape (survey/hand_points.csv), or read "
            "the distances of one robot frame",
            "vframe",
            "mirror",
        )
    elif verdict.status == "confirmed":
        mirrors = [other for other in verdict.others if other.kind == "mirrored"]
        shown = _exchange(mirrors[0]) if mirrors else str(verdict.others[0])
        yield Finding(
            "good",
            f"the Vframe points are symmetric: {shown} would fit the readings to them equally "
            f"well; the labels as used are confirmed by {' and '.join(verdict.decided_by)}",
            "vframe",
            "mirror",
        )


def _units(outcome: SurveyOutcome, solution: SurveySolution) -> Iterator[Finding]:
    evidence, settings = outcome.inputs.evidence, outcome.inputs.settings
    for file, rough, found in (
        (settings.hand_points, evidence.hand, {p.name: p.position for p in solution.world.points}),
        (settings.initial_guesses, evidence.guesses, {f.pose: f.state for f in solution.frames}),
    ):
        both = [name for name in rough if name in found]
        unit = unit_of_points([rough[n][:2] for n in both], [found[n][:2] for n in both])
        if unit:
            text = f"write metres in {file}: its coordinates are in {unit}, by the readings"
            yield Finding("warning", text, "survey", "unit")


def _exchange(labelling: Labelling) -> str:
    """The exchanged labels in words."""
    pairs = {frozenset((a, b)) for a, b in labelling.meaning.items()}
    if all(len(pair) == 2 for pair in pairs) and len(pairs) * 2 == len(labelling.meaning):
        said = ", ".join(" and ".join(sorted(pair)) for pair in sorted(pairs, key=sorted))
        return f"the labels {said} exchanged"
    return "the labels read as " + ", ".join(f"{a} = {b}" for a, b in labelling.meaning.items())


def _frame(solution: SurveySolution) -> Iterator[Finding]:
    checks = solution.vframe.tests
    limit = SUSPECT_FRAME / max(len(checks), 1)
    off = [check for check in checks if check.p_value < limit]
    for check in off:
        scale, unit = (1e3, "mm") if check.unit == "m" else (1e3, "mrad")
        yield Finding(
            "warning",
            f"{check.name}: measured {check.measured:.5f} {check.unit}, expected "
            f"{check.expected:.5f}: {scale * (check.measured - check.expected):+.1f} {unit}, p = "
            f"{check.p_value:.2g} under the stated sigmas. Measure it again, or mark the points "
            "anew",
            "vframe",
            "frame-shape",
            (
                Size(
                    f"{check.name}: measured less expected",
                    check.measured - check.expected,
                    check.unit,
                ),
            ),
        )
    if checks and not off:
        yield Finding(
            "good",
            f"the Vframe has its nominal shape within the stated sigmas ({len(checks)} "
            f"test{'s' if len(checks) > 1 else ''}, smallest p = "
            f"{min(check.p_value for check in checks):.2f})",
            "vframe",
            "frame-shape",
            tuple(Size(c.name, c.measured - c.expected, c.unit) for c in checks),
        )


def _world_points(solution: SurveySolution) -> Iterator[Finding]:
    late = [lost.name for lost in solution.world.missing if lost.name in solution.from_marks]
    if late:
        yield Finding(
            "note",
            f"{len(late)} world point(s) are not located from the Vframe alone: {', '.join(late)}. "
            "Their places in the joint adjustment come from the robot's marks as well",
            "world points",
            "world-point-from-marks",
            (Size("world points", len(late), "points"),),
        )
    for lost in solution.world.missing:
        if lost.name in solution.from_marks:
            continue
        places = " or ".join(f"({x:.3f}, {y:.3f})" for x, y in lost.candidates)
        yield Finding(
            "error" if "contradict" in lost.reason else "warning",
            f"no position: {lost.reason}" + (f"; it is at {places}" if places else ""),
            f"world point {lost.name}",
            "world-point-open",
        )
    for point in solution.world.points:
        p = float(chdtrc(point.redundancy, point.cost)) if point.redundancy else 1.0
        if p < 1e-3:  # a judgement: of 20 points one is told in fifty good surveys
            yield Finding(
                "warning",
                f"the {point.redundancy + 2} readings of world point {point.name} do not meet in "
                f"one place within the stated sigmas (chi-squared {point.cost:.1f}, {_chance(p)})",
                f"world point {point.name}",
                "world-point-misfit",
                (Size("chi-squared per degree of freedom", point.cost / point.redundancy),),
            )


def _published(outcome: SurveyOutcome) -> Iterator[Finding]:
    comparison = outcome.published
    if comparison is None:
        return
    where = {name: i for i, name in enumerate(comparison.names)}
    for name in worst(comparison):
        dx, dy = 1e3 * comparison.difference[where[name]]
        remedy = comparison.remedies[name]
        yield Finding(
            "warning",
            "the published coordinates do not follow from the readings; they "
            f"are off by {dx:+.1f} mm in x and {dy:+.1f} mm in y. No change of a single reading by "
            f"up to 5 cm brings them together: the best, {1e3 * remedy.change:+.0f} mm on the "
            f"distance to {remedy.label}, leaves {1e3 * remedy.remains:.1f} mm"
            if remedy.remains > 1e-3  # a judgement: a millimetre is the last digit printed
            else f"the published coordinates are off by {dx:+.1f} mm in x and "
            f"{dy:+.1f} mm in y; a change of {1e3 * remedy.change:+.0f} mm in the distance to "
            f"{remedy.label} would explain it",
            f"world point {name}",
            "published-inconsistent",
            (Size("off in x", dx / 1e3, "m"), Size("off in y", dy / 1e3, "m")),
        )
    fine = [i for i, bad in enumerate(comparison.inconsistent) if not bad]
    if fine:
        most = 1e3 * float(np.abs(comparison.difference[fine]).max())
        yield Finding(
            "good",
            f"{len(fine)} of {len(comparison.names)} published world points follow from the "
            f"readings within {most:.2f} mm in each coordinate",
            "world points",
            "published-consistent",
            (Size("largest difference in a coordinate", most / 1e3, "m"),),
        )


def _from_origin(outcome: SurveyOutcome) -> Iterator[Finding]:
    """Where the document's first filter ends from the Vframe's origin, beside this program's."""
    literal = outcome.as_published
    if literal is None:
        return
    lost = {name: off for name, off in literal.lost_from_origin.items() if off > RETURNED}
    total, own = len(literal.lost_from_origin), literal.own_from_origin
    worst = "".join(f"; world point {name} ends {off:.2g} m away" for name, off in lost.items())
    yield Finding(
        "note",
        f"started at the Vframe's origin, the document's first filter finds {total - len(lost)} of "
        f"{total} world points{worst}. This program's filter finds "
        f"{sum(off <= RETURNED for off in own.values())} of {total} from there",
        "world points",
        "from_origin",
        (Size("world points not found", len(lost), "points"),),
    )


def _poses(outcome: SurveyOutcome, solution: SurveySolution) -> Iterator[Finding]:
    for pose in solution.not_posed:
        places = " or ".join(f"({x:.3f}, {y:.3f}, {t:.3f})" for x, y, t in pose.candidates[:4])
        yield Finding(
            "error" if "contradict" in pose.reason else "warning",
            f"not determined: {pose.reason}" + (f"; it may be {places}" if places else ""),
            f"pose {pose.pose}",
            "pose-open",
        )
    if not solution.poses and outcome.inputs.published_poses is not None:
        yield Finding(
            "note",
            "there are no readings of robot frames: the validation poses are taken over as "
            "published and cannot be checked here",
            "survey",
            "published-poses",
        )
    for frame in solution.frames:
        p = float(chdtrc(frame.redundancy, frame.cost)) if frame.redundancy else 1.0
        if p < 1e-4:  # a judgement: of 20 stops one is told in five hundred good surveys
            yield Finding(
                "warning",
                f"the readings of pose {frame.pose} do not agree with one place of the robot frame "
                f"within the stated sigmas (chi-squared {frame.cost:.0f} with {frame.redundancy} "
                f"degrees of freedom, {_chance(p)})",
                f"pose {frame.pose}",
                "pose-misfit",
                (Size("chi-squared per degree of freedom", frame.cost / frame.redundancy),),
            )


def _named(readings: Readings, most: int = 8) -> str:
    """The first few readings by their points, and how many more there are."""
    pairs = list(zip(readings.start, readings.end, strict=True))
    more = f" and {len(pairs) - most} more" if len(pairs) > most else ""
    return ", ".join(f"{a}–{b}" for a, b in pairs[:most]) + more


def _left_out(solution: SurveySolution) -> Iterator[Finding]:
    if len(solution.left_out):
        yield Finding(
            "note",
            f"{len(solution.left_out)} reading(s) are not used, because one of their points has "
            f"no position: {_named(solution.left_out)}",
            "survey",
            "readings-left-out",
            (Size("readings not used", len(solution.left_out), "readings"),),
        )


def _unit_weight(solution: SurveySolution) -> Iterator[Finding]:
    adjustment = solution.adjustment
    dof = adjustment.degrees_of_freedom
    if dof < 1:
        yield Finding(
            "warning",
            "the joint adjustment has no redundancy: nothing checks the readings, and no blunder "
            "can be found",
            "survey",
            "m0",
        )
        return
    m0 = adjustment.m0
    low, high = np.sqrt(unit_weight_interval(dof))
    # The interval of the true factor: m0 over the quantiles between which m0 falls if it is 1.
    sizes = (Size("m0", m0, "", m0 / float(high), m0 / float(low), 0.95),)
    said = f"m0 = {m0:.3f} with {dof} degrees of freedom (95 %: {low:.3f} to {high:.3f})"
    fitting = fitted_reading_sigma(solution)
    n = len(adjustment.network.sigma)
    stated = float(np.sqrt(np.mean(np.square(adjustment.network.sigma))))
    k = len(solution.suspicions)
    if m0 > high:
        without = ""
        if 0 < k < dof:
            rest = adjustment.chi_squared - sum(float(s.w[0] ** 2) for s in solution.suspicions)
            without = "; if the suspected readings are left out, m0 is "
            without += f"{np.sqrt(max(rest, 0.0) / (dof - k)):.3f}"
        yield Finding(
            "warning",
            f"the readings scatter more than stated: {said}{without}. Standard deviation of a "
            f"reading from the residuals {1e3 * fitting:.1f} mm, stated {1e3 * stated:.1f} mm. "
            "Measure the suspected blunders again first. If there are none, state the larger "
            "value: all covariances are too small now",
            "survey",
            "m0",
            sizes,
        )
    elif m0 < low:
        yield Finding(
            "note",
            f"the readings scatter less than stated: {said}. Standard deviation of a reading from "
            f"the residuals {1e3 * fitting:.1f} mm, stated {1e3 * stated:.1f} mm; the covariances "
            "are larger than they need to be",
            "survey",
            "m0",
            sizes,
        )
    else:
        yield Finding("good", f"the {n} readings scatter as stated: {said}", "survey", "m0", sizes)


def fitted_reading_sigma(solution: SurveySolution) -> float:
    """Standard deviation of a reading as the residuals show it, in metres.

    Notes
    -----
    sqrt(sum v^2 / sum r) over the distances: their residuals v and redundancy numbers r.
    """
    adjustment = solution.adjustment
    n = len(adjustment.network.sigma)
    metres = adjustment.residual[:n] * adjustment.network.sigma
    return float(np.sqrt((metres @ metres) / max(adjustment.redundancy[:n].sum(), 1e-12)))


def _blunders(solution: SurveySolution) -> Iterator[Finding]:
    for suspicion in solution.suspicions:
        yield Finding(
            "error",
            _suspicion_text(solution.used, suspicion),
            solution.used.start[suspicion.candidates[0]],
            "blunder",
            tuple(
                Size(f"{solution.used.start[i]}-{solution.used.end[i]} off by", float(size), "m")
                for i, size in zip(suspicion.candidates, suspicion.size, strict=True)
            ),
        )
    reading_redundancy = solution.adjustment.redundancy[: len(solution.used)]
    weak = np.flatnonzero(reading_redundancy < WEAK_REDUNDANCY)
    if len(weak):
        shown = _named(solution.used.select(weak))
        yield Finding(
            "note",
            f"{len(weak)} reading(s) are checked little by others (redundancy below "
            f"{WEAK_REDUNDANCY:g}), so a blunder in them may not be found: {shown}",
            "survey",
            "unchecked",
            (Size("readings checked little", len(weak), "readings"),),
        )


def _suspicion_text(used: Readings, suspicion: BlunderSuspicion) -> str:
    """One suspected blunder with all its candidates."""

    def named(k: int) -> str:
        i = int(suspicion.candidates[k])
        line = f" (line {used.line[i]})" if used.line[i] else ""
        return (
            f"{used.start[i]}–{used.end[i]}{line}: {used.distance[i]:.3f} m, off by "
            f"{1e3 * suspicion.size[k]:+.0f} mm, |w| = {abs(suspicion.w[k]):.1f}"
        )

    first = named(0)
    if len(suspicion.candidates) == 1:
        return f"probable blunder in {first}. Measure it again"
    others = "; ".join(named(k) for k in range(1, len(suspicion.candidates)))
    return (
        f"probable blunder in one of {len(suspicion.candidates)} readings that cannot be told "
        f"apart: {first}; {others}. Measure all of them again"
    )


def _set_aside(outcome: SurveyOutcome) -> Iterator[Finding]:
    lines = () if outcome.inputs.file is None else outcome.inputs.file.said_before
    if lines:
        shown = ", ".join(map(str, lines[:6])) + (", …" if len(lines) > 6 else "")
        text = (
            f"{len(lines)} row(s) of the readings say the same as an earlier one, time and value "
            f"(line {shown}): they were used as repeats. Delete them if they were pasted twice"
        )
        size = Size("rows that repeat an earlier one", len(lines), "readings")
        yield Finding("note", text, "survey", "readings-repeated", (size,))
    if outcome.inputs.file is None or not len(outcome.inputs.file.set_aside):
        return
    aside = outcome.inputs.file.set_aside
    said = "; ".join(
        f"{a}–{b} (line {line}{': ' + note if note else ''})"
        for a, b, line, note in zip(
            aside.start, aside.end, aside.line, outcome.inputs.file.notes, strict=True
        )
    )
    yield Finding(
        "note", f"{len(aside)} reading(s) set aside by hand: {said}", "survey", "set-aside"
    )


def _assumed(outcome: SurveyOutcome) -> Iterator[Finding]:
    file = outcome.inputs.file
    assumed = assumed_sigmas(outcome.campaign, rig=file is not None and bool(file.used.poses))
    if assumed:
        named = ", ".join(f"{key} = {value:g} m" for key, value in assumed.items())
        yield Finding(
            "note",
            "standard deviations that campaign.toml does not state were assumed, and all "
            f"covariances rest on them: {named}. State your own",
            "survey",
            "assumed_sigmas",
        )
