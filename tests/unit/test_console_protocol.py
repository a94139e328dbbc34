"""What a page may say: parsed strictly, never raised further than a DecodeError."""

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer.console.protocol import MAX_MESSAGE, Give, Move, Release, Take, Want, encode, parse
from shared.errors import DecodeError
from shared.messages import Wish

json_values: st.SearchStrategy[Any] = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=6), inner, max_size=4),
    max_leaves=8,
)
known = st.fixed_dictionaries(
    {"type": st.sampled_from(["take", "release", "give", "hand", "wish"])},
    optional={"to": json_values, "point": json_values, "yaw": json_values, "wish": json_values},
)


@pytest.mark.parametrize(
    ("text", "request_"),
    [
        ('{"type":"take"}', Take()),
        (b'{"type":"release"}', Release()),
        ('{"type":"give","to":3}', Give(3)),
        ('{"type":"hand","point":[1,-2.5,1.2],"yaw":0.5}', Move((1.0, -2.5, 1.2), 0.5)),
        ('{"type":"wish","wish":"GROUND"}', Want(Wish.GROUND)),
    ],
)
def test_what_a_page_may_say(text: str | bytes, request_: object) -> None:
    assert parse(text) == request_


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "malformed"),
        ("[]", "malformed"),
        ("nonsense", "malformed"),
        (b"\xff\xfe\x00", "malformed"),
        ("[" * 900, "malformed"),
        ('{"type":"take","x":1}', "wrong-fields"),
        ('{"type":"hand","point":[1,2,3]}', "wrong-fields"),
        ('{"type":"fly"}', "unknown-type"),
        ('{"type":["take"]}', "unknown-type"),
        ('{"type":"give","to":true}', "wrong-type"),
        ('{"type":"hand","point":[1,2],"yaw":0}', "wrong-type"),
        ('{"type":"hand","point":"123","yaw":0}', "wrong-type"),
        ('{"type":"hand","point":[1,2,NaN],"yaw":0}', "non-finite"),
        ('{"type":"hand","point":[1,2,1e999],"yaw":0}', "out-of-range"),
        ('{"type":"hand","point":[1,2,1001],"yaw":0}', "out-of-range"),
        ('{"type":"hand","point":[1,2,true],"yaw":0}', "out-of-range"),
        ('{"type":"wish","wish":"LAND"}', "out-of-range"),
        ('{"type":"wish","wish":[]}', "out-of-range"),
        (" " * (MAX_MESSAGE + 1), "oversized"),
    ],
)
def test_everything_else_is_refused_with_its_reason(text: str | bytes, reason: str) -> None:
    with pytest.raises(DecodeError) as refused:
        parse(text)
    assert refused.value.reason == reason


@given(st.text() | st.binary() | known.map(json.dumps))
def test_no_message_raises_anything_else(text: str | bytes) -> None:
    try:
        request = parse(text)
    except DecodeError:
        return
    if isinstance(request, Move):
        assert all(math.isfinite(number) for number in (*request.point, request.yaw))


def test_numbers_go_out_rounded_and_never_infinite() -> None:
    assert encode({"p": (1.23456, 0.0), "n": 1_000_000, "deep": {"x": [0.0004]}}) == (
        '{"p":[1.235,0.0],"n":1000000,"deep":{"x":[0.0]}}'
    )
    with pytest.raises(ValueError, match="not JSON compliant"):
        encode({"x": math.nan})
