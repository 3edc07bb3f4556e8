"""Who may use the page: devices that were let in by a code shown in the terminal."""

import contextlib
import hashlib
import hmac
import ipaddress
import json
import os
import secrets
import time
from collections import OrderedDict, deque
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

from validation.errors import GtvalError
from validation.page.people import MAX_NAME, Person, clean_text

ALPHABET = "23456789ABCDEFGHJKMNPQRSTUVWXYZ"
"""Without the characters that are read for one another: 0 and O, 1, I and L."""
CODE_LENGTH = 8
"""31^8 = 8.5e11 codes: at ten tries a minute, a year of guessing finds it with a chance of 6e-6."""
WRONG_CODES = 10
WINDOW = 60.0
"""So many wrong codes from one address within so many seconds, and it must wait."""
MAX_ADDRESSES = 10_000
"""Addresses remembered: at ten tries a minute each, an hour of guessing finds the code with a
chance of 7e-6."""
MAX_AGE = 7 * 86400.0
"""Seconds that a device stays let in. A judgement: a campaign takes days."""
MAX_DEVICES = 100
"""A judgement: no room holds as many people."""

DEVICE = "page "


class AccessError(GtvalError):
    """A code that lets nobody in."""


@dataclass
class Device:
    """A phone or tablet that was let in.

    Parameters
    ----------
    name : str
        Its name in what it writes.
    person : Person
        Who is at it.
    joined : float
        When it was let in, seconds since 1970.
    """

    name: str
    person: Person
    joined: float = 0.0

    @property
    def by(self) -> str:
        """Who decides here: the person, or the device of one who gave no name."""
        return self.person.name or self.name


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
    store : Path, optional
        Where the devices are kept, so that they stay let in after a restart: hashes of what they
        show, which let nobody in.
    prefix : str
        Begins the names of the devices.
    """

    def __init__(
        self,
        announce: Callable[[str], None] = lambda _text: None,
        clock: Callable[[], float] = time.monotonic,
        used: int = 0,
        store: Path | None = None,
        prefix: str = DEVICE,
    ) -> None:
        self._announce = announce
        self._clock = clock
        self._store = store
        self._prefix = prefix
        self._devices: dict[str, Device] = {} if store is None else _kept(store)
        numbers = (_number_of(device.name) for device in self._devices.values())
        self._used = max([used, *numbers])
        self._wrong: OrderedDict[str, deque[float]] = OrderedDict()
        self.code = new_code()

    def join(self, code: str, name: str, address: str = "") -> tuple[str, Device]:
        """The token of a device that shows the right code, which then changes.

        Parameters
        ----------
        code, name : str
            As typed.
        address : str
            Where the device is; only who tries wrong codes must wait, nobody else.

        Raises
        ------
        AccessError
            If the code is wrong or was used, or too many wrong ones were tried from there.
        """
        now = self._clock()
        wrong = self._wrong.get(address, deque())
        if len(wrong) == WRONG_CODES and now - wrong[0] < WINDOW:
            raise AccessError("too many wrong codes from this device; wait a minute and try again")
        given = "".join(c for c in code.upper() if c in ALPHABET)
        if not hmac.compare_digest(given, self.code):
            self._note_wrong(address, now)
            raise AccessError("this is not the code that the terminal shows now; each works once")
        self._wrong.pop(address, None)
        self.code = new_code()
        token = secrets.token_urlsafe(32)
        self._used += 1
        who = clean_text(name, MAX_NAME)
        name = f"{self._prefix}{self._used}"
        device = Device(name, Person(who, name), time.time())
        self._devices[_hash(token)] = device
        self._forget_old()
        self.keep()
        self._announce(f"{who or 'somebody'} joined on {device.name}")
        return token, device

    def _forget_old(self) -> None:
        """Of more devices than may be, those let in longest ago have to type a code again."""
        for key, _ in sorted(self._devices.items(), key=lambda item: item[1].joined)[:-MAX_DEVICES]:
            del self._devices[key]

    def _note_wrong(self, address: str, now: float) -> None:
        wrong = self._wrong.setdefault(address, deque(maxlen=WRONG_CODES))
        wrong.append(now)
        self._wrong.move_to_end(address)
        while len(self._wrong) > MAX_ADDRESSES:
            self._wrong.popitem(last=False)

    def device(self, token: str | None) -> Device | None:
        """The device with a token; None for any other."""
        found = self._devices.get(_hash(token or ""))
        return found if found and time.time() - found.joined < MAX_AGE else None

    def keep(self) -> None:
        """Write down who is let in, for a restart; no harm is done where that fails."""
        if self._store is None:
            return
        said = {key: asdict(device) for key, device in self._devices.items()}
        with contextlib.suppress(OSError):
            handle = os.open(self._store, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
            with os.fdopen(handle, "w", encoding="utf-8") as stream:
                json.dump(said, stream)


def _kept(store: Path) -> dict[str, Device]:
    """The devices that were let in before; none where nothing can be read."""
    try:
        said = json.loads(store.read_text(encoding="utf-8"))
        found = {
            str(key): Device(str(one["name"]), Person(**one["person"]), float(one["joined"]))
            for key, one in said.items()
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}
    return {key: one for key, one in found.items() if time.time() - one.joined < MAX_AGE}


def _hash(token: str) -> str:
    return hashlib.sha256(token.encode(errors="replace")).hexdigest()


def _number_of(device: str) -> int:
    text = device.removeprefix(DEVICE)
    return int(text) if device.startswith(DEVICE) and text.isdecimal() else 0


def address_of(host: str) -> str:
    """The address by which wrong codes are counted: of IPv6, the network, which is one's own."""
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return host
    if address.version == 6 and address.ipv4_mapped is None:
        return str(ipaddress.ip_network((address, 64), strict=False))
    return host


def last_device(names: Iterable[str]) -> int:
    """The highest number among names of devices that have written something; 0 without any."""
    return max(map(_number_of, names), default=0)


def new_code() -> str:
    """A code to type: some 40 bits."""
    return "".join(secrets.choice(ALPHABET) for _ in range(CODE_LENGTH))


def shown_code(code: str) -> str:
    """The code in two halves: 'K7QM-3XPD'."""
    half = len(code) // 2
    return f"{code[:half]}-{code[half:]}"
