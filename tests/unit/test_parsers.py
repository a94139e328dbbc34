"""Every parser of the table: its good inputs are good, and no bytes get more out of it than a refusal."""

import gzip
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fuzz.parsers import CORPUS, PARSERS, Parser

NASTY = (
    *(
        b"9" * 20,
        b"9" * 400,
        b"9" * 5000,
        b"-1",
        b"1e999",
        b"nan",
        b"inf",
        b"[" * 3000,
        b"{" * 3000,
        b'{"a":' * 2000,
    ),
    *(
        b"\0",
        b"\xff\xfe",
        b"\xed\xa0\x80",
        b"\r\n",
        b"=",
        b"[[",
        b'"',
        b"'''",
        b",,",
        b"[]",
        b"{}",
        b"null",
        b"true",
        b"%00",
        b"//",
        b"[::1",
    ),
)
"""What parsers stumble over."""


MOST = 50_000
"""Bytes by which a file may grow here; the bounds themselves are tested with their readers."""
_WORD = re.compile(rb"[\w.+-]+|\W")


@st.composite
def with_other_bytes(draw: st.DrawFn, good: list[bytes]) -> bytes:
    """Makes a good input with a few bytes changed in place."""
    data = bytearray(draw(st.sampled_from(good)))
    for _ in range(draw(st.integers(1, 3)) if data else 0):
        data[draw(st.integers(0, len(data) - 1))] = draw(st.integers(0, 255))
    return bytes(data)


@st.composite
def with_other_words(draw: st.DrawFn, good: list[bytes]) -> bytes:
    """Makes a good input with words left out, doubled, or replaced by something nasty."""
    words = _WORD.findall(draw(st.sampled_from(good)))
    for _ in range(draw(st.integers(1, 3)) if words else 0):
        at = draw(st.integers(0, len(words) - 1))
        new = draw(st.sampled_from(NASTY) | st.sampled_from((b"", words[at] * 2)) | st.binary(max_size=8))
        words[at : at + draw(st.sampled_from((1, 1)) | st.integers(2, 12))] = [new]
    return b"".join(words)


@st.composite
def of_another_size(draw: st.DrawFn, good: list[bytes]) -> bytes:
    """Makes a good input that was cut off, goes on and on, or is packed, and then cut off."""
    data = draw(st.sampled_from(good))
    at = draw(st.integers(0, len(data)))
    more = draw(st.sampled_from((data[at:], b"\0", b"\n", b"9", b",", b"x = 1\n", b"[", b"\xff")))
    times = draw(st.integers(0, MOST // max(1, len(more))))
    data = draw(st.sampled_from((data[:at], data + more * times, data[:at] + more * times)))
    if draw(st.booleans()):
        data = gzip.compress(data, mtime=0)
        data = data[: draw(st.integers(0, len(data)))]
    return data


@pytest.mark.parametrize("parser", PARSERS, ids=lambda parser: parser.name)
def test_good_inputs_are_good_and_the_corpus_holds(parser: Parser) -> None:
    assert all(parser.accepts(data) for data in parser.seeds())
    for data in parser.inputs():
        parser.accepts(data)


@pytest.mark.parametrize("parser", PARSERS, ids=lambda parser: parser.name)
def test_whatever_comes_in_is_a_value_or_a_refusal(parser: Parser) -> None:
    good = parser.inputs()

    anything = st.binary(max_size=300) | st.sampled_from(NASTY)

    @settings(max_examples=500 if parser.is_wire else 200)
    @given(data=with_other_words(good) | with_other_bytes(good) | anything)
    def check(data: bytes) -> None:
        parser.accepts(data)

    check()


@pytest.mark.parametrize("parser", [p for p in PARSERS if p.is_file], ids=lambda parser: parser.name)
def test_a_file_of_whatever_size_is_a_value_or_a_refusal(parser: Parser) -> None:
    good = parser.inputs()

    @settings(max_examples=60)
    @given(data=of_another_size(good))
    def check(data: bytes) -> None:
        parser.accepts(data)

    check()


def test_the_corpus_belongs_to_parsers() -> None:
    assert {folder.name for folder in CORPUS.iterdir()} <= {parser.name for parser in PARSERS}
