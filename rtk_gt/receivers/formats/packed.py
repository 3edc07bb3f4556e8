"""Contents of files that may be compressed: gzip, bzip2, or a zip archive of one file."""

import bz2
import gzip
import io
import zipfile
import zlib
from pathlib import Path

from validation.errors import InputError, Problem
from validation.text_files.reading import file_bytes

MAX_BYTES = 2_000_000_000
"""A judgement: a day of GGA and GST at 20 Hz has 0.3 GB; what fits into a laptop's memory."""
GZIP, BZIP2, ZIP = b"\x1f\x8b", b"BZh", b"PK\x03\x04"
_SHEET = ("xl/", "content.xml")
ENDINGS = (".gz", ".bz2", ".zip")


def contents(path: Path, most: int = MAX_BYTES, what: str = "a log") -> bytes:
    """The bytes of a file, unpacked.

    Parameters
    ----------
    path : Path
        Of the file.
    most : int
        Bytes beyond which it is not read, packed or unpacked.
    what : str
        What it is, for the message of a file that is too large.

    Raises
    ------
    InputError
        Where the file is missing or too large, what is compressed is cut or damaged, or an archive
        holds several files.
    """
    data = file_bytes(path, most, what)
    kind = {GZIP: "gzip", BZIP2: "bzip2", ZIP: "zip"}
    named = next((name for magic, name in kind.items() if data.startswith(magic)), None)
    if named is None:
        return data
    try:
        if named == "zip":
            return _of_archive(path, data, most)
        packed = io.BytesIO(data)
        with gzip.GzipFile(fileobj=packed) if named == "gzip" else bz2.BZ2File(packed) as stream:
            found = stream.read(most + 1)
    except (EOFError, OSError, zlib.error, zipfile.BadZipFile, RuntimeError, ValueError) as error:
        said = f"the {named} file is cut or damaged: {error}; copy it anew"
        raise InputError([Problem(path, said)]) from None
    if len(found) > most:
        raise InputError([Problem(path, f"more than {most / 1e6:.0f} MB when unpacked")])
    return found


def _of_archive(path: Path, data: bytes, most: int) -> bytes:
    """The only file of a zip archive; a spreadsheet, which is one, too, stays as it is."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        names = archive.namelist()
        if any(name.startswith(_SHEET) for name in names):
            return data
        files = [one for one in archive.infolist() if not one.is_dir()]
        files = [one for one in files if "__MACOSX" not in one.filename]
        if len(files) != 1:
            listed = ", ".join(one.filename for one in files[:5]) or "none"
            said = f"the zip archive holds {len(files)} files ({listed}); expected one: unpack it"
            raise InputError([Problem(path, said)])
        if files[0].file_size > most:
            raise InputError([Problem(path, f"more than {most / 1e6:.0f} MB when unpacked")])
        return archive.read(files[0])


def inner_suffix(path: Path) -> str:
    """Ending of a name in small letters, without that of a compression: '.csv' of log.csv.gz."""
    name = path.name.lower()
    for ending in ENDINGS:
        name = name.removesuffix(ending)
    return Path(name).suffix
