"""Who has to go when too many are at the console's door, and which pages get a place."""

import asyncio
import logging
import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer.console.crowd import (
    CLOSING_S,
    HEADERS_S,
    KEPT,
    LARGEST_BACKLOG,
    LIFE_S,
    MOST,
    MOST_OF_ONE,
    PAGES,
    PAGES_OF_ONE,
    Guest,
    Pace,
    Place,
    Places,
    has_stayed_too_long,
    in_the_way,
    origin,
)
from observer.console.serve import is_news


@pytest.mark.parametrize(
    ("host", "user", "expected"),
    [
        ("127.0.0.1", 1000, "user 1000"),
        ("::1", 0, "user 0"),
        ("::ffff:127.0.0.1", 7, "user 7"),
        ("192.168.0.7", None, "192.168.0.7"),
        ("::ffff:192.168.0.7", None, "192.168.0.7"),
        ("2001:db8:1:2:3:4:5:6", None, "2001:db8:1:2::/64"),
        ("fe80::1%eth0", None, "fe80::/64"),
        ("testclient", None, "testclient"),
    ],
)
def test_a_connection_comes_from_an_address_a_user_or_a_network(
    host: str, user: int | None, expected: str
) -> None:
    assert origin(host, user) == expected


def come(guests: list[Guest], origin: str) -> Guest:
    """Lets one in, and another one out if there is no room."""
    newcomer = Guest(origin, since=float(len(guests)))
    gone = in_the_way(guests, newcomer)
    if gone:
        guests.remove(gone)
    guests.append(newcomer)
    return newcomer


def test_a_flood_from_one_place_ends_its_own_oldest_and_nobody_elses() -> None:
    guests: list[Guest] = []
    operator = come(guests, "operator")
    page = come(guests, "flood")
    page.is_page = True
    flood = [come(guests, "flood") for _ in range(5_000)]
    assert [guest for guest in guests if guest in flood] == flood[-MOST_OF_ONE:]
    assert {operator, page} <= set(guests)
    assert come(guests, "flood") in guests, "also a newcomer from there is let in"


@given(st.lists(st.sampled_from([f"10.0.0.{k}" for k in range(20)]), max_size=600))
def test_there_are_never_too_many_and_a_newcomer_always_gets_in(origins: list[str]) -> None:
    guests = [Guest("me", 0.0, is_page=True)]
    for place in origins:
        newcomer = come(guests, place)
        assert newcomer in guests
        assert guests[0].is_page
        assert sum(guest.origin == place for guest in guests) <= MOST_OF_ONE
        assert len(guests) <= MOST + 1


def test_a_flood_from_everywhere_leaves_room_for_each() -> None:
    guests: list[Guest] = []
    quiet = come(guests, "operator")
    for k in range(10_000):
        come(guests, f"10.0.{k % 7}.1")
    assert quiet in guests


@pytest.mark.parametrize(
    ("guest", "longest_s"),
    [
        (Guest("a", 0.0), HEADERS_S),
        (Guest("a", 0.0, asked=True), LIFE_S),
        (Guest("a", 0.0, asked=True, is_page=True, closing_since=1.0), 1.0 + CLOSING_S),
    ],
)
def test_nobody_stays_for_ever(guest: Guest, longest_s: float) -> None:
    assert not has_stayed_too_long(guest, longest_s, 0)
    assert has_stayed_too_long(guest, longest_s + 0.1, 0)


def test_a_page_stays_unless_it_never_reads() -> None:
    page = Guest("a", 0.0, asked=True, is_page=True)
    assert not has_stayed_too_long(page, 1e9, LARGEST_BACKLOG)
    assert has_stayed_too_long(page, 0.0, LARGEST_BACKLOG + 1)


def test_places_end_for_one_place_and_for_all_and_two_are_kept() -> None:
    places = Places()
    taken = [places.take("one") for _ in range(PAGES_OF_ONE)]
    assert taken == [Place("one")] * PAGES_OF_ONE
    assert [places.take(f"{k}") for k in range(PAGES - PAGES_OF_ONE)] == [
        Place(f"{k}") for k in range(PAGES - PAGES_OF_ONE)
    ]
    kept = [places.take("operator") for _ in range(KEPT)]
    assert kept == [Place("operator", is_kept=True)] * KEPT
    assert places.take("operator") is None
    places.leave(Place("one"))
    assert places.take("operator") == Place("operator"), "a place that is free is better than a kept one"
    places.leave(Place("operator", is_kept=True))
    assert places.take("one") == Place("one", is_kept=True)


def test_pages_that_go_away_fill_no_log(caplog: pytest.LogCaptureFixture) -> None:
    async def write_to_who_has_gone() -> None:
        _, server = await asyncio.open_connection(sock=ours)
        server.transport.abort()
        for _ in range(100):
            server.transport.write(b"x")

    logger = logging.getLogger("asyncio")
    logger.addFilter(is_news)
    try:
        ours, theirs = socket.socketpair()
        with ours, theirs:
            asyncio.run(write_to_who_has_gone())
        logger.warning("something else")
    finally:
        logger.removeFilter(is_news)
    assert [record.message for record in caplog.records] == ["something else"]


def test_a_page_may_speak_in_every_frame_and_no_faster() -> None:
    pace, now, heard = Pace(0.0), 0.0, 0
    while now < 10.0:
        now += pace.wait(now) + 1e-6
        heard += 1
    assert heard == pytest.approx(10.0 * Pace.MOST_HZ + Pace.BURST, rel=0.01)
    pace = Pace(0.0)
    assert all(pace.wait(k / 240.0) == 0.0 for k in range(10_000))
