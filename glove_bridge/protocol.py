"""The glove's wire protocol: its messages and their numbers. Pure; `framing` puts them on a line.

Host to chip: HELLO, SET, PLAY, STOP, PING; back: ACK, and HELLO's reply. `docs/glove-protocol.md` has every
byte, and `firmware/swarmtouch_glove.h` is the other end. Integers are big-endian.

HELLO opens a session under a nonce that the host draws; the same nonce again is answered and changes nothing.
Everything else names its session by that nonce. The dead-man ends a session: nothing obeyed for that long.
Outside a session every motor is off and only HELLO is obeyed. Each command has its own seq, counted up from
HELLO's modulo 256; a retry repeats it. The chip obeys what is 1 to 127 ahead of the newest seq it knows, and
only answers the rest: DUPLICATE or STALE.
"""

import enum
import struct
from typing import ClassVar, Self

from attrs import field, frozen
from attrs.validators import and_, deep_iterable, ge, le, max_len, min_len

PROTOCOL = 2
"""Version of the messages; a chip with another one opens no session."""
MOTORS = 5
MAX_FRAMES = 32
"""Frames of one PLAY: the longest pattern in which every frame has a kick-start."""
MAX_PATTERN_MS = 10_000
MIN_DEADMAN_MS, MAX_DEADMAN_MS = 100, 2000
"""The chip keeps the dead-man between these."""
USB_DEADMAN_MS, XBEE_DEADMAN_MS = 350, 1000
USB_BAUD, XBEE_BAUD = 115_200, 57_600
HELD = 0xFFFF
"""`Ack.remaining_ms` while a SET is held."""
_FRAME = struct.Struct(f">H{MOTORS}B")
_SESSION = struct.Struct(">H")


class Status(enum.IntEnum):
    """What the chip did with a command."""

    OK = 0
    DUPLICATE = 1
    """It has this one already, and did nothing again."""
    NO_SESSION = 2
    """The command is of no session, or of another one: a reset, the dead-man or a new HELLO has ended it."""
    STALE = 3
    """It knows a newer command."""
    BAD_BODY = 4
    """Wrong length or beyond a limit."""
    UNKNOWN_TYPE = 5


_U8, _U16 = and_(ge(0), le(0xFF)), and_(ge(0), le(0xFFFF))


@frozen
class Hello:
    """Opens a session; answered by `HelloReply`.

    Attributes:
        seq: Where the session's numbering starts.
        nonce: Names the session.
        deadman_ms: How long the chip may hear nothing before it stops; it may choose the nearest it can.
        protocol: Version of the messages.
    """

    TYPE: ClassVar = 0x01
    _BODY: ClassVar = struct.Struct(">BHH")

    seq: int = field(validator=_U8)
    nonce: int = field(validator=_U16)
    deadman_ms: int = field(validator=_U16)
    protocol: int = PROTOCOL

    def body(self) -> bytes:
        """Returns the bytes after type and seq."""
        return self._BODY.pack(self.protocol, self.nonce, self.deadman_ms)

    @classmethod
    def parse(cls, seq: int, body: bytes) -> Self:
        """Reads `body`; raises ValueError or struct.error."""
        protocol, nonce, deadman_ms = cls._BODY.unpack(body)
        return cls(seq, nonce, deadman_ms, protocol)


@frozen
class _InSession:
    """What belongs to a session: every command but HELLO, and its acknowledgement.

    Attributes:
        seq: Number of the command.
        session: Nonce of the session.
    """

    seq: int = field(validator=_U8)
    session: int = field(default=0, validator=_U16, kw_only=True)

    def body(self) -> bytes:
        """Returns the bytes after type and seq."""
        return _SESSION.pack(self.session) + self._rest()

    @classmethod
    def parse(cls, seq: int, body: bytes) -> Self:
        """Reads `body`; raises ValueError or struct.error."""
        (session,) = _SESSION.unpack_from(body)
        return cls._parse_rest(seq, session, body[_SESSION.size :])

    def _rest(self) -> bytes:
        return b""

    @classmethod
    def _parse_rest(cls, seq: int, session: int, rest: bytes) -> Self:
        if rest:
            raise ValueError(f"{len(rest)} bytes too many")
        return cls(seq, session=session)


@frozen
class Set(_InSession):
    """Sets every motor now and holds it, for as long as the session lives.

    Attributes:
        duties: PWM duty of finger 1 (thumb) .. 5 (little), 0 (off) to 255.
    """

    TYPE: ClassVar = 0x02

    duties: tuple[int, ...] = field(validator=[deep_iterable(_U8), min_len(MOTORS), max_len(MOTORS)])

    def _rest(self) -> bytes:
        return bytes(self.duties)

    @classmethod
    def _parse_rest(cls, seq: int, session: int, rest: bytes) -> Self:
        return cls(seq, tuple(rest), session=session)


