"""The lab does what it says: real packets of real processes, parted, lost, late, doubled."""

import subprocess
import sys
from collections.abc import Iterator
from statistics import median

import pytest

from tests.chaos.lab import Lab, obstacle
from tests.chaos.weather import Weather

pytestmark = [pytest.mark.container, pytest.mark.timeout(120)]

COUNT = 400
HEAR = """
import select, socket, sys, time
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
    ear.bind(("", 9000))
    print("ready", flush=True)
    watched, patience = [ear, sys.stdin], None
    while ready := select.select(watched, [], [], patience)[0]:
        if ear in ready:
            number, sent = map(int, ear.recv(100).split())
            print(number, time.monotonic_ns() - sent, flush=True)
        else:  # the speaker has ended: only what is under way may still come
            watched, patience = [ear], 0.7
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
    with subprocess.Popen(ear, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as listening:
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
    fair = heard(lab, lab.mesh("drone/2"))
    assert [number for number, _ in fair] == list(range(COUNT))
    lab.weather(Weather(delay=0.05, jitter=0.02, loss=0.2, duplicate=0.1))
    arrived = heard(lab, lab.mesh("drone/2"))
    numbers = [number for number, _ in arrived]
    assert 0.7 < len(set(numbers)) / COUNT < 0.9
    assert 1.03 < len(numbers) / len(set(numbers)) < 1.2
    assert numbers != sorted(numbers)
    assert min(delay for _, delay in arrived) >= 0.03
    assert median(delay for _, delay in arrived) >= median(delay for _, delay in fair) + 0.03
    lab.weather(Weather())
    assert [number for number, _ in heard(lab, lab.mesh("drone/2"))] == list(range(COUNT))
