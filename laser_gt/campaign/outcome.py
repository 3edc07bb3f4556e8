"""A campaign solved for laser GT: what `gtval run` and `gtval laser` both start from."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from laser_gt.campaign.inputs import LaserInputs, load_inputs
from laser_gt.campaign.solve import (
    Engine,
    LaserSolution,
    Matching,
    Report,
    Surveyed,
    Trajectory,
    find_pairs,
    first_trajectory,
    match_pairs,
    solve,
)
from laser_gt.matching.genetic import GeneticSettings, genetic_match
from laser_gt.placing.mounts import MountCheck, check_mount
from laser_gt.placing.pairs import CandidatePairs
from laser_gt.scans.planar import between, compose
from laser_gt.settings import LaserSettings
from validation.campaign.folder import Campaign
from validation.errors import GtvalError, InputError, Problem
from validation.poses.angles import Array
from validation.poses.pose_table import PoseTable
from validation.results import VALIDATION_SYSTEM
from validation.systems import installed_systems, no_progress

GENETIC_PAIRS = 3
"""Nearest neighbours of a stop that the genetic aligner matches: it takes a third of a second."""


@dataclass(frozen=True)
class Published:
    """Poses by the document's own way: every stop matched with the reference alone.

    Parameters
    ----------
    stops : tuple of str
        Names.
    poses : (n, 3) array
        Robot poses in the GTV frame.
    fitness : (n,) array
        Of the winner, square metres; 0 for the reference.
    reference : str
        The surveyed stop.
    """

    stops: tuple[str, ...]
    poses: Array
    fitness: Array
    reference: str


@dataclass(frozen=True)
class LaserOutcome:
    """Everything that laser GT makes of a campaign.

    Parameters
    ----------
    settings, inputs, trajectory, pairs
        What it started from.
    survey, surveyed : Surveyed
        All surveyed poses; those that place the laser frame.
    solutions : dict of str to LaserSolution
        One for each engine that placed any stop.
    matchings : dict of str to Matching
        One for each engine.
    failures : dict of str to str
        Why an engine placed nothing.
    mount_check : MountCheck or None
        Where the survey allows one.
    mount_note : str
        Why not, else.
    published : Published or None
        Where it was asked for.
    """

    settings: LaserSettings
    inputs: LaserInputs
    trajectory: Trajectory
    pairs: CandidatePairs
    survey: Surveyed
    surveyed: Surveyed
    matchings: dict[Engine, Matching]
    solutions: dict[Engine, LaserSolution] = field(default_factory=dict)
    failures: dict[Engine, str] = field(default_factory=dict)
    mount_check: MountCheck | None = None
    mount_note: str = ""
    published: Published | None = None


def surveyed_poses(campaign: Campaign) -> Surveyed:
    """The validation poses: those of this run, else by whichever installed system makes them.

    Raises
    ------
    GtvalError
        If there is no survey, or it does not determine any pose.
    """
    known = campaign.solved.get(VALIDATION_SYSTEM)
    if known is None:
        surveys = (s for s in installed_systems() if s.name == VALIDATION_SYSTEM)
        survey = next((s for s in surveys if s.has_data(campaign)), None)
        known = survey.solve(campaign, no_progress) if survey is not None else None
    if known is not None and known.tables:
        return as_surveyed(known.tables[0])
    raise GtvalError(
        f"{campaign.folder}: laser poses need at least one surveyed stop to place the laser "
        "frame; survey one (survey/readings.csv), or give survey/published_poses.csv"
    )


def as_surveyed(table: PoseTable) -> Surveyed:
    """A pose table as surveyed stops; stops without covariance get 2 mm and 3 mrad."""
    n = len(table)
    stated = np.asarray(np.isfinite(table.covariances).all((1, 2)))
    default = np.diag([0.002, 0.002, 0.003]) ** 2
    joint = table.joint_covariance
    if joint is not None and stated.all():
        return Surveyed(tuple(table.ids), table.poses, joint)
    joint = np.zeros((3 * n, 3 * n))
    for row in range(n):
        part = slice(3 * row, 3 * row + 3)
        joint[part, part] = table.covariances[row] if stated[row] else default
    return Surveyed(tuple(table.ids), table.poses, joint)


def solve_campaign(
    campaign: Campaign,
    report: Report = no_progress,
    *,
    engines: Sequence[Engine] | None = None,
    as_published: bool = False,
    need_poses: bool = True,
) -> LaserOutcome:
    """Robot poses by scan matching and by the genetic aligner.

    Parameters
    ----------
    campaign : Campaign
        The folder and its settings.
    report : callable
        Called with what is being done and the share done.
    engines : sequence of str, optional
        'scanmatch', 'genetic'; by default as the settings say.
    as_published : bool
        Also the document's way.
    need_poses : bool
        Whether it is an error if no stop can be placed; for looking at the matches it is not.

    Raises
    ------
    GtvalError
        If the files are bad, or no engine could place a stop.
    """
    settings = campaign.section("laser", LaserSettings)
    inputs = load_inputs(campaign, settings)
    survey = surveyed_poses(campaign)
    surveyed = _references(campaign, settings, inputs, survey)
    report("first trajectory", 0.02)
    trajectory = first_trajectory(inputs)
    both: tuple[Engine, ...] = ("scanmatch", "genetic") if settings.genetic else ("scanmatch",)
    wanted = both if engines is None else tuple(engines)
    pairs = find_pairs(inputs, trajectory, settings)
    outcome = LaserOutcome(settings, inputs, trajectory, pairs, survey, surveyed, {})
    for number, engine in enumerate(wanted):
        _run_engine(outcome, engine, _part(report, number, len(wanted)))
    if need_poses and not outcome.solutions:
        raise GtvalError("\n".join(dict.fromkeys(outcome.failures.values())))
    published = _as_published(outcome) if as_published else None
    check, note = _mount_check(outcome)
    return LaserOutcome(
        settings,
        inputs,
        trajectory,
        pairs,
        survey,
        surveyed,
        outcome.matchings,
        outcome.solutions,
        outcome.failures,
        check,
        note,
        published,
    )


def _part(report: Report, number: int, count: int) -> Report:
    """Progress inside of one engine's share."""

    def inside(what: str, share: float) -> None:
        report(what, 0.05 + 0.9 * (number + share) / count)

    return inside


