"""Messages to bytes and back: MessagePack maps, strict on the way in.

Messages are structs of msgspec, which encodes and decodes them in C. What it does not take is looked at again,
field by field, by hooks for cattrs that know why: they have the last word, they alone refuse.
(cattrs by itself would accept NaN, `"1.5"`, `True` as a number or a string as a vector.)
Unknown extra fields are ignored (a newer publisher may say more), a missing or wrong one is not.
"""

import enum
import functools
import math
from collections.abc import Callable
from typing import Annotated, Any, TypeVar, cast, get_args, get_origin, get_type_hints

import msgpack
import msgspec
from cattrs import Converter
from msgspec import structs

from shared.errors import DecodeError
from shared.messages import SCHEMA_VERSION, DroneState, Flag, Message, Mode, ProcessStatus, Wish
from shared.topics import parse_key

MAX_PAYLOAD = 4096
"""Largest payload in bytes that is looked at at all."""

M = TypeVar("M", bound=Message)
Hook = Callable[[Any, Any], Any]


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


class _Envelope(msgspec.Struct):
    """The version as a field that must be there: as the tag of a message msgspec does without it."""

    v: Annotated[int, msgspec.Meta(ge=SCHEMA_VERSION, le=SCHEMA_VERSION)]


_version = msgspec.msgpack.Decoder(_Envelope)


@functools.cache
def _decoder(kind: Any) -> msgspec.msgpack.Decoder[Any]:
    return msgspec.msgpack.Decoder(kind)


def decode_valid(payload: bytes, kind: type[M]) -> M | None:
    """Decodes what is right at first sight, None for anything that is not."""
    try:
        _version.decode(payload)
        return cast(M, _decoder(cast(Any, kind)).decode(payload))
    except Exception:  # noqa: BLE001  whatever it is, the strict decoder has the last word
        return None


def decode_strictly(payload: bytes, kind: type[M]) -> M:
    """Decodes field by field; arguments and errors as for `decode`."""
    try:
        fields = msgpack.unpackb(payload, use_list=False)
    except Exception as error:
        raise DecodeError("malformed", type(error).__name__) from error
    if type(fields) is not dict:
        raise DecodeError("malformed", f"a map is expected, not {type(fields).__name__}")
    version = fields.get("v")
    if type(version) is not int or version != SCHEMA_VERSION:
        raise DecodeError("version", f"schema {version!r}, this process speaks {SCHEMA_VERSION}")
    try:
        return cast(M, _structure_hook(cast(Any, kind))(fields, kind))
    except DecodeError:
        raise
    except KeyError as error:
        raise DecodeError("missing-field", str(error)) from error
    except Exception as error:
        raise DecodeError("wrong-type", f"{type(error).__name__}: {error}") from error


@functools.cache
def _structure_hook(kind: Any) -> Hook:
    return _converter.get_structure_hook(kind)


def _integer(value: Any, _: Any = int) -> int:
    if type(value) is not int:
        raise DecodeError("wrong-type", f"an integer is expected, not {value!r:.40}")
    return value


def _number(value: Any, _: Any = float) -> float:
    if type(value) is not float and type(value) is not int:
        raise DecodeError("wrong-type", f"a number is expected, not {value!r:.40}")
    if not math.isfinite(value):
        raise DecodeError("non-finite", repr(value))
    return float(value)


def _text(value: Any, _: Any = str) -> str:
    if type(value) is not str:
        raise DecodeError("wrong-type", f"a string is expected, not {value!r:.40}")
    return value


def _boolean(value: Any, _: Any = bool) -> bool:
    if type(value) is not bool:
        raise DecodeError("wrong-type", f"true or false is expected, not {value!r:.40}")
    return value


def _binary(value: Any, _: Any = bytes) -> bytes:
    if type(value) is not bytes:
        raise DecodeError("wrong-type", f"bytes are expected, not {value!r:.40}")
    return value


def _flags(value: Any, _: Any) -> Flag:
    bits = _integer(value)
    if bits < 0 or bits > 0xFFFF_FFFF:
        raise DecodeError("out-of-range", f"flags {bits}")
    return Flag(bits)


def _word_hook(kind: type[enum.StrEnum]) -> Hook:
    """Makes the hook of an enumeration of words."""
    words = {word.value: word for word in kind}

    def word(value: Any, _: Any) -> enum.StrEnum:
        found = words.get(value) if type(value) is str else None
        if found is None:
            raise DecodeError("out-of-range", f"{_text(value)!r:.40} is none of {', '.join(words)}")
        return found

    return word


