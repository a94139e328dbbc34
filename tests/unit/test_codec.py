"""The codec: exact for every message, and strict with everything else."""

import math
from typing import Any

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from shared.codec import MAX_PAYLOAD, decode, decode_valid, encode
from shared.config import load_scenario
from shared.errors import DecodeError
from shared.formation import build_formation
from shared.messages import (
    ORIGIN,
    SCHEMA_VERSION,
    DroneState,
    Flag,
    FormationState,
    HandSample,
    Heard,
    Message,
    Mode,
    ProcessStatus,
    Wish,
)
from shared.strict_codec import decode_strictly
from shared.topics import DRONE_STATE, HAND
from tests.strategies import MESSAGES, TREES, fields_of, garbage, mutations, refusal

REASONS = {"malformed", "oversized", "version", "wrong-type", "missing-field", "non-finite", "out-of-range"}
KINDS = st.sampled_from(sorted(MESSAGES, key=lambda kind: kind.__name__))
NOW = 1_800_000_000_000_000_000

HAND_SAMPLE = HandSample(
    epoch=NOW, seq=7, stamp_ns=NOW, position=(0.1, 0.2, 1.2), velocity=(0.3, 0.0, 0.0), yaw=0.5, mode=Wish.FLY
)
STATE = DroneState(
    epoch=NOW,
    seq=7,
    stamp_ns=NOW,
    id=4,
    position=(0.1, 0.2, 1.2),
    velocity=(0.1, 0.0, 0.0),
    goal=(0.1, 0.2, 1.2),
    goal_velocity=ORIGIN,
    setpoint=(0.1, 0.2, 1.2),
    mode=Mode.FOLLOW,
    displacements={"2-4": (0.01, 0.02, 0.03), "3-4": (0.01, 0.02, 0.03)},
    flags=Flag.FENCE | Flag.AVOIDING,
    heard={key: Heard(NOW, 7, NOW) for key in (HAND.key(), DRONE_STATE.key(id=2), DRONE_STATE.key(id=3))},
    step_ns=NOW,
)
FORMATION = FormationState(
    epoch=1,
    seq=1,
    stamp_ns=1,
    area=0.5,
    area_ratio=1.0,
    distances={"1-2": 0.7},
    extent=0,
    trend=0,
    displacement=0.0,
)
STATUS = ProcessStatus(epoch=1, seq=1, stamp_ns=1, role="drone", id=1, pid=2, host="here", state="running")


def pack(message: Message, **changed: Any) -> bytes:
    return bytes(msgpack.packb({**fields_of(message), **changed}))


@given(data=st.data(), kind=KINDS)
def test_every_message_survives_the_wire_exactly(data: st.DataObject, kind: type[Message]) -> None:
    message = data.draw(MESSAGES[kind])
    payload = encode(message)
    decoded = decode(payload, kind)
    assert decoded == message
    assert type(decoded) is kind
    assert encode(decoded) == payload
    assert payload == msgpack.packb({"v": SCHEMA_VERSION, **structs.asdict(message)})


@pytest.mark.parametrize(("first", "last"), [(1, 2), (2, 2), (None, 2), (2, None), (None, None)])
def test_a_version_is_there_and_right_wherever_it_is(first: int | None, last: int | None) -> None:
    fields = msgpack.packb(structs.asdict(HAND_SAMPLE))
    said = [b"" if v is None else msgpack.packb("v") + msgpack.packb(v) for v in (first, last)]
    count = len(structs.asdict(HAND_SAMPLE)) + sum(map(bool, said))
    with pytest.raises(DecodeError) as refused:
        decode(bytes([0x80 | count]) + said[0] + fields[1:] + said[1], HandSample)
    assert refused.value.reason == "version"


def test_a_version_may_come_last() -> None:
    fields = {**structs.asdict(HAND_SAMPLE), "v": SCHEMA_VERSION}
    assert decode(msgpack.packb(fields), HandSample) == HAND_SAMPLE


@given(data=st.data(), kind=KINDS)
def test_both_decoders_agree_on_what_is_valid(data: st.DataObject, kind: type[Message]) -> None:
    payload = encode(data.draw(MESSAGES[kind]))
    assert decode_valid(payload, kind) == decode_strictly(payload, kind)
    wrong = data.draw(mutations(kind))
    taken = decode_valid(wrong, kind)
    if taken is not None:
        assert taken == decode_strictly(wrong, kind)
        assert encode(taken) == encode(decode_strictly(wrong, kind))


def test_words_and_flags_come_back_as_what_they_were() -> None:
    state = decode(encode(STATE), DroneState)
    assert type(state.mode) is Mode
    assert state.flags == Flag.FENCE | Flag.AVOIDING
    assert type(state.flags) is Flag
    assert type(state.heard[HAND.key()]) is Heard
    assert type(decode(encode(HAND_SAMPLE), HandSample).mode) is Wish


