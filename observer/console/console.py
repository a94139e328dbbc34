"""Between the swarm and the pages: what is heard goes to every page, the holder's hand to the relay."""

import asyncio
import threading
from collections.abc import Callable, Mapping, Sequence

from observer.console.ownership import (
    Ownership,
    expire,
    give,
    join,
    leave,
    move,
    release,
    take,
    want,
)
from observer.console.page_link import PageLink
from observer.console.protocol import Give, Json, Move, Release, Request, Take, Want, encode, parse
from observer.console.scene import HandMap, scene
from observer.console.swarm_view import SwarmView
from shared.clock import NS_PER_S, Clock
from shared.errors import DecodeError
from shared.formation import Formation
from shared.messages import Vector, Wish
from shared.pointer_link import REPEAT_S, Pointed, Verb, encode_pointed
from shared.process import StatusReporter
from shared.scenario import Scenario
from shared.transport import Arrival, Bus, Inbox

ROLE = "console"
NOBODY = 0
"""Pages are numbered from 1."""
RATE_HZ = 60.0
"""Most snapshots per second."""

_HEALTH_PERIOD_NS = NS_PER_S
_NOTICE_PERIOD_NS = NS_PER_S // 10
_REPEAT_NS = round(REPEAT_S * NS_PER_S)
_VERBS = {Wish.GROUND: Verb.GROUND, Wish.FLY: Verb.FLY, Wish.HOLD: Verb.HOLD}

Point = Callable[[bytes], str]
"""Sends one datagram towards the relay; returns why nobody hears it, empty if somebody does; raises nothing."""


