"""One contract for every bus: bytes arrive exactly and in order, presence appears and disappears.

Delivery is best effort: of a burst most samples may be lost, but none that has the way to itself. So the tests
wait for each sample before they send the next, except where a burst is what they are about.
"""

import json
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
import zenoh

from deploy.launcher.ports import free_ports
from shared.bus import ZenohBus, routing
from shared.errors import DeviceError
from shared.memory_bus import MemoryBus, MemoryNetwork
from shared.net.settings import client_settings, peer_settings
from shared.radio import Receiver, Transmitter
from shared.radio_link import GROUP, RadioGroup
from shared.topics import DRONE_STATE, HAND, STATUS
from shared.transport import Bus, Inbox, Publish

DEADLINE_S = 20.0
OpenBus = Callable[[], Bus]


@contextmanager
def memory_swarm() -> Iterator[OpenBus]:
    network = MemoryNetwork()
    yield lambda: MemoryBus(network)


@contextmanager
def zenoh_swarm() -> Iterator[OpenBus]:
    """Each bus listens on a port of its own and dials all that came before."""
    ports = iter(free_ports(tcp=6, udp=0)[0])
    earlier: list[str] = []

    def open_bus() -> Bus:
        bus = ZenohBus(peer_settings("swarm", f"tcp/127.0.0.1:{(port := next(ports))}", tuple(earlier)))
        earlier.append(f"tcp/127.0.0.1:{port}")
        return bus

    yield open_bus


@contextmanager
def routed_swarm() -> Iterator[OpenBus]:
    """Each bus is client of one router."""
    where = f"tcp/127.0.0.1:{free_ports(tcp=1, udp=0)[0][0]}"
    with routing(where):
        yield lambda: ZenohBus(client_settings("swarm", where))


@contextmanager
def radio_swarm() -> Iterator[OpenBus]:
    """The first bus is the relay's, which only speaks; the others have a mesh, and the radio beside it."""
    group = RadioGroup(GROUP, free_ports(tcp=0, udp=1)[1][0], "lo")
    swarm = uuid.uuid4().hex
    opened = 0

    def open_bus() -> Bus:
        nonlocal opened
        opened += 1
        if opened == 1:
            return Transmitter(group, swarm, time.monotonic_ns)
        keys = [HAND.key(), *(DRONE_STATE.key(id=i) for i in (1, 2)), STATUS.key(role="drone", id=1)]
        radio = Receiver(group, swarm, "drone/1", keys, time.monotonic_ns)
        return ZenohBus(peer_settings(swarm, ""), radio)

    yield open_bus


BOTH_WAYS = (memory_swarm, zenoh_swarm, routed_swarm)


@pytest.fixture(params=BOTH_WAYS)
def open_bus(request: pytest.FixtureRequest) -> Iterator[OpenBus]:
    """Opens further buses of one swarm; all are closed at the end."""
    yield from opening(request)


@pytest.fixture(params=[*BOTH_WAYS, radio_swarm])
def open_one_way(request: pytest.FixtureRequest) -> Iterator[OpenBus]:
    """Opens one bus that speaks, then those that listen to it; all are closed at the end."""
    yield from opening(request)


def opening(request: pytest.FixtureRequest) -> Iterator[OpenBus]:
    opened: list[Bus] = []
    with request.param() as make:

        def open_one() -> Bus:
            opened.append(make())
            return opened[-1]

        yield open_one
        for bus in opened:
            bus.close()


class Presence:
    """What a bus tells about who is there."""

    def __init__(self, bus: Bus) -> None:
        self.here: set[str] = set()
        self.log: list[tuple[str, bool]] = []
        self._changed = threading.Condition()
        bus.watch_presence(self._change)

    def _change(self, token: str, present: bool) -> None:
        with self._changed:
            (self.here.add if present else self.here.discard)(token)
            self.log.append((token, present))
            self._changed.notify_all()

    def until(self, *tokens: str) -> None:
        """Waits until exactly these are here."""
        self.until_true(lambda: self.here == set(tokens))

    def until_true(self, condition: Callable[[], bool]) -> None:
        with self._changed:
            assert self._changed.wait_for(condition, DEADLINE_S), self.log