@frozen
class PlayFrame:
    """One step of a pattern.

    Attributes:
        ms: Length, ms.
        duties: PWM duty of finger 1 (thumb) .. 5 (little), 0 (off) to 255.
    """

    ms: int = field(validator=and_(ge(1), le(MAX_PATTERN_MS)))
    duties: tuple[int, ...] = field(validator=[deep_iterable(_U8), min_len(MOTORS), max_len(MOTORS)])


@frozen
class Play(_InSession):
    """Plays a whole pattern from now on, instead of whatever plays.

    Attributes:
        frames: Steps, one after the other without gaps; 1 to `MAX_FRAMES`, `MAX_PATTERN_MS` in all.
    """

    TYPE: ClassVar = 0x03

    frames: tuple[PlayFrame, ...]

    def __attrs_post_init__(self) -> None:
        if not 1 <= len(self.frames) <= MAX_FRAMES:
            raise ValueError(f"{len(self.frames)} frames; a pattern has 1 to {MAX_FRAMES}")
        if self.length_ms > MAX_PATTERN_MS:
            raise ValueError(f"a pattern of {self.length_ms} ms; at most {MAX_PATTERN_MS}")

    @property
    def length_ms(self) -> int:
        """Length of the whole pattern, ms."""
        return sum(frame.ms for frame in self.frames)

    def _rest(self) -> bytes:
        return b"".join(_FRAME.pack(frame.ms, *frame.duties) for frame in self.frames)

    @classmethod
    def _parse_rest(cls, seq: int, session: int, rest: bytes) -> Self:
        frames = tuple(PlayFrame(ms, tuple(duties)) for ms, *duties in _FRAME.iter_unpack(rest))
        return cls(seq, frames, session=session)


@frozen
class Stop(_InSession):
    """Every motor off at once; the session lives on."""

    TYPE: ClassVar = 0x04


@frozen
class Ping(_InSession):
    """Keeps the session alive."""

    TYPE: ClassVar = 0x05


@frozen
class Ack(_InSession):
    """What the chip did with a command; seq and session are that command's.

    Attributes:
        status: What it did.
        remaining_ms: Length of what is still to play; 0 when the motors rest, `HELD` while a SET is held.
        rejected: Frames that did not arrive whole since the chip's reset, modulo 65536.
    """

    TYPE: ClassVar = 0x80
    _BODY: ClassVar = struct.Struct(">BHH")

    status: Status = field(converter=Status)
    remaining_ms: int = field(validator=_U16)
    rejected: int = field(validator=_U16)

    def _rest(self) -> bytes:
        return self._BODY.pack(self.status, self.remaining_ms, self.rejected)

    @classmethod
    def _parse_rest(cls, seq: int, session: int, rest: bytes) -> Self:
        return cls(seq, *cls._BODY.unpack(rest), session=session)


@frozen
class HelloReply:
    """What the chip is. A session is open if `protocol` is ours.

    Attributes:
        seq: Number of the HELLO.
        protocol: Version of its messages.
        firmware: Its version, (major, minor).
        nonce: The HELLO's.
        motors: How many it drives.
        max_frames: Most frames of a PLAY.
        max_pattern_ms: Longest PLAY.
        deadman_ms: The dead-man in force.
    """

    TYPE: ClassVar = 0x81
    _BODY: ClassVar = struct.Struct(">BBBHBBHH")

    seq: int = field(validator=_U8)
    protocol: int = field(validator=_U8)
    firmware: tuple[int, int]
    nonce: int = field(validator=_U16)
    motors: int = field(validator=_U8)
    max_frames: int = field(validator=_U8)
    max_pattern_ms: int = field(validator=_U16)
    deadman_ms: int = field(validator=_U16)

    def body(self) -> bytes:
        """Returns the bytes after type and seq."""
        counts = self.motors, self.max_frames, self.max_pattern_ms, self.deadman_ms
        return self._BODY.pack(self.protocol, *self.firmware, self.nonce, *counts)

    @classmethod
    def parse(cls, seq: int, body: bytes) -> Self:
        """Reads `body`; raises ValueError or struct.error."""
        protocol, major, minor, *rest = cls._BODY.unpack(body)
        return cls(seq, protocol, (major, minor), *rest)


Command = Hello | Set | Play | Stop | Ping
Reply = Ack | HelloReply
Message = Command | Reply
