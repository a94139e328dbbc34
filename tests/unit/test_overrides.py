"""Several settings in one environment variable."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.overrides import split_overrides


@pytest.mark.parametrize(
    ("text", "items"),
    [
        ("", []),
        ("  swarm.name=one\n rates.hand_hz=30 ", ["swarm.name=one", "rates.hand_hz=30"]),
        ("a=[[0, 0], [1, 0]] b=2", ["a=[[0, 0], [1, 0]]", "b=2"]),
        ('a={x = 1, y = "]} "} b=2', ['a={x = 1, y = "]} "}', "b=2"]),
        ("a=\"one two\" b='three four'", ['a="one two"', "b='three four'"]),
        (r'a="one \" two" b="\\" c=3', [r'a="one \" two"', r'b="\\"', "c=3"]),
        ("'a=[0, 1]' \"b=one two\"", ["a=[0, 1]", "b=one two"]),
        ('net.endpoints."drone/2"=tcp/x:1', ['net.endpoints."drone/2"=tcp/x:1']),
        ("vehicles.all.uri=sim://h:1/{id} b=2", ["vehicles.all.uri=sim://h:1/{id}", "b=2"]),
        ('a="open b=2', ['a="open b=2']),
        ("a=[1, 2 b=3", ["a=[1, 2 b=3"]),
    ],
)
def test_white_space_separates_but_not_in_quotes_and_brackets(text: str, items: list[str]) -> None:
    assert split_overrides(text) == items


KEYS = st.from_regex(r"[a-z]{1,5}(\.[a-z]{1,5}){0,2}", fullmatch=True)
VALUES = st.recursive(
    st.integers() | st.text(alphabet="ab ]}[{'=\\\""), lambda inner: st.lists(inner, max_size=3), max_leaves=6
)


def toml(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return str(value)


@given(st.lists(st.tuples(KEYS, VALUES), max_size=4))
def test_any_toml_values_come_through(pairs: list[tuple[str, object]]) -> None:
    items = [f"{key}={toml(value)}" for key, value in pairs]
    assert split_overrides("  ".join(items)) == items


@given(st.text())
def test_nothing_is_lost_but_white_space_and_outer_quotes(text: str) -> None:
    kept = "".join("".join(split_overrides(text)).split())
    assert len(kept) <= len("".join(text.split()))