def link(sender: Bus, receiver: Bus, number: int = 1) -> None:
    """Waits until the sender knows the subscriptions of the receiver: its declarations come in order.

    A radio knows nobody: it speaks to whoever listens.
    """
    if isinstance(sender, Transmitter):
        return
    presence = Presence(sender)
    receiver.announce("drone", number)
    presence.until_true(lambda: f"drone/{number}" in presence.here)


def collect(inbox: Inbox, count: int) -> dict[str, list[bytes]]:
    """Waits for so many samples in all."""
    found: dict[str, list[bytes]] = {}
    deadline = time.monotonic() + DEADLINE_S
    while sum(map(len, found.values())) < count:
        assert inbox.wait(deadline - time.monotonic()), f"only {found}"
        for key, arrivals in inbox.take().items():
            found.setdefault(key, []).extend(arrival.payload for arrival in arrivals)
    return found


def inbox_of(bus: Bus, *expressions: str) -> Inbox:
    inbox = Inbox(time.monotonic_ns, depth=10_000)
    for expression in expressions:
        bus.subscribe(expression, inbox)
    return inbox


def send(publish: Publish, inbox: Inbox, *payloads: bytes) -> list[tuple[str, bytes]]:
    """Publishes one after the other and returns what arrived, with its key."""
    found: list[tuple[str, bytes]] = []
    for payload in payloads:
        publish(payload)
        found += ((key, got) for key, arrived in collect(inbox, 1).items() for got in arrived)
    return found


def test_bytes_arrive_exactly(open_one_way: OpenBus) -> None:
    sender, receiver = open_one_way(), open_one_way()
    inbox = inbox_of(receiver, HAND.key())
    link(sender, receiver)
    payloads = [b"", b"\0", bytes(range(256)), *(number.to_bytes(2, "big") for number in range(100))]
    assert send(sender.publisher(HAND), inbox, *payloads) == [(HAND.key(), payload) for payload in payloads]


def test_a_burst_arrives_in_order_and_nothing_twice(open_one_way: OpenBus) -> None:
    sender, receiver = open_one_way(), open_one_way()
    inbox = inbox_of(receiver, HAND.key())
    link(sender, receiver)
    publish = sender.publisher(HAND)
    for number in range(500):
        publish(number.to_bytes(2, "big"))
    end = (500).to_bytes(2, "big")
    seen: list[bytes] = []
    deadline = time.monotonic() + DEADLINE_S
    while end not in seen:
        assert time.monotonic() < deadline
        publish(end)
        inbox.wait(0.1)
        seen += (arrival.payload for arrival in inbox.take().get(HAND.key(), ()))
    numbers = [int.from_bytes(payload, "big") for payload in seen[: seen.index(end)]]
    assert numbers == sorted(set(numbers))
    assert numbers[0] == 0


@pytest.mark.parametrize("size", [4_096, 4_097, 65_536])
def test_any_size_arrives_whole(open_bus: OpenBus, size: int) -> None:
    """What is too long is the codec's business."""
    sender, receiver = open_bus(), open_bus()
    inbox = inbox_of(receiver, HAND.key())
    link(sender, receiver)
    payload = bytes(number % 251 for number in range(size))
    assert send(sender.publisher(HAND), inbox, payload, b"after") == [
        (HAND.key(), payload),
        (HAND.key(), b"after"),
    ]


def test_each_sample_comes_under_its_concrete_key(open_one_way: OpenBus) -> None:
    sender, receiver = open_one_way(), open_one_way()
    inbox = inbox_of(receiver, DRONE_STATE.wildcard)
    link(sender, receiver)
    one, two = sender.publisher(DRONE_STATE, id=1), sender.publisher(DRONE_STATE, id=2)
    sender.publisher(HAND)(b"not subscribed")
    found = [*send(one, inbox, b"1"), *send(two, inbox, b"2"), *send(one, inbox, b"3")]
    assert found == [("drone/1/state", b"1"), ("drone/2/state", b"2"), ("drone/1/state", b"3")]


