"""Where all marks and stops are that the readings determine together.

Marks from stops, stops from marks, groups of both: a small network is solved as one. Of a large
one first a group is, whose marks then carry the other stops.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from survey.estimation.distance_fit import coordinate_sigma
from survey.estimation.evidence import Evidence
from survey.estimation.geometry import rotate
from survey.estimation.robot_frames import solve_robot_frames
from survey.estimation.vframe import VframeEstimate
from survey.estimation.whole.groups import OPEN_SIGMA, Group, solve_group
from survey.estimation.whole.units import FAR, Index, make_units, stop_key
from survey.estimation.whole.wanted import Open, Surroundings, wanted_readings
from survey.estimation.world_points import WorldPoint, WorldPoints
from survey.readings.point_names import robot_point
from survey.readings.readings import Readings
from validation.campaign.folder import RobotFrame
from validation.poses.angles import Array

MOST_POINTS = 120
"""Places, and three for each stop, that are solved as one group: more take long (a start in space
with 100 points takes 0.1 s, and the time grows with the cube) and make nothing safer."""
GUESS_SIGMA = np.array([0.5, 0.5, 0.5])
"""Standard deviations, in metres and radians, granted to rough values of stops. A judgement: by
steps and by eye; they decide between solutions that are metres apart."""
TRUSTED_SIGMA = np.full(3, 0.005)
"""Standard deviations, in metres and radians, of what was found otherwise: of a usual survey."""
_GRAVE = 1 / 3
"""Share of a unit's readings that do not fit from which it has no place: what is left would not
check it."""


@dataclass
class Whole:
    """What the readings determine together.

    Parameters
    ----------
    places : dict of str to (2,) array
        World points, metres, Vframe.
    poses : dict of str to (3,) array
        Stops, by their `stop_key`, as in all that follows.
    sigma : dict of str to (3,) array
        Standard deviations of both, readings taken as independent.
    open : dict of str to Open
        World points and stops that have no place, and why.
    """

    places: dict[str, Array] = field(default_factory=dict)
    poses: dict[str, Array] = field(default_factory=dict)
    sigma: dict[str, Array] = field(default_factory=dict)
    open: dict[str, Open] = field(default_factory=dict)

    def world_points(self) -> WorldPoints:
        """The places with their own covariances, correlations left out."""
        points = tuple(
            WorldPoint(
                name,
                place,
                np.diag(self.sigma[name][:2] ** 2),
                0.0,
                0,
                None,
                np.empty((2, 0)),
                0,
            )
            for name, place in self.places.items()
        )
        spread = [self.sigma[name][:2] ** 2 for name in self.places]
        return WorldPoints(points, np.diag(np.concatenate([*spread, np.empty(0)])), ())


def locate_whole(
    vframe: VframeEstimate,
    rig: RobotFrame,
    readings: Readings,
    world_points: Sequence[str],
    evidence: Evidence,
    starts: Mapping[str, Array],
    *,
    trusting: bool = False,
) -> Whole:
    """Places and poses from all readings together.

    Parameters
    ----------
    vframe : VframeEstimate
        The frame.
    rig : RobotFrame
        Nominal rig.
    readings : Readings
        All readings.
    world_points : sequence of str
        Names of the world points.
    evidence : Evidence
        Rough values: starts, and what decides between solutions that fit equally well.
    starts : mapping of str to array
        Places (2,) and poses (3,) found otherwise: one more start.
    trusting : bool
        In a network of more than one group these starts are right, and only what is open is
        looked for.
    """
    search = _Search(vframe, rig, readings, world_points, evidence, starts)
    if trusting and len(search.places) + 3 * len(search.stops) > MOST_POINTS:
        search.trust()
    return search.run()


class _Search:
    """The work of `locate_whole`."""

    def __init__(
        self,
        vframe: VframeEstimate,
        rig: RobotFrame,
        readings: Readings,
        world_points: Sequence[str],
        evidence: Evidence,
        starts: Mapping[str, Array],
    ) -> None:
        self.rig, self.readings, self.evidence, self.starts = rig, readings, evidence, starts
        self.rng = np.random.default_rng(0)
        sigma = coordinate_sigma(vframe.covariance)
        self.fixed = {
            name: (place, float(s))
            for name, place, s in zip(vframe.names, vframe.points, sigma, strict=True)
        }
        self.found = Whole()
        self.partners = _partners(readings)
        self.places = [name for name in world_points if name in self.partners]
        self.stops = [stop_key(pose) for pose in readings.poses]
        self.tried: dict[str, tuple[Group, int]] = {}

    def trust(self) -> None:
        """Take over all that was found otherwise."""
        for name in [name for name in (*self.places, *self.stops) if name in self.starts]:
            self._take(name, self.starts[name], TRUSTED_SIGMA, is_place=name in self.places)

    def run(self) -> Whole:
        """Groups until nothing more is found."""
        while self._open_places() or self._open_stops():
            places, stops = self._chosen()
            everything = len(places) + len(stops) == len(self.places) + len(self.stops)
            group = self._solved(places, stops)
            self._taken(group)
            for i in range(group.units.fixed, len(group.units.names)):
                self.tried[group.units.names[i]] = group, i
            if everything:
                break
            self._extend()
        self._say_why()
        return self.found

    def _open_places(self) -> list[str]:
        return [name for name in self.places if name not in self.tried]

    def _open_stops(self) -> list[str]:
        return [name for name in self.stops if name not in self.tried]

    def _chosen(self) -> tuple[list[str], list[str]]:
        """What is solved next: everything, or the stops that share most with what is known."""
        if len(self.places) + 3 * len(self.stops) <= MOST_POINTS:
            return list(self.places), list(self.stops)
        places: dict[str, None] = {}
        stops: list[str] = []
        known = set(self.fixed)
        waiting = self._open_stops()
        while waiting and len(places) + 3 * len(stops) < MOST_POINTS:
            seen = known | set(places)

            def ties(stop: str, seen: set[str] = seen) -> tuple[bool, int, int]:
                own = self.partners[stop]  # a stop that fits by itself spoils no group
                shared = sum(n for name, n in own.items() if name in seen)
                return stop in self.starts, shared, own.total()

            best = max(waiting, key=ties)
            waiting.remove(best)
            stops.append(best)
            for name in self.partners[best]:
                if name in self.places and name not in self.tried:
                    places[name] = None
        rest = [name for name in self._open_places() if name not in places]
        rest.sort(key=lambda name: -self.partners[name].total())
        places |= dict.fromkeys(rest[: max(MOST_POINTS - len(places) - 3 * len(stops), 0)])
        return [name for name in self.places if name in places], stops

    def _solved(self, places: list[str], stops: list[str]) -> Group:
        """The group of these."""
        units = make_units(self.fixed, places, stops, self.readings, self.rig)
        n = len(units.names)
        known, rough = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
        sigma = np.ones((n, 3))
        known[: units.fixed] = [[*place, 0.0] for place, _ in self.fixed.values()]
        for i in range(units.fixed, n):
            name, size = units.names[i], 2 if i < units.fixed + units.places else 3
            if name in self.starts:
                known[i, :size] = self.starts[name]
            evidence = self.evidence
            hand = evidence.hand.get(name) if size == 2 else evidence.guesses.get(name[:-1])
            if hand is not None:
                rough[i, :size] = hand[:size]
            sigma[i] = self.evidence.hand_sigma if size == 2 else GUESS_SIGMA
        return solve_group(units, known, rough, sigma, self.rng)

    def _taken(self, group: Group) -> None:
        """Take over what a group determines."""
        units = group.units
        good = ~group.weak & ~group.ambiguous
        for i in range(units.fixed, len(units.names)):
            rows, _, count = group.outliers(i)
            if not good[i] or len(rows) > max(1, _GRAVE * count):
                continue
            is_place = i < units.fixed + units.places
            self._take(units.names[i], group.state[i], group.sigma[i], is_place=is_place)

    def _take(self, name: str, state: Array, sigma: Array, *, is_place: bool) -> None:
        """One place or stop is known."""
        self.found.sigma[name] = sigma
        if is_place:
            self.found.places[name] = state[:2]
            self.fixed[name] = state[:2], float(np.sqrt((sigma[:2] ** 2).mean()))
            self.places.remove(name)
            return
        self.found.poses[name] = state
        self.stops.remove(name)
        for point, body in self.rig.points.items():
            arm = rotate(state[2], np.asarray(body, dtype=float))
            spread = (sigma[:2] ** 2).mean() + arm @ arm * sigma[2] ** 2
            spread += self.rig.mark_variance
            self.fixed[f"{name}{point}"] = state[:2] + arm, float(np.sqrt(spread))

    def _extend(self) -> None:
        """Stops that the places known by now determine each by itself."""
        if not self.stops or not self.found.places:
            return
        world = self.found.world_points()
        fits, _ = solve_robot_frames(
            [name[:-1] for name in self.stops],
            self.readings,
            world,
            self.rig,
            self.evidence.guesses,
        )
        for fit in fits:
            sigma = np.sqrt(np.diagonal(fit.covariance))
            self._take(stop_key(fit.pose), fit.state, sigma, is_place=False)

    def _say_why(self) -> None:
        """Why what is left has no place."""
        around = Surroundings(
            {name: place for name, (place, _) in self.fixed.items()},
            {name: np.asarray(point, dtype=float) for name, point in self.rig.points.items()},
            self.readings,
        )
        for name in (*self.places, *self.stops):
            group, i = self.tried[name]
            size = 2 if name in self.places else 3
            rows, misfit, count = group.outliers(i)
            states = group.candidates(i)[:, :size]
            if group.ambiguous[i] and len(states) > 1:
                reason = f"{len(states)} places fit all readings equally well"
            elif group.weak[i]:
                states = states[:1]
                spread = float(group.sigma[i, :2].max())
                reason = f"its {count} reading(s) do not determine it"
                if spread < OPEN_SIGMA:
                    reason += ": its heading is open"
                elif spread < FAR / 10:
                    reason += f" (standard deviation {spread:.2f} m)"
            else:
                self.found.open[name] = Open(
                    self._contradiction(rows, misfit, count), candidates=states
                )
                continue
            reason += wanted_readings(name, states, group.sigma[i, :size], around)
            kept = states if len(states) > 1 else np.empty((0, size))
            self.found.open[name] = Open(reason, bool(group.weak[i]), kept)

    def _contradiction(self, rows: Index, misfit: Array, count: int) -> str:
        """Which readings of a place do not fit it."""
        said = []
        for row, off in list(zip(rows, misfit, strict=True))[:4]:
            a, b, line = self.readings.start[row], self.readings.end[row], self.readings.line[row]
            at = f" (line {line})" if line else ""
            said.append(f"{a}–{b}{at} by {off:+.2f} m")
        return (
            f"its readings contradict each other by far: {len(rows)} of {count} do not fit where "
            f"the others would have it, {', '.join(said)}. Measure again"
        )


def _partners(readings: Readings) -> dict[str, Counter[str]]:
    """How often each point, and each stop, is read to which point or stop."""
    found: dict[str, Counter[str]] = {}
    for a, b in zip(readings.start, readings.end, strict=True):
        marks = [(name, robot_point(name)) for name in (a, b)]
        own = [name if mark is None else stop_key(mark[0]) for name, mark in marks]
        for here, there in (own, own[::-1]):
            if here != there:
                found.setdefault(here, Counter())[there] += 1
    return found
