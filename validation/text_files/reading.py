"""Whole files, read with errors that a person understands."""

from pathlib import Path

from validation.errors import GtvalError, InputError, Problem


def file_bytes(path: Path, max_bytes: int, kind: str = "a file", *, text: bool = False) -> bytes:
    """Contents of a file.

    Parameters
    ----------
    path : Path
        The file.
    max_bytes : int
        A larger one is refused unread.
    kind : str
        What is expected, for that message: 'a table'.
    text : bool
        Whether it is a text file, which may not be UTF-16.

    Raises
    ------
    GtvalError
        If it is missing, no file, too large, or cannot be read.
    """
    try:
        if path.exists() and not path.is_file():
            said = "this is no file, but a folder or a device; put the file there"
            raise InputError([Problem(path, said)])
        size = path.stat().st_size
        if size > max_bytes:
            said = f"the file has {size / 1e6:.0f} MB; more than {max_bytes / 1e6:.0f} MB"
            raise InputError([Problem(path, f"{said} cannot be {kind} of this kind")])
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError([Problem(path, "there is no such file")]) from None
    except OSError as error:
        raise GtvalError(f"cannot read {path}: {error.strerror or error}") from error
    except ValueError as error:  # a NUL byte in the name
        raise GtvalError(f"cannot read {str(path)!r}: {error}") from error
    if text and is_utf16(data):
        raise InputError([Problem(path, "saved as UTF-16; save the file as UTF-8", 1)])
    return data


def is_utf16(data: bytes) -> bool:
    """Whether a text is UTF-16: by its byte-order mark, or as every second byte is zero."""
    even, odd = (bool(data[first:100:2].strip(b"\0")) for first in (0, 1))
    return data.startswith((b"\xff\xfe", b"\xfe\xff")) or (len(data) > 1 and even != odd)


def is_empty(path: Path) -> bool:
    """Whether a table that is appended to has nothing yet: it is missing, or has just been made."""
    try:
        return path.stat().st_size == 0
    except OSError:
        return not path.exists()
