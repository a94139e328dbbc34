"""Links to those who come near: opened and closed as the agent wishes, one per drone."""

import logging
from collections.abc import Callable
from concurrent.futures import Executor, Future

from shared.clock import NS_PER_S, Clock
from shared.errors import SwarmTouchError
from shared.topics import DRONE_STATE
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
        inbox: Where goes what is heard.
        clock: Of the process.
        aside: Opens and closes links, one call at a time: that takes too long for a loop that flies.
    """

    def __init__(self, reach: Reach, inbox: Inbox, clock: Clock, aside: Executor) -> None:
        self._reach, self._inbox, self._clock, self._aside = reach, inbox, clock, aside
        self._links: dict[int, Bus] = {}
        self._not_before_ns: dict[int, int] = {}
        self._settling: Future[None] | None = None

    def follow(self, wanted: frozenset[int]) -> None:
        """Has the links opened that are missing, and those closed that nobody wants any more."""
        if self._settling is not None:
            if not self._settling.done():
                return
            self._settling = None
        if wanted != self._links.keys():
            self._settling = self._aside.submit(self._settle, wanted)

    def close(self) -> None:
        """Closes them all, once nobody opens any more."""
        self._aside.shutdown(cancel_futures=True)
        self._settle(frozenset())

    def _settle(self, wanted: frozenset[int]) -> None:
        for drone in sorted(self._links.keys() - wanted):
            _log.info("drone %d is far again", drone)
            self._links.pop(drone).close()
        now = self._clock()
        for drone in sorted(wanted - self._links.keys()):
            if now >= self._not_before_ns.get(drone, 0):
                self._open(drone, now)

    def _open(self, drone: int, now_ns: int) -> None:
        try:
            link = self._reach(drone)
        except SwarmTouchError as error:
            self._not_before_ns[drone] = now_ns + AGAIN_NS
            _log.warning("drone %d comes near and cannot be reached: %s", drone, error)
            return
        _log.info("drone %d comes near", drone)
        link.subscribe(DRONE_STATE.key(id=drone), self._inbox)
        self._links[drone] = link
