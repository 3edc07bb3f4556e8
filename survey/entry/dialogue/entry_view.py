"""An entry session as one looks at it: what was entered, what is doubtful, what is left."""

import threading
from collections.abc import Iterable
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from survey.entry.dialogue.guide import Guide
from survey.entry.record.journal import Journal
from survey.entry.record.readings_file import ReadingsFile
from survey.entry.record.remembered import RememberedDoubts
from survey.entry.record.state import EntryState, Pair, replayed
from survey.entry.room.double import agreement
from survey.entry.room.groups import group_key
from survey.entry.room.targets import Station, Target
from survey.settings import EntrySettings, SurveySettings
from validation.campaign.folder import Campaign

if TYPE_CHECKING:
    from survey.entry.room.room_checks import PointStatus, RoomChecks


class EntryView:
    """What stands after the entries of a journal, and what the readings say of the room.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    journal : Journal
        Read; open for writing or not.
    """

    def __init__(self, campaign: Campaign, journal: Journal) -> None:
        self.campaign = campaign
        self.survey = campaign.section("survey", SurveySettings)
        self.settings: EntrySettings = self.survey.entry
        self.journal = journal
        self.state: EntryState = replayed(
            journal.entries,
            agreement(campaign.settings.instrument, self.survey),
            second_measures=self.settings.second != "type",
            heading="distance" if self.survey.units == "m" else "distance [m]",
        )
        self.guide = Guide(campaign, self.settings, self.state, self._doubtful_pairs)
        doubts = journal.path.with_suffix(".doubts")
        self._remembered = RememberedDoubts(doubts, campaign)
        self.readings_file = ReadingsFile(campaign.folder / self.survey.readings, self.survey.units)
        self.version = 0
        """Grows with every entry; a page asks for it to know whether it is up to date."""
        self.changing: AbstractContextManager[bool] = threading.RLock()
        self._checks: RoomChecks | None = None

    @property
    def checks(self) -> "RoomChecks":
        """What the readings say of the room; made, and numpy loaded, when first needed."""
        if self._checks is None:
            from survey.entry.room.room_checks import RoomChecks  # noqa: PLC0415

            with self.changing:
                if self._checks is None:
                    checks = RoomChecks(self.campaign.settings, self.survey, self.state)
                    checks.take_as_examined(self._remembered.recall(self.journal.entries))
                    self._checks = checks
        return self._checks

    def doubtful(self) -> list[int]:
        """All doubtful readings, in the order entered."""
        recalled = self._recalled(self.state.pairs)
        if recalled is not None:
            return recalled
        while self.examine():
            pass
        self._remember()
        return self.doubtful_so_far()

    def disagreeing(self) -> list[Pair]:
        """Pairs of which no two entries by different people agree: none of them counts."""
        return [pair for pair in self.state.doubled if self.state.disagrees(pair)]

    def doubtful_so_far(self) -> list[int]:
        """Those of all stops and world points that were examined since they last changed."""
        return self.checks.doubtful_so_far() if self.state.pairs else []

    def would_fit(self, number: int) -> str:
        """What a doubtful reading would have to be for the others; '' where they do not say."""
        return self.checks.would_fit(number)

    def unchecked(self) -> list[int]:
        """Readings that nothing checks yet, in the order entered."""
        return self.checks.unchecked() if self.state.pairs else []

    def unexamined(self) -> int:
        """Stops and world points whose readings were not looked through since they changed."""
        return self.checks.examine(0) if self.state.pairs else 0

    def examine(self) -> int:
        """Look through the readings of one more stop or world point; how many are left."""
        if not self.state.pairs:
            return 0
        return self.checks.examine(1)

    def doubtful_at(self, station: Station) -> list[int]:
        """Doubtful readings of a station, neither kept nor measured again."""
        pairs = [target.pair for target in station.targets]
        if not any(self.state.counting(pair) for pair in pairs):
            return []
        return self.checks.doubtful(pairs)

    def status(self, target: Target) -> "PointStatus | None":
        """How well the world point or stop is known that a target belongs to."""
        return self.checks.status(target.pair)

    def _doubtful_pairs(self, station: Station) -> set[Pair]:
        """Doubtful pairs of a station that has nothing else left to measure."""
        numbers = self._recalled(target.pair for target in station.targets)
        if numbers is None:
            numbers = self.doubtful_at(station)
            self._remember()
        return {self.state.entries[number].pair for number in numbers}

    def _recalled(self, pairs: Iterable[Pair]) -> list[int] | None:
        """Doubtful readings of some pairs as found before the start; None where not known."""
        if self._checks is not None:
            return None
        wanted = {pair for pair in pairs if self.state.counting(pair)}
        keys = {group_key(pair, self.guide.names.world) for pair in wanted}
        found = self._remembered.recall(self.journal.entries)
        if not keys <= found.keys():
            return None
        numbers = (number for key in keys for number in found[key] - self.state.kept)
        return sorted(number for number in numbers if self.state.entries[number].pair in wanted)

    def _remember(self) -> None:
        """Keep what is doubtful for the next start."""
        if self._checks is not None and self.journal.is_open:
            self._remembered.keep(self.journal.entries, self._checks.examined)
