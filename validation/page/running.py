"""`python -m validation.page.running CAMPAIGN`: a run that tells its progress line by line."""

import contextlib
import json
import os
import signal
import sys
from pathlib import Path

from validation.errors import GtvalError
from validation.page.runner import STOPPED


def main(folder: str) -> int:
    """Exit status of a run of a campaign folder; progress and errors as lines of JSON."""
    # Started in a session of its own, it may have been told to pass interrupts over.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    last = [-1.0]

    def report(what: str, share: float) -> None:
        if share - last[0] >= 0.001 or share >= 1:
            last[0] = share
            tell(what=what, share=round(share, 4))

    try:
        from validation.whole_run import run_and_write  # noqa: PLC0415  (after the setting)

        run_and_write(Path(folder), report)
    except GtvalError as error:
        tell(error=str(error))
        return 2
    except KeyboardInterrupt:
        return STOPPED
    return 0


def tell(**said: object) -> None:
    """A line of JSON; nobody may be left to read it, and that ends nothing."""
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.write(json.dumps(said) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    status = main(sys.argv[1])
    with contextlib.suppress(OSError):
        sys.stdout.close()
    os._exit(status) if sys.stdout.closed else sys.exit(status)