def test_a_star_is_one_chunk(open_one_way: OpenBus) -> None:
    sender, receiver = open_one_way(), open_one_way()
    inbox = inbox_of(receiver, "*/*", STATUS.wildcard)
    link(sender, receiver)
    sender.publisher(DRONE_STATE, id=1)(b"three chunks, but not status/*/*")
    assert send(sender.publisher(HAND), inbox, b"two chunks") == [(HAND.key(), b"two chunks")]
    status = sender.publisher(STATUS, role="drone", id=1)
    assert send(status, inbox, b"status") == [("status/drone/1", b"status")]


def test_everybody_else_hears_and_one_does_not_hear_oneself(open_bus: OpenBus) -> None:
    sender, *receivers = (open_bus() for _ in range(3))
    own = inbox_of(sender, HAND.key())
    inboxes = [inbox_of(receiver, HAND.key()) for receiver in receivers]
    for number, receiver in enumerate(receivers):
        link(sender, receiver, number)
        link(receiver, sender, 10 + number)
    sender.publisher(HAND)(b"mine")
    for inbox in inboxes:
        assert collect(inbox, 1) == {HAND.key(): [b"mine"]}
    for receiver in receivers:
        receiver.publisher(HAND)(b"another")
    assert collect(own, 2) == {HAND.key(): [b"another", b"another"]}


def test_a_late_subscriber_hears_what_comes_after_it(open_one_way: OpenBus) -> None:
    sender = open_one_way()
    publish = sender.publisher(HAND)
    publish(b"before")
    receiver = open_one_way()
    inbox = inbox_of(receiver, HAND.key())
    link(sender, receiver)
    publish(b"after")
    assert collect(inbox, 1) == {HAND.key(): [b"after"]}


def test_publishing_needs_nobody_to_listen(open_one_way: OpenBus) -> None:
    publish = open_one_way().publisher(HAND)
    for _ in range(1_000):
        publish(b"anybody?")


def test_presence_appears_and_disappears(open_bus: OpenBus) -> None:
    watcher = open_bus()
    presence = Presence(watcher)
    first, second = open_bus(), open_bus()
    first.announce("drone", 2)
    presence.until("drone/2")
    second.announce("relay", 0)
    presence.until("drone/2", "relay/0")
    first.close()
    presence.until("relay/0")
    assert presence.log == [("drone/2", True), ("relay/0", True), ("drone/2", False)]


def test_a_late_watcher_learns_who_is_there(open_bus: OpenBus) -> None:
    present = open_bus()
    present.announce("drone", 1)
    present.announce("drone", 2)
    Presence(open_bus()).until("drone/1", "drone/2")


def test_closing_ends_the_subscriptions_and_may_be_repeated(open_bus: OpenBus) -> None:
    sender, leaving, staying = open_bus(), open_bus(), open_bus()
    left, kept = inbox_of(leaving, HAND.key()), inbox_of(staying, HAND.key())
    link(sender, leaving, 1)
    link(sender, staying, 2)
    presence = Presence(sender)
    with leaving:
        presence.until("drone/1", "drone/2")
    presence.until("drone/2")
    leaving.close()
    sender.publisher(HAND)(b"still here?")
    assert collect(kept, 1) == {HAND.key(): [b"still here?"]}
    assert left.take() == {}


def test_processes_may_start_in_any_order() -> None:
    """Zenoh: whoever is dialled before it listens is found as soon as it does."""
    port, other = free_ports(tcp=2, udp=0)[0]
    with ZenohBus(peer_settings("swarm", f"tcp/127.0.0.1:{other}", [f"tcp/127.0.0.1:{port}"])) as early:
        inbox = inbox_of(early, HAND.key())
        early.announce("drone", 1)
        with ZenohBus(peer_settings("swarm", f"tcp/127.0.0.1:{port}")) as late:
            Presence(late).until("drone/1")
            late.publisher(HAND)(b"found")
            assert collect(inbox, 1) == {HAND.key(): [b"found"]}


