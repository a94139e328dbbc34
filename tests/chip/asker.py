"""A host that asks once and waits: for what the session on the real line would never do."""

import time
from pathlib import Path
from types import TracebackType
from typing import Self

import attrs
import serial

from glove_bridge.framing import StreamDecoder, encode
from glove_bridge.protocol import USB_BAUD, USB_DEADMAN_MS, Ack, Command, Hello, HelloReply, Reply

PATIENCE_S = 0.5
ATTEMPTS = 3


class Asker:
    """Holds the port while it is entered.

    Args:
        path: The port.
        baud: Its rate.

    Attributes:
        session: What it names in its commands: the nonce of its last greeting.
    """

    def __init__(self, path: Path, baud: int = USB_BAUD) -> None:
        self._port = serial.Serial(str(path), baud, timeout=0.005)
        self._decoder = StreamDecoder()
        self.session = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._port.close()

    def greet(self, deadman_ms: int = USB_DEADMAN_MS, nonce: int = 0xBEEF) -> HelloReply:
        """Opens a session whose numbering starts at 0."""
        self.session = nonce
        reply = self._insist(Hello(0, nonce, deadman_ms))
        assert isinstance(reply, HelloReply)
        return reply

    def tell(self, command: Command) -> Ack:
        """Asks for something that is acknowledged."""
        reply = self._insist(command)
        assert isinstance(reply, Ack)
        return reply

    def ask(self, command: Command) -> Reply | None:
        """Sends a command once and returns its answer, None if none comes in time."""
        self.send(self.line(command))
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            for message in self._decoder.feed(self._port.read(64)):
                if isinstance(message, Reply) and message.seq == command.seq:
                    return message
        return None

    def line(self, command: Command) -> bytes:
        """Returns the bytes of a command of its session."""
        return encode(command if isinstance(command, Hello) else attrs.evolve(command, session=self.session))

    def send(self, line: bytes) -> None:
        """Writes bytes."""
        self._port.write(line)

    def forget(self) -> None:
        """Drops the answers that nobody has read."""
        self._port.reset_input_buffer()
        self._decoder = StreamDecoder()

    def _insist(self, command: Command) -> Reply:
        """Asks again if need be: a chip that starts hears nothing."""
        for _ in range(ATTEMPTS):
            reply = self.ask(command)
            if reply is not None:
                return reply
        raise AssertionError(f"no answer to {command}")
