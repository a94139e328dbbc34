"""Whom a node lets in at all: one trust anchor per member (DESIGN section 8).

Zenoh knows no revocation lists, and gives a link to every certificate that it trusts. Access rules then make
sure that nobody listens to one who is no member, but he has taken a place. So the swarm's authority issues each
node's certificate in a name that it uses for this node only, and a node trusts the authority in the names of
the members. The key behind all these names is the same: who is issued a new certificate is trusted as before,
and who is struck from the list of members is a stranger, whatever certificates he has.
"""

import base64
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from shared.errors import ConfigError
from shared.files import read_bytes

if TYPE_CHECKING:
    from cryptography import x509


def issuer_of(authority: "x509.Name", node: str) -> "x509.Name":
    """Returns the name in which an authority issues the certificates of one node."""
    from cryptography import x509  # noqa: PLC0415  only swarms with keys need it
    from cryptography.x509.oid import NameOID  # noqa: PLC0415

    return x509.Name([*authority, x509.NameAttribute(NameOID.ORGANIZATIONAL_UNIT_NAME, node)])


def trust_anchors(authority: Path, members: Iterable[str]) -> str:
    """Makes the certificates that a node trusts, for Zenoh's `root_ca_certificate_base64`.

    A trust anchor is a name and a key. That it is written as a certificate, which somebody has to sign, is only
    a matter of form: nobody checks that, and the authority's private key is not here.

    Args:
        authority: Certificate of the swarm's authority, PEM.
        members: The nodes that belong to the swarm.

    Raises:
        ConfigError: There is no such certificate.
    """
    from cryptography import x509  # noqa: PLC0415
    from cryptography.hazmat.primitives import serialization  # noqa: PLC0415
    from cryptography.hazmat.primitives.asymmetric import ed25519  # noqa: PLC0415

    certificate = _load(authority)
    form = ed25519.Ed25519PrivateKey.from_private_bytes(bytes(32))
    anchors = [
        x509.CertificateBuilder()
        .subject_name(name := issuer_of(certificate.subject, member))
        .issuer_name(name)
        .public_key(certificate.public_key())
        .serial_number(1)
        .not_valid_before(certificate.not_valid_before_utc)
        .not_valid_after(certificate.not_valid_after_utc)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .sign(form, algorithm=None)
        for member in members
    ]
    pem = b"".join(anchor.public_bytes(serialization.Encoding.PEM) for anchor in anchors)
    return base64.b64encode(pem).decode()


def check_issued(certificate: Path, authority: Path, node: str) -> None:
    """Checks that others will trust a node's certificate.

    Raises:
        ConfigError: It is not issued by this authority in this node's name; those of earlier versions are not.
    """
    if _load(certificate).issuer != issuer_of(_load(authority).subject, node):
        raise ConfigError(
            f"{certificate}: not issued by {authority} in the name of {node}, so nobody lets it in;"
            f" issue it anew with swarmtouch net keys issue SCENARIO {node}, and copy it here"
        )


def _load(file: Path) -> "x509.Certificate":
    from cryptography import x509  # noqa: PLC0415

    try:
        return x509.load_pem_x509_certificate(read_bytes(file))
    except (OSError, ValueError, x509.InvalidVersion) as error:
        raise ConfigError(f"{file}: not a certificate ({error})") from error
