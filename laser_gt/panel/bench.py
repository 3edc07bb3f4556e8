"""The matches of a campaign as long as its page is served: kept up to date, tried, decided on.

What is decided is appended to the campaign's decisions file, as the command does it, and what is
shown follows from that file: nothing is known here that would be lost with the process.
"""

import sys
import threading
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

import numpy as np

from laser_gt.campaign.kept import KeptPairs, ManyPairsError
from laser_gt.campaign.outcome import LaserOutcome
from laser_gt.campaign.result_files import kept_files
from laser_gt.campaign.sections import kind_of
from laser_gt.campaign.solve import engine_settings, solve_campaign
from laser_gt.logs.decision_file import append_decisions, decision_history
from laser_gt.logs.decisions import Decision
from laser_gt.matching.verdicts import Match, objections
from laser_gt.placing.engines import Engine, EngineSettings, Matching, match_by_hand, told_anew
from laser_gt.placing.solution import solve
from laser_gt.settings import LaserSettings
from laser_gt.system import SYSTEM
from validation.campaign.folder import Campaign
from validation.errors import FinalError, GtvalError
from validation.page.desk import Desk, version_of
from validation.page.runner import Runner
from validation.page.undoing import TAKEN_BACK
from validation.page.undoing import undoing as taking_back
from validation.pieces.processes import give_back_memory
from validation.poses.angles import Array
from validation.results import VALIDATION_SYSTEM, SystemResult
from validation.solving import solve_validation
from validation.systems import inputs_of, installed_systems
from validation.text_files.writing import write_files

ENGINE: Engine = "scanmatch"
MOST_HERE = 30
"""Pairs that are matched in this process, in seconds; more in one of their own, whose memory ends
with it. A judgement: what a few decisions ask for."""
MOST_OBJECTIONS = 2
"""Kinds of objection that are decided on together; with more a match is looked at by itself."""
MOST_WAITED = 30.0
"""Seconds; the page itself gives up after a minute."""
Pair = tuple[str, str]
Asked = Callable[[], None]


@dataclass(frozen=True)
class Seen:
    """The matches as the files have them.

    Parameters
    ----------
    version : str
        Of the files.
    outcome : LaserOutcome
        What was made of them.
    history : list of (str, Decision)
        All decisions with their times.
    """

    version: str
    outcome: LaserOutcome
    history: list[tuple[str, Decision]]

    @property
    def matching(self) -> Matching:
        """All matches."""
        return self.outcome.matchings[ENGINE]

    @property
    def settings(self) -> EngineSettings:
        """How pairs are matched."""
        return engine_settings(self.outcome.settings)

    def match(self, pair: Pair) -> Match:
        """The match of a pair, named either way round.

        Raises
        ------
        GtvalError
            If there is none.
        """
        for one in self.matching.matches:
            if {one.reference, one.moving} == set(pair):
                return one
        raise FinalError(f"the stops {' and '.join(pair)} are not matched")

    def placed(self, matching: Matching | None = None) -> tuple[str, ...]:
        """Stops that get a pose, with these matches or with others."""
        known = self.outcome.solutions.get(ENGINE)
        if matching is None:
            return () if known is None else known.stops
        inputs, settings = self.outcome.inputs, self.outcome.settings
        mount = (inputs.mount, inputs.mount_sigmas)
        poses, surveyed = self.outcome.trajectory.poses, self.outcome.surveyed
        try:
            return solve(
                inputs.stops, *mount, poses, matching, surveyed, settings.guess_sigmas
            ).stops
        except GtvalError:
            return ()

    def with_decisions(self, made: Collection[Decision]) -> Matching:
        """The matches as they would be with further decisions, none of them a guess."""
        decisions = dict(self.outcome.inputs.decisions)
        for one in made:
            decisions[one.reference, one.moving] = one
            decisions[one.moving, one.reference] = one.turned()
        sweeps, poses = self.outcome.inputs.sweeps, self.outcome.trajectory.poses
        return told_anew(sweeps, poses, self.matching, decisions, self.settings)

    def objections(self, one: Match) -> tuple[str, ...]:
        """What makes that a match may be wrong."""
        return objections(one, self.settings.judgement)

    def sole_objections(self) -> dict[str, list[Match]]:
        """Matches held up by one kind of objection alone, or by two, the most common first."""
        found: dict[str, list[Match]] = {}
        for one in self.matching.of("may be wrong"):
            kinds = {kind_of(reason) for reason in self.objections(one)}
            if len(kinds) <= MOST_OBJECTIONS:
                found.setdefault("; ".join(sorted(kinds)), []).append(one)
        return dict(sorted(found.items(), key=lambda item: -len(item[1])))


