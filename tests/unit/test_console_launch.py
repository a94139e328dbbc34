"""How a flight gets its console: the hand it chooses, the rows, the pattern file."""

import os
import socket
from contextlib import closing
from pathlib import Path
from urllib.parse import quote

import pytest

from deploy.launcher.hand_choice import choose_hand
from deploy.launcher.pattern_file import write_pattern_file
from deploy.launcher.ports import free_port_near
from deploy.launcher.process_table import ConsoleChoice, process_table, resolve_scenario
from glove_bridge.patterns import CUES, load_patterns
from observer.console.pattern_file import read_patterns
from shared.config import load_scenario
from shared.errors import ConfigError, DeviceError
from shared.formation import build_formation
from shared.nodes import all_nodes
from shared.private_socket import PrivateListener

SLALOM = load_scenario("slalom")
MAZE = load_scenario("maze")


@pytest.fixture(autouse=True)
def mine(short_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that sockets are made in."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(short_path))
    return short_path / "swarmtouch"


def test_a_console_may_take_over_any_hand_no_faster_than_the_swarm(mine: Path) -> None:
    choice = choose_hand("scripted:tour", SLALOM, console=True)
    assert choice.uri == "scripted:tour"
    assert choice.pointer == str(mine / f"pointer-{os.getpid()}.sock")
    assert choice.takeover == f"pointer://{choice.pointer}?speed=0.75"
    assert choose_hand("scripted:tour", SLALOM, console=False).pointer == ""


def test_a_pointer_needs_no_address_and_no_takeover(mine: Path) -> None:
    for console in (True, False):
        choice = choose_hand("pointer://", SLALOM, console=console)
        assert choice.pointer == str(mine / f"pointer-{os.getpid()}.sock")
        assert (choice.uri, choice.takeover) == (f"pointer://{choice.pointer}?speed=0.75", None)


def test_what_the_user_says_of_the_pointer_stays(short_path: Path) -> None:
    path = short_path / "a b?.sock"
    choice = choose_hand(f"pointer://{quote(str(path))}?speed=0.3", SLALOM, console=True)
    assert choice.pointer == str(path)
    assert choice.uri == f"pointer://{quote(str(path))}?speed=0.3"


def test_a_gain_slows_the_hand_down() -> None:
    assert choose_hand("pointer://", MAZE, console=True).uri.endswith("speed=0.75")


def test_what_cannot_be_a_hand_is_refused(short_path: Path) -> None:
    with pytest.raises(ConfigError, match="a socket of this machine"):
        choose_hand("pointer://10.0.0.1:1", SLALOM, console=True)
    taken = PrivateListener(short_path / "taken.sock")
    with closing(taken), pytest.raises(DeviceError, match="somebody listens there"):
        choose_hand(f"pointer://{short_path}/taken.sock", SLALOM, console=True)


def test_the_console_is_a_process_that_starts_before_the_hand() -> None:
    formation = build_formation(SLALOM)
    scenario = resolve_scenario(
        SLALOM, formation, range(9001, 9001 + len(all_nodes(formation))), 9999, "/run/x"
    )
    assert scenario.net.pointer == "/run/x"
    rows = process_table(
        scenario,
        formation,
        file=Path("/runs/1/scenario.toml"),
        hand="scripted:tour",
        run_dir=Path("/runs/1"),
        console=ConsoleChoice(port=8460, pattern_file=Path("/runs/1/patterns.json"), takeover="pointer://x"),
    )
    assert [row.token for row in rows][-2:] == ["console/0", "relay/0"]
    assert rows[-2].restarts
    assert rows[-2].command[-4:] == ("--port", "8460", "--patterns", "/runs/1/patterns.json")
    assert rows[-1].command[-2:] == ("--takeover", "pointer://x")


def test_without_a_pointer_the_resolved_scenario_says_so() -> None:
    formation = build_formation(SLALOM)
    ports = range(9001, 9001 + len(all_nodes(formation)))
    assert resolve_scenario(SLALOM, formation, ports, 9999).net.pointer == ""


def test_the_pattern_file_has_every_pattern_and_names_the_cues(tmp_path: Path) -> None:
    known = read_patterns(write_pattern_file(tmp_path, "paper"))
    paper, cues = load_patterns("paper").patterns, load_patterns(CUES).patterns
    assert set(known.frames) == {*paper, *cues}
    assert known.cues == set(cues)
    for name, pattern in paper.items():
        frames = [(f["ms"], {int(finger): hz for finger, hz in f["hz"].items()}) for f in known.frames[name]]
        assert frames == [(frame.ms, dict(frame.hz)) for frame in pattern.frames]


def test_a_port_that_is_taken_is_replaced() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert free_port_near(port) not in (0, port)
    assert free_port_near(port) == port