def test_swarms_of_other_names_are_not_heard() -> None:
    (port,) = free_ports(tcp=1, udp=0)[0]
    with ZenohBus(peer_settings("ours", f"tcp/127.0.0.1:{port}")) as receiver:
        inbox = inbox_of(receiver, HAND.key())
        receiver.announce("drone", 1)
        tree = {"mode": "client", "connect": {"endpoints": [f"tcp/127.0.0.1:{port}"]}}
        tree["scouting"] = {"multicast": {"enabled": False}}
        with zenoh.open(zenoh.Config.from_json5(json.dumps(tree))) as foreigner:
            for key in ("theirs/human/hand", "human/hand", "ours/human/foot", "ours/human/hand"):
                foreigner.put(key, key.encode(), congestion_control=zenoh.CongestionControl.BLOCK)
            assert collect(inbox, 1) == {HAND.key(): [b"ours/human/hand"]}


def test_what_is_put_on_many_keys_at_once_comes_under_the_key_that_it_was_put_on() -> None:
    """So that nobody takes it for a sample of its own key: `shared.topics` knows no such key."""
    with foreigner("ours") as (receiver, session):
        inbox = inbox_of(receiver, HAND.key(), DRONE_STATE.wildcard)
        receiver.announce("drone", 1)
        for key in ("**", "human/*", "drone/1/state"):
            session.put(f"ours/{key}", key.encode(), congestion_control=zenoh.CongestionControl.BLOCK)
        found = collect(inbox, 4)
    assert found == {"**": [b"**", b"**"], "human/*": [b"human/*"], "drone/1/state": [b"drone/1/state"]}


@pytest.mark.parametrize("token", ["**", f"drone/{'9' * 5000}", "[/x]/\x1b[31m", "drone/1/2"])
def test_a_foreign_token_is_nobody_and_is_counted(token: str) -> None:
    with foreigner("ours") as (receiver, session):
        presence = Presence(receiver)
        foreign = session.liveliness().declare_token(f"ours/alive/{token}")
        relay = session.liveliness().declare_token("ours/alive/relay/0")
        presence.until("relay/0")
        assert receiver.audit() == {"refused tokens of no process": 1.0}
        for declared in (foreign, relay):
            declared.undeclare()  # type: ignore[no-untyped-call]  # the stub lacks its return type
        presence.until()
        assert presence.log == [("relay/0", True), ("relay/0", False)]


@contextmanager
def foreigner(swarm: str) -> Iterator[tuple[ZenohBus, zenoh.Session]]:
    """Opens a bus, and a session of somebody who puts what he likes where he likes."""
    (port,) = free_ports(tcp=1, udp=0)[0]
    tree = {"mode": "client", "connect": {"endpoints": [f"tcp/127.0.0.1:{port}"]}}
    tree["scouting"] = {"multicast": {"enabled": False}}
    with (
        ZenohBus(peer_settings(swarm, f"tcp/127.0.0.1:{port}")) as receiver,
        zenoh.open(zenoh.Config.from_json5(json.dumps(tree))) as session,
    ):
        yield receiver, session


def test_an_endpoint_in_use_is_refused_with_a_hint() -> None:
    (port,) = free_ports(tcp=1, udp=0)[0]
    with (
        ZenohBus(peer_settings("swarm", f"tcp/127.0.0.1:{port}")),
        pytest.raises(DeviceError, match=rf"^(?!.*\.rs).*{port}.*Is the port in use\? Set net\.endpoints"),
    ):
        ZenohBus(peer_settings("swarm", f"tcp/127.0.0.1:{port}"))


def test_clients_outlive_their_router_and_need_one_to_begin() -> None:
    where = f"tcp/127.0.0.1:{free_ports(tcp=1, udp=0)[0][0]}"
    with pytest.raises(DeviceError, match=r"no router(?!.*\.rs).*net\.router"):
        ZenohBus(client_settings("swarm", where))
    with routing(where):
        sender, receiver = (ZenohBus(client_settings("swarm", where)) for _ in range(2))
    with sender, receiver, routing(where):
        inbox = inbox_of(receiver, HAND.key())
        sender.announce("drone", 1)
        Presence(receiver).until("drone/1")
        sender.publisher(HAND)(b"through the new one")
        assert collect(inbox, 1) == {HAND.key(): [b"through the new one"]}
