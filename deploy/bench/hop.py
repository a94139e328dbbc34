"""One node of the floor: the least that still passes a hand on from node to node in the order of the formation.

A bare node decodes a 48-byte header, waits until the same hand sample has come through all of its references,
and publishes as many bytes as an agent would. No control, no numpy, no MessagePack.
"""

import struct
from collections.abc import Iterable
from typing import NamedTuple

from shared.clock import Clock

HAND_ID = 0
"""Number of the hand among the nodes; drones have theirs."""

_HEADER = struct.Struct("<6Q")


class Token(NamedTuple):
    """What a payload of the floor says; the rest of it is padding.

    Attributes:
        node: Who sent it.
        number: The newest hand sample that came to it through every hop, counted from 1.
        hand_ns: When that sample was sent.
        arrival_ns: When the last of what it answers to had arrived.
        stamp_ns: When this payload was sent.
        seq: Counts the payloads of its node from 1.
    """

    node: int
    number: int
    hand_ns: int
    arrival_ns: int
    stamp_ns: int
    seq: int


def pack(token: Token, size: int) -> bytes:
    """Makes a payload of `size` bytes, at least as many as the header has."""
    return _HEADER.pack(*token).ljust(size, b"\0")


def unpack(payload: bytes) -> Token:
    """Reads a payload of the floor."""
    return Token(*_HEADER.unpack_from(payload))


class Hop:
    """Waits for its inputs and answers.

    Args:
        node: Own number.
        references: Numbers of the nodes that it refers to, `HAND_ID` for the hand.
        size: Bytes of each answer.
    """

    def __init__(self, node: int, references: Iterable[int], size: int) -> None:
        self._node = node
        self._through = dict.fromkeys(references, 0)
        self._size = size
        self._sent = self._seq = 0

    def hear(self, payload: bytes, arrival_ns: int, clock: Clock) -> bytes | None:
        """Takes a payload in; returns the answer when it completes the inputs."""
        token = unpack(payload)
        if token.node in self._through:
            self._through[token.node] = token.number
        number = min(self._through.values())
        if number <= self._sent:
            return None
        self._sent = number
        self._seq += 1
        return pack(Token(self._node, number, token.hand_ns, arrival_ns, clock(), self._seq), self._size)
