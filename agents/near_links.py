"""Links to those who come near: opened and closed as the agent wishes, one per drone."""

import logging
from collections.abc import Callable, Iterable

from shared.clock import NS_PER_S, Clock
from shared.errors import SwarmTouchError
from shared.transport import Bus, Inbox

AGAIN_NS = NS_PER_S
"""Who could not be reached is tried again after this long."""

Reach = Callable[[int], Bus]
"""Opens a link to one drone."""

_log = logging.getLogger("near")


class NearLinks:
    """The links of one agent beside those that it always has.

    Args:
        reach: Opens a link.
        keys: Of one drone, what is to be heard of it.
        inbox: Where that goes.
        clock: Of the process.
    """

    def __init__(self, reach: Reach, keys: Callable[[int], Iterable[str]], inbox: Inbox, clock: Clock) -> None:
        self._reach, self._keys, self._inbox, self._clock = reach, keys, inbox, clock
        self._links: dict[int, Bus] = {}
        self._not_before_ns: dict[int, int] = {}

    def follow(self, wanted: frozenset[int]) -> None:
        """Opens the links that are missing and closes those that nobody wants any more."""
        if wanted == self._links.keys():
            return
        for drone in sorted(self._links.keys() - wanted):
            _log.info("drone %d is far again", drone)
            self._links.pop(drone).close()
        now = self._clock()
        for drone in sorted(wanted - self._links.keys()):
            if now >= self._not_before_ns.get(drone, 0):
                self._open(drone, now)

    def close(self) -> None:
        """Closes them all."""
        for link in self._links.values():
            link.close()
        self._links.clear()

    def _open(self, drone: int, now_ns: int) -> None:
        try:
            link = self._reach(drone)
        except SwarmTouchError as error:
            self._not_before_ns[drone] = now_ns + AGAIN_NS
            _log.warning("drone %d comes near and cannot be reached: %s", drone, error)
            return
        _log.info("drone %d comes near", drone)
        for key in self._keys(drone):
            link.subscribe(key, self._inbox)
        self._links[drone] = link
