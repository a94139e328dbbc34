"""The lab does what it says: real packets of real processes, parted, lost, late, doubled."""

import subprocess
import sys
from collections.abc import Iterator

import pytest

from tests.chaos.lab import Lab, obstacle
from tests.chaos.weather import Weather

pytestmark = [pytest.mark.container, pytest.mark.timeout(60)]

COUNT = 400
HEAR = """
import socket, time
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
    ear.bind(("", 9000))
    print("ready", flush=True)
    ear.settimeout(0.7)
    try:
        while True:
            datagram = ear.recv(100)
            number, sent = map(int, datagram.split())
            print(number, time.monotonic_ns() - sent, flush=True)
    except TimeoutError:
        pass
"""
SPEAK = """
import socket, sys, time
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as mouth:
    for number in range(int(sys.argv[2])):
        mouth.sendto(b"%d %d" % (number, time.monotonic_ns()), (sys.argv[1], 9000))
        time.sleep(0.002)
"""


@pytest.fixture(params=[False, True], ids=["switch", "emulator"])
def lab(request: pytest.FixtureRequest) -> Iterator[Lab]:
    if reason := obstacle():
        pytest.skip(reason)
    with Lab(["drone/1", "drone/2"], emulated=request.param) as made:
        yield made


def heard(lab: Lab, address: str) -> list[tuple[int, float]]:
    """Sends numbered datagrams from drone 1 to an address of drone 2; returns (number, delay in s)."""
    ear = (*lab.within("drone/2"), sys.executable, "-c", HEAR)
    with subprocess.Popen(ear, stdout=subprocess.PIPE, text=True) as listening:
        assert listening.stdout is not None
        assert listening.stdout.readline() == "ready\n"
        mouth = (*lab.within("drone/1"), sys.executable, "-c", SPEAK, address, str(COUNT))
        subprocess.run(mouth, check=True, timeout=30.0)
        lines = [line.split() for line in listening.communicate(timeout=30.0)[0].splitlines()]
    return [(int(number), int(delay) / 1e9) for number, delay in lines]


def test_all_arrives_in_order_through_mesh_and_air(lab: Lab) -> None:
    for address in (lab.mesh("drone/2"), lab.air("drone/2")):
        assert [number for number, _ in heard(lab, address)] == list(range(COUNT))


def test_parted_nodes_hear_nothing_in_the_mesh_until_they_are_healed(lab: Lab) -> None:
    lab.part(["drone/1"], ["drone/2"])
    assert heard(lab, lab.mesh("drone/2")) == []
    assert len(heard(lab, lab.air("drone/2"))) == COUNT
    lab.silence("drone/2", "drone/1")
    assert heard(lab, lab.air("drone/2")) == []
    lab.heal()
    assert len(heard(lab, lab.mesh("drone/2"))) == len(heard(lab, lab.air("drone/2"))) == COUNT


def test_packets_are_lost_by_chance(lab: Lab) -> None:
    lab.lose(0.2)
    assert 0.7 < len(heard(lab, lab.mesh("drone/2"))) / COUNT < 0.9
    assert len(heard(lab, lab.air("drone/2"))) == COUNT


@pytest.mark.parametrize("lab", [True], indirect=True, ids=["emulator"])
def test_the_emulator_makes_weather(lab: Lab) -> None:
    lab.weather(Weather(delay=0.05, jitter=0.02, loss=0.2, duplicate=0.1))
    arrived = heard(lab, lab.mesh("drone/2"))
    numbers = [number for number, _ in arrived]
    assert 0.7 < len(set(numbers)) / COUNT < 0.9
    assert 1.03 < len(numbers) / len(set(numbers)) < 1.2
    assert numbers != sorted(numbers)
    delays = sorted(delay for _, delay in arrived)
    assert delays[0] >= 0.03
    assert delays[len(delays) // 2] == pytest.approx(0.05, abs=0.01)
    lab.weather(Weather())
    assert [number for number, _ in heard(lab, lab.mesh("drone/2"))] == list(range(COUNT))
