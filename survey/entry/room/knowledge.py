"""What the readings taken so far say of the room, kept up to date reading by reading.

A reading concerns one group: the frame, one world point, or one stop. Only what depends on it is
computed again, so that an answer takes milliseconds however long the campaign is.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from survey.entry.room.fits import predicted_distances
from survey.entry.room.groups import Pair, group_key
from survey.entry.room.judgement import Judgement, judge
from survey.entry.room.prediction import Prediction, Sides
from survey.estimation.distance_fit import DistanceFit, coordinate_sigma, place_fit
from survey.estimation.geometry import rotate
from survey.estimation.robot_frames import PoseReadings, full_model, pose_covariance, pose_readings
from survey.estimation.vframe import VframeEstimate, estimate_vframe
from survey.estimation.world_points import WorldPoints, joint_covariance, place_at, place_readings
from survey.readings.instrument import corrected, reading_sigma
from survey.readings.point_names import robot_point
from survey.readings.readings import Readings
from survey.settings import SurveySettings
from validation.campaign.folder import CampaignSettings
from validation.poses.angles import Array


@dataclass(frozen=True)
class KnownReading:
    """A reading that counts: its journal entry, its points as written, metres as shown."""

    number: int
    start: str
    end: str
    metres: float


@dataclass(frozen=True)
class Judged:
    """A group of readings and what they say.

    Parameters
    ----------
    numbers : tuple of int
        Journal entries of the rows of the fit.
    fit : DistanceFit
        The readings.
    judgement : Judgement
        What they say together.
    """

    numbers: tuple[int, ...]
    fit: DistanceFit
    judgement: Judgement

    def entries_of(self, rows: Iterable[int]) -> tuple[int, ...]:
        """Journal entries of some rows."""
        return tuple(self.numbers[row] for row in rows)


class _Side(NamedTuple):
    """A triangle that a reading closes: a known side with its sigma, and a side that was read."""

    known: float
    read: float
    sigma: float
    number: int


@dataclass
class _Group:
    """Readings of a group by pair, and what was made of them, by the point judged."""

    pairs: dict[Pair, list[KnownReading]] = field(default_factory=dict)
    judged: dict[str, Judged] = field(default_factory=dict)
    near: dict[str, Array] = field(default_factory=dict)
    changes: int = 0

    def changed(self) -> None:
        """Forget what was made of the readings."""
        self.judged.clear()
        self.changes += 1


class RoomKnowledge:
    """Places of world points and stops from the readings so far, and predictions of the next.

    Parameters
    ----------
    campaign : CampaignSettings
        Frame, rig and instrument.
    survey : SurveySettings
        World points, labels, sigma.
    """

    def __init__(self, campaign: CampaignSettings, survey: SurveySettings) -> None:
        self._rig = campaign.robot_frame
        self._instrument = campaign.instrument
        self._survey = survey
        self._world_names = set(survey.world_points)
        self._vframe: VframeEstimate = estimate_vframe(
            campaign.vframe, Readings((), (), np.empty(0), np.empty(0))
        )
        self._groups: dict[str, _Group] = {}
        self._world: WorldPoints | None = None

    def set_readings(self, pair: Pair, readings: Sequence[KnownReading]) -> None:
        """Replace what is known of a pair."""
        key = self.group_key(pair)
        group = self._groups.setdefault(key, _Group())
        if readings:
            group.pairs[pair] = list(readings)
        else:
            group.pairs.pop(pair, None)
        group.changed()
        if key in self._world_names:
            self._world = None
            for other in self._groups:
                if other not in self._world_names:
                    self._groups[other].changed()

    @contextmanager
    def supposing(self, pair: Pair, readings: Sequence[KnownReading]) -> Iterator[None]:
        """As if other readings were known of a pair; afterwards all is as before."""
        groups, world = self._groups, self._world
        self._groups = {
            key: replace(one, pairs={**one.pairs}, judged={**one.judged}, near={**one.near})
            for key, one in groups.items()
        }
        try:
            self.set_readings(pair, readings)
            yield
        finally:
            self._groups, self._world = groups, world

    def groups(self) -> dict[str, int]:
        """Keys of all groups with readings, and how often each has changed."""
        return {key: group.changes for key, group in self._groups.items() if group.pairs}

    def group_key(self, pair: Pair) -> str:
        """The group that a pair's reading belongs to."""
        return group_key(pair, self._world_names)

    def sigma(self, metres: float) -> float:
        """Standard deviation of a reading."""
        stated = self._survey.reading_sigma
        return stated if stated is not None else float(reading_sigma(self._instrument, metres))

    def judged(self, key: str) -> list[Judged]:
        """What the readings of a world point or stop say; of a stop perhaps mark by mark.

        As long as the pose of a stop is open, each of its marks stands alone.
        """
        if key in self._world_names:
            return [self._judged(key, key)]
        whole = self._judged(key, key)
        if whole.judgement.why_open is None or whole.judgement.explanations:
            return [whole]
        marks = sorted({r.start for r in self._readings(key)})
        return [self._judged(key, mark) for mark in marks]

    def world(self) -> WorldPoints:
        """World points with one place each, and their joint covariance."""
        if self._world is None:
            found = []
            for name in self._survey.world_points:
                if name not in self._groups or not self._groups[name].pairs:
                    continue
                one = self._judged(name, name)
                if one.judgement.is_unique and not one.judgement.explanations:
                    own = self._as_readings(self._readings(name))
                    found.append(place_at(name, one.judgement.states[0], own, self._vframe))
            self._world = WorldPoints(tuple(found), joint_covariance(found, self._vframe), ())
        return self._world

    def stop_precision(self, stop: str) -> tuple[Array, float | None] | None:
        """Standard deviations (3,) of x, y (metres) and theta (radians), and m0 of a stop.

        None while it is open; m0 None without redundancy. All that its readings share, with one
        another and with other stops, is allowed for.
        """
        one = self._judged(f"{stop}/", f"{stop}/")
        fit, state = one.fit, one.judgement.states[:1]
        if (
            not one.judgement.is_unique
            or one.judgement.explanations
            or not isinstance(fit, PoseReadings)
        ):
            return None
        h, _, R = full_model(fit, self.world(), self._rig)(state[0])
        covariance = pose_covariance(state[0], fit, self.world(), self._rig)
        spare = len(fit) - fit.unknowns
        m0 = float(np.sqrt(h @ np.linalg.solve(R, h) / spare)) if spare > 0 else None
        return np.asarray(np.sqrt(np.diagonal(covariance))), m0

    def world_precision(self, name: str) -> tuple[Array, float | None] | None:
        """Standard deviations (2,) of x and y, and m0, of a world point; None while it is open."""
        world = self.world()
        if name not in world.names:
            return None
        point = world.points[world.names.index(name)]
        m0 = float(np.sqrt(point.cost / point.redundancy)) if point.redundancy > 0 else None
        return np.asarray(np.sqrt(np.diagonal(point.covariance))), m0

    def places(self, stops: Iterable[str]) -> dict[str, tuple[float, float]]:
        """Places of the Vframe and world points, and of the marks of some stops, for a map."""
        found = {
            name: tuple(map(float, place))
            for name, place in zip(self._vframe.names, self._vframe.points, strict=True)
        }
        world = self.world()
        found |= {
            name: tuple(map(float, place))
            for name, place in zip(world.names, world.positions, strict=True)
        }
        for stop in stops:
            for one in self.judged(f"{stop}/"):
                found |= self._marks_of(f"{stop}/", one)
        return {name: (x, y) for name, (x, y) in found.items()}

    def _marks_of(self, key: str, one: Judged) -> Mapping[str, tuple[float, ...]]:
        """Places of the marks of a judged stop or mark, where there is one solution."""
        if not one.judgement.is_unique:
            return {}
        state = one.judgement.states[0]
        if isinstance(one.fit, PoseReadings):
            return {
                f"{key}{name}": tuple(
                    map(float, state[:2] + rotate(state[2], np.array(body, dtype=float)))
                )
                for name, body in self._rig.points.items()
            }
        mark = next(r.start for r in self._readings(key) if r.number == one.numbers[0])
        return {mark: tuple(map(float, state))}

    def predict(self, start: str, end: str) -> Prediction:
        """What a reading between two points should be, from all that is known now."""
        mark, other = (end, start) if robot_point(end) else (start, end)
        point = robot_point(mark)
        if point is not None:
            return self._predict_from_mark(mark, other, point)
        a, b = self._meaning(start), self._meaning(end)
        world = next((name for name in (a, b) if name in self._world_names), None)
        if world is None:
            return self._predict_in_frame(a, b)
        return self._predict_world(world, a if b == world else b)

    # -- predictions ------------------------------------------------------------------------

    def _predict_in_frame(self, a: str, b: str) -> Prediction:
        """The nominal distance of two Vframe points."""
        i, j = (self._vframe.names.index(name) for name in (a, b))
        length = float(np.linalg.norm(self._vframe.points[i] - self._vframe.points[j]))
        sigma = coordinate_sigma(self._vframe.covariance)[[i, j]]
        total = np.sqrt(self.sigma(length) ** 2 + (sigma**2).sum())
        return Prediction(np.array([length]), np.array([total]), Sides.none(), "the nominal frame")

    def _predict_world(self, world: str, frame: str) -> Prediction:
        """From a world point's other readings."""
        group = self._groups.get(world, _Group())
        index = self._vframe.names.index(frame)
        mark_sigma = coordinate_sigma(self._vframe.covariance)[index]
        sides: list[_Side] = []
        for reading in self._readings(world):
            other = self._vframe.names.index(reading.end)
            if other != index:
                side = np.linalg.norm(self._vframe.points[index] - self._vframe.points[other])
                sigma = float(mark_sigma * np.sqrt(2))
                sides.append(_Side(float(side), reading.metres, sigma, reading.number))
        if not group.pairs:
            return Prediction.unknown(self._sides(sides))
        one = self._judged(world, world)
        states, covariances = one.judgement.states, one.judgement.covariances
        if len(states) == 0:
            return Prediction.unknown(self._sides(sides))
        distance, variance = predicted_distances(states, covariances, self._vframe.points[index])
        basis = f"{len(one.numbers)} readings of world point {world}"
        return self._prediction(distance, variance + mark_sigma**2, sides, basis)

    def _predict_from_mark(self, mark: str, other: str, point: tuple[str, str]) -> Prediction:
        """From the stop's other readings."""
        world = self.world()
        key = f"{point[0]}/"
        sides = self._sides_of_mark(mark, other, key)
        if other not in world.names:
            return Prediction.unknown(self._sides(sides))
        index = world.names.index(other)
        known = world.positions[index]
        known_variance = float(np.trace(world.points[index].covariance)) / 2
        if key not in self._groups or not self._groups[key].pairs:
            return Prediction.unknown(self._sides(sides))
        whole = self._judged(key, key).judgement
        body = np.array(self._rig.points[point[1]], dtype=float)
        if len(whole.states):
            distance, variance = predicted_distances(whole.states, whole.covariances, known, body)
            marking = self._rig.marking_sigma**2 + self._rig.shape_sigma**2
            basis = f"{int(whole.accepted.sum())} readings of stop {point[0]}"
            return self._prediction(distance, variance + known_variance + marking, sides, basis)
        if mark not in {r.start for r in self._readings(key)}:
            return Prediction.unknown(self._sides(sides))
        alone = self._judged(key, mark).judgement
        if len(alone.states) == 0:
            return Prediction.unknown(self._sides(sides))
        distance, variance = predicted_distances(alone.states, alone.covariances, known)
        basis = f"{int(alone.accepted.sum())} readings of mark {mark}"
        return self._prediction(distance, variance + known_variance, sides, basis)

    def _prediction(
        self, distance: Array, variance: Array, sides: list[_Side], basis: str
    ) -> Prediction:
        """Predictions with the sigma of a reading added."""
        own = np.array([self.sigma(float(d)) for d in distance])
        return Prediction(distance, np.sqrt(variance + own**2), self._sides(sides), basis)

    def _sides_of_mark(self, mark: str, other: str, key: str) -> list[_Side]:
        """Triangles that a reading from a mark to a world point closes."""
        world = self.world()
        place = {point.name: point for point in world.points}
        found: list[_Side] = []
        rig = self._rig
        for reading in self._readings(key):
            if reading.start == mark and reading.end != other:
                if other in place and reading.end in place:
                    a, b = place[other], place[reading.end]
                    side = float(np.linalg.norm(a.position - b.position))
                    sigma = float(np.sqrt(np.trace(a.covariance + b.covariance)))
                    found.append(_Side(side, reading.metres, sigma, reading.number))
            elif reading.end == other and reading.start != mark:
                bodies = [
                    np.array(rig.points[(robot_point(n) or ("", ""))[1]], dtype=float)
                    for n in (mark, reading.start)
                ]
                sigma = float(np.hypot(rig.marking_sigma, rig.shape_sigma) * 2)
                side = float(np.linalg.norm(bodies[0] - bodies[1]))
                found.append(_Side(side, reading.metres, sigma, reading.number))
        return found

    def _sides(self, sides: list[_Side]) -> Sides:
        """Triangles with the readings corrected and their sigma added."""
        if not sides:
            return Sides.none()
        columns = list(zip(*sides, strict=True))
        known, read, sigma = (np.array(column) for column in columns[:3])
        of_readings = np.array([self.sigma(float(d)) for d in read]) * np.sqrt(2)
        return Sides(
            known, corrected(self._instrument, read), np.hypot(sigma, of_readings), columns[3]
        )

    def corrected(self, metres: float) -> float:
        """The distance that a reading stands for."""
        return float(corrected(self._instrument, metres))

    # -- judgements -------------------------------------------------------------------------

    def _judged(self, key: str, name: str) -> Judged:
        """What the readings of a group (of one of its marks) say; kept until they change."""
        group = self._groups.setdefault(key, _Group())
        if name not in group.judged:
            numbers, fit = self._fit(key, name)
            judgement = judge(fit, group.near.get(name))
            group.judged[name] = Judged(numbers, fit, judgement)
            if judgement.is_unique and judgement.redundancy > fit.unknowns:
                group.near[name] = judgement.states
            else:
                group.near.pop(name, None)
        return group.judged[name]

    def _fit(self, key: str, name: str) -> tuple[tuple[int, ...], DistanceFit]:
        """The readings to judge, with their entries."""
        rows = self._readings(key)
        if key in self._world_names:
            own = self._as_readings(rows)
            return own.line, place_readings(own, self._vframe)
        world = self.world()
        located = set(world.names)
        rows = [r for r in rows if r.end in located and name in (key, r.start)]
        own = self._as_readings(rows)
        if name == key:
            return own.line, pose_readings(key[:-1], own, world, self._rig)
        index = [world.names.index(end) for end in own.end]
        sigma = coordinate_sigma(world.covariance)[index]
        return own.line, place_fit(world.positions[index], sigma, own.distance, own.sigma)

    def _readings(self, key: str) -> list[KnownReading]:
        """Readings of a group in the order entered, turned to start at the world point or mark."""
        group = self._groups.get(key, _Group())
        flat = sorted((r for rows in group.pairs.values() for r in rows), key=lambda r: r.number)
        turned = []
        for r in flat:
            start, end = self._meaning(r.start), self._meaning(r.end)
            if end == key or (robot_point(end) and key not in self._world_names):
                start, end = end, start
            turned.append(KnownReading(r.number, start, end, r.metres))
        return turned

    def _as_readings(self, rows: Sequence[KnownReading]) -> Readings:
        """Readings as the survey's estimators take them; ``line`` holds the journal entries."""
        shown = np.array([r.metres for r in rows])
        return Readings(
            start=tuple(r.start for r in rows),
            end=tuple(r.end for r in rows),
            distance=corrected(self._instrument, shown),
            sigma=np.array([self.sigma(float(d)) for d in shown]),
            line=tuple(r.number for r in rows),
        )

    def _meaning(self, name: str) -> str:
        """The point that a written name stands for."""
        return self._survey.labels.get(name, name)
