"""What the bench hears of the floor's bare nodes."""

import socket
from collections.abc import Iterable, Sequence

from deploy.bench.floor_udp import LOOPBACK, MAX_DATAGRAM
from deploy.bench.hop import Token, unpack
from deploy.launcher.monitor import INBOX_DEPTH
from shared.clock import NS_PER_S, system_clock
from shared.formation import Formation
from shared.topics import DRONE_STATE, HAND
from shared.transport import Bus, Inbox


class FloorEar:
    """Counts what bare nodes send; see `deploy.bench.swarm.Ear`.

    Args:
        formation: Its drones' numbers are those of the nodes.

    Attributes:
        answers: What each drone's node has sent.
        payload_bytes: Size of the newest payload, by node, 0 for the hand.
    """

    def __init__(self, formation: Formation) -> None:
        self._ids = formation.ids
        self.answers: dict[int, list[Token]] = {}
        self.payload_bytes: dict[int, int] = {}
        self.begin()

    @property
    def latencies_ms(self) -> dict[int, list[float]]:
        """By node: from the stamp of a hand sample to the stamp of the answer that completes it."""
        return {
            node: [(token.stamp_ns - token.hand_ns) * 1e3 / NS_PER_S for token in tokens]
            for node, tokens in self.answers.items()
        }

    def take(self, payload: bytes) -> None:
        """Counts one payload."""
        token = unpack(payload)
        self.payload_bytes[token.node] = len(payload)
        if token.node in self.answers:
            self.answers[token.node].append(token)

    @property
    def is_ready(self) -> bool:
        """Whether the hand has come through to every node."""
        return all(self.answers.values())

    def begin(self) -> None:
        """Forgets the answers so far."""
        self.answers = {drone: [] for drone in self._ids}


class ZenohEar(FloorEar):
    """Hears the floor over Zenoh as the observer of a flight does.

    Args:
        bus: The observer's connection.
        formation: See `FloorEar`.
    """

    def __init__(self, bus: Bus, formation: Formation) -> None:
        super().__init__(formation)
        self._inbox = Inbox(system_clock(), INBOX_DEPTH)
        self._present: set[str] = set()
        for topic in (HAND, DRONE_STATE):
            bus.subscribe(topic.wildcard, self._inbox)
        bus.watch_presence(self._presence_changed)

    def drain(self) -> None:
        """Takes what has arrived."""
        for arrivals in self._inbox.take().values():
            for arrival in arrivals:
                self.take(arrival.payload)

    def hears(self, tokens: Iterable[str]) -> bool:
        """Says whether all of these processes have announced themselves."""
        return self._present.issuperset(tokens)

    def _presence_changed(self, token: str, present: bool) -> None:
        (self._present.add if present else self._present.discard)(token)


class UdpEar(FloorEar):
    """Hears the floor over UDP.

    Args:
        port: Where every node sends to.
        formation: See `FloorEar`.
    """

    def __init__(self, port: int, formation: Formation) -> None:
        super().__init__(formation)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((LOOPBACK, port))
        self._socket.setblocking(False)

    def drain(self) -> None:
        """Takes what has arrived."""
        while True:
            try:
                payload = self._socket.recv(MAX_DATAGRAM)
            except BlockingIOError:
                return
            self.take(payload)

    def hears(self, tokens: Sequence[str]) -> bool:
        """Sockets have no presence: nobody is waited for."""
        del tokens
        return True

    def close(self) -> None:
        """Closes the socket."""
        self._socket.close()
