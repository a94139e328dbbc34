"""What every process does alike: arguments from the environment, and a watchdog that hears of the loop."""

import argparse
import platform
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from shared.clock import system_clock
from shared.codec import decode
from shared.compiled import form
from shared.memory_bus import MemoryBus, MemoryNetwork
from shared.messages import ProcessStatus
from shared.process import OVERRIDES, SCENARIO, StatusReporter, add_process_arguments, tell_form
from shared.topics import STATUS
from shared.transport import Inbox
from shared.watchdog import NOTIFY_SOCKET, feed_watchdog


def parsed(*arguments: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_process_arguments(parser)
    return parser.parse_args(arguments)


def test_the_environment_stands_for_arguments_and_the_command_line_comes_last(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(SCENARIO, "maze")
    monkeypatch.setenv(OVERRIDES, "  swarm.name=one\n rates.hand_hz=30 ")
    assert parsed().scenario == "maze"
    assert parsed("--scenario", "vee").scenario == "vee"
    assert parsed("--set", "swarm.name=two").set == ["swarm.name=one", "rates.hand_hz=30", "swarm.name=two"]
    assert parsed().set == ["swarm.name=one", "rates.hand_hz=30"]


def test_without_environment_a_scenario_is_demanded(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv(SCENARIO, raising=False)
    with pytest.raises(SystemExit):
        parsed()
    assert "--scenario" in capsys.readouterr().err


ARENAS = """
import ctypes, threading
from shared.process import prepare_process

libc = ctypes.CDLL(None)
prepare_process("x")
together = threading.Barrier(8)
threads = [threading.Thread(target=together.wait) for _ in range(8)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
libc.malloc_info(0, ctypes.c_void_p.in_dll(libc, "stdout"))
libc.fflush(None)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="asks glibc how many arenas it has")
def test_all_threads_share_one_arena() -> None:
    told = subprocess.run([sys.executable, "-c", ARENAS], check=True, capture_output=True, text=True).stdout
    assert told.count("<heap nr=") == 1


ENDING = """
import signal, sys
from shared.process import prepare_process

signal.signal(signal.SIGHUP, signal.SIG_IGN if "nohup" in sys.argv else signal.SIG_DFL)
stopping = prepare_process("x")
signal.raise_signal(signal.Signals[sys.argv[1]])
print(stopping.is_set())
"""


@pytest.mark.parametrize(
    ("name", "ends"), [("SIGTERM", True), ("SIGINT", True), ("SIGHUP", True), ("SIGHUP nohup", False)]
)
def test_a_signal_or_a_lost_terminal_ends_the_loop(name: str, ends: bool) -> None:
    command = [sys.executable, "-c", ENDING, *name.split()]
    told = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert told == f"{ends}\n"


@pytest.fixture
def manager(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> socket.socket:
    """The socket of a service manager, and the environment that names it."""
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    listening.bind(str(tmp_path / "notify"))
    listening.setblocking(False)
    monkeypatch.setenv(NOTIFY_SOCKET, str(tmp_path / "notify"))
    return listening


def test_every_status_feeds_the_watchdog(manager: socket.socket) -> None:
    with manager:
        status = StatusReporter(MemoryBus(MemoryNetwork()), "drone", 1, system_clock())
        status.tick(0)
        assert manager.recv(100).split() == [b"READY=1", b"WATCHDOG=1"]
        status.tick(1)
        with pytest.raises(BlockingIOError):
            manager.recv(100)  # the second has not passed yet


def test_a_status_says_which_form_of_the_law_runs() -> None:
    network, clock = MemoryNetwork(), system_clock()
    heard = Inbox(clock)
    MemoryBus(network).subscribe(STATUS.wildcard, heard)
    StatusReporter(MemoryBus(network), "drone", 1, clock, tell_form()).tick(0)
    StatusReporter(MemoryBus(network), "relay", 0, clock).tick(0)
    said = {key: decode(arrivals[-1].payload, ProcessStatus).form for key, arrivals in heard.take().items()}
    assert said == {STATUS.key(role="drone", id=1): str(form()), STATUS.key(role="relay", id=0): ""}


def test_an_abstract_socket_is_fed(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind("")  # Linux chooses an abstract address
        monkeypatch.setenv(NOTIFY_SOCKET, "@" + listening.getsockname()[1:].decode())
        feed_watchdog()
        assert b"WATCHDOG=1" in listening.recv(100)


def test_a_manager_that_is_gone_or_full_stops_nobody(manager: socket.socket) -> None:
    with manager:
        for _ in range(10_000):
            feed_watchdog()
    feed_watchdog()
