"""Messages to bytes and back: MessagePack maps, strict on the way in.

Messages are structs of msgspec, which encodes and decodes them in C. What it does not take is looked at again,
field by field (`shared.strict_codec`), by hooks that know why: they have the last word, they alone refuse.
Unknown extra fields are ignored (a newer publisher may say more), a missing or wrong one is not.
"""

from typing import Any, Final, TypeVar, cast

import msgspec
from msgspec import structs

from shared.errors import DecodeError
from shared.messages import SCHEMA_VERSION, DroneState, Message, ProcessStatus
from shared.strict_codec import check_version, decode_strictly
from shared.topics import parse_key

MAX_PAYLOAD: Final = 4096
"""Largest payload in bytes that is looked at at all."""

M = TypeVar("M", bound=Message)


def encode(message: Message, stamp_ns: int | None = None) -> bytes:
    """Encodes a message as one MessagePack map with its schema version.

    Args:
        message: Any of the types in `shared.messages`.
        stamp_ns: Replaces the stamp of the message, for a publisher that stamps at the last moment.

    Returns:
        The payload; the same message always gives the same bytes.
    """
    # The version comes first and the fields keep their order: a signature is the end of the payload.
    return _encoder.encode(message if stamp_ns is None else structs.replace(message, stamp_ns=stamp_ns))


# Numbers of numpy are none of its own.
_encoder = msgspec.msgpack.Encoder(enc_hook=float)


def decode(payload: bytes, kind: type[M]) -> M:
    """Decodes and checks one payload.

    Args:
        payload: Bytes as received, from anyone.
        kind: The type that the topic promises.

    Returns:
        The message, every number finite and in range.

    Raises:
        DecodeError: For whatever is wrong with the payload; nothing else is ever raised.
    """
    if len(payload) > MAX_PAYLOAD:
        raise DecodeError("oversized", f"{len(payload)} bytes, at most {MAX_PAYLOAD}")
    message = decode_valid(payload, kind)
    return decode_strictly(payload, kind) if message is None else message


def decode_on(key: str, payload: bytes) -> Message:
    """Decodes what came on a key, and checks that it speaks for whom the key belongs to.

    Access rules bind a node to keys, so a payload never says who it is from: where it does, it must agree.

    Raises:
        DecodeError: Nobody would accept it: an unknown key, no valid message, or another one's (`wrong-id`).
    """
    place = parse_key(key)
    message = decode(payload, place.topic.kind)
    if isinstance(message, DroneState) and message.id != place.id:
        raise DecodeError("wrong-id", f"drone {message.id} on {key}")
    if isinstance(message, ProcessStatus) and (message.role, message.id) != place[1:]:
        raise DecodeError("wrong-id", f"{message.role!r:.40} {message.id} on {key}")
    return message


_decoders: dict[Any, msgspec.msgpack.Decoder[Any]] = {}

_VERSION: Final = b"\xa1v" + bytes([SCHEMA_VERSION])
"""How our own messages go on after the length of the map, which is one byte or, from 16 fields on, three."""
_SHORTEST_MAP: Final = 0x80
_LONGEST_SHORT_MAP: Final = 0x8F
_LONG_MAP: Final = 0xDE


def decode_valid(payload: bytes, kind: type[M]) -> M | None:
    """Decodes what is right at first sight, None for anything that is not."""
    try:
        if not _begins_with_version(payload):
            check_version(payload)
        decoder = _decoders.get(kind)
        if decoder is None:
            decoder = _decoders[kind] = msgspec.msgpack.Decoder(cast(Any, kind))
        return cast(M, decoder.decode(payload))
    except Exception:  # noqa: BLE001  whatever it is, the strict decoder has the last word
        return None


def _begins_with_version(payload: bytes) -> bool:
    """Says whether the version is there at first sight; msgspec looks at its value wherever it appears."""
    length = payload[0]
    if length == _LONG_MAP:
        return payload[3:6] == _VERSION
    return _SHORTEST_MAP <= length <= _LONGEST_SHORT_MAP and payload[1:4] == _VERSION