def _run_engine(outcome: LaserOutcome, engine: Engine, report: Report) -> None:
    """Match with one engine and solve the graph; the outcome records what became of it."""
    pairs = outcome.pairs
    if engine == "genetic":
        most = min(GENETIC_PAIRS, outcome.settings.pairs_per_stop)
        pairs = find_pairs(outcome.inputs, outcome.trajectory, outcome.settings, most)
    matching = match_pairs(
        outcome.inputs, outcome.trajectory, pairs, outcome.settings, engine, report
    )
    outcome.matchings[engine] = matching
    try:
        outcome.solutions[engine] = solve(
            outcome.inputs, outcome.trajectory, matching, outcome.surveyed
        )
    except GtvalError as error:
        outcome.failures[engine] = f"{engine}: {error}"


def _references(
    campaign: Campaign, settings: LaserSettings, inputs: LaserInputs, surveyed: Surveyed
) -> Surveyed:
    """The surveyed stops that place the laser frame."""
    wanted = settings.reference or [s for s in inputs.stops if s in surveyed.stops]
    problems = [
        Problem(campaign.toml, "no scan of this stop", None, "laser.reference", stop)
        for stop in wanted
        if stop not in inputs.stops
    ] + [
        Problem(campaign.toml, "this stop has no surveyed pose", None, "laser.reference", stop)
        for stop in wanted
        if stop not in surveyed.stops
    ]
    if not wanted:
        problems.append(
            Problem(campaign.toml, "no scanned stop has a surveyed pose", None, "laser")
        )
    if problems:
        raise InputError(problems)
    return surveyed.select(wanted)


def _mount_check(outcome: LaserOutcome) -> tuple[MountCheck | None, str]:
    """The mount from all surveyed stops, or why there is none."""
    engine = next(iter(outcome.matchings))
    try:
        matches = outcome.matchings[engine].matches
        return check_mount(outcome.inputs, matches, outcome.survey), ""
    except GtvalError as error:
        return None, str(error)


def _as_published(outcome: LaserOutcome) -> Published:
    """Every stop matched with one reference by the published genetic aligner, not judged.

    AD2.3, "Validation results" of the laser-based GT: reference pose, mount, match, inverse
    mount. Population 100, 300 generations, seeded with odometry, the worst five points dropped.
    """
    inputs, settings = outcome.inputs, outcome.settings
    reference = outcome.surveyed.stops[0]
    root = inputs.stops.index(reference)
    laser = compose(outcome.surveyed.poses[0], inputs.mount)
    back = between(inputs.mount, np.zeros(3))
    poses, fitness = [], []
    generators = np.random.default_rng(settings.seed).spawn(len(inputs.stops))
    form = GeneticSettings(settings.population, settings.generations, as_published=True)
    for number, rng in enumerate(generators):
        if number == root:
            poses.append(outcome.surveyed.poses[0])
            fitness.append(0.0)
            continue
        guess = between(outcome.trajectory.poses[root], outcome.trajectory.poses[number])
        found = genetic_match(
            inputs.sweeps[root], inputs.sweeps[number], rng, [guess], form, middle=guess
        )
        poses.append(compose(compose(laser, found.pose), back))
        fitness.append(found.fitness)
    return Published(inputs.stops, np.array(poses), np.array(fitness), reference)
