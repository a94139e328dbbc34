"""The hand's radio: the relay only sends multicast datagrams, everybody else only hears them.

It stands beside the mesh. There is no return path: a sample that is lost is lost, and presence is being heard.
"""

import logging
import socket
import struct
import threading
from collections import Counter
from collections.abc import Callable, Iterable
from typing import Self

from shared.clock import NS_PER_S, Clock
from shared.errors import DecodeError, DeviceError
from shared.radio_link import MAX_DATAGRAM, RadioGroup, decode_datagram, encode_head
from shared.topics import Topic, matches
from shared.transport import Inbox, Publish

SILENT_S = 1.0
"""Who has not been heard for so long is gone; the group is joined anew, for interfaces come and go."""
_LOOK_S = 0.25
"""How often a receiver that hears nothing looks at the time, and whether to close."""
_RETRY_NS = NS_PER_S
_LOCAL_HOPS = 1
_ANY_ADDRESS = bytes(4)
_log = logging.getLogger("radio")


class Transmitter:
    """The relay's bus on a radio; see `shared.transport.Bus`.

    Its one socket is connected to the group, so the kernel takes in nothing for it: no datagram can come *from*
    a multicast address. What cannot be sent is counted, and the socket is opened anew; publishing never raises.

    Args:
        group: Where to speak.
        swarm: Name of the swarm.
        clock: The process's clock.

    Raises:
        DeviceError: There is no such interface, or it has no address.
    """

    def __init__(self, group: RadioGroup, swarm: str, clock: Clock) -> None:
        self._group, self._swarm, self._clock = group, swarm, clock
        self._unsent = 0
        self._closed = False
        self._retry_ns = clock()
        self._socket = _open(group, _prepare_to_send)

    def publisher(self, topic: Topic, **parts: object) -> Publish:
        """See `Bus.publisher`."""
        head = encode_head(self._swarm, topic.key(**parts))
        return lambda payload: self._send(head + payload)

    def subscribe(self, key_expression: str, inbox: Inbox) -> None:
        """Nothing ever arrives."""

    def announce(self, role: str, number: int) -> None:
        """A radio has no tokens: who listens, knows by the samples that it is there."""

    def watch_presence(self, on_change: Callable[[str, bool], None]) -> None:
        """Nobody is ever heard."""

    def audit(self) -> dict[str, float]:
        """Returns how many datagrams could not be sent, if any."""
        return {"unsent": float(self._unsent)} if self._unsent else {}

    def close(self) -> None:
        """See `Bus.close`."""
        self._closed = True
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _send(self, datagram: bytes) -> None:
        try:
            self._socket.send(datagram)
        except OSError as error:
            self._unsent += 1
            if (now := self._clock()) >= self._retry_ns and not self._closed:
                self._retry_ns = now + _RETRY_NS
                self._reopen(error)

    def _reopen(self, reason: Exception) -> None:
        self._socket.close()
        try:
            self._socket = _open(self._group, _prepare_to_send)
        except DeviceError as error:
            reason = error
        _log.warning("cannot send: %s (so far %d)", reason, self._unsent)


