"""Messages as frames on a serial line, and a decoder that survives garbage. Pure.

A frame is `00 COBS(type seq body crc) 00`; the CRC is CRC-16/CCITT (polynomial 0x1021, start 0xffff) of type,
seq and body. The delimiter in front cuts off what noise has left on the line.
"""

import struct
from binascii import crc_hqx
from collections import Counter
from collections.abc import Callable
from typing import get_args

from cobs import cobs

from glove_bridge.protocol import MAX_FRAMES, MOTORS, Message
from shared.errors import DecodeError

MAX_PACKET = 2 + 2 + (2 + MOTORS) * MAX_FRAMES + 2
"""Longest frame before COBS, bytes: below 254, so COBS adds exactly one byte."""

_CRC_START = 0xFFFF
_DELIMITER = b"\0"
_PARSERS: dict[int, Callable[[int, bytes], Message]] = {kind.TYPE: kind.parse for kind in get_args(Message)}


def encode(message: Message) -> bytes:
    """Returns what goes on the line for a message, delimiters included; write it in one piece."""
    packet = bytes((message.TYPE, message.seq)) + message.body()
    checked = packet + crc_hqx(packet, _CRC_START).to_bytes(2, "big")
    return _DELIMITER + bytes(cobs.encode(checked)) + _DELIMITER


def decode(frame: bytes) -> Message:
    """Reads what stood between two delimiters.

    Raises:
        DecodeError: `framing`, `crc`, `type` or `body`: it is not a message.
    """
    try:
        packet = cobs.decode(frame)
    except cobs.DecodeError as error:
        raise DecodeError("framing", str(error)) from error
    if len(packet) < 4 or crc_hqx(packet, _CRC_START):
        raise DecodeError("crc", f"{len(packet)} bytes")
    parse = _PARSERS.get(packet[0])
    if parse is None:
        raise DecodeError("type", f"0x{packet[0]:02x}")
    try:
        return parse(packet[1], packet[2:-2])
    except (ValueError, struct.error) as error:
        raise DecodeError("body", f"type 0x{packet[0]:02x}: {error}") from error


class StreamDecoder:
    """Finds the messages in a stream of bytes, whatever else is in it.

    Args:
        rejected: Where to count, a counter of its own by default.

    Attributes:
        rejected: How many frames were none, by the reason of `decode` or `oversized`.
    """

    def __init__(self, rejected: Counter[str] | None = None) -> None:
        self.rejected: Counter[str] = Counter() if rejected is None else rejected
        self._frame = bytearray()

    def feed(self, data: bytes) -> list[Message]:
        """Returns the messages that end in `data`, in order."""
        *whole, tail = data.split(_DELIMITER)
        messages = []
        for piece in whole:
            message = self._close(piece)
            if message is not None:
                messages.append(message)
        self._grow(tail)
        return messages

    def _grow(self, piece: bytes) -> None:
        """Keeps one byte more than a frame can have: enough to see that it has too many."""
        self._frame += piece[: MAX_PACKET + 2 - len(self._frame)]

    def _close(self, piece: bytes) -> Message | None:
        self._grow(piece)
        frame, self._frame = bytes(self._frame), bytearray()
        if not frame:
            return None
        if len(frame) > MAX_PACKET + 1:
            self.rejected["oversized"] += 1
            return None
        try:
            return decode(frame)
        except DecodeError as error:
            self.rejected[error.reason] += 1
            return None
