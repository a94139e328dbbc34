"""The hand's radio: who speaks hears nothing, who listens is not disturbed, neither needs the other."""

import logging
import socket
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import closing

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deploy.launcher.ports import free_ports
from shared.errors import ConfigError, DecodeError, DeviceError
from shared.radio import Receiver, Transmitter
from shared.radio_link import GROUP, MAX_DATAGRAM, RadioGroup, decode_datagram, encode_head, radio_group
from shared.scenario import Net
from shared.topics import HAND
from shared.transport import Inbox

DEADLINE_S = 20.0
KEY = HAND.key()
RELAY = "relay/0"
TOO_LONG = bytes(70_000)
"""More than UDP can carry: sending it fails."""


@pytest.fixture
def group() -> RadioGroup:
    return RadioGroup(GROUP, free_ports(tcp=0, udp=1)[1][0], "lo")


@pytest.fixture
def swarm() -> str:
    return uuid.uuid4().hex


@pytest.fixture
def transmitter(group: RadioGroup, swarm: str) -> Iterator[Transmitter]:
    with Transmitter(group, swarm, time.monotonic_ns) as made:
        yield made


@pytest.fixture
def receiver(group: RadioGroup, swarm: str) -> Iterator[Receiver]:
    with closing(make_receiver(group, swarm)) as made:
        yield made