class Receiver:
    """Hears one speaker on a radio, on a thread of its own that only stores bytes.

    Args:
        group: Where it speaks.
        swarm: Name of the swarm.
        speaker: Who it is, as `role/id`; while it is heard, it is present.
        keys: What it may say. Everything else on the air is refused, so nobody can play a drone here.
        clock: The process's clock.

    Raises:
        DeviceError: The group cannot be joined.
    """

    def __init__(self, group: RadioGroup, swarm: str, speaker: str, keys: Iterable[str], clock: Clock) -> None:
        self._group, self._swarm, self._speaker = group, swarm, speaker
        self._keys = frozenset(keys)
        self._clock = clock
        self._subscriptions: list[tuple[str, Inbox]] = []
        self._watchers: list[Callable[[str, bool], None]] = []
        self._present = False
        self._heard_ns = 0
        self._refused: Counter[str] = Counter()
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._socket = _open(group, _prepare_to_hear)
        self._joined_ns = clock()
        self._thread = threading.Thread(target=self._listen, name="radio", daemon=True)
        self._thread.start()

    def subscribe(self, key_expression: str, inbox: Inbox) -> None:
        """See `Bus.subscribe`."""
        self._subscriptions.append((key_expression, inbox))

    def watch_presence(self, on_change: Callable[[str, bool], None]) -> None:
        """See `Bus.watch_presence`: the speaker appears when it is heard and disappears after `SILENT_S`."""
        with self._lock:
            self._watchers.append(on_change)
            if self._present:
                on_change(self._speaker, True)

    def audit(self) -> dict[str, float]:
        """Returns how many datagrams were refused, by reason."""
        with self._lock:
            return {f"refused radio ({reason})": float(count) for reason, count in self._refused.items()}

    def close(self) -> None:
        """Stops listening; returns within a moment, may be called twice."""
        self._closing.set()
        self._thread.join()
        self._socket.close()

    def _listen(self) -> None:
        while not self._closing.is_set():
            try:
                self._hear(self._socket.recv(MAX_DATAGRAM + 1))
            except TimeoutError:
                pass
            except DecodeError as error:
                self._refuse(error)
            except OSError as error:
                _log.warning("cannot listen to %s: %s", self._group, error)
                self._closing.wait(_LOOK_S)
            self._notice_silence()

    def _hear(self, datagram: bytes) -> None:
        swarm, key, payload = decode_datagram(datagram)
        if swarm != self._swarm:
            raise DecodeError("foreign", f"swarm {swarm!r:.40}")
        if key not in self._keys:
            raise DecodeError("unknown-key", f"{key!r:.40}")
        for expression, inbox in self._subscriptions:
            if matches(expression, key):
                inbox.put(key, payload)
        self._heard_ns = self._clock()
        if not self._present:
            self._tell(present=True)

    def _notice_silence(self) -> None:
        now, silent_ns = self._clock(), round(SILENT_S * NS_PER_S)
        if now - self._heard_ns < silent_ns:
            return
        if self._present:
            self._tell(present=False)
        if now - self._joined_ns >= silent_ns:
            self._joined_ns = now
            self._join_anew()

    def _join_anew(self) -> None:
        try:
            fresh = _open(self._group, _prepare_to_hear)
        except DeviceError as error:
            _log.debug("%s", error)
            return
        self._socket.close()
        self._socket = fresh

    def _tell(self, *, present: bool) -> None:
        with self._lock:
            self._present = present
            for watcher in self._watchers:
                watcher(self._speaker, present)

    def _refuse(self, error: DecodeError) -> None:
        with self._lock:
            self._refused[error.reason] += 1
            count = self._refused.total()
        if count & (count - 1) == 0:  # the 1st, 2nd, 4th, 8th ...
            _log.warning("dropped a datagram: %s (so far %d)", error, count)


def _open(group: RadioGroup, prepare: Callable[[socket.socket, RadioGroup, bytes], None]) -> socket.socket:
    """Opens a UDP socket and prepares it for a group, given with its interface as a `struct ip_mreqn`.

    Raises:
        DeviceError: It cannot be prepared; what to do.
    """
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        place = socket.inet_aton(group.address), _ANY_ADDRESS, socket.if_nametoindex(group.interface)
        prepare(opened, group, struct.pack("=4s4si", *place))
    except (OSError, ValueError) as error:
        opened.close()
        raise DeviceError(
            f"no radio at {group}: {error}; set net.interface to one that is up and has an address"
        ) from error
    return opened


def _prepare_to_send(opened: socket.socket, group: RadioGroup, membership: bytes) -> None:
    opened.setblocking(False)
    opened.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, _LOCAL_HOPS)
    opened.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, membership)
    opened.connect((group.address, group.port))
    opened.shutdown(socket.SHUT_RD)


def _prepare_to_hear(opened: socket.socket, group: RadioGroup, membership: bytes) -> None:
    opened.settimeout(_LOOK_S)
    # Many processes of one machine hear the same group.
    opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    opened.bind((group.address, group.port))
    opened.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
