"""The world as a process: flies, survives garbage, reports, ends on SIGTERM."""

import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from agents.vehicles import open_vehicle

pytestmark = pytest.mark.parallel

DEADLINE_S = 30.0


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture
def world(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], int]]:
    port = free_port(socket.SOCK_DGRAM)
    command = [
        *(sys.executable, "-m", "agents.vehicles.world", "--scenario", "rhombus", "--run-dir", str(tmp_path)),
        *("--set", f'vehicles.all.uri="sim://127.0.0.1:{port}/{{id}}"'),
        *("--set", f'net.endpoints."world"="tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"'),
    ]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        yield process, port
        process.kill()


def await_true(condition: Callable[[], bool]) -> None:
    """Repeats until it holds; commands must be repeated anyway."""
    deadline = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline, "the world did not get there"
        time.sleep(0.02)


def test_world_process_flies_reports_and_ends(world: tuple[subprocess.Popen[str], int], tmp_path: Path) -> None:
    process, port = world
    vehicle = open_vehicle(f"sim://127.0.0.1:{port}/2")
    await_true(lambda: vehicle.pose() is not None)
    pose = vehicle.pose()
    assert pose is not None
    x, y, _ = pose.position
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:

        def airborne() -> bool:
            stranger.sendto(b"\xff" * 200, ("127.0.0.1", port))
            vehicle.fly((x, y, 0.8))
            newest = vehicle.pose()
            return newest is not None and newest.airborne

        await_true(airborne)
    process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=DEADLINE_S)
    vehicle.close()
    assert process.returncode == 0, errors
    numbers = json.loads((tmp_path / "referee.json").read_text(encoding="utf-8"))
    assert numbers["collisions"] == numbers["fence_exits"] == 0
    assert 0.4 < numbers["min_distance_m"] < 1.5


def test_bad_configuration_exits_before_anything_starts() -> None:
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "agents.vehicles.world",
            "--scenario",
            "rhombus",
            "--set",
            "vehicles.al.body=x",
        ],
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )
    assert done.returncode == 2
    assert "unknown key 'al'" in done.stderr
