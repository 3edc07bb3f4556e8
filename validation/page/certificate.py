"""A certificate made on the spot, so that phones may keep awake and read a meter by Bluetooth."""

import ipaddress
import os
from collections.abc import Collection
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from validation.errors import GtvalError

VALID = timedelta(days=90)
"""A judgement: longer than a campaign; browsers take up to 825 days."""


@dataclass(frozen=True)
class CertificateFile:
    """A file with key and certificate, and what a browser shows of the latter."""

    path: Path
    fingerprint: str

    @property
    def warning(self) -> str:
        """What to do when the browser warns."""
        return (
            "The browser warns once, as nobody vouches for the certificate made here: let it go on "
            f"where it shows this fingerprint (SHA-256): {self.fingerprint}"
        )


def certificate(path: Path, names: Collection[str]) -> CertificateFile:
    """The certificate of the page: the one of before as long as it is good for all names.

    Parameters
    ----------
    path : Path
        Where key and certificate are kept, for nobody else to read.
    names : collection of str
        Host names and addresses under which the page is called.

    Raises
    ------
    GtvalError
        If ``cryptography`` is not installed, or the file cannot be written.
    """
    try:
        from cryptography import x509  # noqa: PLC0415  (an extra)
        from cryptography.hazmat.primitives import hashes, serialization  # noqa: PLC0415
        from cryptography.hazmat.primitives.asymmetric import ec  # noqa: PLC0415
    except ImportError:
        raise GtvalError("--tls needs the extra 'web': pip install gtval[web]") from None

    wanted = x509.SubjectAlternativeName([_name(x509, one) for one in sorted(names)])
    now = datetime.now(UTC)
    try:
        made = x509.load_pem_x509_certificate(path.read_bytes())
        alike = made.extensions.get_extension_for_class(x509.SubjectAlternativeName).value == wanted
        good = alike and made.not_valid_after_utc > now + timedelta(days=1)
    except (OSError, ValueError, x509.ExtensionNotFound):
        good = False
    if not good:
        key = ec.generate_private_key(ec.SECP256R1())
        subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "gtval enter")])
        made = (
            x509.CertificateBuilder()
            .subject_name(subject)
            .issuer_name(subject)
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(now - timedelta(days=1))
            .not_valid_after(now + VALID)
            .add_extension(wanted, critical=False)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .sign(key, hashes.SHA256())
        )
        secret = key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
        _write(path, secret + made.public_bytes(serialization.Encoding.PEM))
    return CertificateFile(path, made.fingerprint(hashes.SHA256()).hex(":").upper())


def _name(x509: Any, name: str) -> Any:
    """A host name or address as a certificate holds it."""
    try:
        return x509.IPAddress(ipaddress.ip_address(name.partition("%")[0]))
    except ValueError:
        return x509.DNSName(name)


def _write(path: Path, data: bytes) -> None:
    """A file that only its owner may read."""
    try:
        path.unlink(missing_ok=True)
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
    except OSError as error:
        raise GtvalError(f"cannot write {path}: {error.strerror or error}") from error
