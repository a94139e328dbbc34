"""Signed hand samples: Ed25519 over the key and every byte of the payload before the signature.

The signature is the last field of a hand sample and 64 bytes long, so it is the end of the payload, and the
exact bytes that were sent are checked: epoch, seq and whatever a newer version adds are all under it. Only
`sign_with` and `verify_with` load `cryptography`, and only where a swarm has keys.
"""

from collections.abc import Callable
from pathlib import Path

from shared.errors import ConfigError, DecodeError
from shared.files import read_bytes
from shared.topics import HAND

SIGNATURE_BYTES = 64
_BLANK = bytes(SIGNATURE_BYTES)
_MARK = bytes([0xC4, SIGNATURE_BYTES])
"""How MessagePack begins 64 bytes of binary."""
_KEY = HAND.key().encode()

Sign = Callable[[bytes], bytes]
Verify = Callable[[bytes], None]


def blank() -> bytes:
    """Returns what stands in a sample's `signature` until it is signed."""
    return _BLANK


def sign_with(private: Path) -> Sign:
    """Makes the relay's signer.

    Args:
        private: PEM file of an Ed25519 private key.

    Returns:
        A function from an encoded sample with a blank signature to the same sample signed.

    Raises:
        ConfigError: There is no such key.
    """
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey  # noqa: PLC0415
    from cryptography.hazmat.primitives.serialization import load_pem_private_key  # noqa: PLC0415

    key = _read_key(private, lambda pem: load_pem_private_key(pem, password=None))
    if not isinstance(key, Ed25519PrivateKey):
        raise ConfigError(f"{private}: not an Ed25519 key; make one with swarmtouch net keys init")

    def sign(payload: bytes) -> bytes:
        body = payload[:-SIGNATURE_BYTES]
        return body + key.sign(_KEY + body)

    return sign


def verify_with(public: Path) -> Verify:
    """Makes a listener's check.

    Args:
        public: PEM file of an Ed25519 public key.

    Returns:
        A function that raises `DecodeError` (`unsigned`, `bad-signature`) unless a payload was signed.

    Raises:
        ConfigError: There is no such key.
    """
    from cryptography.exceptions import InvalidSignature  # noqa: PLC0415
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey  # noqa: PLC0415
    from cryptography.hazmat.primitives.serialization import load_pem_public_key  # noqa: PLC0415

    key = _read_key(public, load_pem_public_key)
    if not isinstance(key, Ed25519PublicKey):
        raise ConfigError(f"{public}: not an Ed25519 key; copy hand.pub from where the keys were made")

    def verify(payload: bytes) -> None:
        body, signature = payload[:-SIGNATURE_BYTES], payload[-SIGNATURE_BYTES:]
        if not body.endswith(_MARK):
            raise DecodeError("unsigned", "a hand sample without a signature at its end")
        try:
            key.verify(signature, _KEY + body)
        except InvalidSignature:
            raise DecodeError("bad-signature", "a hand sample signed by somebody else, or altered") from None

    return verify


def _read_key(file: Path, load: Callable[[bytes], object]) -> object:
    from cryptography.exceptions import UnsupportedAlgorithm  # noqa: PLC0415

    try:
        return load(read_bytes(file))
    except (OSError, ValueError, TypeError, UnsupportedAlgorithm) as error:  # TypeError: a password
        raise ConfigError(f"{file}: no readable key of the hand ({error})") from error
