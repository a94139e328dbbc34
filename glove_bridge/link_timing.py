"""How fast a glove's line is, and how long to wait on it. Pure."""

from attrs import frozen

from glove_bridge.protocol import USB_BAUD, USB_DEADMAN_MS, XBEE_BAUD, XBEE_DEADMAN_MS
from shared.clock import NS_PER_S

_NS_PER_MS = 1_000_000
_BITS_PER_BYTE = 10
_LONGEST_REPLY = 20


@frozen(kw_only=True)
class LinkTiming:
    """How fast a line is.

    Attributes:
        baud: Bits per second.
        deadman_ms: Dead-man to ask the device for, ms.
        answer_ms: How long an answer may take beyond the bytes' own time, ms.
        greeting_ms: Time between two HELLOs, ms.
    """

    baud: int
    deadman_ms: int
    answer_ms: int
    greeting_ms: int

    def patience_ns(self, line: bytes) -> int:
        """Returns how long to wait for the answer to some bytes, ns."""
        bits = _BITS_PER_BYTE * (len(line) + _LONGEST_REPLY)
        return self.answer_ms * _NS_PER_MS + bits * NS_PER_S // self.baud


USB = LinkTiming(baud=USB_BAUD, deadman_ms=USB_DEADMAN_MS, answer_ms=60, greeting_ms=100)
XBEE = LinkTiming(baud=XBEE_BAUD, deadman_ms=XBEE_DEADMAN_MS, answer_ms=200, greeting_ms=300)
