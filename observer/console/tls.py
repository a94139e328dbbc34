"""A certificate for the console: given, or made by itself for this machine."""

import datetime
import ipaddress
import os
import socket
from pathlib import Path
from typing import TYPE_CHECKING

from shared.errors import ConfigError

if TYPE_CHECKING:
    from cryptography import x509

CERTIFICATE, KEY = "cert.pem", "key.pem"

_DAYS = 397
"""Longer ones are refused by browsers."""


def certificate(folder: Path, host: str) -> tuple[Path, Path]:
    """Returns certificate and key from a folder; makes them, self-signed, if there are none.

    Args:
        folder: With `cert.pem` and `key.pem`.
        host: Address that the console binds, for a certificate that is made.

    Raises:
        ConfigError: One of the two is missing, the folder cannot be written, or there is no `cryptography`.
    """
    pair = folder / CERTIFICATE, folder / KEY
    try:
        there = [path.is_file() for path in pair]
        if all(there):
            return pair
        if any(there):
            raise ConfigError(
                f"--tls {folder}: expected both {CERTIFICATE} and {KEY}, or neither to have them made"
            )
        _make(*pair, host)
    except OSError as error:
        raise ConfigError(f"--tls {folder}: cannot be written: {error}") from error
    return pair


def _make(certificate_file: Path, key_file: Path, host: str) -> None:
    try:
        from cryptography.hazmat.primitives import hashes, serialization  # noqa: PLC0415  an optional extra
        from cryptography.hazmat.primitives.asymmetric import ec  # noqa: PLC0415
    except ImportError as error:
        raise ConfigError(
            "--tls: making a certificate needs the package cryptography: pip install 'swarmtouch[secure]'"
        ) from error
    key = ec.generate_private_key(ec.SECP256R1())
    signed = _builder(host).public_key(key.public_key()).sign(key, hashes.SHA256())
    certificate_file.parent.mkdir(parents=True, exist_ok=True)
    secret = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    descriptor = os.open(key_file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(secret)
    certificate_file.write_bytes(signed.public_bytes(serialization.Encoding.PEM))


def _builder(host: str) -> "x509.CertificateBuilder":
    from cryptography import x509  # noqa: PLC0415  an optional extra
    from cryptography.x509.oid import NameOID  # noqa: PLC0415

    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "SwarmTouch console")])
    now = datetime.datetime.now(datetime.UTC)
    names: list[x509.GeneralName] = [x509.DNSName("localhost"), x509.DNSName(socket.gethostname())]
    names += [x509.IPAddress(ipaddress.ip_address(a)) for a in sorted({"127.0.0.1", *_addresses(host)})]
    return (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(hours=1))
        .not_valid_after(now + datetime.timedelta(days=_DAYS))
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
    )


def _addresses(host: str) -> set[str]:
    """Returns the address to bind; for "all of them", those by which this machine's name is known."""
    if host not in ("0.0.0.0", "::"):  # noqa: S104  compared, not bound
        return {str(found[4][0]) for found in socket.getaddrinfo(host, None, proto=socket.IPPROTO_TCP)}
    try:
        found = socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET, proto=socket.IPPROTO_TCP)
    except OSError:
        return set()
    return {str(entry[4][0]) for entry in found}
