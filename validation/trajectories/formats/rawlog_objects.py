"""The objects of MRPT's rawlogs, byte by byte.

Objects carry no length: one of a class that a reader does not know cannot be stepped over.
"""

import gzip
import struct
import zlib
from pathlib import Path

from validation.errors import InputError, Problem
from validation.text_files.reading import file_bytes

FILETIME_TO_UNIX = 11644473600.0
"""Seconds from 1601-01-01, from which MRPT counts, to 1970-01-01."""
MOST_TEXT = 10_000_000
"""Characters of a text beyond which the file is damaged. A judgement."""
END = 0x88


FIRST = ("CObservation", "CSensoryFrame", "CActionCollection", "CRawlog")
"""How the class of a rawlog's first object begins."""


def is_rawlog(data: bytes) -> bool:
    """Whether contents, unpacked, begin as a rawlog does."""
    return any(name.encode() in data[:40] for name in FIRST) and b"\0" in data[:100]


def unpacked(path: Path, most: int, what: str = "a log") -> bytes:
    """Contents of a rawlog, which may be compressed by gzip.

    Parameters
    ----------
    path : Path
        Of the file.
    most : int
        Bytes beyond which it is not read.
    what : str
        What it is, for the message of a file that is too large.

    Raises
    ------
    InputError
        Where the file is too large, or what is compressed is cut or damaged.
    """
    data = file_bytes(path, most, what)
    if not data.startswith(b"\x1f\x8b"):
        return data
    try:
        return gzip.decompress(data)
    except (EOFError, OSError, zlib.error) as error:
        problem = Problem(path, f"the gzip file is cut or damaged: {error}")
        raise InputError([problem]) from None


class Objects:
    """A place in the bytes of a rawlog.

    Parameters
    ----------
    path : Path
        Of the file, for messages.
    data : bytes
        Its contents, unpacked.

    Notes
    -----
    Whatever is read raises `InputError` where the file ends within it.
    """

    def __init__(self, path: Path, data: bytes) -> None:
        self.path, self.data, self.at = path, data, 0

    @property
    def at_end(self) -> bool:
        """Whether all was read."""
        return self.at >= len(self.data)

    def bad(self, text: str) -> InputError:
        """The error of this place."""
        return InputError([Problem(self.path, text, None, f"byte {self.at}")])

    def bytes(self, size: int) -> bytes:
        """The next bytes."""
        if self.at + size > len(self.data):
            raise self.bad("the file ends in the middle of an object; it was cut")
        self.at += size
        return self.data[self.at - size : self.at]

    def numbers(self, layout: str) -> tuple[float, ...]:
        """Little-endian numbers by the letters of `struct`."""
        return struct.unpack("<" + layout, self.bytes(struct.calcsize("<" + layout)))

    def count(self, most: int) -> int:
        """A count; more than ``most`` is damage."""
        (value,) = self.numbers("I")
        if value > most:
            raise self.bad(f"a count of {value}; the file is damaged")
        return int(value)

    def text(self) -> str:
        """A text with its length before it."""
        return self.bytes(self.count(MOST_TEXT)).decode("latin-1")

    def time(self) -> float:
        """Seconds since 1970."""
        return self.numbers("Q")[0] / 1e7 - FILETIME_TO_UNIX

    def head(self) -> tuple[str, int]:
        """Class, its namespace left out, and version of the object that begins here."""
        (length,) = self.bytes(1)
        name = self.bytes(length & 0x7F) if length & 0x80 else b""
        if not name.replace(b"::", b"").replace(b"_", b"").isalnum():
            raise self.bad("no object of an MRPT rawlog begins here")
        return name.decode("ascii").rpartition("::")[2], self.bytes(1)[0]

    def end(self, name: str) -> None:
        """The mark at the end of an object of that class."""
        if self.bytes(1)[0] != END:
            self.at -= 1
            raise self.bad(f"the {name} does not end where its version says; the file is damaged")
