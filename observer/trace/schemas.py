"""JSON Schemas of messages and attrs classes, derived from their declared types: a trace explains itself.

A schema describes the decoded MessagePack map, and the same message in JSON. Bytes are binary in MessagePack
and base64 in JSON; JSON Schema has a word for the latter only.
"""

import base64
import enum
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import attrs
import msgpack
from msgspec import Meta, structs

from shared.codec import encode
from shared.messages import SCHEMA_VERSION, Message

Schema = dict[str, Any]
Kind = type[Message] | type[attrs.AttrsInstance]
"""What has a schema: a message, or any attrs class of numbers, words, vectors and such classes."""

_DIALECT = "https://json-schema.org/draft/2020-12/schema"
_FLAG_BITS = 32
_PLAIN: dict[Any, Schema] = {
    str: {"type": "string"},
    bytes: {"type": "string", "contentEncoding": "base64"},
    int: {"type": "integer"},
    float: {"type": "number"},
    bool: {"type": "boolean"},
    NoneType: {"type": "null"},
}


def json_schema(kind: Kind) -> Schema:
    """Describes a class.

    Args:
        kind: Its type.

    Returns:
        A JSON Schema (2020-12); more fields than it names are allowed, as in `shared.codec`.
    """
    schema = {"$schema": _DIALECT, "title": kind.__name__, **_object(kind)}
    if issubclass(kind, Message):
        schema["properties"] = {"v": {"const": SCHEMA_VERSION}, **schema["properties"]}
        schema["required"] = ["v", *schema["required"]]
    return schema


def json_fields(message: Message) -> dict[str, Any]:
    """Returns a message as its schema describes it, ready for JSON: the map that is sent, bytes as base64."""
    fields: dict[str, Any] = msgpack.unpackb(encode(message))
    return {name: _base64(value) if isinstance(value, bytes) else value for name, value in fields.items()}


def _base64(value: bytes) -> str:
    return base64.b64encode(value).decode()


def _object(kind: Kind) -> Schema:
    hints = get_type_hints(kind, include_extras=True)
    if issubclass(kind, Message):
        required = {field.name: field.required for field in structs.fields(kind)}
    else:
        required = {field.name: field.default is attrs.NOTHING for field in attrs.fields(kind)}
    return {
        "type": "object",
        "properties": {name: _schema(hints[name]) for name in required},
        "required": [name for name, needed in required.items() if needed],
    }


def _schema(kind: Any) -> Schema:
    if kind in _PLAIN:
        return dict(_PLAIN[kind])
    return _class(kind) if isinstance(kind, type) and get_origin(kind) is None else _generic(kind)


def _generic(kind: Any) -> Schema:
    origin, arguments = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _bounded(_schema(arguments[0]), arguments[1])
    if origin in (Union, UnionType):
        return {"anyOf": [_schema(option) for option in arguments]}
    if origin is tuple:
        return _array(arguments)
    if origin is dict:
        return {"type": "object", "additionalProperties": _schema(arguments[1])}
    raise TypeError(f"no schema for {kind}")


def _class(kind: Any) -> Schema:
    if issubclass(kind, enum.StrEnum):
        return {"type": "string", "enum": [word.value for word in kind]}
    if issubclass(kind, enum.IntFlag):
        return {"type": "integer", "minimum": 0, "maximum": 2**_FLAG_BITS - 1}
    if issubclass(kind, enum.IntEnum):
        return {"type": "integer", "enum": [number.value for number in kind]}
    if issubclass(kind, tuple):
        return _array(tuple(get_type_hints(kind, include_extras=True).values()))
    return _object(kind)


def _array(kinds: tuple[Any, ...]) -> Schema:
    """Describes a tuple."""
    if not kinds:
        return {"type": "array", "maxItems": 0}
    one_type = ... in kinds or all(kind == kinds[0] for kind in kinds)
    schema: Schema = {"type": "array"}
    schema |= {"items": _schema(kinds[0])} if one_type else {"prefixItems": [_schema(kind) for kind in kinds]}
    if ... not in kinds:
        schema |= {"minItems": len(kinds), "maxItems": len(kinds)}
    return schema


def _bounded(schema: Schema, bounds: Meta) -> Schema:
    limits = {"minimum": bounds.ge, "maximum": bounds.le}
    return {**schema, **{name: limit for name, limit in limits.items() if limit is not None}}
