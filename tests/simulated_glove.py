"""A simulated device: the glove's protocol on a pseudo-terminal, in Python, with lines that lose and unplugs.

It stands for the firmware where the chip itself is not what is tested; `tests/chip` runs the real one.
"""

import os
import pty
import select
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from glove_bridge.framing import StreamDecoder, encode
from glove_bridge.protocol import (
    HELD,
    MAX_FRAMES,
    MAX_PATTERN_MS,
    MOTORS,
    PROTOCOL,
    Ack,
    Command,
    Hello,
    HelloReply,
    Ping,
    Play,
    PlayFrame,
    Set,
    Status,
    Stop,
)

OFF = (0,) * MOTORS
MS = 1_000_000
TICK_S = 0.002


class Device:
    """What the firmware does, on a clock in nanoseconds.

    Attributes:
        log: Every change of duty: when and to what.
        plays: Patterns begun.
    """

    def __init__(self, protocol: int = PROTOCOL) -> None:
        self.log: list[tuple[int, tuple[int, ...]]] = []
        self.plays: list[tuple[PlayFrame, ...]] = []
        self._protocol = protocol
        self._nonce: int | None = None
        self._seq = 0
        self._deadman_ns = self._obeyed_ns = 0
        self._frames: tuple[PlayFrame, ...] = ()
        self._started_ns = 0
        self._held = OFF

    @property
    def duties(self) -> tuple[int, ...]:
        """What the motors get."""
        return self.log[-1][1] if self.log else OFF

    @property
    def obeys(self) -> bool:
        """Whether a session is open."""
        return self._nonce is not None

    def tick(self, now_ns: int) -> None:
        """Moves on: dead-man and frames."""
        if self._nonce is not None and now_ns - self._obeyed_ns >= self._deadman_ns:
            self._nonce = None
            self._rest()
        self._drive(now_ns)

    def answer(self, command: Command, now_ns: int) -> HelloReply | Ack:
        """Obeys a command."""
        if isinstance(command, Hello):
            reply: HelloReply | Ack = self._greet(command, now_ns)
        else:
            reply = self._acknowledge(command, now_ns)
        self._drive(now_ns)
        return reply

    def _acknowledge(self, command: Set | Play | Stop | Ping, now_ns: int) -> Ack:
        status = self._obey(command, now_ns)
        if status is Status.OK:
            self._obeyed_ns = now_ns
        return Ack(command.seq, status, self._remaining_ms(now_ns), 0, session=command.session)

    def _greet(self, hello: Hello, now_ns: int) -> HelloReply:
        if hello.protocol == self._protocol and hello.nonce != self._nonce:
            self._nonce, self._seq, self._deadman_ns = hello.nonce, hello.seq, hello.deadman_ms * MS
            self._obeyed_ns = now_ns
            self._rest()
        return HelloReply(
            seq=hello.seq,
            protocol=self._protocol,
            firmware=(0, 9),
            nonce=self._nonce or 0,
            motors=MOTORS,
            max_frames=MAX_FRAMES,
            max_pattern_ms=MAX_PATTERN_MS,
            deadman_ms=hello.deadman_ms,
        )

    def _obey(self, command: Set | Play | Stop | Ping, now_ns: int) -> Status:
        if self._nonce is None or command.session != self._nonce:
            return Status.NO_SESSION
        ahead = (command.seq - self._seq) % 256
        if not 1 <= ahead <= 127:
            return Status.STALE if ahead else Status.DUPLICATE
        self._seq = command.seq
        if isinstance(command, Ping):
            return Status.OK
        self._rest()
        if isinstance(command, Play):
            self._frames, self._started_ns = command.frames, now_ns
            self.plays.append(command.frames)
        elif isinstance(command, Set):
            self._held = command.duties
        return Status.OK

    def _rest(self) -> None:
        self._frames, self._held = (), OFF

    def _remaining_ms(self, now_ns: int) -> int:
        if self._held != OFF:
            return HELD
        length_ms = sum(frame.ms for frame in self._frames)
        return max(0, length_ms - (now_ns - self._started_ns) // MS) if self._frames else 0

    def _drive(self, now_ns: int) -> None:
        duties, end_ns = self._held, self._started_ns
        for frame in self._frames:
            end_ns += frame.ms * MS
            if now_ns < end_ns:
                duties = frame.duties
                break
        if duties != self.duties:
            self.log.append((now_ns, duties))


class SimulatedGlove:
    """A device behind a pseudo-terminal at a path that stays when it is plugged in again.

    Args:
        path: Where the port appears.
        protocol: Version that it speaks.

    Attributes:
        device: The device, a new one after every unplug.
        lose: How many of the next commands it does not hear.
        mute: How many of the next commands it obeys without an answer.
    """

    def __init__(self, path: Path, protocol: int = PROTOCOL) -> None:
        self.path, self.lose, self.mute = path, 0, 0
        self.device = Device(protocol)
        self._protocol = protocol
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def plug(self) -> None:
        """Plugs it in."""
        self._stop.clear()
        self.device = Device(self._protocol)
        master, slave = pty.openpty()
        tty.setraw(slave)
        self.path.symlink_to(os.ttyname(slave))
        self._thread = threading.Thread(target=self._run, args=(master, slave), daemon=True)
        self._thread.start()

    def unplug(self) -> None:
        """Takes port and power away."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
            self.path.unlink()

    def _run(self, master: int, slave: int) -> None:
        decoder = StreamDecoder()
        while not self._stop.is_set():
            if select.select([master], [], [], TICK_S)[0]:
                for message in decoder.feed(os.read(master, 4096)):
                    if not isinstance(message, Ack | HelloReply):
                        self._hear(master, message)
            self.device.tick(time.monotonic_ns())
        os.close(slave)
        os.close(master)

    def _hear(self, master: int, command: Command) -> None:
        if self.lose > 0:
            self.lose -= 1
            return
        reply = self.device.answer(command, time.monotonic_ns())
        if self.mute > 0:
            self.mute -= 1
            return
        with suppress(OSError):
            os.write(master, encode(reply))


@contextmanager
def simulated_glove(path: Path, protocol: int = PROTOCOL) -> Iterator[SimulatedGlove]:
    """Plugs a device in at a path, and unplugs it at the end."""
    glove = SimulatedGlove(path, protocol)
    glove.plug()
    try:
        yield glove
    finally:
        glove.unplug()