class Bench:
    """Matches of one campaign, loaded in the background whenever a file has changed."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._loading: threading.Thread | None = None
        self._changing = threading.Lock()
        self.seen: Seen | None = None
        self.problem = ""
        """Why the matches cannot be shown."""
        self.progress = 0.0
        self._validated: tuple[str, Mapping[str, SystemResult]] | None = None
        self._failed_at = ""

    def files(self) -> list[Path]:
        """All that the matches depend on."""
        campaign = self._desk.campaign()
        return [campaign.toml, *SYSTEM.inputs(campaign), *self._of_validation(campaign)]

    def version(self) -> str:
        """Changes with every file that the matches depend on, and when they have been loaded."""
        try:
            files = version_of(self.files())
        except GtvalError as error:
            return str(error)
        state = f"{self.progress:.2f}" if self.is_loading else ""
        return f"{files}/{self.seen.version if self.seen else ''}/{self.problem}/{state}"

    @property
    def is_loading(self) -> bool:
        """Whether matches are being made or read."""
        return self._loading is not None and self._loading.is_alive()

    def refresh(self, *, wait: bool = False) -> Seen | None:
        """What is known now; what has changed is loaded in the background, or waited for."""
        with self._changing:
            try:
                version = version_of(self.files())
            except GtvalError as error:
                self.problem, self._failed_at = str(error), ""
                return self.seen
            fresh = self.seen is not None and self.seen.version == version
            if fresh:
                self.problem = self._failed_at = ""
            if not fresh and not self.is_loading and self._failed_at != version:
                self._loading = threading.Thread(target=self._load, args=(version,), daemon=True)
                self._loading.start()
            loading = self._loading
        if wait and loading is not None:
            loading.join()
        return self.seen

    def _load(self, version: str) -> None:
        """Take over what the files hold."""
        try:
            campaign = self._desk.campaign()
            history = decision_history(self.decisions_path(campaign), self._stops(campaign))
            solved = self._with_validation(campaign)
            try:
                outcome = self._solved(solved, MOST_HERE)
            except ManyPairsError:
                self._make_apart()
                outcome = self._solved(solved, None)
            before = None if self.seen is None else self.seen.outcome.keys
            if before != outcome.keys:
                write_files(campaign.results, kept_files(outcome))
            self.seen, self.problem, self._failed_at = Seen(version, outcome, history), "", ""
        except GtvalError as error:
            self.problem, self._failed_at = str(error), version
        except Exception as error:  # noqa: BLE001  (told on the page, which goes on)
            self.problem = f"unexpected: {type(error).__name__}: {error}. Please report it"
            self._failed_at = version
        finally:
            give_back_memory()

    def _with_validation(self, campaign: Campaign) -> Campaign:
        """The campaign with its validation poses, solved anew where their files have changed."""
        version = version_of([campaign.toml, *self._of_validation(campaign)])
        if self._validated is None or self._validated[0] != version:
            self._validated = version, solve_validation(campaign, installed_systems()).solved
        return replace(campaign, solved=self._validated[1])

    @staticmethod
    def _of_validation(campaign: Campaign) -> list[Path]:
        """What the validation poses are made from."""
        systems = [one for one in installed_systems() if one.name == VALIDATION_SYSTEM]
        return [path for one in systems for path in inputs_of(one, campaign)]

    def _solved(self, campaign: Campaign, most: int | None) -> LaserOutcome:
        """What the campaign holds; `ManyPairsError` where more than `most` pairs are new."""

        def report(_what: str, share: float) -> None:
            self.progress = share

        return solve_campaign(
            campaign,
            report,
            engines=(ENGINE,),
            as_published=False,
            need_poses=False,
            matcher=KeptPairs(campaign.folder).matcher(1, most),
        )

    def _make_apart(self) -> None:
        """Make and keep all matches in another process.

        Raises
        ------
        GtvalError
            If that fails.
        """
        command = (sys.executable, "-m", "laser_gt.panel.making")
        making = Runner(self._desk.folder, command)
        making.start("")
        while making.state.is_at_work:
            self.progress = making.state.share
            time.sleep(0.1)
        if making.state.state != "done":
            raise GtvalError(making.state.what)

    def _stops(self, campaign: Campaign) -> Collection[str]:
        """Stops that have scans."""
        from laser_gt.campaign.inputs import load_inputs  # noqa: PLC0415  (the scans once more)

        if self.seen is not None:
            return self.seen.outcome.inputs.stops
        return load_inputs(campaign, campaign.section("laser", LaserSettings)).stops

    @staticmethod
    def decisions_path(campaign: Campaign) -> Path:
        """The file of all decisions."""
        return campaign.folder / campaign.section("laser", LaserSettings).decisions

    def loaded(self) -> Seen:
        """What is known.

        Raises
        ------
        GtvalError
            If nothing is, yet.
        """
        seen = self.refresh()
        if seen is None:
            raise GtvalError(self.problem or "the matches are being made; wait a moment")
        return seen

    def current(self) -> Seen:
        """What the files hold now; waited for, as long as it takes to match a few pairs.

        Raises
        ------
        GtvalError
            If they hold nothing that can be shown, or it takes longer.
        """
        until = time.monotonic() + MOST_WAITED
        while time.monotonic() < until:
            seen = self.loaded()
            with self._changing:
                loading = self._loading
            if self.problem:
                raise GtvalError(self.problem)
            if seen.version == version_of(self.files()):
                return seen
            if loading is not None:
                loading.join(until - time.monotonic())
        raise GtvalError("the matches are being made anew; wait a moment")

    def tried(self, pair: Pair, guess: Array) -> Match:
        """The match of a pair from another guess, judged; nothing is decided by that."""
        seen = self.loaded()
        one, sweeps = seen.match(pair), seen.outcome.inputs.by_stop
        return match_by_hand(sweeps[one.reference], sweeps[one.moving], guess, seen.settings)

    def decide(self, decisions: Sequence[Decision], seen: Seen) -> int:
        """Record decisions; those that count already are not recorded twice. How many were."""
        with self._changing:
            path = self.decisions_path(self._desk.campaign())
            stops = seen.outcome.inputs.stops
            counting = {_key(one): one for _, one in decision_history(path, stops)}
            new = [one for one in decisions if not _same(counting.get(_key(one)), one)]
            if new:
                now = datetime.now().astimezone().isoformat(timespec="milliseconds")
                append_decisions(path, new, stops, now)
        self.refresh()
        return len(new)

    def undo(self, by: str) -> list[Decision]:
        """Take back what a person decided last, and has not taken back; what was recorded.

        Raises
        ------
        GtvalError
            If there is nothing of theirs.
        """
        seen = self.loaded()
        history = decision_history(
            self.decisions_path(self._desk.campaign()), seen.outcome.inputs.stops
        )
        restoring = undoing(history, by)
        if not restoring:
            raise FinalError("there is no decision of yours to take back")
        self.decide(restoring, seen)
        return restoring


def undoing(history: Sequence[tuple[str, Decision]], by: str) -> list[Decision]:
    """Decisions that take back the last ones of a person, as `validation.page.undoing` says."""

    def restored(before: Decision | None, back: Decision) -> Decision:
        return replace(before or replace(back, kind="open", guess=None), by=by, note=TAKEN_BACK)

    return taking_back(history, by, _key, restored)


def _key(one: Decision) -> frozenset[str]:
    """The pair that a decision is about."""
    return frozenset((one.reference, one.moving))


def _same(counting: Decision | None, one: Decision) -> bool:
    """Whether a decision says what counts already, so that it came twice."""
    if counting is None:
        return one.kind == "open"
    if counting.reference != one.reference:
        counting = counting.turned()
    if (counting.kind, counting.by, counting.note) != (one.kind, one.by, one.note):
        return False
    if counting.guess is None or one.guess is None:
        return counting.guess is one.guess
    return bool(np.allclose(counting.guess, one.guess, rtol=0, atol=2e-6))


def by_need(seen: Seen) -> list[Match]:
    """The matches in the order of need: those that would place stops, then others held up.

    Then refuted, imprecise and accepted ones, each with the least agreement first.
    """
    solution = seen.outcome.solutions.get(ENGINE)
    lost: set[str] = set()
    placing: set[frozenset[str]] = set()
    if solution is not None:
        lost = set(solution.lost)
        placing |= {frozenset((m.reference, m.moving)) for m, _ in solution.hanging}
    order: Mapping[str, int] = {"may be wrong": 0, "refuted": 2, "imprecise": 3, "accepted": 4}

    def need(one: Match) -> tuple[int, float]:
        helps = frozenset((one.reference, one.moving)) in placing
        helps |= (one.reference in lost) != (one.moving in lost)
        rank = order[one.verdict] + (one.verdict == "may be wrong" and not helps)
        return rank, one.agreement

    return sorted(seen.matching.matches, key=need)