def _ranged_hook(annotated: Any) -> Hook:
    """Makes the hook of an `Annotated[number, Meta(...)]`."""
    base, bounds = get_args(annotated)[:2]
    low, high = bounds.ge, math.inf if bounds.le is None else bounds.le
    scalar = _integer if base is int else _number

    def number(value: Any, _: Any) -> Any:
        checked = scalar(value)
        if not low <= checked <= high:
            raise DecodeError("out-of-range", f"{checked!r} not in [{low}, {high}]")
        return checked

    return number


def _vector_hook(kind: Any) -> Hook:
    """Makes the hook of a `tuple[number, number, number]`."""
    element = get_args(kind)[0]
    hook = _converter.get_structure_hook(element)

    def vector(value: Any, _: Any) -> tuple[float, float, float]:
        if type(value) is not tuple or len(value) != 3:
            raise DecodeError("wrong-type", f"three numbers are expected, not {value!r:.40}")
        x, y, z = value
        return (hook(x, element), hook(y, element), hook(z, element))

    return vector


def _record_hook(kind: Any) -> Hook:
    """Makes the hook of a named tuple."""
    hints = get_type_hints(kind, include_extras=True)
    hooks = [(_converter.get_structure_hook(hint), hint) for hint in hints.values()]
    names = ", ".join(hints)

    def record(value: Any, _: Any) -> Any:
        if type(value) is not tuple or len(value) != len(hooks):
            raise DecodeError("wrong-type", f"({names}) is expected, not {value!r:.40}")
        return kind(*[hook(item, hint) for item, (hook, hint) in zip(value, hooks, strict=True)])

    return record


def _sequence_hook(kind: Any) -> Hook:
    """Makes the hook of a `tuple[element, ...]`; bytes and maps can be iterated too, but are none."""
    element = get_args(kind)[0]
    hook = _converter.get_structure_hook(element)

    def sequence(value: Any, _: Any) -> tuple[Any, ...]:
        if type(value) is not tuple:
            raise DecodeError("wrong-type", f"a list is expected, not {value!r:.40}")
        return tuple([hook(item, element) for item in value])

    return sequence


def _message_hook(kind: Any) -> Hook:
    """Makes the hook of a message."""
    fields = [(field, _converter.get_structure_hook(field.type)) for field in structs.fields(kind)]

    def message(value: Any, _: Any) -> Any:
        given = {
            field.name: hook(value[field.name], field.type)
            for field, hook in fields
            if field.required or field.name in value
        }
        return kind(**given)

    return message


def _mapping_hook(kind: Any) -> Hook:
    """Makes the hook of a `dict[str, element]`."""
    element = get_args(kind)[1]
    hook = _converter.get_structure_hook(element)

    def mapping(value: Any, _: Any) -> dict[str, Any]:
        if type(value) is not dict:
            raise DecodeError("wrong-type", f"a map is expected, not {value!r:.40}")
        return {_text(key): hook(item, element) for key, item in value.items()}

    return mapping


def _is_sequence(kind: Any) -> bool:
    return get_origin(kind) is tuple and ... in get_args(kind)


def _is_vector(kind: Any) -> bool:
    return get_origin(kind) is tuple and len(get_args(kind)) == 3


def _is_mapping(kind: Any) -> bool:
    return get_origin(kind) is dict


def _is_ranged(kind: Any) -> bool:
    return get_origin(kind) is Annotated and isinstance(get_args(kind)[1], msgspec.Meta)


def _is_record(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")


def _is_message(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, Message)


def _make_converter() -> Converter:
    converter = Converter(detailed_validation=False)
    converter.register_structure_hook(bool, _boolean)
    converter.register_structure_hook(int, _integer)
    converter.register_structure_hook(float, _number)
    converter.register_structure_hook(str, _text)
    converter.register_structure_hook(bytes, _binary)
    converter.register_structure_hook_factory(_is_ranged, _ranged_hook)
    converter.register_structure_hook_factory(_is_sequence, _sequence_hook)
    converter.register_structure_hook_factory(_is_vector, _vector_hook)
    converter.register_structure_hook_factory(_is_mapping, _mapping_hook)
    converter.register_structure_hook_factory(_is_message, _message_hook)
    converter.register_structure_hook_factory(_is_record, _record_hook)
    # By class, because a hook for `str` or `int` would also take their subclasses and leave a bare string.
    converter.register_structure_hook(Flag, _flags)
    for words in (Wish, Mode):
        converter.register_structure_hook(words, _word_hook(words))
    return converter


_converter = _make_converter()
