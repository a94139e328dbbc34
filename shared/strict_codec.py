"""Messages field by field: says what is wrong with a payload that `shared.codec` does not take."""

import enum
import functools
import math
from collections.abc import Callable
from types import UnionType
from typing import Annotated, Any, TypeVar, cast, get_args, get_origin, get_type_hints

import msgpack
import msgspec
from msgspec import structs

from shared.errors import DecodeError
from shared.messages import SCHEMA_VERSION, Flag, Message

M = TypeVar("M", bound=Message)
Hook = Callable[[Any], Any]


class _Envelope(msgspec.Struct):
    """The version as a field that must be there: as the tag of a message msgspec does without it."""

    v: Annotated[int, msgspec.Meta(ge=SCHEMA_VERSION, le=SCHEMA_VERSION)]


_envelope = msgspec.msgpack.Decoder(_Envelope)


def check_version(payload: bytes) -> None:
    """Looks for the version wherever it may be.

    Raises:
        msgspec.MsgspecError: It is not there, or not ours, or this is no map.
    """
    _envelope.decode(payload)


def decode_strictly(payload: bytes, kind: type[M]) -> M:
    """Decodes field by field; arguments and errors as for `shared.codec.decode`."""
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
        return cast(M, _hook_of(kind)(fields))
    except DecodeError:
        raise
    except KeyError as error:
        raise DecodeError("missing-field", str(error)) from error
    except Exception as error:
        raise DecodeError("wrong-type", f"{type(error).__name__}: {error}") from error


@functools.cache
def _hook_of(kind: Any) -> Hook:
    """Returns what checks, and makes, a value of a type that fields of messages have."""
    if kind in _SCALARS:
        return _SCALARS[kind]
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _ranged_hook(*arguments[:2])
    if origin is dict:
        return _mapping_hook(arguments[1])
    if origin is tuple:
        return _sequence_hook(arguments[0]) if ... in arguments else _vector_hook(arguments)
    if origin is UnionType:
        return _optional_hook(arguments[0])
    return _class_hook(kind)


def _class_hook(kind: type) -> Hook:
    if issubclass(kind, enum.StrEnum):
        return _word_hook(kind)
    return _message_hook(kind) if issubclass(kind, Message) else _record_hook(kind)


def _integer(value: Any) -> int:
    if type(value) is not int:
        raise DecodeError("wrong-type", f"an integer is expected, not {value!r:.40}")
    return value


def _number(value: Any) -> float:
    if type(value) is not float and type(value) is not int:
        raise DecodeError("wrong-type", f"a number is expected, not {value!r:.40}")
    if not math.isfinite(value):
        raise DecodeError("non-finite", repr(value))
    return float(value)


def _text(value: Any) -> str:
    if type(value) is not str:
        raise DecodeError("wrong-type", f"a string is expected, not {value!r:.40}")
    return value


def _boolean(value: Any) -> bool:
    if type(value) is not bool:
        raise DecodeError("wrong-type", f"true or false is expected, not {value!r:.40}")
    return value


def _binary(value: Any) -> bytes:
    if type(value) is not bytes:
        raise DecodeError("wrong-type", f"bytes are expected, not {value!r:.40}")
    return value


def _flags(value: Any) -> Flag:
    bits = _integer(value)
    if bits < 0 or bits > 0xFFFF_FFFF:
        raise DecodeError("out-of-range", f"flags {bits}")
    return Flag(bits)


def _word_hook(kind: type[enum.StrEnum]) -> Hook:
    """Makes the hook of an enumeration of words."""
    words = {word.value: word for word in kind}

    def word(value: Any) -> enum.StrEnum:
        found = words.get(value) if type(value) is str else None
        if found is None:
            raise DecodeError("out-of-range", f"{_text(value)!r:.40} is none of {', '.join(words)}")
        return found

    return word


def _ranged_hook(base: type, bounds: Any) -> Hook:
    """Makes the hook of an `Annotated[number, Meta(...)]`."""
    low, high = bounds.ge, math.inf if bounds.le is None else bounds.le
    scalar = _integer if base is int else _number

    def number(value: Any) -> Any:
        checked = scalar(value)
        if not low <= checked <= high:
            raise DecodeError("out-of-range", f"{checked!r} not in [{low}, {high}]")
        return checked

    return number


def _vector_hook(elements: tuple[Any, ...]) -> Hook:
    """Makes the hook of a `tuple[number, number, number]`."""
    hook = _hook_of(elements[0])

    def vector(value: Any) -> tuple[float, float, float]:
        if type(value) is not tuple or len(value) != 3:
            raise DecodeError("wrong-type", f"three numbers are expected, not {value!r:.40}")
        x, y, z = value
        return (hook(x), hook(y), hook(z))

    return vector


def _record_hook(kind: Any) -> Hook:
    """Makes the hook of a named tuple."""
    hints = get_type_hints(kind, include_extras=True)
    hooks = [_hook_of(hint) for hint in hints.values()]
    names = ", ".join(hints)

    def record(value: Any) -> Any:
        if type(value) is not tuple or len(value) != len(hooks):
            raise DecodeError("wrong-type", f"({names}) is expected, not {value!r:.40}")
        return kind(*[hook(item) for item, hook in zip(value, hooks, strict=True)])

    return record


def _sequence_hook(element: Any) -> Hook:
    """Makes the hook of a `tuple[element, ...]`; bytes and maps can be iterated too, but are none."""
    hook = _hook_of(element)

    def sequence(value: Any) -> tuple[Any, ...]:
        if type(value) is not tuple:
            raise DecodeError("wrong-type", f"a list is expected, not {value!r:.40}")
        return tuple([hook(item) for item in value])

    return sequence


def _message_hook(kind: Any) -> Hook:
    """Makes the hook of a message."""
    fields = [(field, _hook_of(field.type)) for field in structs.fields(kind)]

    def message(value: Any) -> Any:
        given = {
            field.name: hook(value[field.name])
            for field, hook in fields
            if field.required or field.name in value
        }
        return kind(**given)

    return message


def _mapping_hook(element: Any) -> Hook:
    """Makes the hook of a `dict[str, element]`."""
    hook = _hook_of(element)

    def mapping(value: Any) -> dict[str, Any]:
        if type(value) is not dict:
            raise DecodeError("wrong-type", f"a map is expected, not {value!r:.40}")
        return {_text(key): hook(item) for key, item in value.items()}

    return mapping


def _optional_hook(element: Any) -> Hook:
    """Makes the hook of an `element | None`."""
    hook = _hook_of(element)
    return lambda value: None if value is None else hook(value)


_SCALARS: dict[Any, Hook] = {
    bool: _boolean,
    int: _integer,
    float: _number,
    str: _text,
    bytes: _binary,
    Flag: _flags,
}
