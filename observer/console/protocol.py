"""What the page and the console say to each other over the WebSocket `/ws`: JSON, one object per message.

Pure. Every message has a `type`; `docs/console.md` lists the fields. Units are SI, the frame is the world's
(x, y horizontal, z up), times are seconds on the console's clock. What a page sends is parsed strictly: unknown
types, unknown or missing fields, non-finite numbers and oversized messages are refused, never raised further.
"""

import json
from collections.abc import Callable, Mapping
from typing import Any, NoReturn

from attrs import frozen

from shared.errors import DecodeError
from shared.messages import MAX_POSITION, Vector, Wish

PROTOCOL_VERSION = 1

MAX_MESSAGE = 1024
"""Longest message that a page may send, bytes."""

MAX_YAW = 1_000.0

Json = dict[str, Any]


@frozen
class Take:
    """Takes the hand if nobody holds it, else asks for it."""


@frozen
class Release:
    """Lets go of the hand, or withdraws the question."""


@frozen
class Give:
    """Hands the hand to another page, which must have asked.

    Attributes:
        to: Number of that page.
    """

    to: int


@frozen
class Move:
    """Where the holder wants the mapped hand; repeated at least twice a second, also at rest.

    Attributes:
        point: World frame, m.
        yaw: Heading, rad.
    """

    point: Vector
    yaw: float


@frozen
class Want:
    """What the operator wants.

    Attributes:
        wish: FLY, HOLD, GROUND (land) or STOP; STOP is obeyed from any page, the others from the holder.
    """

    wish: Wish


Request = Take | Release | Give | Move | Want


def encode(message: Mapping[str, Any]) -> str:
    """Writes a message to the page as compact JSON; lengths to the millimetre, times to the millisecond.

    Raises:
        ValueError: It holds a number that is not finite.
    """
    return json.dumps(_rounded(message), separators=(",", ":"), allow_nan=False)


def parse(text: str | bytes) -> Request:
    """Reads a message from a page.

    Args:
        text: As received.

    Raises:
        DecodeError: For whatever is wrong with it; nothing else is raised.
    """
    if len(text) > MAX_MESSAGE:
        raise DecodeError("oversized", f"{len(text)} characters, at most {MAX_MESSAGE}")
    try:
        fields = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise DecodeError("malformed", str(error)) from error
    if type(fields) is not dict:
        raise DecodeError("malformed", "an object is expected")
    kind = fields.pop("type", None)
    reader = _READERS.get(kind) if type(kind) is str else None
    if reader is None:
        raise DecodeError("unknown-type", f"{kind!r:.40}; known: {', '.join(_READERS)}")
    names, build = reader
    if set(fields) != set(names):
        raise DecodeError("wrong-fields", f"{kind} takes {', '.join(names) or 'no fields'}")
    return build(*(fields[name] for name in names))


def _rounded(value: Any) -> Any:
    kind = type(value)
    if kind is float:
        return round(value, 3)
    if kind is dict:
        return {key: _rounded(item) for key, item in value.items()}
    if kind is list or kind is tuple:
        return [_rounded(item) for item in value]
    return value


def _refuse_constant(name: str) -> NoReturn:
    raise DecodeError("non-finite", name)


def _give(to: Any) -> Give:
    if type(to) is not int:
        raise DecodeError("wrong-type", f"the number of a page is expected, not {to!r:.40}")
    return Give(to)


def _move(point: Any, yaw: Any) -> Move:
    if type(point) is not list or len(point) != 3:
        raise DecodeError("wrong-type", f"three numbers are expected, not {point!r:.40}")
    x, y, z = (_number(item, MAX_POSITION) for item in point)
    return Move((x, y, z), _number(yaw, MAX_YAW))


def _want(wish: Any) -> Want:
    if wish not in (Wish.FLY, Wish.HOLD, Wish.GROUND, Wish.STOP):
        raise DecodeError("out-of-range", f"wish {wish!r:.40}; FLY, HOLD, GROUND or STOP")
    return Want(Wish(wish))


def _number(value: Any, limit: float) -> float:
    # A NaN fails every comparison, and a whole number of any length can be compared.
    if type(value) not in (int, float) or not abs(value) <= limit:
        raise DecodeError("out-of-range", f"a number within +-{limit:g} is expected, not {value!r:.40}")
    return float(value)


_READERS: dict[str, tuple[tuple[str, ...], Callable[..., Request]]] = {
    "take": ((), Take),
    "release": ((), Release),
    "give": (("to",), _give),
    "hand": (("point", "yaw"), _move),
    "wish": (("wish",), _want),
}
"""Type -> fields in order, and what makes a request of them."""
