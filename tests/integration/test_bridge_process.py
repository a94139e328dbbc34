"""The bridge as a process of its own: without a glove, without a swarm, with half of one, with garbage."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from deploy.launcher.ports import free_ports
from deploy.launcher.process_table import resolve_scenario
from shared.bus import ZenohBus
from shared.clock import system_clock
from shared.codec import decode, encode
from shared.config import dump_scenario, load_scenario
from shared.formation import build_formation
from shared.messages import ORIGIN, DroneState, Mode, ProcessStatus
from shared.net.settings import peer_settings
from shared.nodes import all_nodes, drone_node, endpoint
from shared.scenario import Scenario
from shared.topics import DRONE_STATE, STATUS
from shared.transport import Inbox
from tests.integration.bridged import BridgeListener

pytestmark = [pytest.mark.parallel, pytest.mark.timeout(90)]

DEADLINE_S = 30.0
FORMATION = build_formation(load_scenario("rhombus"))


@pytest.fixture
def scenario(tmp_path: Path) -> Scenario:
    tcp, (udp,) = free_ports(tcp=len(all_nodes(FORMATION)), udp=1)
    resolved = resolve_scenario(load_scenario("rhombus"), FORMATION, tcp, udp)
    (tmp_path / "scenario.toml").write_text(dump_scenario(resolved), encoding="utf-8")
    return resolved


def start(folder: Path, *arguments: str) -> "subprocess.Popen[str]":
    command = (sys.executable, "-P", "-m", "glove_bridge", "--scenario", str(folder / "scenario.toml"))
    return subprocess.Popen((*command, *arguments), stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


@pytest.fixture
def bridge(scenario: Scenario, tmp_path: Path) -> Iterator["subprocess.Popen[str]"]:
    """A bridge without a glove."""
    assert scenario.swarm.name == "rhombus"
    with start(tmp_path) as process:
        yield process
        process.kill()


def finish(process: "subprocess.Popen[str]") -> str:
    """Ends it and returns its log."""
    process.send_signal(signal.SIGTERM)
    _, log = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, log
    assert "Traceback" not in log
    return log


def until(condition: Callable[[], bool], each: Callable[[], None] = lambda: None) -> None:
    deadline = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline
        each()
        time.sleep(0.02)


def test_without_a_swarm_it_says_so_and_waits(bridge: "subprocess.Popen[str]", scenario: Scenario) -> None:
    with closing(BridgeListener(scenario)) as listener:
        until(lambda: len(listener.states) > 5, listener.drain)
    assert listener.states[-1].missing == FORMATION.ids
    assert listener.events == []
    assert "starting: no drone has been heard yet; no glove" in finish(bridge)


def state(drone: int, seq: int) -> bytes:
    x, y, z = FORMATION.rest[FORMATION.row(drone)]
    moment = DroneState(
        epoch=1,
        seq=seq,
        stamp_ns=seq,
        id=drone,
        position=(x, y, z + 1.2),
        velocity=ORIGIN,
        goal=(x, y, z + 1.2),
        goal_velocity=ORIGIN,
        setpoint=(x, y, z + 1.2),
        mode=Mode.FOLLOW,
    )
    return encode(moment)


def test_half_a_swarm_garbage_and_no_glove(bridge: "subprocess.Popen[str]", scenario: Scenario) -> None:
    """Drones 1 and 2 fly, 3 talks garbage, 4 is silent; whatever plays fails, and nothing ends."""
    inbox, seq = Inbox(system_clock(), depth=1000), 0
    statuses: list[ProcessStatus] = []
    with (
        ZenohBus(peer_settings("rhombus", endpoint(scenario, FORMATION, drone_node(1)), [])) as swarm,
        closing(BridgeListener(scenario)) as listener,
    ):
        swarm.subscribe(STATUS.wildcard, inbox)
        publish = {drone: swarm.publisher(DRONE_STATE, id=drone) for drone in (1, 2, 3)}

        def fly() -> None:
            nonlocal seq
            seq += 1
            publish[1](state(1, seq))
            publish[2](state(2, seq))
            publish[3](bytes([seq % 256]) * 300)
            listener.drain()
            for arrivals in inbox.take().values():
                statuses.extend(decode(arrival.payload, ProcessStatus) for arrival in arrivals)

        def felt() -> bool:
            failed = [event.pattern for event in listener.events if event.outcome == "failed"]
            return (
                failed.count("DRONE_LOST") >= 2 and bool(statuses) and sum(statuses[-1].rejected.values()) > 20
            )

        until(felt, fly)
    assert statuses[-1].state == "degraded"
    assert statuses[-1].metrics["missing"] == 2.0
    assert statuses[-1].metrics["patterns_failed"] >= 1.0
    assert listener.states[-1].missing == (3, 4)
    assert set(listener.states[-1].distances) == {"1-2"}
    log = finish(bridge)
    assert "degraded: not heard: drone 3, 4; no glove" in log
    assert "dropped a sample on drone/3/state" in log


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--patterns", "papr"), "bridge: papr: no such pattern set; did you mean 'paper'?"),
        (("--glove", "cloud://"), "bridge: glove 'cloud://': no such backend; known: none://"),
        (("--patterns", "cues"), "choose one that means 'state' or 'advice'"),
    ],
)
def test_a_wrong_configuration_is_refused(
    scenario: Scenario, tmp_path: Path, arguments: tuple[str, ...], expected: str
) -> None:
    assert scenario.swarm.name == "rhombus"
    with start(tmp_path, *arguments) as process:
        _, log = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 2
    assert expected in log


def test_it_stays_light() -> None:
    code = "import sys, glove_bridge.__main__; print({'rich', 'scipy', 'serial'} & set(sys.modules))"
    found = subprocess.run((sys.executable, "-c", code), capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "set()"
