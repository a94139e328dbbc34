"""Signed hand samples: the exact bytes that were sent, and nothing older than what was heard."""

from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import BestAvailableEncryption, Encoding, PrivateFormat
from hypothesis import given
from hypothesis import strategies as st

from deploy.net.authority import create
from shared.codec import decode, encode
from shared.errors import ConfigError, DecodeError
from shared.messages import HandSample, Wish
from shared.net.keyring import Keyring
from shared.senses import Senses
from shared.signature import blank, sign_with, verify_with
from shared.topics import HAND
from shared.transport import Arrival


@pytest.fixture(scope="module")
def keyring(tmp_path_factory: pytest.TempPathFactory) -> Keyring:
    made = Keyring(tmp_path_factory.mktemp("keys") / "ours")
    create(made, "swarm")
    return made


def sample(epoch: int = 7, seq: int = 0) -> HandSample:
    return HandSample(
        epoch=epoch,
        seq=seq,
        stamp_ns=1,
        position=(1.0, 2.0, 3.0),
        velocity=(0.0, 0.0, 0.0),
        yaw=0.0,
        mode=Wish.FLY,
        signature=blank(),
    )


def signed(keyring: Keyring, epoch: int = 7, seq: int = 0) -> bytes:
    return sign_with(keyring.hand_private)(encode(sample(epoch, seq)))


def test_a_signed_sample_is_accepted_and_means_the_same(keyring: Keyring) -> None:
    payload = signed(keyring)
    verify_with(keyring.hand_public)(payload)
    assert decode(payload, HandSample).position == sample().position


@given(position=st.integers(min_value=0), flip=st.integers(1, 255))
def test_any_changed_byte_is_noticed(keyring: Keyring, position: int, flip: int) -> None:
    payload = bytearray(signed(keyring))
    payload[position % len(payload)] ^= flip
    with pytest.raises(DecodeError, match=r"bad-signature|unsigned"):
        verify_with(keyring.hand_public)(bytes(payload))


def test_unsigned_samples_are_told_apart_from_forged_ones(keyring: Keyring, tmp_path: Path) -> None:
    verify = verify_with(keyring.hand_public)
    with pytest.raises(DecodeError, match=r"^unsigned"):
        verify(
            encode(
                HandSample(
                    epoch=1, seq=0, stamp_ns=0, position=(0, 0, 0), velocity=(0, 0, 0), yaw=0, mode=Wish.FLY
                )
            )
        )
    others = Keyring(tmp_path / "theirs")
    create(others, "swarm")
    with pytest.raises(DecodeError, match=r"^bad-signature"):
        verify(signed(others))


@given(payload=st.binary(max_size=300))
def test_no_bytes_do_more_than_be_refused(keyring: Keyring, payload: bytes) -> None:
    with pytest.raises(DecodeError):
        verify_with(keyring.hand_public)(payload)


def test_a_replayed_sample_is_dropped_however_long_the_hand_has_been_silent(keyring: Keyring) -> None:
    senses = Senses((), verify_with(keyring.hand_public))
    old, new = signed(keyring, epoch=5, seq=9), signed(keyring, epoch=7, seq=0)
    key, year_ns = HAND.key(), 365 * 86_400 * 10**9
    senses.take({key: [Arrival(new, 0)]})
    senses.take({key: [Arrival(old, year_ns), Arrival(new, year_ns)]})
    assert senses.hand is not None
    assert senses.hand.message.epoch == 7
    assert senses.hand.arrival_ns == 0
    assert senses.rejected["out-of-order"] == 2


def test_missing_and_wrong_keys_are_refused_by_name(keyring: Keyring, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"absent\.pub"):
        verify_with(tmp_path / "absent.pub")
    with pytest.raises(ConfigError, match="not an Ed25519 key"):
        sign_with(keyring.authority_key)
    locked = tmp_path / "locked.key"
    locked.write_bytes(
        Ed25519PrivateKey.generate().private_bytes(
            Encoding.PEM, PrivateFormat.PKCS8, BestAvailableEncryption(b"password")
        )
    )
    with pytest.raises(ConfigError, match=r"locked\.key: no readable key"):
        sign_with(locked)
