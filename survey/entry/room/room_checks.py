"""The checks of an entry session: readings against everything that the others say."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from survey.entry.record.entries import FROM_FILE, FROM_FILE_UNUSED, Entry
from survey.entry.record.numbers import TypedDistance, parse_distance, plain
from survey.entry.record.state import EntryState, Pair
from survey.entry.room.checks import (
    SHARP,
    Verdict,
    has_too_many_decimals,
    other_ends,
    suspects_of,
    verdict,
)
from survey.entry.room.fits import test_values
from survey.entry.room.groups import FRAME
from survey.entry.room.knowledge import Judged, KnownReading, RoomKnowledge
from survey.entry.room.prediction import Prediction
from survey.entry.room.slips import fitting_originals, shown_decimals
from survey.readings.levels import CRITICAL
from survey.settings import EntrySettings, SurveySettings
from validation.campaign.folder import CampaignSettings
from validation.poses.angles import Array

UNCHECKED = 0.01
"""Redundancy number up to which nothing checks a reading: an error must exceed 4.13 / sqrt(0.01) =
41 standard deviations, a decimetre, to show (Baarda)."""
_NEVER: tuple[int, frozenset[int]] = (-1, frozenset())


@dataclass(frozen=True)
class Expectation:
    """What a reading should be, from all that was known before it.

    Parameters
    ----------
    prediction : Prediction
        Of its distance.
    suspects : tuple of int
        Entries that were suspected before it.
    """

    prediction: Prediction
    suspects: tuple[int, ...]


@dataclass(frozen=True)
class PointStatus:
    """How well a world point or stop is known by now.

    Parameters
    ----------
    name : str
        Of the point or stop.
    readings, redundancy : int
        Readings that count, and how many of them are more than needed.
    m0 : float or None
        Standard deviation of unit weight; None without redundancy.
    sigmas : tuple of float
        Of x, y in metres (and theta in radians); empty while the place is open.
    good_enough : bool
        Whether a stop is as exact as planned.
    text : str
        The same in a sentence.
    """

    name: str
    readings: int
    redundancy: int
    m0: float | None
    sigmas: tuple[float, ...]
    good_enough: bool
    text: str


class RoomChecks:
    """Knowledge of the room that follows the state of an entry session.

    Parameters
    ----------
    campaign : CampaignSettings
        Frame, rig, instrument.
    survey : SurveySettings
        World points, labels, when a stop is good enough.
    state : EntryState
        What counts; `update` is called for every pair that changes.
    """

    def __init__(
        self, campaign: CampaignSettings, survey: SurveySettings, state: EntryState
    ) -> None:
        self._instrument = campaign.instrument
        self._settings: EntrySettings = survey.entry
        self._units = survey.units
        self._rig = tuple(campaign.robot_frame.points)
        self._state = state
        self.knowledge = RoomKnowledge(campaign, survey)
        self._examined: dict[str, tuple[int, frozenset[int]]] = {}
        self._unchecked: dict[str, tuple[int, frozenset[int]]] = {}
        for pair in state.pairs:
            self.update(pair)
        self.knowledge.world()  # all stops need it; better now than at a reading

    @property
    def examined(self) -> dict[str, frozenset[int]]:
        """Doubtful readings, kept ones among them, of all groups examined since they changed."""
        groups = self.knowledge.groups()
        return {
            key: numbers
            for key, (changes, numbers) in self._examined.items()
            if groups.get(key) == changes
        }

    def take_as_examined(self, found: Mapping[str, frozenset[int]]) -> None:
        """Take over what was found before of the very same readings."""
        groups = self.knowledge.groups()
        self._examined |= {key: (groups[key], found[key]) for key in found.keys() & groups.keys()}

    def update(self, pair: Pair) -> None:
        """Take over what counts of a pair now."""
        self._know(pair, self._state.counting(pair))

    def expect(self, entry: Entry) -> Expectation:
        """What a reading that is about to be recorded should be.

        A reading that it replaces says nothing any more from here on.
        """
        if entry.of:
            self._know(entry.pair, [n for n in self._state.counting(entry.pair) if n != entry.of])
        prediction = self.knowledge.predict(entry.start, entry.end)
        return Expectation(prediction, self._suspects(entry.pair))

    def verdict(
        self, entry: Entry, typed: TypedDistance, expected: Expectation, ends: Iterable[str]
    ) -> Verdict:
        """What to say of a reading that has been recorded.

        Parameters
        ----------
        entry : Entry
            The reading.
        typed : TypedDistance
            As typed.
        expected : Expectation
            What was known before it.
        ends : iterable of str
            Points that the laser could have pointed at instead.
        """
        metres = self.knowledge.corrected(typed.metres)
        suspects = tuple(
            number
            for number in self._suspects(entry.pair)
            if number not in expected.suspects and number not in self._state.kept
        )
        prediction = expected.prediction
        found = verdict(typed, metres, prediction, suspects, entry.number, self._instrument)
        if found.status == "doubtful" and prediction.checks:
            others = other_ends(self.knowledge, entry.start, entry.end, metres, ends)
            found = replace(found, other_ends=others)
        return found

    def doubtful(self, pairs: Iterable[Pair]) -> list[int]:
        """Doubtful readings of some pairs, not kept, in the order entered."""
        wanted = set(pairs)
        keys = {self.knowledge.group_key(pair) for pair in wanted if self._state.counting(pair)}
        return sorted(
            number
            for key in keys
            for number in self._doubts(key)
            if self._state.entries[number].pair in wanted
        )

    def examine(self, most: float = inf) -> int:
        """How many groups of readings were not looked through yet, after so many more were."""
        groups = self.knowledge.groups()
        waiting = [
            key for key, changes in groups.items() if self._examined.get(key, _NEVER)[0] != changes
        ]
        for number, key in enumerate(waiting):
            if number >= most:
                return len(waiting) - number
            self._doubts(key)
        return 0

    def would_fit(self, number: int) -> str:
        """What a doubtful reading would have to be for the others: '8.096 (one digit wrong)'.

        '' where the others do not say, or say several values none of which a slip explains.
        """
        entry = self._state.entries[number]
        others = [n for n in self._state.counting(entry.pair) if n != number]
        with self.knowledge.supposing(entry.pair, self._known(others)):
            prediction = self.knowledge.predict(entry.start, entry.end)
        if not prediction.checks or float(prediction.sigmas.min()) > SHARP:
            return ""
        shown = shown_decimals(self._instrument)
        typed = TypedDistance(f"{entry.metres or 0.0:.{shown}f}", entry.metres or 0.0)
        originals = fitting_originals(
            typed,
            self._instrument,
            lambda value: prediction.misfit(self.knowledge.corrected(value)),
            CRITICAL,
        )
        if originals:
            return f"{plain(originals[0].metres)} ({originals[0].slip})"
        distances = prediction.distances
        if float(np.ptp(distances)) > SHARP or prediction.misfit(float(distances[0])) > CRITICAL:
            return ""
        instrument = self._instrument
        return plain(round((float(distances[0]) - instrument.offset) / instrument.scale, shown))

    def unchecked(self) -> list[int]:
        """Readings that nothing checks yet: an error of any size would fit."""
        groups = self.knowledge.groups()
        for key, changes in groups.items():
            if self._unchecked.get(key, _NEVER)[0] != changes:
                self._unchecked[key] = changes, self._not_checked(key)
        return sorted(frozenset().union(*(self._unchecked[key][1] for key in groups)))

    def _not_checked(self, key: str) -> frozenset[int]:
        """Readings of a group whose errors the others would not show."""
        numbers = {
            number
            for pair in self._state.pairs
            if len(pair) == 2 and self.knowledge.group_key(pair) == key
            for number in self._state.counting(pair)
        }
        if key == FRAME:  # the nominal lengths check them
            return frozenset()
        for one in self.knowledge.judged(key):
            numbers -= set(_checked(one))
        return frozenset(numbers)

    def doubtful_so_far(self) -> list[int]:
        """Doubtful readings of all groups that were examined, not kept, in the order entered."""
        return sorted(frozenset().union(*self.examined.values()) - self._state.kept)

    def status(self, pair: Pair) -> PointStatus | None:
        """How well the world point or stop is known that a pair belongs to."""
        key = self.knowledge.group_key(pair)
        if key == FRAME:
            return None
        judged = self.knowledge.judged(key)
        if not judged:
            return None
        if not key.endswith("/"):
            found = self.knowledge.world_precision(key)
            return _status(f"world point {key}", judged, found, enough=False)
        found = self.knowledge.stop_precision(key[:-1])
        enough = found is not None and self._good_enough(key[:-1], found[0], judged)
        return _status(f"stop {key[:-1]}", judged, found, enough=enough)

    def _good_enough(self, stop: str, sigmas: Array, judged: Sequence[Judged]) -> bool:
        """Whether a stop is as exact as planned, checked mark by mark, with nothing doubtful."""
        if self._doubts(f"{stop}/"):
            return False
        ends: dict[str, set[str]] = {}
        for number in judged[0].numbers:
            entry = self._state.entries[number]
            mark, other = sorted((entry.start, entry.end), key=lambda name: "/" not in name)
            ends.setdefault(mark, set()).add(other)
        seen = [len(ends.get(f"{stop}/{point}", ())) for point in self._rig]
        return bool(
            sigmas[:2].max() <= self._settings.pose_sigma
            and sigmas[2] <= self._settings.heading_sigma
            and min(seen) >= self._settings.least_world_points
        )

    def _know(self, pair: Pair, numbers: Sequence[int]) -> None:
        if len(pair) == 2:
            self.knowledge.set_readings(pair, self._known(numbers))

    def _known(self, numbers: Sequence[int]) -> list[KnownReading]:
        """Readings of the journal as the knowledge of the room takes them."""
        entries = [self._state.entries[n] for n in numbers]
        return [KnownReading(e.number, e.start, e.end, e.metres or 0.0) for e in entries]

    def _suspects(self, pair: Pair) -> tuple[int, ...]:
        key = self.knowledge.group_key(pair)
        return () if key == FRAME else suspects_of(self.knowledge.judged(key))

    def _doubts(self, key: str) -> list[int]:
        """Doubtful readings of a group: those that do not fit the others, not kept."""
        changes = self.knowledge.groups().get(key, 0)
        if self._examined.get(key, _NEVER)[0] != changes:
            self._examined[key] = changes, self._misfits(key) | self._too_fine(key)
        return sorted(self._examined[key][1] - self._state.kept)

    def _too_fine(self, key: str) -> frozenset[int]:
        """Readings of a group typed with more decimals than the instrument shows."""
        numbers = (
            number
            for pair in self._state.pairs
            if len(pair) == 2 and self.knowledge.group_key(pair) == key
            for number in self._state.counting(pair)
        )
        return frozenset(filter(self._is_too_fine, numbers))

    def _is_too_fine(self, number: int) -> bool:
        entry = self._state.entries[number]
        if entry.device in {FROM_FILE, FROM_FILE_UNUSED} or not entry.text:
            return False  # a file may hold means
        with suppress(ValueError):
            typed = parse_distance(entry.text, self._instrument, self._units)
            return has_too_many_decimals(typed, self._instrument)
        return False

    def _misfits(self, key: str) -> frozenset[int]:
        """Readings of a group that do not fit the others."""
        if key == FRAME:
            return frozenset(self._misfits_in_frame())
        found: set[int] = set()
        for one in self.knowledge.judged(key):
            found |= set(one.entries_of(one.judgement.suspects)) | _unlikely(one)
        return frozenset(found)

    def _misfits_in_frame(self) -> set[int]:
        found = set()
        for pair in self._state.pairs:
            if len(pair) != 2 or self.knowledge.group_key(pair) != FRAME:
                continue
            for number in self._state.counting(pair):
                entry = self._state.entries[number]
                metres = self.knowledge.corrected(entry.metres or 0.0)
                if self.knowledge.predict(entry.start, entry.end).misfit(metres) > CRITICAL:
                    found.add(number)
        return found


def _checked(one: Judged) -> list[int]:
    """Readings of which an error would show: of as many solutions as there are, in all."""
    judgement = one.judgement
    if judgement.why_open is not None or not len(judgement.states) or judgement.redundancy <= 0:
        return []
    if judgement.explanations:  # something shows
        return list(one.numbers)
    spare = np.min([test_values(one.fit, state)[1] for state in judgement.states], axis=0)
    return [number for number, r in zip(one.numbers, spare, strict=True) if r > UNCHECKED]


def _unlikely(one: Judged) -> set[int]:
    """Readings that fit the others, but worse than chance allows one in a thousand."""
    judgement = one.judgement
    if not judgement.is_unique or judgement.redundancy <= 0 or judgement.explanations:
        return set()
    w, _ = test_values(one.fit, judgement.states[0])
    return {number for number, value in zip(one.numbers, w, strict=True) if abs(value) > CRITICAL}


def _status(
    name: str,
    judged: Sequence[Judged],
    precision: tuple[Array, float | None] | None,
    *,
    enough: bool,
) -> PointStatus:
    """Counts, m0 and sigmas with the sentence that says them."""
    readings = sum(len(one.numbers) for one in judged)
    redundancy = sum(max(one.judgement.redundancy, 0) for one in judged)
    sigmas: tuple[float, ...] = ()
    if precision is None:
        # No pose yet, or something is doubtful: that of the readings which fit, mark by mark.
        cost = sum(one.judgement.cost for one in judged)
        m0 = (cost / redundancy) ** 0.5 if redundancy else None
    else:
        sigmas, m0 = tuple(map(float, precision[0])), precision[1]
    text = f"{name}: {readings} reading{'' if readings == 1 else 's'}, {redundancy} to spare"
    if m0 is not None:
        text += f", m0 {m0:.1f}"
    if sigmas:
        text += f", ± {1000 * max(sigmas[:2]):.1f} mm"
    if len(sigmas) == 3:
        text += f", ± {1000 * sigmas[2]:.1f} mrad"
    return PointStatus(name, readings, redundancy, m0, sigmas, enough, text)
