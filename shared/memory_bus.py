"""The bus within one process: delivers at once, in order, without loss. Ships for simulation and tests."""

from collections.abc import Callable
from typing import Self

from shared.topics import ALIVE, Topic
from shared.transport import Inbox, Publish

_PRESENCE_PREFIX = ALIVE.split("/", maxsplit=1)[0]


class MemoryNetwork:
    """What the `MemoryBus`es of one swarm share."""

    def __init__(self) -> None:
        self.buses: list[MemoryBus] = []


class MemoryBus:
    """One participant of a `MemoryNetwork`; see `shared.transport.Bus`.

    Attributes:
        watchers: Whom to tell about presence.
        tokens: What was announced.
    """

    def __init__(self, network: MemoryNetwork) -> None:
        self._network = network
        self._subscriptions: list[tuple[str, Inbox]] = []
        self.watchers: list[Callable[[str, bool], None]] = []
        self.tokens: list[str] = []
        network.buses.append(self)

    def publisher(self, topic: Topic, **parts: object) -> Publish:
        """See `Bus.publisher`."""
        key = topic.key(**parts)

        def publish(payload: bytes) -> None:
            for bus in self._network.buses:
                if bus is not self:
                    bus.deliver(key, payload)

        return publish

    def subscribe(self, key_expression: str, inbox: Inbox) -> None:
        """See `Bus.subscribe`."""
        self._subscriptions.append((key_expression, inbox))

    def announce(self, role: str, number: int) -> None:
        """See `Bus.announce`."""
        token = ALIVE.format(role=role, id=number).removeprefix(f"{_PRESENCE_PREFIX}/")
        self.tokens.append(token)
        self._tell(token, present=True)

    def watch_presence(self, on_change: Callable[[str, bool], None]) -> None:
        """See `Bus.watch_presence`."""
        self.watchers.append(on_change)
        for bus in self._network.buses:
            for token in bus.tokens:
                on_change(token, True)

    def audit(self) -> dict[str, float]:
        """See `Bus.audit`; nobody is refused within one process."""
        return {}

    def close(self) -> None:
        """See `Bus.close`."""
        if self in self._network.buses:
            self._network.buses.remove(self)
            for token in self.tokens:
                self._tell(token, present=False)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def deliver(self, key: str, payload: bytes) -> None:
        """Puts a payload of another participant into the matching inboxes."""
        for expression, inbox in self._subscriptions:
            if _matches(expression, key):
                inbox.put(key, payload)

    def _tell(self, token: str, *, present: bool) -> None:
        for bus in self._network.buses:
            for watcher in bus.watchers:
                watcher(token, present)


def _matches(expression: str, key: str) -> bool:
    pattern, chunks = expression.split("/"), key.split("/")
    return len(pattern) == len(chunks) and all(p in ("*", c) for p, c in zip(pattern, chunks, strict=True))