class Console:
    """Pages on one side, the swarm on the other.

    Args:
        scenario: The resolved scenario.
        formation: Its formation.
        view: What is known of the swarm.
        hand: Mapping of the hand.
        point: Where the hand goes.
        sender: Number of this process in the datagrams of the hand.
        clock: The process's clock.

    Attributes:
        steps: How often it has stepped.
    """

    def __init__(
        self,
        scenario: Scenario,
        formation: Formation,
        *,
        view: SwarmView,
        hand: HandMap,
        point: Point,
        sender: int,
        clock: Clock,
    ) -> None:
        self.view = view
        self.steps = 0
        self._scene = scene(scenario, formation, hand)
        self._hand, self._point, self._sender, self._clock = hand, point, sender, clock
        self._owner = Ownership()
        self._links: dict[int, PageLink] = {}
        self._opened = 0
        self._control: Json = {}
        self._unheard = ""
        self._notices = view.notices(clock())
        self._health_ns = self._notice_ns = self._pointed_ns = 0

    def open(self) -> PageLink:
        """Opens a page and tells it everything that is known."""
        self._opened += 1
        now = self._clock()
        link = PageLink(self._opened, encode({**self._scene, "you": self._opened}))
        self._own(join(self._owner, link.number))
        self._links[link.number] = link
        playing = self.view.playing(now)
        if playing is not None:
            link.tell(encode(playing))
        for state in (
            self._control,
            self._current_notices(now),
            self.view.health(now),
            self.view.snapshot(now),
        ):
            link.show(state["type"], encode(state))
        return link

    def close(self, link: PageLink) -> None:
        """Closes a page; the hand that it held is released."""
        del self._links[link.number]
        self._own(leave(self._owner, link.number))
        self._send_hand(self._clock())

    @property
    def pages(self) -> int:
        """How many pages are open."""
        return len(self._links)

    def steers(self, link: PageLink) -> bool:
        """Says whether a page holds the hand, or asks for it."""
        return link.number == self._owner.holder or link.number in self._owner.asking

    def hear(self, link: PageLink, text: str | bytes) -> None:
        """Takes a message of a page; whatever is wrong with it is answered, not raised."""
        now = self._clock()
        try:
            request = parse(text)
            self._own(self._obey(link.number, request, now))
        except DecodeError as error:
            link.tell(encode({"type": "refused", "why": str(error)}))
            return
        self._send_hand(now)

    def stop(self) -> str:
        """Stops all motors, for whoever has no page; as final as a page's STOP.

        Returns:
            Why nobody has heard it, empty if the relay has; it is repeated either way.
        """
        now = self._clock()
        self._own(want(self._owner, NOBODY, Wish.STOP, now / NS_PER_S))
        self._send_hand(now)
        return self._unheard

    def step(self, arrivals: Mapping[str, Sequence[Arrival]]) -> None:
        """Takes what has arrived from the swarm, tells the pages, and repeats the hand."""
        now = self._clock()
        self.steps += 1
        for event in self.view.take(arrivals, now):
            self._tell(event)
        self._own(expire(self._owner, now / NS_PER_S))
        if now - self._pointed_ns >= _REPEAT_NS:
            self._send_hand(now)
        if not self._links:
            return
        if arrivals:
            self._show(self.view.snapshot(now))
        self._tell_slow_news(now)

    def _tell_slow_news(self, now: int) -> None:
        if now - self._notice_ns >= _NOTICE_PERIOD_NS:
            self._notice_ns = now
            current = self._current_notices(now)
            if current != self._notices:
                self._notices = current
                self._show(current)
        if now - self._health_ns >= _HEALTH_PERIOD_NS:
            self._health_ns = now
            self._show(self.view.health(now))

    def _obey(self, page: int, request: Request, now: int) -> Ownership:
        owner, seconds = self._owner, now / NS_PER_S
        match request:
            case Take():
                return take(owner, page, seconds, Wish.FLY if self.view.airborne else Wish.GROUND)
            case Release():
                return release(owner, page)
            case Give(to):
                return give(owner, page, to, seconds)
            case Move(point, yaw):
                return move(owner, page, point, yaw, seconds)
            case Want(wish):
                return want(owner, page, wish, seconds)

    def _own(self, owner: Ownership) -> None:
        """Adopts the new state of the hand and tells the pages if they would see it."""
        self._owner = owner
        control = self._control_message()
        if control != self._control:
            self._control = control
            self._show(control)

    def _control_message(self) -> Json:
        owner = self._owner
        return {
            "type": "control",
            "holder": owner.holder,
            "asking": owner.asking,
            "pages": len(owner.pages),
            "wish": Wish.STOP if owner.stopped else owner.wish if owner.holder is not None else Wish.HOLD,
        }

    def _send_hand(self, now: int) -> None:
        """Says what the hand does; silent when no page is open, which releases it as well."""
        owner = self._owner
        self._pointed_ns = now
        if owner.stopped:
            pointed = Pointed(self._sender, Verb.STOP)
        elif owner.holder is not None:
            pointed = Pointed(self._sender, _VERBS[owner.wish], self._target(owner.point), owner.yaw)
        elif owner.pages:
            pointed = Pointed(self._sender, Verb.RELEASED)
        else:
            return
        self._unheard = self._point(encode_pointed(pointed))

    def _current_notices(self, now: int) -> Json:
        """What the swarm gives cause for, and first of all whether the page that steers is heard."""
        message = self.view.notices(now)
        if self._unheard and (self._owner.holder is not None or self._owner.stopped):
            unheard = {"level": "alarm", "text": f"no relay hears this page: {self._unheard}"}
            message["notices"] = [unheard, *message["notices"]]
        return message

    def _target(self, point: Vector | None) -> Vector:
        """Returns where to point; until the holder has said so, where the hand is."""
        if point is None:
            return self.view.hand_position or self._hand.real(self._hand.start)
        return self._hand.real(point)

    def _tell(self, event: Json) -> None:
        text = encode(event)
        for link in self._links.values():
            link.tell(text)

    def _show(self, state: Json) -> None:
        text = encode(state)
        for link in self._links.values():
            link.show(state["type"], text)


async def run(console: Console, bus: Bus, inbox: Inbox, clock: Clock, stopping: threading.Event) -> None:
    """Runs the console's loop until told to stop: receive -> compute -> publish, at most 60 times a second."""
    status = StatusReporter(bus, ROLE, 0, clock)
    due = clock()
    while not stopping.is_set():
        console.step(inbox.take())
        status.tick(console.steps, "running", console.view.rejected, lambda: {"pages": float(console.pages)})
        due = max(due + round(NS_PER_S / RATE_HZ), clock())
        await asyncio.sleep((due - clock()) / NS_PER_S)
    status.tick(console.steps, "ending", console.view.rejected, force=True)