@given(data=st.data(), kind=KINDS)
def test_whatever_is_wrong_with_a_field_is_a_decode_error(data: st.DataObject, kind: type[Message]) -> None:
    payload = data.draw(mutations(kind))
    reason = refusal(payload, kind)
    if reason is None:
        message = decode(payload, kind)
        assert decode(encode(message), kind) == message
    else:
        assert reason in REASONS


@given(payload=st.binary(max_size=MAX_PAYLOAD + 2), kind=KINDS)
def test_random_bytes_are_refused(payload: bytes, kind: type[Message]) -> None:
    assert refusal(payload, kind) in REASONS


@given(tree=TREES, kind=KINDS)
def test_other_trees_are_refused(tree: Any, kind: type[Message]) -> None:
    assert refusal(bytes(msgpack.packb(tree)), kind) in REASONS


@given(data=st.data(), kind=KINDS)
def test_the_garbage_of_the_other_tests_is_garbage(data: st.DataObject, kind: type[Message]) -> None:
    assert refusal(data.draw(garbage(kind)), kind) in REASONS


@pytest.mark.parametrize("message", [HAND_SAMPLE, STATE, FORMATION, STATUS])
def test_a_truncation_at_any_length_is_malformed(message: Message) -> None:
    payload = encode(message)
    reasons = {refusal(payload[:length], type(message)) for length in range(len(payload))}
    assert reasons == {"malformed"}
    assert refusal(payload + b"\0", type(message)) == "malformed"


@pytest.mark.parametrize("message", [HAND_SAMPLE, STATE, FORMATION, STATUS])
def test_a_field_that_is_missing_is_named(message: Message) -> None:
    fields = fields_of(message)
    optional = {"signature", "displacements", "pose_age", "battery", "flags", "heard", "step_ns", "missing"}
    optional |= {"unheard", "lost", "jumped", "ahead", "pace", "asked"}
    optional |= {"form", "rate_hz", "cpu", "rss_mb", "rejected", "metrics"}
    for name in fields.keys() - {"v"}:
        payload = bytes(msgpack.packb({key: value for key, value in fields.items() if key != name}))
        if name in optional:
            assert refusal(payload, type(message)) is None
        else:
            with pytest.raises(DecodeError, match=f"missing-field: '{name}'"):
                decode(payload, type(message))


NAN, INF = math.nan, math.inf


