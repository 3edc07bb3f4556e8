"""A page of gtval served by a process, and devices that talk to it."""

import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Self

import httpx

GTVAL = str(Path(sys.executable).with_name("gtval"))


class WebServer:
    """A served page; killed at the end if it still runs."""

    def __init__(self, log: Path, command: list[str], prepare=None) -> None:
        self.log = log
        with log.open("wb") as stream:
            self.process = subprocess.Popen(
                [GTVAL, *command],
                stdout=stream,
                stderr=subprocess.STDOUT,
                preexec_fn=prepare,  # noqa: PLW1509  (sets a limit, nothing else)
            )
        self.url = self._said(r"the page is at (\S+)")
        self.port = self.url.rpartition(":")[2]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.kill()

    @property
    def code(self) -> str:
        """The code that the terminal shows now."""
        return re.findall(r"#([0-9A-Z]+)\)", self.log.read_text())[-1]

    @contextmanager
    def join(self, name: str = "ann") -> Iterator[httpx.Client]:
        """A device that was let in."""
        with httpx.Client(base_url=self.url, timeout=60) as client:
            joined = client.post("/join", json={"code": self.code, "name": name})
            assert joined.status_code == 200, joined.text
            yield client

    def check_sound(self) -> None:
        """Whatever was asked of it, it has neither ended nor stumbled."""
        assert self.process.poll() is None
        said = self.log.read_text()
        assert "Traceback" not in said
        assert "Exception" not in said

    def kill(self) -> None:
        """End it at once, as a dead battery would."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def stop(self) -> int:
        """End it as Ctrl-C does; its exit status."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(20)

    def memory(self) -> float:
        """Megabytes that the process has at most had at once."""
        said = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(r"VmHWM:\s+(\d+)", said)[1]) / 1e3

    def _said(self, pattern: str) -> str:
        until = time.monotonic() + 120
        while time.monotonic() < until:
            found = re.search(pattern, self.log.read_text())
            if found and self.log.read_text().rstrip().endswith(")"):
                return found[1]
            if self.process.poll() is not None:
                break
            time.sleep(0.02)
        raise AssertionError(self.log.read_text())
