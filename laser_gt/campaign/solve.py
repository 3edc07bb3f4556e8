"""A campaign solved for laser GT: initial guess, pairs, matches, poses, mount."""

from collections.abc import Sequence
from dataclasses import replace

from laser_gt.campaign.inputs import LaserInputs, load_inputs, references, surveyed_poses
from laser_gt.campaign.kept import KeptPairs, kept_file, matching_key, read_matching
from laser_gt.campaign.outcome import LaserOutcome
from laser_gt.campaign.slips import likely_slip
from laser_gt.matching.genetic import GeneticSettings
from laser_gt.matching.judgement import MatchSettings
from laser_gt.matching.verdicts import JudgementSettings
from laser_gt.placing.anchors import Surveyed
from laser_gt.placing.engines import Engine, EngineSettings, Matcher, Matching, Report, match_pairs
from laser_gt.placing.guesses import (
    first_trajectory,
    scatter_from_stop_to_stop,
    wider_guesses,
)
from laser_gt.placing.mounts import MountCheck, check_mount
from laser_gt.placing.noises import scanner_noise, with_noise
from laser_gt.placing.pairs import PairSettings, find_pairs
from laser_gt.placing.published import Published, published_poses
from laser_gt.placing.solution import solve
from laser_gt.settings import LaserSettings
from validation.campaign.folder import Campaign
from validation.errors import GtvalError
from validation.poses.angles import Array
from validation.systems import no_progress

FEW_ACCEPTED = 0.5
"""Share of the matches that are accepted, up to which a slip of the pen is looked for. A judgement:
in rooms two thirds are; the search takes seconds."""


def solve_campaign(
    campaign: Campaign,
    progress: Report = no_progress,
    *,
    engines: Sequence[Engine] | None = None,
    as_published: bool | None = None,
    need_poses: bool = True,
    matcher: Matcher | None = None,
) -> LaserOutcome:
    """Robot poses by scan matching and by the genetic aligner.

    Parameters
    ----------
    campaign : Campaign
        The folder and its settings, and what the survey made of it.
    progress : callable
        Called with what is being done and the share done.
    engines : sequence of str, optional
        'scanmatch', 'genetic'; by default as the settings say.
    as_published : bool, optional
        Also the document's way; as the settings say by default.
    need_poses : bool
        Whether it is an error if no stop can be placed, and the mount is checked; for looking at
        the matches neither is.
    matcher : callable, optional
        What matches pairs; by default `KeptPairs` of the campaign, in as many processes as there
        are processors.

    Raises
    ------
    GtvalError
        If the files are bad, or no engine could place a stop.
    """
    settings = campaign.section("laser", LaserSettings)
    survey = surveyed_poses(campaign)
    inputs = load_inputs(campaign, settings, len(survey.stops))
    surveyed = references(campaign, settings, inputs.stops, survey)
    progress("first trajectory", 0.02)
    trajectory = first_trajectory(inputs.sweeps, inputs.laser_odometry)
    progress("noise of the scanners", 0.03)
    length, angle = settings.guess_sigmas
    noise = scanner_noise(inputs.sweeps, trajectory.poses, MatchSettings(length, angle))
    stated = {name: one.sigma for name, one in settings.scanners.items() if one.sigma is not None}
    inputs = replace(inputs, sweeps=with_noise(inputs.sweeps, noise, stated))
    both: tuple[Engine, ...] = ("scanmatch", "genetic") if settings.genetic else ("scanmatch",)
    wanted = tuple(dict.fromkeys(both if engines is None else engines))
    poses, assumed = trajectory.poses, None
    using = KeptPairs(campaign.folder).matcher() if matcher is None else matcher
    first_part = _part(progress, 0, wanted)
    kept = {wanted[0]: _matched(campaign, inputs, poses, settings, wanted[0], first_part, using)}
    wider = _wider(inputs, poses, settings, kept[wanted[0]][1])
    if wider is not None:
        assumed, settings = (
            settings.guess_sigmas,
            settings.model_copy(update={"guess_sigmas": wider}),
        )
        kept = {}
    for at, engine in enumerate(wanted):
        if engine not in kept:
            part = _part(progress, at, wanted)
            kept[engine] = _matched(campaign, inputs, poses, settings, engine, part, using)
    keys = {engine: key for engine, (key, _) in kept.items()}
    matchings = {engine: one for engine, (_, one) in kept.items()}
    mount = (inputs.mount, inputs.mount_sigmas)
    solutions, failures = {}, {}
    for engine, one in matchings.items():
        try:
            solutions[engine] = solve(
                inputs.stops, *mount, trajectory.poses, one, surveyed, settings.guess_sigmas
            )
        except GtvalError as error:
            failures[engine] = f"{engine}: {error}"
    first = matchings[wanted[0]]
    few = len(first.of("accepted")) <= FEW_ACCEPTED * len(first.matches)
    slip = likely_slip(inputs, MatchSettings(length, angle)) if few else None
    if slip is not None and not solutions:
        failures = {engine: f"{engine}: {slip.text}" for engine in failures}
    if need_poses and not solutions:
        raise GtvalError("\n".join(dict.fromkeys(failures.values())))
    check, note = None, ""
    if need_poses:
        check, note = _checked(inputs, matchings[wanted[0]], survey)
    published = None
    if settings.as_published if as_published is None else as_published:
        published = _published(inputs, trajectory.poses, settings, surveyed)
    return LaserOutcome(
        settings=settings,
        inputs=inputs,
        trajectory=trajectory,
        survey=survey,
        surveyed=surveyed,
        matchings=matchings,
        solutions=solutions,
        failures=failures,
        mount_check=check,
        mount_note=note,
        published=published,
        noise=noise,
        keys=keys,
        slip=slip,
        assumed_guesses=assumed,
    )


