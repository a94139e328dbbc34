"""The chip's end of the line: repeated commands, latency, the dead-man, resets, and a wrong rate."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from glove_bridge.framing import encode
from glove_bridge.protocol import (
    HELD,
    MAX_FRAMES,
    USB_BAUD,
    USB_DEADMAN_MS,
    XBEE_BAUD,
    XBEE_DEADMAN_MS,
    Hello,
    HelloReply,
    Ping,
    Play,
    PlayFrame,
    Set,
    Status,
    Stop,
)
from tests.chip.asker import Asker
from tests.chip.simulated_chip import SimulatedChip

pytestmark = [pytest.mark.chip, pytest.mark.parallel]

REST = (0,) * 5
ALL = (90, 100, 110, 120, 130)
LATENCY_MS = 0.2


def test_a_repeated_pattern_plays_once(chip: SimulatedChip) -> None:
    play = Play(1, (PlayFrame(60, ALL), PlayFrame(40, REST), PlayFrame(50, ALL)))
    with Asker(chip.path) as asker:
        asker.greet()
        answers = [asker.tell(play) for _ in range(3)]
        while asker.tell(Ping(2)).remaining_ms:
            pass
        answers.append(asker.tell(play))
    statuses = [answer.status for answer in answers]
    assert statuses == [Status.OK, Status.DUPLICATE, Status.DUPLICATE, Status.STALE]
    assert answers[0].remaining_ms == 150
    assert answers[2].remaining_ms > 0
    chip.expect(ALL, REST, ALL, REST)


def test_a_repeated_greeting_interrupts_nothing_and_a_new_one_stops_everything(chip: SimulatedChip) -> None:
    with Asker(chip.path) as asker:
        asker.greet(nonce=1)
        asker.tell(Set(1, ALL))
        asker.greet(nonce=1)
        assert asker.tell(Ping(2)).remaining_ms == HELD
        asker.greet(nonce=2)
        assert asker.tell(Ping(1)).remaining_ms == 0
    chip.expect(ALL, REST)


@pytest.mark.parametrize("frames", [1, 3, 10, MAX_FRAMES])
def test_from_the_last_byte_to_the_motors_it_is_200_us_at_most(frames: int, chip: SimulatedChip) -> None:
    with Asker(chip.path) as asker:
        asker.greet()
        for k in range(10):
            command = Play(2 * k + 1, (PlayFrame(20, ALL),) * frames)
            assert asker.tell(command).status is Status.OK
            assert asker.tell(Stop(2 * k + 2)).remaining_ms == 0
    chip.wait(lambda chip: len(chip.drives) == 100)
    heard = chip.times("heard")[1:]
    by_command = [chip.drives[k : k + 5] for k in range(0, 100, 5)]
    latencies = [drive.ms - at for at, five in zip(heard, by_command, strict=True) for drive in five]
    assert min(latencies) > 0.0
    assert max(latencies) <= LATENCY_MS


@dataclass
class Link:
    baud: int
    deadman_ms: int
    options: tuple[str, ...]


LINKS = {
    "usb": Link(USB_BAUD, USB_DEADMAN_MS, ()),
    "xbee": Link(XBEE_BAUD, XBEE_DEADMAN_MS, ("--xbee",)),
}


@pytest.mark.parametrize("name", LINKS)
@pytest.mark.parametrize("last", [Set(1, ALL), Play(1, (PlayFrame(5000, ALL),))])
def test_the_motors_stop_when_the_line_dies(
    name: str, last: Set | Play, start_chip: Callable[..., SimulatedChip]
) -> None:
    link = LINKS[name]
    chip = start_chip(*link.options)
    with Asker(chip.path, link.baud) as asker:
        assert asker.greet(link.deadman_ms).deadman_ms == link.deadman_ms
        asker.tell(last)
        asker.tell(Ping(2))
        chip.do("cut")
        chip.wait(lambda chip: len(chip.steps) == 2)
        chip.do("join")
        assert asker.tell(Ping(3)).status is Status.NO_SESSION
    chip.expect(ALL, REST)
    silence = chip.steps[1].ms - chip.times("heard")[2]
    assert link.deadman_ms <= silence <= 1.2 * link.deadman_ms


def test_noise_does_not_keep_the_motors_alive(chip: SimulatedChip) -> None:
    with Asker(chip.path) as asker:
        asker.greet()
        asker.tell(Set(1, ALL))
        until = time.monotonic() + 1.0
        while len(chip.steps) < 2 and time.monotonic() < until:
            asker.send(b"\x05\x05\x02\x00\x07" * 10)
            time.sleep(0.005)
    chip.expect(ALL, REST)
    assert USB_DEADMAN_MS <= chip.steps[1].ms - chip.times("heard")[1] <= 1.2 * USB_DEADMAN_MS


def test_without_a_session_only_a_greeting_is_obeyed(chip: SimulatedChip) -> None:
    with Asker(chip.path) as asker:
        for command in (Set(1, ALL), Play(2, (PlayFrame(100, ALL),)), Stop(3), Ping(4)):
            assert asker.tell(command).status is Status.NO_SESSION
        stranger = asker.ask(Hello(5, 1, USB_DEADMAN_MS, protocol=99))
        assert isinstance(stranger, HelloReply)
        assert asker.tell(Ping(6)).status is Status.NO_SESSION
    assert not chip.drives


def test_a_hung_firmware_is_reset_by_the_watchdog_and_its_motors_stop(chip: SimulatedChip) -> None:
    with Asker(chip.path) as asker:
        asker.greet()
        asker.tell(Set(1, ALL))
        hung = chip.do("hang")
        chip.wait(lambda chip: len(chip.steps) == 2)
        assert asker.tell(Ping(2)).status is Status.NO_SESSION
        asker.greet()
        assert asker.tell(Set(1, ALL)).status is Status.OK
    chip.expect(ALL, REST, ALL, REST)
    assert 0 < chip.steps[1].ms - hung < 200


def test_a_reset_stops_the_motors_until_the_next_greeting(chip: SimulatedChip) -> None:
    with Asker(chip.path) as asker:
        asker.greet()
        asker.tell(Play(1, (PlayFrame(3000, ALL),)))
        chip.do("reset")
        assert asker.tell(Ping(2)).status is Status.NO_SESSION
    chip.expect(ALL, REST)


def test_at_the_wrong_rate_nothing_is_understood(start_chip: Callable[..., SimulatedChip]) -> None:
    chip = start_chip("--xbee")
    with Asker(chip.path, USB_BAUD) as asker:
        assert asker.ask(Hello(0, 1, USB_DEADMAN_MS)) is None
        asker.send(encode(Set(1, ALL)))
    with Asker(chip.path, XBEE_BAUD) as asker:
        asker.greet()
        assert asker.tell(Ping(1)).rejected > 0
    assert not chip.drives


def test_a_flood_of_commands_costs_answers_and_nothing_else(chip: SimulatedChip) -> None:
    with Asker(chip.path) as asker:
        asker.greet()
        asker.send(b"".join(asker.line(Ping(1 + k % 100)) for k in range(400)))
        ack = asker.tell(Play(101, (PlayFrame(50, ALL),)))
        assert ack.status is Status.OK
        chip.wait(lambda chip: len(chip.drives) == 10)
    chip.expect(ALL, REST)
