"""Who may use the page: devices that were let in by a code shown in the terminal."""

import hmac
import secrets
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from survey.entry.record.entries import MAX_NAME, Entry, Person, clean_text
from validation.errors import GtvalError

ALPHABET = "23456789ABCDEFGHJKMNPQRSTUVWXYZ"
"""Without the characters that are read for one another: 0 and O, 1, I and L."""
CODE_LENGTH = 8
"""31^8 = 8.5e11 codes: at ten tries a minute, a year of guessing finds it with a chance of 6e-6."""
WRONG_CODES = 10
WINDOW = 60.0
"""So many wrong codes within so many seconds, and nobody is let in for a while."""
MAX_DEVICES = 100
"""A judgement: no room holds as many people."""

DEVICE = "page "


class AccessError(GtvalError):
    """A code that lets nobody in."""


@dataclass
class Device:
    """A phone or tablet that was let in."""

    name: str
    person: Person


class Access:
    """Codes that work once, and the devices let in by them.

    Parameters
    ----------
    announce : callable
        Told when somebody joined and the code has changed.
    clock : callable
        Seconds, for the limit on wrong codes.
    used : int
        Number of the last device of earlier sessions: undo takes back what the same device did,
        so that another one must not have its name.
    """

    def __init__(
        self,
        announce: Callable[[str], None] = lambda _text: None,
        clock: Callable[[], float] = time.monotonic,
        used: int = 0,
    ) -> None:
        self._announce = announce
        self._clock = clock
        self._used = used
        self._devices: dict[str, Device] = {}
        self._wrong: deque[float] = deque(maxlen=WRONG_CODES)
        self.code = new_code()

    def join(self, code: str, name: str) -> tuple[str, Device]:
        """The token of a device that shows the right code, which then changes.

        Raises
        ------
        AccessError
            If the code is wrong or was used, or too many wrong ones were tried.
        """
        now = self._clock()
        if len(self._wrong) == WRONG_CODES and now - self._wrong[0] < WINDOW:
            raise AccessError("too many wrong codes; wait a minute and try again")
        given = "".join(c for c in code.upper() if c in ALPHABET)
        if not hmac.compare_digest(given, self.code):
            self._wrong.append(now)
            raise AccessError("this is not the code that the terminal shows now; each works once")
        if len(self._devices) >= MAX_DEVICES:
            raise AccessError("too many devices; start the page anew")
        self.code = new_code()
        token = secrets.token_urlsafe(32)
        self._used += 1
        number = self._used
        who = clean_text(name, MAX_NAME)
        device = Device(f"{DEVICE}{number}", Person(who, f"{DEVICE}{number}"))
        self._devices[token] = device
        self._announce(f"{who or 'somebody'} joined on {device.name}")
        return token, device

    def device(self, token: str | None) -> Device | None:
        """The device with a token; None for any other."""
        return self._devices.get(token or "")


def last_device(entries: Iterable[Entry]) -> int:
    """The highest number of a device that has written to a journal; 0 if none has."""
    numbers = (e.device.removeprefix(DEVICE) for e in entries if e.device.startswith(DEVICE))
    return max((int(text) for text in numbers if text.isdecimal()), default=0)


def new_code() -> str:
    """A code to type: some 40 bits."""
    return "".join(secrets.choice(ALPHABET) for _ in range(CODE_LENGTH))


def shown_code(code: str) -> str:
    """The code in two halves: 'K7QM-3XPD'."""
    half = len(code) // 2
    return f"{code[:half]}-{code[half:]}"