def _checked(
    inputs: LaserInputs, matching: Matching, survey: Surveyed
) -> tuple[MountCheck | None, str]:
    """The mount as the matches have it, or why they do not tell it."""
    mount = (inputs.mount, inputs.mount_sigmas)
    try:
        return check_mount(inputs.stops, *mount, matching.matches, survey), ""
    except GtvalError as error:
        return None, str(error)


def _wider(
    inputs: LaserInputs, poses: Array, settings: LaserSettings, first: Matching
) -> tuple[float, float] | None:
    """Standard deviations of the guesses by first matches, where these show more than assumed."""
    if "guess_sigmas" in settings.model_fields_set:
        return None
    free = [one for one in first.matches if (one.reference, one.moving) not in inputs.decisions]
    scatter = scatter_from_stop_to_stop(inputs.stops, poses, free, settings.guess_sigmas)
    return None if scatter is None else wider_guesses(scatter, settings.guess_sigmas)


def _part(progress: Report, at: int, engines: Sequence[Engine]) -> Report:
    """Progress inside of one engine's share."""

    def inside(what: str, share: float) -> None:
        progress(what, 0.05 + 0.9 * (at + share) / len(engines))

    return inside


def _matched(
    campaign: Campaign,
    inputs: LaserInputs,
    poses: Array,
    settings: LaserSettings,
    engine: Engine,
    progress: Report,
    matcher: Matcher,
) -> tuple[str, Matching]:
    """All matches by one engine with their key, as they were kept or made anew."""
    limits = PairSettings(
        settings.pair_radius,
        settings.pair_heading,
        settings.pair_overlap,
        settings.pairs_per_stop,
    )
    form = engine_settings(settings)
    pairs = find_pairs(poses, [one.sweep for one in inputs.sweeps], limits, inputs.decisions)
    decisions = inputs.decisions
    key = matching_key(inputs.sweeps, form, engine, poses, pairs, decisions)
    kept = read_matching(campaign.results / kept_file(engine), key, engine)
    if kept is not None:
        return key, kept
    asked = (inputs.sweeps, poses, pairs, decisions, form, engine)
    return key, match_pairs(*asked, progress, matcher)


def engine_settings(settings: LaserSettings) -> EngineSettings:
    """How pairs are matched, as campaign.toml says."""
    return EngineSettings(
        settings.guess_sigmas,
        settings.initial,
        _genetic(settings),
        settings.genetic_pairs,
        settings.seed,
        JudgementSettings(**settings.judgement.model_dump()),
    )


def _published(
    inputs: LaserInputs, poses: Array, settings: LaserSettings, surveyed: Surveyed
) -> Published:
    """The document's own way, from the first of the surveyed stops."""
    return published_poses(
        inputs.sweeps,
        inputs.mount,
        poses,
        surveyed.stops[0],
        surveyed.poses[0],
        _genetic(settings),
        settings.seed,
    )


def _genetic(settings: LaserSettings) -> GeneticSettings:
    """Size of the genetic search."""
    radius, turn = settings.genetic_radius, GeneticSettings().window[2]
    return GeneticSettings(settings.population, settings.generations, window=(radius, radius, turn))
