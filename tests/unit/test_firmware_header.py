"""Host and chip agree: the numbers of the protocol are read from the firmware's header."""

import re
from pathlib import Path

import pytest

import glove_bridge
from glove_bridge import framing, protocol

HEADER = (Path(glove_bridge.__file__).parent / "firmware" / "glove" / "swarmtouch_glove.h").read_text()
CONSTANTS = {
    name: int(value, 0) for name, value in re.findall(r"constexpr \w+ k(\w+) = (0x[\dA-F]+|\d+);", HEADER)
}


def snake(name: str) -> str:
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).upper()


def enum_of(name: str) -> dict[str, int]:
    body = re.search(rf"enum {name} : uint8_t {{(.*?)}};", HEADER, re.DOTALL)
    assert body, name
    return {key: int(value, 0) for key, value in re.findall(r"k(\w+) = (\w+),", body[1])}


@pytest.mark.parametrize(
    "name",
    [
        "Protocol",
        "Motors",
        "MaxFrames",
        "MaxPatternMs",
        "MinDeadmanMs",
        "MaxDeadmanMs",
        "UsbBaud",
        "XbeeBaud",
        "Held",
    ],
)
def test_a_constant_is_the_same_on_both_ends(name: str) -> None:
    assert getattr(protocol, snake(name)) == CONSTANTS[name]


def test_the_crc_starts_alike() -> None:
    assert CONSTANTS["CrcStart"] == framing._CRC_START


def test_message_types_are_the_same() -> None:
    types = (protocol.Hello, protocol.Set, protocol.Play, protocol.Stop, protocol.Ping, protocol.Ack)
    assert enum_of("Type") == {
        **{kind.__name__: kind.TYPE for kind in types},
        "HelloReply": protocol.HelloReply.TYPE,
    }


def test_statuses_are_the_same() -> None:
    assert {snake(name): value for name, value in enum_of("Status").items()} == dict(
        protocol.Status.__members__.items()
    )


def test_the_dead_man_that_hosts_ask_for_is_one_that_the_chip_grants() -> None:
    for deadman_ms in (protocol.USB_DEADMAN_MS, protocol.XBEE_DEADMAN_MS):
        assert CONSTANTS["MinDeadmanMs"] <= deadman_ms <= CONSTANTS["MaxDeadmanMs"]
