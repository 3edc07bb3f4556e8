"""Text for terminals and files that cannot show every character.

Where stdout is not UTF-8 (cp1252 on older Windows, ASCII in many containers) a character that it
lacks is replaced by a readable one, so that no output ends in an error.
"""

import codecs
import io
import sys
import unicodedata
from typing import TextIO

READABLE = "gtval.readable"
"""Name of the way in which a stream treats characters that it lacks, as for `str.encode`."""

_PLAIN = {
    "−": "-",
    "–": "-",
    "—": "-",
    "±": "+-",
    "×": "x",
    "·": "*",
    "…": "...",
    "→": "->",
    "←": "<-",
    "≤": "<=",
    "≥": ">=",
    "≈": "~",
    "°": " deg",
    "‘": "'",
    "’": "'",
    "“": '"',
    "”": '"',
    "─": "-",
    "━": "-",
    "│": "|",
    "•": "*",
    "✓": "ok",
}


def plain(character: str) -> str:
    """The character in ASCII: a sign that looks like it, its letter, or its name if Greek."""
    if character in _PLAIN:
        return _PLAIN[character]
    letter = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode()
    if letter:
        return letter
    name = unicodedata.name(character, "")
    if name.startswith("GREEK "):
        return name.rsplit(" ", 1)[-1].lower()
    return character.encode("ascii", "backslashreplace").decode()


def _replaced(error: UnicodeError) -> tuple[str, int]:
    """What stands for the characters that a stream lacks; called by the codec."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = "".join(plain(one) for one in error.object[error.start : error.end])
    return text, error.end


codecs.register_error(READABLE, _replaced)

_ASCII = "gtval_ascii"


def _ascii_by_another_name(name: str) -> codecs.CodecInfo | None:
    """The codec of streams in ASCII: click writes UTF-8 to those that say so themselves."""
    if name != _ASCII:
        return None
    known = codecs.lookup("ascii")
    return codecs.CodecInfo(
        known.encode,
        known.decode,
        known.streamreader,
        known.streamwriter,
        known.incrementalencoder,
        known.incrementaldecoder,
        name=_ASCII,
    )


codecs.register(_ascii_by_another_name)


def as_shown(text: str, encoding: str) -> str:
    """The text as a stream of that encoding shows it."""
    return text.encode(encoding, READABLE).decode(encoding)


def never_fail(*streams: TextIO) -> None:
    """Let streams replace what they lack; by default stdout and stderr."""
    for stream in streams or (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            is_ascii = codecs.lookup(stream.encoding).name == "ascii"
            stream.reconfigure(encoding=_ASCII if is_ascii else None, errors=READABLE)
