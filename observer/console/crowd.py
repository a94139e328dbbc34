"""Who has to go when too many are at the door, and when; and which pages get a place. Pure: time is passed in.

Connections are counted by where they come from. One that is no page must make way for newer ones from the same
place, and for those from elsewhere if most come from there; a page never has to make way.
"""

import ipaddress
from collections import Counter
from collections.abc import Iterable

from attrs import define, frozen

MOST_OF_ONE, MOST = 32, 128
"""Connections that are no pages: from one place, and in all. A browser makes six."""
HEADERS_S = 5.0
"""A connection says what it wants within so long."""
LIFE_S = 30.0
"""A connection that is no page ends after so long, whatever it does."""
CLOSING_S = 2.0
"""One that is being closed and does not end is cut off after so long."""
LARGEST_BACKLOG = 1 << 20
"""Bytes that wait for somebody who does not read them."""

PAGES_OF_ONE, PAGES = 16, 32
"""Pages: from one place, and in all."""
KEPT = 2
"""Places beyond these, for whoever comes to steer or to say STOP."""
KEPT_S = 5.0
"""Who has one of those and does not steer leaves after so long."""


def origin(host: str, user: int | None) -> str:
    """Names where a connection comes from: an address, on this machine a user, of IPv6 a network."""
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return host
    mapped = getattr(address, "ipv4_mapped", None) or address
    if mapped.is_loopback:
        return f"user {user}"
    if mapped.version == 6:  # one program has all addresses of such a network
        return str(ipaddress.ip_network((mapped, 64), strict=False))
    return str(mapped)


@define(eq=False)
class Guest:
    """One connection.

    Attributes:
        origin: Where it comes from.
        since: When it came, s.
        is_stranger: Whether it may be told why it is refused, and no more.
        asked: Whether it has said what it wants.
        is_page: Whether it is a page.
        closing_since: Since when it is being closed, None before.
    """

    origin: str
    since: float
    is_stranger: bool = False
    asked: bool = False
    is_page: bool = False
    closing_since: float | None = None


def in_the_way(guests: Iterable[Guest], newcomer: Guest) -> Guest | None:
    """Returns the connection that has to go for a new one, None while there is room.

    Args:
        guests: Who is there, in the order in which they came.
        newcomer: Who comes.
    """
    plain = [guest for guest in guests if not guest.is_page]
    alike = [guest for guest in plain if guest.origin == newcomer.origin]
    if len(alike) >= MOST_OF_ONE:
        return alike[0]
    if len(plain) < MOST:
        return None
    ((most, _),) = Counter(guest.origin for guest in plain).most_common(1)
    return next(guest for guest in plain if guest.origin == most)


def has_stayed_too_long(guest: Guest, now: float, backlog: int) -> bool:
    """Says whether a connection is to be cut off.

    Args:
        guest: The connection.
        now: The time, s.
        backlog: Bytes that it has not read.
    """
    if backlog > LARGEST_BACKLOG:
        return True
    if guest.closing_since is not None:
        return now - guest.closing_since > CLOSING_S
    if guest.is_page:
        return False
    return now - guest.since > (LIFE_S if guest.asked else HEADERS_S)


@frozen
class Place:
    """A page's place.

    Attributes:
        origin: Where the page comes from.
        is_kept: Whether it is only for those who steer.
    """

    origin: str
    is_kept: bool = False


class Places:
    """The places for pages."""

    def __init__(self) -> None:
        self._taken: list[Place] = []

    def take(self, origin: str) -> Place | None:
        """Takes a place, None if there is none."""
        normal = [place for place in self._taken if not place.is_kept]
        alike = sum(place.origin == origin for place in normal)
        is_kept = len(normal) >= PAGES or alike >= PAGES_OF_ONE
        if is_kept and len(self._taken) - len(normal) >= KEPT:
            return None
        place = Place(origin, is_kept)
        self._taken.append(place)
        return place

    def leave(self, place: Place) -> None:
        """Gives a place back."""
        self._taken.remove(place)


class Pace:
    """How fast one page may speak: whoever is faster is heard later.

    Args:
        now: The time, s.
    """

    MOST_HZ = 300.0
    BURST = 300.0
    """Screens with 240 frames a second say something in each."""

    def __init__(self, now: float) -> None:
        self._left, self._at = self.BURST, now

    def wait(self, now: float) -> float:
        """Counts a message, and returns how long to wait before the next one is heard, s."""
        self._left = min(self.BURST, self._left + (now - self._at) * self.MOST_HZ) - 1.0
        self._at = now
        return max(0.0, -self._left / self.MOST_HZ)
