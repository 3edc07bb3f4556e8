"""Files that people name for a receiver's log and that are none: what they are, and what to do."""

import re

_TEXT = 4096
MAGIC: tuple[tuple[bytes, str], ...] = (
    (b"\x89PNG", "a picture; name the receiver's log"),
    (b"\xff\xd8\xff", "a picture; name the receiver's log"),
    (b"%PDF", "a PDF document; name the receiver's log"),
    (b"7z\xbc\xaf", "a 7z archive; unpack it"),
    (b"Rar!", "a RAR archive; unpack it"),
    (b"\xfd7zXZ", "a file compressed by xz; unpack it, or compress it by gzip"),
    (b"\x28\xb5\x2f\xfd", "a file compressed by zstd; unpack it, or compress it by gzip"),
    (b"\xaa\x44\x12", "a binary log of NovAtel; let the receiver write BESTPOSA, or convert it"),
    (b"$@", "a log of Septentrio (SBF); convert it to NMEA"),
    (b"\xd4\xc3\xb2\xa1", "a capture of network packets; save the sentences in them"),
    (b"SQLite format 3", "the database inside a bag; name the folder of the bag"),
)
WORDS: tuple[tuple[re.Pattern[bytes], str], ...] = (
    (re.compile(rb"(?i)<!doctype html|<html"), "a web page, not the file; download it anew"),
    (re.compile(rb"<kml"), "KML, which has no times of its points; export GPX, CSV or NMEA"),
    (re.compile(rb"(?m)RINEX VERSION / TYPE"),
     "RINEX, raw observations without positions; process it (RTKLIB) and name the solution"),
    (re.compile(rb"^\s*[{\[]"), "JSON; export CSV, GPX or NMEA"),
    (re.compile(rb"<\?xml"), "XML that is no GPX; export GPX, CSV or NMEA"),
)  # fmt: skip


def foreign(data: bytes) -> str | None:
    """What the contents of a file are that is no log, with what to do; None if it may be one."""
    for magic, said in MAGIC:
        if data.startswith(magic):
            return said
    if data[257:262] == b"ustar":
        return "a tar archive; unpack it"
    if data[:1] == b"\xd3" and data[1:2] and data[1] < 4 and b"$G" not in data[:_TEXT]:
        return "a stream of RTCM corrections, not of positions; let the receiver write NMEA"
    head = data[:_TEXT]
    return next((said for words, said in WORDS if words.search(head)), None)
