"""The swarm's own certificate authority and the hand's signing key (needs the extra `secure`).

Every node has a certificate whose common name is its own; the access rules know it by that. Zenoh has no
revocation lists: who is removed is struck from the list of members, and the rules refuse it.
"""

import datetime
import ipaddress
import os
from collections.abc import Sequence
from pathlib import Path

import tomli_w
from attrs import frozen

from shared.errors import ConfigError
from shared.files import read_bytes
from shared.net.anchors import issuer_of
from shared.net.keyring import MEMBERS_FILE, Keyring, stem

try:
    from cryptography import x509
    from cryptography.exceptions import UnsupportedAlgorithm
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec, ed25519
    from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID
except ImportError as error:
    raise ConfigError("keys need the package cryptography: pip install 'swarmtouch[secure]'") from error

AUTHORITY_DAYS = 3650
NODE_DAYS = 825
"""How long a node's certificate is good for, days."""
WARN_DAYS = 30
LOCAL = ("localhost", "127.0.0.1")
"""Where every node may be dialled; its own hosts come beside."""

_SECRET, _PUBLIC, _FOLDER = 0o600, 0o644, 0o700
_SLACK = datetime.timedelta(minutes=5)
"""Certificates are valid from a little earlier on, for machines whose clocks are behind."""


@frozen
class Issued:
    """One certificate.

    Attributes:
        name: Common name.
        hosts: Names and addresses under which its node may be dialled.
        expires: When it ends.
        is_member: Whether the access rules name it.
        has_key: Whether its private key lies here too.
    """

    name: str
    hosts: tuple[str, ...]
    expires: datetime.datetime
    is_member: bool
    has_key: bool

    def days_left(self, now: datetime.datetime) -> int:
        """Returns how many days it is still good for; negative once it has ended."""
        return (self.expires - now).days


def create(keyring: Keyring, swarm: str) -> None:
    """Makes the authority, the hand's key pair and an empty list of members.

    Raises:
        ConfigError: There is an authority already; it is never overwritten.
    """
    if keyring.authority.exists() or keyring.authority_key.exists():
        raise ConfigError(f"{keyring.authority}: there already; every certificate would be void without it")
    keyring.folder.mkdir(mode=_FOLDER, parents=True, exist_ok=True)
    keyring.folder.chmod(_FOLDER)
    key = ec.generate_private_key(ec.SECP256R1())
    name = _name(f"SwarmTouch {swarm}")
    certificate = (
        _validity(x509.CertificateBuilder(), AUTHORITY_DAYS)
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .add_extension(x509.BasicConstraints(ca=True, path_length=1), critical=True)
        .add_extension(_usage(signs_certificates=True), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )
    _write(keyring.authority_key, _private_pem(key), _SECRET)
    _write(keyring.authority, certificate.public_bytes(serialization.Encoding.PEM), _PUBLIC)
    hand = ed25519.Ed25519PrivateKey.generate()
    _write(keyring.hand_private, _private_pem(hand), _SECRET)
    public = hand.public_key().public_bytes(
        serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo
    )
    _write(keyring.hand_public, public, _PUBLIC)
    _write_members(keyring, ())


def issue(keyring: Keyring, node: str, hosts: Sequence[str] = ()) -> None:
    """Issues a node's key and certificate and makes it a member; a second time it gets new ones.

    Args:
        keyring: Where the authority's key lies.
        node: Its name (`shared.nodes`), which becomes the common name.
        hosts: Names and addresses under which it is dialled, beside this machine's loopback.

    Raises:
        ConfigError: There is no authority here.
    """
    authority, authority_key = _authority(keyring)
    key = ec.generate_private_key(ec.SECP256R1())
    roles = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
    certificate = (
        _validity(x509.CertificateBuilder(), NODE_DAYS)
        .subject_name(_name(node))
        .issuer_name(issuer_of(authority.subject, node))
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_usage(signs_certificates=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage(roles), critical=False)
        .add_extension(
            x509.SubjectAlternativeName([_host(h) for h in dict.fromkeys((*LOCAL, *hosts))]), critical=False
        )
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(authority_key.public_key()), critical=False
        )
        .sign(authority_key, hashes.SHA256())
    )
    _write(keyring.key(node), _private_pem(key), _SECRET)
    chain = (certificate, _issuer(authority, authority_key, node))
    pem = b"".join(each.public_bytes(serialization.Encoding.PEM) for each in chain)
    _write(keyring.certificate(node), pem, _PUBLIC)
    _write_members(keyring, dict.fromkeys((*keyring.members(), node)))


