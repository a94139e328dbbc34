"""Hypothesis strategies of the shared vocabulary: valid messages, and payloads that are none."""

import math
from typing import Any

import msgpack
from hypothesis import strategies as st

from shared.codec import MAX_PAYLOAD, decode, encode
from shared.errors import DecodeError
from shared.messages import (
    MAX_POSITION,
    MAX_RADIUS,
    MAX_VALID,
    MAX_VELOCITY,
    DroneState,
    Flag,
    FormationState,
    HandSample,
    Heard,
    Message,
    Mode,
    ObstacleState,
    PatternEvent,
    Places,
    ProcessStatus,
    Seen,
    Wish,
)

UINT64 = st.integers(0, 2**64 - 1)


def _vectors(limit: float) -> st.SearchStrategy[tuple[float, float, float]]:
    number = st.floats(-limit, limit)
    return st.tuples(number, number, number)


POSITIONS, VELOCITIES = _vectors(MAX_POSITION), _vectors(MAX_VELOCITY)
NAMES = st.text(max_size=12)
NOT_NEGATIVE = st.floats(0.0, 1e9)
ENVELOPE = {"epoch": UINT64, "seq": UINT64, "stamp_ns": UINT64}
HEARD = st.dictionaries(NAMES, st.builds(Heard, UINT64, UINT64, UINT64), max_size=4)
LOST = st.builds(
    Seen, st.integers(1, 65_535), UINT64, UINT64, POSITIONS, VELOCITIES, st.sampled_from(Mode), NOT_NEGATIVE
)

MESSAGES: dict[type[Message], st.SearchStrategy[Any]] = {
    HandSample: st.builds(
        HandSample,
        **ENVELOPE,
        position=POSITIONS,
        velocity=VELOCITIES,
        yaw=st.floats(-1_000.0, 1_000.0),
        mode=st.sampled_from(Wish),
        signature=st.none() | st.binary(max_size=64),
    ),
    DroneState: st.builds(
        DroneState,
        **ENVELOPE,
        id=st.integers(1, 65_535),
        position=POSITIONS,
        velocity=VELOCITIES,
        goal=POSITIONS,
        goal_velocity=VELOCITIES,
        setpoint=POSITIONS,
        mode=st.sampled_from(Mode),
        displacements=st.dictionaries(NAMES, POSITIONS, max_size=4),
        pose_age=NOT_NEGATIVE,
        battery=st.floats(0.0, 1.0),
        flags=st.integers(0, int(sum(Flag))).map(Flag),
        heard=HEARD,
        unheard=st.lists(st.integers(1, 65_535), max_size=4).map(tuple),
        lost=st.lists(LOST, max_size=3).map(tuple),
        step_ns=UINT64,
    ),
    Places: st.builds(
        Places, **ENVELOPE, id=st.integers(1, 65_535), seen=st.lists(LOST, max_size=3).map(tuple)
    ),
    ObstacleState: st.builds(
        ObstacleState,
        **ENVELOPE,
        id=st.integers(1, 65_535),
        position=POSITIONS,
        velocity=VELOCITIES,
        radius=st.floats(0.0, MAX_RADIUS),
        height=st.floats(0.0, MAX_POSITION),
        valid_s=st.floats(0.0, MAX_VALID),
    ),
    FormationState: st.builds(
        FormationState,
        **ENVELOPE,
        area=NOT_NEGATIVE,
        area_ratio=NOT_NEGATIVE,
        distances=st.dictionaries(NAMES, NOT_NEGATIVE, max_size=4),
        extent=st.integers(-1, 1),
        trend=st.integers(-1, 1),
        displacement=st.floats(-MAX_POSITION, MAX_POSITION),
        missing=st.lists(st.integers(1, 65_535), max_size=4).map(tuple),
        heard=HEARD,
    ),
    PatternEvent: st.builds(
        PatternEvent,
        **ENVELOPE,
        pattern=NAMES,
        outcome=NAMES,
        state_seq=UINT64,
        heard=HEARD,
        started_ns=UINT64,
        finished_ns=UINT64,
    ),
    ProcessStatus: st.builds(
        ProcessStatus,
        **ENVELOPE,
        role=NAMES,
        id=st.integers(0, 65_535),
        pid=UINT64,
        host=NAMES,
        state=NAMES,
        rate_hz=NOT_NEGATIVE,
        cpu=NOT_NEGATIVE,
        rss_mb=NOT_NEGATIVE,
        rejected=st.dictionaries(NAMES, UINT64, max_size=4),
        metrics=st.dictionaries(NAMES, st.floats(allow_nan=False, allow_infinity=False), max_size=4),
    ),
}
"""Every message type -> all of its values."""

SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats()
    | st.sampled_from([math.nan, math.inf, -math.inf, 1e300, 2**63])
    | st.text(max_size=8)
    | st.binary(max_size=8)
    | st.just(msgpack.ExtType(5, b"x"))
)
TREES = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)
"""Whatever MessagePack can carry."""


def fields_of(message: Message) -> dict[str, Any]:
    """Returns a message as the map that goes over the wire."""
    fields: dict[str, Any] = msgpack.unpackb(encode(message))
    return fields


@st.composite
def mutations(draw: st.DrawFn, kind: type[Message]) -> bytes:
    """A valid message with one field replaced by anything, left out, or of another version."""
    fields = fields_of(draw(MESSAGES[kind]))
    name = draw(st.sampled_from(sorted(fields)))
    if draw(st.booleans()):
        fields[name] = draw(TREES)
    else:
        del fields[name]
    return bytes(msgpack.packb(fields))


def garbage(kind: type[Message]) -> st.SearchStrategy[bytes]:
    """Payloads that are no message of this type: mutated, cut short, random or too long."""
    cut = st.builds(lambda m, share: encode(m)[: int(share * 100)], MESSAGES[kind], st.floats(0.0, 1.0))
    long = st.builds(lambda m, n: encode(m) + bytes(n), MESSAGES[kind], st.integers(MAX_PAYLOAD, 65_536))
    return st.one_of(mutations(kind), cut, long, st.binary(max_size=256)).filter(
        lambda payload: refusal(payload, kind) is not None
    )


def refusal(payload: bytes, kind: type[Message]) -> str | None:
    """Returns the reason for which a payload is refused, None if it is a message of this type."""
    try:
        decode(payload, kind)
    except DecodeError as error:
        return error.reason
    return None
