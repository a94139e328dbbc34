"""What feeds the chip's dead-man: commands of this session that it obeys, for ten minutes; and nothing else."""

from binascii import crc_hqx
from collections.abc import Iterable

import pytest
from cobs import cobs

from glove_bridge.framing import encode
from glove_bridge.protocol import USB_DEADMAN_MS, Ack, Hello, Ping, Set, Status
from tests.chip.asker import Asker
from tests.chip.simulated_chip import SimulatedChip

pytestmark = [pytest.mark.chip, pytest.mark.parallel, pytest.mark.timeout(200)]

REST = (0,) * 5
ALL = (90, 100, 110, 120, 130)
MINE, OTHER = 0xBEEF, 0x1234
PERIOD_MS, LENGTH_S = 100, 600
SEQS = range(2, 256)


def line(kind: int, seq: int, body: bytes = MINE.to_bytes(2, "big")) -> bytes:
    """A whole frame of any kind, by default of this session."""
    packet = bytes((kind, seq)) + body
    return b"\0" + bytes(cobs.encode(packet + crc_hqx(packet, 0xFFFF).to_bytes(2, "big"))) + b"\0"


def of_my_session(kind: int, body: bytes) -> list[bytes]:
    return [line(kind, seq, MINE.to_bytes(2, "big") + body) for seq in SEQS]


NOT_OBEYED = {
    "a greeting of another version": [encode(Hello(0, MINE, USB_DEADMAN_MS, protocol=1))],
    "a greeting that is cut short": [line(Hello.TYPE, 0, b"\x02\xbe")],
    "the greeting again": [encode(Hello(0, MINE, USB_DEADMAN_MS))],
    "greetings of another host": [encode(Hello(0, nonce, USB_DEADMAN_MS)) for nonce in range(300)],
    "commands of another session": [encode(Ping(seq, session=OTHER)) for seq in SEQS],
    "duties of another session": [encode(Set(seq, ALL, session=OTHER)) for seq in SEQS],
    "commands without a session": [line(Ping.TYPE, seq, b"") for seq in SEQS],
    "the last command again": [encode(Set(1, ALL, session=MINE))],
    "old commands": [encode(Ping(seq, session=MINE)) for seq in range(130, 256)],
    "unknown types": of_my_session(0x7F, b""),
    "answers": [encode(Ack(seq, Status.OK, 0, 0, session=MINE)) for seq in SEQS],
    "a PING with a body": of_my_session(Ping.TYPE, b"x"),
    "duties of four motors": of_my_session(Set.TYPE, bytes(4)),
    "patterns without a length": of_my_session(0x03, bytes(7)),
    "frames that are not whole": [encode(Ping(seq, session=MINE))[:-2] + b"\xff\0" for seq in SEQS],
}


def held(asker: Asker) -> None:
    """Has every motor turn, until something stops it."""
    asker.greet(nonce=MINE)
    assert asker.tell(Set(1, ALL)).status is Status.OK


def hear(chip: SimulatedChip, lines: Iterable[bytes]) -> float:
    return chip.repeat(lines, PERIOD_MS, LENGTH_S)


@pytest.mark.parametrize("kind", NOT_OBEYED)
def test_ten_minutes_of_it_keep_no_motor_on(kind: str, chip: SimulatedChip) -> None:
    with Asker(chip.path) as asker:
        held(asker)
        over_ms = hear(chip, NOT_OBEYED[kind])
        asker.forget()
        assert asker.tell(Ping(2)).status is Status.NO_SESSION
    chip.expect(ALL, REST)
    on, off = chip.steps
    assert off.ms - on.ms <= 1.2 * USB_DEADMAN_MS
    assert over_ms - off.ms > 0.99 * 1000 * LENGTH_S


def test_ten_minutes_of_pings_keep_them_on(chip: SimulatedChip) -> None:
    with Asker(chip.path) as asker:
        held(asker)
        over_ms = hear(chip, [encode(Ping(seq % 256, session=MINE)) for seq in range(2, 258)])
        chip.wait(lambda chip: not chip.turning)
    chip.expect(ALL, REST)
    off_ms = chip.steps[1].ms
    assert over_ms + USB_DEADMAN_MS - PERIOD_MS <= off_ms <= over_ms + 1.2 * USB_DEADMAN_MS