def _issuer(
    authority: x509.Certificate, authority_key: ec.EllipticCurvePrivateKey, node: str
) -> x509.Certificate:
    """Makes the link between a node's certificate and the authority, for those who trust the latter as such."""
    return (
        x509.CertificateBuilder()
        .subject_name(issuer_of(authority.subject, node))
        .issuer_name(authority.subject)
        .public_key(authority_key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(authority.not_valid_before_utc)
        .not_valid_after(authority.not_valid_after_utc)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_usage(signs_certificates=True), critical=True)
        .sign(authority_key, hashes.SHA256())
    )


def remove(keyring: Keyring, node: str) -> None:
    """Strikes a node from the members and deletes its files here.

    Raises:
        ConfigError: It is no member.
    """
    members = keyring.members()
    if node not in members:
        raise ConfigError(
            f"{keyring.folder / MEMBERS_FILE}: {node} is no member; members: {', '.join(members)}"
        )
    _write_members(keyring, [member for member in members if member != node])
    keyring.key(node).unlink(missing_ok=True)
    keyring.certificate(node).unlink(missing_ok=True)


def issued(keyring: Keyring) -> list[Issued]:
    """Lists every certificate that lies here, the authority's first.

    Raises:
        ConfigError: A certificate cannot be read.
    """
    members = keyring.members()
    files = sorted(keyring.folder.glob("*.crt"), key=lambda file: (file != keyring.authority, file))
    return [_describe(file, members) for file in files]


def _describe(file: Path, members: Sequence[str]) -> Issued:
    certificate = _load(file)
    try:
        name = str(certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)[0].value)
        hosts = _hosts(certificate)
    except (ValueError, IndexError, x509.DuplicateExtension, x509.UnsupportedGeneralNameType) as error:
        raise ConfigError(f"{file}: not a certificate of a node ({error})") from error
    return Issued(
        name=name,
        hosts=hosts,
        expires=certificate.not_valid_after_utc,
        is_member=name in members and file.stem == stem(name),
        has_key=file.with_suffix(".key").exists(),
    )


def _hosts(certificate: x509.Certificate) -> tuple[str, ...]:
    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        return ()
    return tuple(str(entry.value) for entry in names)


def _authority(keyring: Keyring) -> tuple[x509.Certificate, ec.EllipticCurvePrivateKey]:
    hint = "issue certificates where swarmtouch net keys init was run"
    try:
        key = serialization.load_pem_private_key(read_bytes(keyring.authority_key), password=None)
    except (OSError, ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise ConfigError(f"{keyring.authority_key}: no key of an authority ({error}); {hint}") from error
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise ConfigError(f"{keyring.authority_key}: not an elliptic-curve key; {hint}")
    return _load(keyring.authority), key


def _load(file: Path) -> x509.Certificate:
    try:
        return x509.load_pem_x509_certificate(read_bytes(file))
    except (OSError, ValueError, x509.InvalidVersion) as error:
        raise ConfigError(f"{file}: not a certificate ({error})") from error


def _validity(builder: x509.CertificateBuilder, days: int) -> x509.CertificateBuilder:
    now = datetime.datetime.now(datetime.UTC)
    return builder.not_valid_before(now - _SLACK).not_valid_after(now + datetime.timedelta(days=days))


def _name(common: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common)])


def _host(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        return x509.DNSName(host)


def _usage(*, signs_certificates: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs_certificates,
        key_cert_sign=signs_certificates,
        crl_sign=signs_certificates,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _private_pem(key: ec.EllipticCurvePrivateKey | ed25519.Ed25519PrivateKey) -> bytes:
    return key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )


def _write_members(keyring: Keyring, members: Sequence[str] | dict[str, None]) -> None:
    text = "# The nodes that the access rules let in. Every node needs the same list.\n"
    text += tomli_w.dumps({"members": list(members)})
    _write(keyring.folder / MEMBERS_FILE, text.encode(), _PUBLIC)


def _write(file: Path, content: bytes, mode: int) -> None:
    """Replaces a file in one step; a secret is never readable by others, not even for a moment."""
    fresh = file.with_name(f".{file.name}.new")
    fresh.unlink(missing_ok=True)
    with os.fdopen(os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as out:
        out.write(content)
    fresh.chmod(mode)
    fresh.replace(file)
