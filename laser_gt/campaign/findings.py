"""What a person should read about a laser GT."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from laser_gt.campaign.inputs import ASSUMED_SIGMAS
from laser_gt.campaign.outcome import LaserOutcome
from laser_gt.logs.motion import MIRROR
from laser_gt.placing.guesses import scatter_from_stop_to_stop, wider_guesses
from laser_gt.placing.solution import LaserSolution
from laser_gt.placing.survey_check import doubt_sizes, doubt_text, shape_of, survey_doubt
from laser_gt.placing.switches import WRONG_SHARE
from validation.poses.angles import Array
from validation.results import Finding, Severity, Size

MISFIT = 1.5
"""Matches are called contradictory where they contradict each other by this factor more than
their covariances allow. A judgement: 20 stops with three matches each have some 120 degrees of
freedom, of which chance makes a factor of 1.07; a covariance that is off by a factor of two
does no harm to the poses."""

MOST_HANGING = 3
"""Matches that nothing checks that are told one by one: more have one cause, as a rule."""
MOST_NAMED = 8
"""Names of a list that a finding shows; the tables have all."""


def laser_findings(outcome: LaserOutcome) -> list[Finding]:
    """Findings in the order in which they should be read."""
    severity: Severity = "warning" if outcome.solutions else "error"
    found = [Finding(severity, text, "laser", "no_poses") for text in outcome.failures.values()]
    if outcome.slip is not None and outcome.solutions:
        size = (Size("share of pairs accepted with it put right", outcome.slip.share),)
        found.append(Finding("error", outcome.slip.text, "laser", "laser_slip", size))
    found += [Finding("note", text, "laser", "left_out") for text in outcome.inputs.left_out]
    found += [Finding("note", text, "laser", "assumed_mount") for text in outcome.inputs.assumed]
    found += _moving(outcome)
    for name, noise in outcome.noise.items():
        text = (
            f"the ranges of the scanner '{name}' scatter by {noise.independent * 1e3:.1f} mm from "
            f"beam to beam, and by {noise.shared * 1e3:.1f} mm that some {noise.length:.0f} "
            "neighbouring beams share, as neighbouring stops laid over each other show"
        )
        sizes = (
            Size("noise of single beams", noise.independent, "m"),
            Size("noise that neighbouring beams share", noise.shared, "m"),
        )
        found.append(Finding("note", text, "laser", "range_noise", sizes))
    if outcome.survey.assumed:
        text = (
            f"the surveyed poses of the stops {', '.join(outcome.survey.assumed)} have no "
            f"covariance. Standard deviations of {ASSUMED_SIGMAS[0] * 1e3:.0f} mm and "
            f"{ASSUMED_SIGMAS[2] * 1e3:.0f} mrad are assumed for them"
        )
        found.append(Finding("note", text, "laser", "assumed_sigmas"))
    for solution in outcome.solutions.values():
        found += _of_solution(solution)
    # One cause has one line: what was mixed up bends all that follows.
    doubts = [] if outcome.slip is not None else list(_survey_doubts(outcome))
    found += doubts
    mount = _mount(outcome)
    if mount.severity != "warning" or not (doubts or outcome.slip is not None):
        found.append(mount)
    found += _guesses(outcome)
    if outcome.trajectory.doubtful:
        stops = ", ".join(outcome.trajectory.doubtful)
        text = (
            f"there is no odometry, and the scans alone do not connect the stops {stops} with "
            "the ones before them. Pairs with them may be missing"
        )
        found.append(Finding("warning", text, "laser", "trajectory"))
    return found


def _survey_doubts(outcome: LaserOutcome) -> Iterator[Finding]:
    """What is wrong where surveyed poses and scans contradict each other."""
    solution = next(iter(outcome.solutions.values()), None)
    if solution is None:
        return
    where = {stop: row for row, stop in enumerate(solution.stops)}
    for part in range(int(solution.parts.max()) + 1):
        inside = np.array(solution.stops, dtype=object)[solution.parts == part].tolist()
        known = outcome.survey.select([s for s in outcome.survey.stops if s in inside])
        rows = np.array([where[stop] for stop in known.stops], dtype=np.intp)
        if len(rows) < 2:
            continue
        shape = shape_of(solution.graph, rows)
        doubt = survey_doubt(known.stops, shape, known.poses, known.covariance)
        if doubt is not None:
            doubt = replace(doubt, assumed=bool(known.assumed))
            text, sizes = doubt_text(doubt, "to the stops"), doubt_sizes(doubt)
            yield Finding(doubt.severity, text, "laser", "survey_contradicts", sizes)


def _of_solution(solution: LaserSolution) -> Iterator[Finding]:
    """Verdicts, stops without a pose, and how the laser frame was placed."""
    matching = solution.matching
    who = f"laser_{matching.engine}"
    count = matching.counts
    text = (
        f"of {len(matching.matches)} matches {count['accepted']} are accepted, "
        f"{count['imprecise']} are right but imprecise, {count['refuted']} are refuted, and "
        f"{count['may be wrong']} may be wrong (`gtval laser inspect`)"
    )
    doubt = (Size("matches that may be wrong", count["may be wrong"], "matches"),)
    yield Finding("note" if count["may be wrong"] else "good", text, who, "verdicts", doubt)
    yield from hanging_findings(solution, who)
    yield from _of_gaps(solution, who)
    if solution.parts.max() > 0:
        groups = "; ".join(
            ", ".join(np.array(solution.stops)[solution.parts == part].tolist())
            for part in np.unique(solution.parts)
        )
        text = (
            f"the stops are placed in {solution.parts.max() + 1} groups, each by its own surveyed "
            f"stops: {groups}. No match that can be used joins them"
        )
        size = (Size("groups", int(solution.parts.max()) + 1, "groups"),)
        yield Finding("note", text, who, "groups", size)
    if matching.loops:
        closed = len(matching.loops) - matching.open_loops
        text = f"{closed} of {len(matching.loops)} loops of three scans close"
        size = (Size("loops that do not close", matching.open_loops, "loops"),)
        yield Finding("warning" if matching.open_loops else "good", text, who, "loops", size)
    if solution.graph.scale > MISFIT:
        text = (
            f"the matches contradict each other {solution.graph.scale:.1f} times more "
            "than their covariances allow. The covariances of the poses are widened by that factor"
        )
        size = (Size("misfit over the stated one", float(solution.graph.scale)),)
        yield Finding("warning", text, who, "graph_misfit", size)
    if len(solution.anchors) > 1:
        text = (
            f"{len(solution.anchors)} surveyed stops placed the laser frame, so that a wrong frame "
            'cannot show. Name one stop ([laser] reference = ["6"]) to do as the document does'
        )
        size = (Size("surveyed stops", len(solution.anchors), "stops"),)
        yield Finding("note", text, who, "anchors", size)


def _moving(outcome: LaserOutcome) -> Iterator[Finding]:
    """Scans that were taken while the robot moved."""
    for one in outcome.inputs.moving:
        length, angle = one.speed * MIRROR * 1e3, one.turn * MIRROR * 1e3
        text = (
            f"at {len(one.stops)} of {len(outcome.inputs.stops)} stops the robot moved while "
            f"'{one.sensor}' took its scan (by the log's odometry up to {one.speed:.2f} m/s and "
            f"{one.turn:.2f} rad/s): in a turn of a mirror of {MIRROR * 1e3:.0f} ms beams go wrong "
            f"by up to {length:.0f} mm and {angle:.0f} mrad. Let it stand, or state when beams are "
            f"fired below [laser.scanners.{one.sensor}]: turn_time = {MIRROR:.5f} for a SICK LMS, "
            "and interlaced = 2 where its beams are half a degree apart"
        )
        sizes = (
            Size("stops at which the robot moved", len(one.stops), "stops"),
            Size("fastest motion", one.speed, "m/s"),
            Size("fastest turn", one.turn, "rad/s"),
        )
        yield Finding("warning", text, "laser", "moving_stops", sizes)


def hanging_findings(solution: LaserSolution, who: str) -> Iterator[Finding]:
    """Matches that may be wrong, and that stops are placed by all the same."""
    if len(solution.hanging) > MOST_HANGING:
        yield _many_hanging(solution, who)
        return
    for one, stops in solution.hanging:
        text = (
            f"the stops {_listed(stops)} are placed by the match {one.reference} - {one.moving} "
            f"alone. It may be wrong: {'; '.join(one.reasons)}. Their covariance counts in that "
            f"one of {1 / WRONG_SHARE:.0f} such matches is. Look at it (`gtval laser inspect`) and "
            "decide, or survey one of them"
        )
        size = (Size("stops placed by it", len(stops), "stops"),)
        yield Finding("warning", text, who, "hanging_stops", size)


def _many_hanging(solution: LaserSolution, who: str) -> Finding:
    """The same as one finding, those that most stops hang on first."""
    found = sorted(solution.hanging, key=lambda one: -len(one[1]))
    every = {stop for _, stops in found for stop in stops}
    told = [f"{one.reference} - {one.moving} ({len(stops)} stops)" for one, stops in found]
    text = (
        f"{len(every)} stops are placed by {len(found)} matches that may be wrong, and that "
        f"nothing else checks: {_listed(told)}. Their covariance counts in that one of "
        f"{1 / WRONG_SHARE:.0f} such matches is. Look at them (`gtval open`, or `gtval laser "
        "inspect`) and decide, or survey some of the stops"
    )
    sizes = (
        Size("stops placed by it", len(every), "stops"),
        Size("matches that nothing checks", len(found), "matches"),
    )
    return Finding("warning", text, who, "hanging_stops", sizes)


def _listed(names: Sequence[str]) -> str:
    """The first few of some names."""
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED + 1 else ""
    return ", ".join(names[:MOST_NAMED] if more else names) + more


def _of_gaps(solution: LaserSolution, who: str) -> Iterator[Finding]:
    """Stops without a pose, and what would close each gap."""
    for gap in solution.gaps:
        many = len(gap.stops) > 1
        stops = f"the stops {_listed(gap.stops)} have" if many else f"stop {gap.stops[0]} has"
        them = "them" if many else "it"
        text = f"{stops} no pose: no match that can be used joins {them} with a placed stop. "
        waiting = [one for one in gap.matches if one.verdict == "may be wrong"]
        other = [one for one in gap.matches if one.verdict == "refuted"]
        if waiting or other:
            named = ", ".join(f"{one.reference} - {one.moving}" for one in (waiting or other)[:5])
            kind = "may be wrong" if waiting else "is refuted"
            text += f"Decide on one that {kind} ({named}; `gtval laser inspect`), or survey one"
        else:
            text += (
                f"Add a stop between {gap.nearest[0]} and {gap.nearest[1]}, {gap.distance:.1f} m "
                "apart, or survey one"
            )
        size = (Size("stops without a pose", len(gap.stops), "stops"),)
        yield Finding("warning", text, who, "lost_stops", size)


def _mount(outcome: LaserOutcome) -> Finding:
    """Stated against found mount."""
    check = outcome.mount_check
    if check is None:
        text = f"the laser mount could not be checked: {outcome.mount_note}"
        return Finding("note", text, "laser", "mount_unchecked")
    values = f"stated less found {_mount_text(check.difference, '+')}"
    shown = f"an error of it of less than {_mount_text(check.least_shown)} would not show"
    if not check.agrees:
        text = (
            f"the stated laser mount does not fit the surveyed poses and the scans: {values}. "
            "Poses of stops that are turned against those that place the frame are off by as much, "
            "beyond what their covariances say. See `gtval laser check-mount`, and state the mount "
            "found or measure it again"
        )
        return Finding("warning", text, "laser", "mount", _mount_sizes(check.difference))
    if check.tells:
        text = f"the stated laser mount fits the data: {values}; {shown}"
        return Finding("good", text, "laser", "mount", _mount_sizes(check.difference))
    text = (
        "the laser mount is not determined well enough by these stops to say whether the stated "
        f"one is right: they know it to {_mount_text(check.found.sigmas)} (standard deviations; "
        f"{values}), and {shown}. Between the stops of a pair the robot turns by "
        f"{np.rad2deg(check.found.turn):.0f} degrees (root mean square). Survey more of the stops, "
        "with headings that differ by a quarter turn, or survey them more exactly"
    )
    sizes = _mount_sizes(check.found.sigmas, "standard deviation of the one found")
    return Finding("note", text, "laser", "mount_unclear", sizes)


def _mount_text(values: Array, sign: str = "") -> str:
    """A mount, or an error of one, (3,), in words."""
    x, y, theta = values * 1e3
    return f"{x:{sign}.1f} mm, {y:{sign}.1f} mm, {theta:{sign}.2f} mrad"


def _mount_sizes(values: Array, what: str = "stated less found") -> tuple[Size, ...]:
    """The three numbers of a mount, or of an error of one, (3,)."""
    kinds = zip(("mount x", "mount y", "mount theta"), ("m", "m", "rad"), strict=True)
    return tuple(
        Size(f"{name}: {what}", float(value), unit)
        for (name, unit), value in zip(kinds, values, strict=True)
    )


def _guesses(outcome: LaserOutcome) -> Iterator[Finding]:
    """Whether the guesses were as good as stated, by what the accepted matches say."""
    sigmas = outcome.settings.guess_sigmas
    before = outcome.assumed_guesses
    stated = "stated" if "guess_sigmas" in outcome.settings.model_fields_set else "assumed"
    for matching in outcome.matchings.values():
        free = [
            one
            for one in matching.matches
            if (one.reference, one.moving) not in outcome.inputs.decisions
        ]
        scatter = scatter_from_stop_to_stop(
            outcome.inputs.stops, outcome.trajectory.poses, free, sigmas
        )
        if scatter is None:
            continue
        text = (
            f"from stop to stop the initial guesses are off by {scatter[0] * 1e3:.0f} mm and "
            f"{scatter[1] * 1e3:.0f} mrad (standard deviation about the accepted matches; "
        )
        if before is None:
            text += f"{stated}: {sigmas[0] * 1e3:.0f} mm and {sigmas[1] * 1e3:.0f} mrad)"
        else:
            text += (
                f"{before[0] * 1e3:.0f} mm and {before[1] * 1e3:.0f} mrad were assumed, and as the "
                "first matches showed more, all pairs were matched again with "
                f"{sigmas[0] * 1e3:.0f} mm and {sigmas[1] * 1e3:.0f} mrad; state them: [laser] "
                f"guess_sigmas = [{sigmas[0]:.2g}, {sigmas[1]:.2g}])"
            )
        wider = wider_guesses(scatter, sigmas)
        worse = wider is not None
        if wider is not None:
            text += (
                f". They are worse than {stated}, so the right pose of some pairs may lie outside "
                f"the search: set [laser] guess_sigmas = [{wider[0]:.2g}, {wider[1]:.2g}]"
            )
        off = zip(("position", "heading"), scatter.tolist(), ("m", "rad"), strict=True)
        sizes = tuple(Size(f"scatter of the guesses in {of}", size, unit) for of, size, unit in off)
        yield Finding("warning" if worse else "note", text, "laser", "guess_sigmas", sizes)
        return
