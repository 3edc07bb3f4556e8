"""A run of the campaign in a process of its own: started, watched and stopped from the page.

The page stays quick, its memory small, and a run that fails takes nobody along. The process
writes its results whole or not at all; when the page ends before it, it goes on to its end.
"""

import json
import os
import signal
import subprocess
import sys
import threading
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import IO, Any, Literal

from validation.errors import GtvalError

STOPPED = 130
"""Exit status of a run that was interrupted, as that of the command."""
PATIENCE = 10.0
"""Seconds that a run has to end orderly once it is stopped. A judgement: its longest single step
that hears no interrupt takes a second or two."""
MOST_SAID = 2_000
"""Characters kept of what a failed run said."""

State = Literal["none", "running", "stopping", "done", "stopped", "failed"]


@dataclass(frozen=True)
class RunState:
    """How far a run is.

    Parameters
    ----------
    number : int
        Of the run since the page was opened; 0 before the first.
    state : {"none", "running", "stopping", "done", "stopped", "failed"}
        Whether there is one.
    what : str
        What is being done; why it failed.
    share : float
        Of the work that is done, 0 to 1.
    by : str
        Who started it.
    """

    number: int = 0
    state: State = "none"
    what: str = ""
    share: float = 0.0
    by: str = ""

    @property
    def is_at_work(self) -> bool:
        """Whether a process is running."""
        return self.state in {"running", "stopping"}

    def as_json(self) -> dict[str, Any]:
        """For scripts of the page."""
        return asdict(self)


class Runner:
    """Runs of one campaign, one at a time.

    Parameters
    ----------
    folder : Path
        The campaign folder.
    command : sequence of str
        What is called with the folder; `validation.page.running` by default.
    """

    def __init__(self, folder: Path, command: tuple[str, ...] = ()) -> None:
        self._command = [
            *(command or (sys.executable, "-m", "validation.page.running")),
            str(folder),
        ]
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self.state = RunState()

    def start(self, by: str) -> RunState:
        """Start a run.

        Raises
        ------
        GtvalError
            If one is at work, or no process can be started.
        """
        with self._lock:
            if self.state.is_at_work:
                who = f" by {self.state.by}" if self.state.by else ""
                raise GtvalError(f"a run is at work already, started{who}; stop it first, or wait")
            try:
                process = subprocess.Popen(  # noqa: S603  (our own program)
                    self._command,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                    text=True,
                    encoding="utf-8",
                    errors="replace",
                    env={**os.environ, "PYTHONUNBUFFERED": "1"},
                    start_new_session=True,  # Ctrl-C ends the page, not what it started
                )
            except OSError as error:
                raise GtvalError(f"no run can be started: {error.strerror or error}") from error
            self._process = process
            self.state = RunState(self.state.number + 1, "running", "starting", 0.0, by)
            threading.Thread(target=self._watch, args=(process,), daemon=True).start()
            return self.state

    def stop(self) -> RunState:
        """Interrupt the run that is at work, if there is one; nothing is half-written."""
        with self._lock:
            process = self._process
            if process is None or not self.state.is_at_work:
                return self.state
            self.state = replace(self.state, state="stopping", what="stopping")
        process.send_signal(signal.SIGINT)
        killing = threading.Timer(PATIENCE, process.kill)
        killing.daemon = True
        killing.start()
        return self.state

    def close(self) -> None:
        """The page ends; a run that is at work goes on to its end."""
        self._process = None

    def _watch(self, process: "subprocess.Popen[str]") -> None:
        """Take over what a process says until it ends."""
        assert process.stdout is not None
        assert process.stderr is not None
        errors: list[str] = []
        reading = threading.Thread(target=_keep_end, args=(process.stderr, errors), daemon=True)
        reading.start()
        told = ""
        for line in process.stdout:
            said = _said(line)
            told = str(said.get("error", told))
            if "share" in said and self.state.state == "running":
                what, share = str(said.get("what", "")), float(said["share"])
                self.state = replace(self.state, what=what, share=min(max(share, 0.0), 1.0))
        status = process.wait()
        reading.join(1)  # a process that it started itself may hold the pipe open
        process.stdout.close()
        if not reading.is_alive():
            process.stderr.close()
        with self._lock:
            stopped = self.state.state == "stopping" and status != 0
            if status == 0:
                self.state = replace(self.state, state="done", what="", share=1.0)
            elif stopped or status == STOPPED:
                self.state = replace(self.state, state="stopped", what="")
            else:
                what = told or "".join(errors)[-MOST_SAID:] or f"exit status {status}"
                self.state = replace(self.state, state="failed", what=what)


def _said(line: str) -> dict[str, Any]:
    """The members of a line of JSON; none where it is something else."""
    try:
        said = json.loads(line)
    except ValueError:
        return {}
    return said if isinstance(said, dict) else {}


def _keep_end(stream: IO[str], errors: list[str]) -> None:
    """Read all, and keep the last lines."""
    for line in stream:
        errors.append(line)
        del errors[:-40]