@pytest.mark.parametrize(
    ("reason", "message", "changed"),
    [
        ("non-finite", HAND_SAMPLE, {"position": [0.0, NAN, 0.0]}),
        ("non-finite", HAND_SAMPLE, {"position": [0, INF, 0]}),
        ("non-finite", HAND_SAMPLE, {"yaw": -INF}),
        ("non-finite", STATE, {"displacements": {"1-2": [0.0, 0.0, INF]}}),
        ("non-finite", STATUS, {"metrics": {"x": NAN}}),
        ("wrong-type", HAND_SAMPLE, {"yaw": True}),
        ("wrong-type", HAND_SAMPLE, {"yaw": "0.5"}),
        ("wrong-type", HAND_SAMPLE, {"yaw": None}),
        ("wrong-type", HAND_SAMPLE, {"position": [False, 0.0, 0.0]}),
        ("wrong-type", HAND_SAMPLE, {"position": "abc"}),
        ("wrong-type", HAND_SAMPLE, {"position": b"abc"}),
        ("wrong-type", HAND_SAMPLE, {"position": {"a": 1, "b": 2, "c": 3}}),
        ("wrong-type", HAND_SAMPLE, {"position": [0.0, 0.0]}),
        ("wrong-type", HAND_SAMPLE, {"position": [0.0, 0.0, 0.0, 0.0]}),
        ("wrong-type", HAND_SAMPLE, {"position": [[0.0], 0.0, 0.0]}),
        ("wrong-type", HAND_SAMPLE, {"signature": "text"}),
        ("wrong-type", HAND_SAMPLE, {"mode": 1}),
        ("wrong-type", HAND_SAMPLE, {"seq": 1.0}),
        ("wrong-type", HAND_SAMPLE, {"seq": True}),
        ("wrong-type", HAND_SAMPLE, {"seq": float(2**64)}),
        ("wrong-type", HAND_SAMPLE, {"epoch": msgpack.ExtType(1, b"1")}),
        ("wrong-type", STATE, {"flags": 1.0}),
        ("wrong-type", STATE, {"displacements": [["1-2", [0.0, 0.0, 0.0]]]}),
        ("wrong-type", STATE, {"displacements": {b"1-2": [0.0, 0.0, 0.0]}}),
        ("wrong-type", STATE, {"heard": None}),
        ("wrong-type", STATE, {"heard": {"human/hand": [1, 2]}}),
        ("wrong-type", STATE, {"heard": {"human/hand": "123"}}),
        ("wrong-type", STATE, {"heard": {"human/hand": [1, 2, 3.0]}}),
        ("wrong-type", FORMATION, {"missing": b"\x01\x02"}),
        ("wrong-type", FORMATION, {"missing": {"1": 2}}),
        ("wrong-type", FORMATION, {"missing": ["1"]}),
        ("wrong-type", STATUS, {"rejected": {"malformed": 1.5}}),
        ("wrong-type", STATUS, {"host": 5}),
        ("out-of-range", HAND_SAMPLE, {"position": [1000.1, 0.0, 0.0]}),
        ("out-of-range", HAND_SAMPLE, {"position": [2**63, 0, 0]}),
        ("out-of-range", HAND_SAMPLE, {"velocity": [0.0, -50.1, 0.0]}),
        ("out-of-range", HAND_SAMPLE, {"yaw": 1e4}),
        ("out-of-range", HAND_SAMPLE, {"mode": "DANCE"}),
        ("out-of-range", HAND_SAMPLE, {"seq": -1}),
        ("out-of-range", HAND_SAMPLE, {"stamp_ns": -(2**63)}),
        ("out-of-range", STATE, {"id": 0}),
        ("out-of-range", STATE, {"id": 65_536}),
        ("out-of-range", STATE, {"flags": -1}),
        ("out-of-range", STATE, {"battery": 1.1}),
        ("out-of-range", STATE, {"pose_age": -0.1}),
        ("out-of-range", STATE, {"heard": {"human/hand": [1, -2, 3]}}),
        ("out-of-range", FORMATION, {"extent": 2}),
        ("version", HAND_SAMPLE, {"v": SCHEMA_VERSION + 1}),
        ("version", HAND_SAMPLE, {"v": float(SCHEMA_VERSION)}),
        ("version", HAND_SAMPLE, {"v": True}),
        ("version", HAND_SAMPLE, {"v": None}),
    ],
)
def test_each_fault_has_its_reason(reason: str, message: Message, changed: dict[str, Any]) -> None:
    with pytest.raises(DecodeError) as refused:
        decode(pack(message, **changed), type(message))
    assert refused.value.reason == reason


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"", "malformed"),
        (b"\xc1", "malformed"),
        (msgpack.packb([1, 2, 3]), "malformed"),
        (msgpack.packb(None), "malformed"),
        (msgpack.packb({1: 2}), "malformed"),
        (msgpack.packb({}), "version"),
        (msgpack.packb({b"v": SCHEMA_VERSION}), "version"),
        (b"\x91" * MAX_PAYLOAD, "malformed"),
        (b"\x81\xa1v" * (MAX_PAYLOAD // 3), "malformed"),
        (b"\xdf\xff\xff\xff\xff", "malformed"),
        (b"\xa2\xff\xfe", "malformed"),
    ],
)
def test_what_is_no_map_of_ours_is_refused(payload: bytes, reason: str) -> None:
    assert refusal(payload, HandSample) == reason


def test_the_size_limit_is_exact_and_comes_first() -> None:
    spare = MAX_PAYLOAD - len(pack(HAND_SAMPLE, later=b"x" * 300)) + 300
    fitting = pack(HAND_SAMPLE, later=b"x" * spare)
    assert len(fitting) == MAX_PAYLOAD
    assert decode(fitting, HandSample) == HAND_SAMPLE
    assert refusal(pack(HAND_SAMPLE, later=b"x" * (spare + 1)), HandSample) == "oversized"
    assert refusal(bytes(64 * 1024), HandSample) == "oversized"


@given(tree=TREES)
def test_unknown_extra_fields_are_ignored(tree: Any) -> None:
    assert decode(pack(STATE, later=tree), DroneState) == STATE


def test_of_newer_flags_the_known_ones_are_kept() -> None:
    newer = 1 << 31
    assert decode(pack(STATE, flags=newer | int(Flag.FENCE)), DroneState).flags == Flag.FENCE


def test_whole_numbers_are_numbers() -> None:
    sample = decode(pack(HAND_SAMPLE, position=[1, 2, 3], yaw=2), HandSample)
    assert (sample.position, sample.yaw) == ((1.0, 2.0, 3.0), 2.0)
    assert {type(x) for x in (*sample.position, sample.yaw)} == {float}


def test_payloads_are_small() -> None:
    assert len(encode(HAND_SAMPLE)) < 160
    assert len(encode(STATE)) < 600
    formation = build_formation(load_scenario("grid", ["formation.n=64"]))
    pairs = {link.name: 0.5 for link in formation.links}
    widest = FormationState(
        **{name: getattr(FORMATION, name) for name in ("epoch", "seq", "stamp_ns", "area", "area_ratio")},
        distances=pairs,
        extent=0,
        trend=0,
        displacement=0.0,
        heard={DRONE_STATE.key(id=i): Heard(NOW, 7, NOW) for i in formation.ids},
    )
    assert len(encode(widest)) < MAX_PAYLOAD
