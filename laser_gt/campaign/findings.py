"""What a person should read about a laser GT, and its numbers for scripts."""

import numpy as np

from laser_gt.campaign.outcome import LaserOutcome
from laser_gt.campaign.solve import LaserSolution
from laser_gt.placing.guesses import GENEROUS, guess_deviations, guess_scatter
from validation.results import Finding

WORSE = 1.5
"""Guesses are called worse than stated beyond this factor: pairs share the motions that they are
made of, and from 25 motions a deviation is known to a quarter of itself only."""


def laser_findings(outcome: LaserOutcome) -> list[Finding]:
    """Findings in the order in which they should be read."""
    found = [Finding("warning", text, "laser", "no_poses") for text in outcome.failures.values()]
    for solution in outcome.solutions.values():
        found += _of_solution(solution)
    found += _mount(outcome)
    found += _guesses(outcome)
    if outcome.trajectory.doubtful:
        stops = ", ".join(outcome.trajectory.doubtful)
        found.append(
            Finding(
                "warning",
                f"there is no odometry, and the scans alone do not connect the stops {stops} with "
                "the ones before them: pairs with them may be missing",
                "laser",
                "trajectory",
            )
        )
    return found


def _of_solution(solution: LaserSolution) -> list[Finding]:
    """Verdicts, stops without a pose, and how the laser frame was placed."""
    matching = solution.matching
    who = f"laser_{matching.engine}"
    count = {v: sum(m.verdict == v for m in matching.matches) for v in ("accept", "look", "reject")}
    found = [
        Finding(
            "good" if not count["look"] else "note",
            f"{count['accept']} of {len(matching.matches)} matches are accepted, "
            f"{count['reject']} rejected, and {count['look']} need eyes (`gtval laser inspect`)",
            who,
            "verdicts",
        )
    ]
    if solution.lost:
        stops = ", ".join(solution.lost)
        text = f"no accepted match connects these stops with a surveyed one: {stops}"
        found.append(Finding("warning", text, who, "lost_stops"))
    open_loops = sum(not loop.closes for loop in matching.loops)
    if matching.loops:
        text = f"{len(matching.loops) - open_loops} of {len(matching.loops)} loops of three close"
        found.append(Finding("warning" if open_loops else "good", text, who, "loops"))
    if solution.graph.scale > 1.5:
        text = (
            f"the accepted matches contradict each other {solution.graph.scale:.1f} times more "
            "than their covariances allow; the covariances of the poses are widened by that"
        )
        found.append(Finding("warning", text, who, "graph_misfit"))
    if len(solution.anchors) > 1:
        text = (
            f"the laser frame was placed by all {len(solution.anchors)} surveyed stops named: "
            "the mean errors against the survey are near zero by construction and say nothing "
            'about bias. Name one stop ([laser] reference = ["6"]) for the document\'s way'
        )
        found.append(Finding("note", text, who, "anchors"))
    return found


def _mount(outcome: LaserOutcome) -> list[Finding]:
    """Stated against found mount."""
    check = outcome.mount_check
    if check is None:
        text = f"the laser mount could not be checked: {outcome.mount_note}"
        return [Finding("note", text, "laser", "mount_unchecked")]
    difference = check.difference
    values = (
        f"stated less found {difference[0] * 1e3:+.1f} mm, {difference[1] * 1e3:+.1f} mm, "
        f"{difference[2] * 1e3:+.2f} mrad"
    )
    if check.agrees:
        return [
            Finding("good", f"the stated laser mount fits the data: {values}", "laser", "mount")
        ]
    text = (
        f"the stated laser mount does not fit the surveyed poses and the scans: {values}. Errors "
        "of the laser poses change with the robot's heading because of it; see "
        "`gtval laser check-mount`"
    )
    return [Finding("warning", text, "laser", "mount")]


def _guesses(outcome: LaserOutcome) -> list[Finding]:
    """Whether the guesses were as good as stated, by what the accepted matches say."""
    stated = np.array(outcome.settings.guess_sigmas)
    place = {stop: number for number, stop in enumerate(outcome.inputs.stops)}
    for matching in outcome.matchings.values():
        free = [
            one
            for one in matching.matches
            if (one.reference, one.moving) not in outcome.inputs.decisions
        ]
        chain = outcome.trajectory.poses
        expected = [
            guess_deviations(chain, place[one.reference], place[one.moving], stated.tolist())
            for one in free
        ]
        scatter = guess_scatter(free, np.array(expected).reshape(-1, 2) / stated)
        if scatter is None:
            continue
        text = (
            f"from stop to stop the initial guesses are off by {scatter[0] * 1e3:.0f} mm and "
            f"{scatter[1] * 1e3:.0f} mrad (standard deviation about the accepted matches; stated: "
            f"{stated[0] * 1e3:.0f} mm and {stated[1] * 1e3:.0f} mrad)"
        )
        if (scatter > WORSE * stated).any():
            wider = np.maximum(GENEROUS * scatter, stated)
            text += (
                f". They are worse than stated, so some matches may have been sought too near: set "
                f"[laser] guess_sigmas = [{wider[0]:.2g}, {wider[1]:.2g}]"
            )
            return [Finding("warning", text, "laser", "guess_sigmas")]
        return [Finding("note", text, "laser", "guess_sigmas")]
    return []


def laser_facts(outcome: LaserOutcome) -> dict[str, object]:
    """Numbers for scripts."""
    facts: dict[str, object] = {
        "stops": len(outcome.inputs.stops),
        "initial": outcome.trajectory.source,
        "reference": list(outcome.surveyed.stops),
        "engines": {
            engine: {
                "pairs": len(matching.matches),
                **{
                    verdict: sum(m.verdict == verdict for m in matching.matches)
                    for verdict in ("accept", "look", "reject")
                },
                "loops": len(matching.loops),
                "loops_open": sum(not loop.closes for loop in matching.loops),
                "poses": len(outcome.solutions[engine].stops) if engine in outcome.solutions else 0,
            }
            for engine, matching in outcome.matchings.items()
        },
    }
    check = outcome.mount_check
    if check is not None:
        facts["mount"] = {
            "stated": check.stated.tolist(),
            "found": check.found.mount.tolist(),
            "sigmas": check.found.sigmas.tolist(),
            "difference": check.difference.tolist(),
            "agrees": bool(check.agrees),
            "turn": check.found.turn,
            "pairs": check.found.pairs,
        }
    if outcome.published is not None:
        facts["as_published"] = {
            "reference": outcome.published.reference,
            "fitness": np.round(outcome.published.fitness, 6).tolist(),
        }
    return facts