@pytest.fixture
def stranger(group: RadioGroup) -> Iterator[Callable[[bytes], object]]:
    """Says anything to the group."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mouth:
        mouth.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        yield lambda datagram: mouth.sendto(datagram, (group.address, group.port))


def make_receiver(group: RadioGroup, swarm: str) -> Receiver:
    return Receiver(group, swarm, RELAY, [KEY], time.monotonic_ns)


def inbox_of(receiver: Receiver) -> Inbox:
    inbox = Inbox(time.monotonic_ns, depth=1000)
    receiver.subscribe("*/*", inbox)
    return inbox


def until(condition: Callable[[], bool], meanwhile: Callable[[], object] = lambda: None) -> None:
    """Waits until it holds, doing something again and again."""
    deadline = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline
        meanwhile()
        time.sleep(0.01)


def next_of(inbox: Inbox) -> list[bytes]:
    """Waits for the next payloads."""
    assert inbox.wait(DEADLINE_S)
    return [arrival.payload for arrivals in inbox.take().values() for arrival in arrivals]


@given(swarm=st.text(max_size=60), key=st.text(max_size=60), payload=st.binary(max_size=300))
def test_what_was_encoded_is_decoded(swarm: str, key: str, payload: bytes) -> None:
    assert decode_datagram(encode_head(swarm, key) + payload) == (swarm, key, payload)


def test_a_datagram_that_is_too_long_or_of_another_version_is_told_apart() -> None:
    head = encode_head("s", KEY)
    for datagram, reason in ((head + bytes(MAX_DATAGRAM), "oversized"), (b"SR\2" + head[3:], "version")):
        with pytest.raises(DecodeError) as refused:
            decode_datagram(datagram)
        assert refused.value.reason == reason


def test_the_group_is_the_scenario_s_or_the_usual_one() -> None:
    assert radio_group(Net(interface="wlan0")) == ("224.0.0.225", 7450, "wlan0")
    assert radio_group(Net(multicast="239.1.2.3:99")) == ("239.1.2.3", 99, "lo")
    for wrong in ("10.0.0.1:7450", "224.0.0.225", "224.0.0.225:0", "224.0.0.225:70000", "224.0.0.256:1"):
        with pytest.raises(ConfigError, match=r"net\.multicast: .* for example 224\.0\.0\.225:7450"):
            radio_group(Net(multicast=wrong))


def test_everybody_on_one_machine_hears_every_sample(
    transmitter: Transmitter, group: RadioGroup, swarm: str
) -> None:
    publish = transmitter.publisher(HAND)
    receivers = [make_receiver(group, swarm) for _ in range(4)]
    inboxes = [inbox_of(receiver) for receiver in receivers]
    for number in range(50):
        publish(b"%d" % number)
        assert [next_of(inbox) for inbox in inboxes] == 4 * [[b"%d" % number]]
    for receiver in receivers:
        receiver.close()


def test_who_speaks_cannot_be_reached(transmitter: Transmitter, group: RadioGroup) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.settimeout(DEADLINE_S)
        ear.bind((group.address, group.port))
        joined = socket.inet_aton(group.address) + socket.inet_aton("127.0.0.1")
        ear.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, joined)
        transmitter.publisher(HAND)(b"here I am")
        _, source = ear.recvfrom(100)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as answer:
        answer.settimeout(DEADLINE_S)
        answer.connect(source)
        answer.send(b"?")
        with pytest.raises(ConnectionRefusedError):  # said by the kernel: no socket takes it
            answer.recv(1)


def test_garbage_is_counted_by_reason_and_disturbs_nobody(
    transmitter: Transmitter, receiver: Receiver, swarm: str, stranger: Callable[[bytes], object]
) -> None:
    inbox = inbox_of(receiver)
    publish = transmitter.publisher(HAND)
    lies = {
        "malformed": b"\xff" * 40,
        "version": b"SR\x09\0\0",
        "oversized": encode_head(swarm, KEY) + bytes(MAX_DATAGRAM),
        "foreign": encode_head("another", KEY) + b"lie",
        "unknown-key": encode_head(swarm, "drone/2/state") + b"lie",
    }
    for _ in range(3):
        for lie in (*lies.values(), b""):
            stranger(lie)
        publish(b"true")
        assert next_of(inbox) == [b"true"]
    counted = {f"refused radio ({reason})": 3.0 for reason in lies}
    assert receiver.audit() == {**counted, "refused radio (malformed)": 6.0}


def test_presence_is_being_heard(transmitter: Transmitter, receiver: Receiver) -> None:
    seen: list[tuple[str, bool]] = []
    receiver.watch_presence(lambda token, present: seen.append((token, present)))
    publish = transmitter.publisher(HAND)
    until(lambda: bool(seen), lambda: publish(b""))
    late: list[tuple[str, bool]] = []
    receiver.watch_presence(lambda token, present: late.append((token, present)))
    until(lambda: len(seen) > 1)
    assert seen == [(RELAY, True), (RELAY, False)]
    assert late[-1] == (RELAY, False)
    until(lambda: len(seen) > 2, lambda: publish(b""))
    assert seen[-1] == (RELAY, True)


def test_a_group_that_was_forgotten_is_joined_anew(
    transmitter: Transmitter, receiver: Receiver, group: RadioGroup
) -> None:
    inbox = inbox_of(receiver)
    publish = transmitter.publisher(HAND)
    left = socket.inet_aton(group.address) + socket.inet_aton("127.0.0.1")
    receiver._socket.setsockopt(socket.IPPROTO_IP, socket.IP_DROP_MEMBERSHIP, left)
    inbox.take()
    until(lambda: bool(inbox.take()), lambda: publish(b"again"))


def test_what_cannot_be_sent_is_counted_told_once_a_second_and_forgotten(
    group: RadioGroup, swarm: str, receiver: Receiver, caplog: pytest.LogCaptureFixture
) -> None:
    inbox, now = inbox_of(receiver), [0]
    with Transmitter(group, swarm, lambda: now[0]) as transmitter, caplog.at_level(logging.WARNING, "radio"):
        publish = transmitter.publisher(HAND)
        for now[0] in (0, 1, 999_999_999, 1_000_000_000):
            publish(TOO_LONG)
        publish(b"after")
        assert transmitter.audit() == {"unsent": 4.0}
    assert [record.args[-1] for record in caplog.records if isinstance(record.args, tuple)] == [1, 4]
    assert next_of(inbox) == [b"after"]


def test_a_closed_transmitter_stays_silent(
    transmitter: Transmitter, receiver: Receiver, group: RadioGroup, swarm: str
) -> None:
    inbox = inbox_of(receiver)
    publish = transmitter.publisher(HAND)
    transmitter.close()
    transmitter.close()
    for _ in range(3):
        publish(b"too late")
    with Transmitter(group, swarm, time.monotonic_ns) as next_one:
        next_one.publisher(HAND)(b"next")
    assert next_of(inbox) == [b"next"]


def test_an_interface_that_is_not_there_is_named(group: RadioGroup, swarm: str) -> None:
    absent = group._replace(interface="absent0")
    for make in (lambda: make_receiver(absent, swarm), lambda: Transmitter(absent, swarm, time.monotonic_ns)):
        with pytest.raises(DeviceError, match=r"no radio at .* on absent0: .*set net\.interface"):
            make()
