"""The panel on which matches are looked at and decided on."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from laser_gt.system import SYSTEM
from validation.errors import FinalError
from validation.page.desk import Desk, english, static_files
from validation.page.heard import Heard
from validation.page.panels import Call, Waiting, answered, recorded, said_in

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

    from laser_gt.logs.decisions import Decision
    from laser_gt.panel.bench import Bench, Seen
    from validation.campaign.folder import Campaign
    from validation.page.access import Device

WORDS = english()["matches"]
FILES = ("matches.css", "matches.js", "scans.js")
KINDS = ("accept", "reject", "open")
MOST_METRES = 1e3


class MatchesPanel:
    """The matches of a campaign with scans of stops."""

    name, title = "matches", WORDS["title"]

    def has_work(self, campaign: "Campaign") -> bool:
        """Whether there are scans."""
        return SYSTEM.has_data(campaign)

    def open(self, desk: Desk) -> "OpenMatches":
        """The matches of a campaign; they are loaded when somebody looks."""
        return OpenMatches(desk)


class OpenMatches:
    """The matches of a campaign, and what people decide about them."""

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._bench: Bench | None = None
        self._heard = Heard()
        self.static: Mapping[str, bytes] = static_files("laser_gt.panel", FILES)
        self.calls: Sequence[Call] = [
            Call("GET", "", self.page),
            Call("GET", "list", self.rows),
            Call("GET", "pair", self.pair),
            Call("POST", "try", self.trial),
            Call("POST", "decide", self.decide),
            Call("POST", "batch", self.batch),
            Call("POST", "undo", self.undo),
        ]

    @property
    def bench(self) -> "Bench":
        """Where the matches are, made when it is first asked for."""
        if self._bench is None:
            from laser_gt.panel.bench import Bench  # noqa: PLC0415  (numpy, and all of laser GT)

            self._bench = Bench(self._desk)
        return self._bench

    def version(self) -> str:
        """Changes with the scans, the decisions, and what was made of them."""
        return "" if self._bench is None else self._bench.version()

    def waiting(self) -> list[Waiting]:
        """How many matches are held up, as the last run, or this page since, has them."""
        seen = None if self._bench is None else self._bench.refresh()
        if seen is not None:
            count = seen.matching.counts["may be wrong"]
        else:
            from laser_gt.panel.stored import stored_held_up  # noqa: PLC0415  (csv tables)

            found = stored_held_up(self._desk.campaign().results)
            if found is None:
                return []
            count = found
        text = WORDS["waiting"].replace("{count}", str(count)) if count else WORDS["none_waits"]
        return [Waiting(text, done=not count, count=count)]

    def close(self) -> None:
        """Nothing is held."""

    async def page(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """The whole panel."""
        values = await self._values()
        return self._desk.html("laser_gt.panel", "matches.html.j2", "matches", device, values)

    async def rows(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """The summary and the list, to be put in place of what the page shows."""
        values = await self._values()
        return self._desk.html("laser_gt.panel", "list.html.j2", "matches", device, values)

    async def _values(self) -> dict[str, Any]:
        """What both show."""
        from starlette.concurrency import run_in_threadpool  # noqa: PLC0415  (an extra)

        def made() -> dict[str, Any]:
            from laser_gt.panel.told import rows_told, summary_told  # noqa: PLC0415  (numpy)

            bench = self.bench
            seen = bench.refresh()
            state: dict[str, Any] = {"problem": bench.problem, "loading": bench.is_loading}
            state["progress"] = round(100 * bench.progress)
            if seen is not None:
                state |= {"rows": rows_told(seen), "summary": summary_told(seen)}
            return {"state": state, "data": {}}

        return await run_in_threadpool(made)

    async def pair(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """One pair with its scans."""
        names = (request.query_params.get("reference", ""), request.query_params.get("moving", ""))

        def made() -> dict[str, Any]:
            from laser_gt.panel.told import pair_told  # noqa: PLC0415  (numpy)

            return pair_told(self.bench.loaded(), names)

        return await answered(made)

    async def trial(self, request: "Request", device: "Device") -> "Response":  # noqa: ARG002
        """The match of a pair from a guess, at once."""
        said = await said_in(request)
        pair, guess = _pair(said), _pose(said)

        def made() -> dict[str, Any]:
            import time  # noqa: PLC0415

            from laser_gt.panel.told import match_told  # noqa: PLC0415  (numpy)

            seen, started = self.bench.loaded(), time.perf_counter()
            found = self.bench.tried(pair, guess)
            sweeps = seen.outcome.inputs.by_stop
            told = match_told(seen, found, sweeps[found.reference], sweeps[found.moving])
            return {"match": told, "milliseconds": round(1e3 * (time.perf_counter() - started))}

        return await answered(made)

    async def decide(self, request: "Request", device: "Device") -> "Response":
        """Record a decision about one pair."""
        from laser_gt.logs.decisions import Decision  # noqa: PLC0415  (numpy)
        from validation.page.requests import RefusedError, text_field  # noqa: PLC0415  (an extra)

        said = await said_in(request)
        kind, note = text_field(said, "decision", needed=True), text_field(said, "note")
        name = text_field(said, "id")
        guess = _pose(said) if kind == "guess" else None
        if kind not in (*KINDS, "guess"):
            raise RefusedError(400, f"there is no decision '{kind[:40]}'")
        names = _pair(said)

        def made() -> dict[str, Any]:
            if name in self._heard:
                return {"recorded": 0}
            seen = self.bench.loaded()
            one = seen.match(names)
            decision = Decision(one.reference, one.moving, kind, guess, device.by, note)
            count = self.bench.decide([decision], seen)
            self._heard.add(name)
            return {"recorded": count}

        return await recorded(made)

    async def batch(self, request: "Request", device: "Device") -> "Response":
        """Accept all that are held up by the same alone, or say what that would place.

        Both are of the files as they are now. What is accepted are the pairs that the page has
        shown, or none.
        """
        from validation.page.requests import flag_field, text_field  # noqa: PLC0415  (an extra)

        said = await said_in(request)
        kind, look = text_field(said, "kind", needed=True), flag_field(said, "look")

        def made() -> dict[str, Any]:
            seen = self.bench.current()
            decisions = _accepting(seen, kind, device.by)
            pairs = [[one.reference, one.moving] for one in decisions]
            if not look:
                if not _same_pairs(said.get("pairs", pairs), pairs):
                    raise FinalError(WORDS["batch_changed"])
                return {"recorded": self.bench.decide(decisions, seen)}
            before = seen.placed()
            after = seen.placed(seen.with_decisions(decisions))
            more = [stop for stop in after if stop not in set(before)]
            return {"count": len(pairs), "pairs": pairs, "more": more, "placed": len(after)}

        return await answered(made)

    async def undo(self, request: "Request", device: "Device") -> "Response":
        """Take back what this person decided last."""
        await said_in(request)

        def made() -> dict[str, Any]:
            back = self.bench.undo(device.by)
            return {"pairs": [[one.reference, one.moving] for one in back]}

        return await answered(made)


def _accepting(seen: "Seen", kind: str, by: str) -> "list[Decision]":
    """Decisions that accept all matches with those objections and no other.

    Raises
    ------
    GtvalError
        If there is none, or no more.
    """
    from laser_gt.logs.decisions import Decision  # noqa: PLC0415  (numpy)

    some = seen.sole_objections().get(kind, [])
    if not some:
        raise FinalError("no match is held up by that alone any more")
    note = f"all held up only by: {kind}"
    return [Decision(one.reference, one.moving, "accept", None, by, note) for one in some]


def _same_pairs(shown: Any, pairs: list[list[str]]) -> bool:
    """Whether what a page has shown is what there is, in any order."""
    if not isinstance(shown, list) or len(shown) != len(pairs):
        return False
    return all(pair in shown for pair in pairs)


def _pair(said: dict[str, Any]) -> tuple[str, str]:
    """The two stops that a request names."""
    from validation.page.requests import text_field  # noqa: PLC0415  (an extra)

    return text_field(said, "reference", needed=True), text_field(said, "moving", needed=True)


def _pose(said: dict[str, Any]) -> Any:
    """The (3,) pose that a request states, metres and radians."""
    import numpy as np  # noqa: PLC0415  (slow to load)

    from validation.page.requests import RefusedError  # noqa: PLC0415  (an extra)

    values = [said.get(name) for name in ("x", "y", "theta")]
    numbers = [v for v in values if isinstance(v, int | float) and not isinstance(v, bool)]
    if len(numbers) != 3 or not all(abs(v) <= MOST_METRES for v in numbers):
        raise RefusedError(400, "'x', 'y' and 'theta' must be numbers in metres and radians")
    x, y, theta = map(float, numbers)
    return np.array([x, y, float(np.arctan2(np.sin(theta), np.cos(theta)))])


PANEL = MatchesPanel()
