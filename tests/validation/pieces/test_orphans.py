"""Workers end with the process that started them, however it ends."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

_SCRIPT = """
import os, time
from validation.pieces.processes import as_they_end

def job(number):
    print(os.getpid(), flush=True)
    time.sleep(300)

if __name__ == "__main__":
    list(as_they_end(job, range(4), 2))
"""


def _runs(number: int) -> bool:
    try:
        state = Path(f"/proc/{number}/stat").read_text(encoding="utf-8").rpartition(")")[2]
    except OSError:
        return False
    return state.split()[0] != "Z"


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked up in /proc")
def test_workers_of_a_killed_process_end(tmp_path):
    script = tmp_path / "work.py"
    script.write_text(_SCRIPT, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, script], stdout=subprocess.PIPE, text=True, env=environment
    ) as main:
        workers = [int(main.stdout.readline()) for _ in range(2)]
        assert all(map(_runs, workers))
        main.send_signal(signal.SIGKILL)
        main.wait()
        until = time.monotonic() + 10
        while any(map(_runs, workers)) and time.monotonic() < until:
            time.sleep(0.05)
        assert not any(map(_runs, workers))
