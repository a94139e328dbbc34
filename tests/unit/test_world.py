"""The world around its bodies: garbage, slow machines, planning, the report on disk."""

import json
import socket
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

from agents.vehicles.bodies.fleet import BODIES, park_fleet, pose_of
from agents.vehicles.bodies.state import Command
from agents.vehicles.link import Verb, decode_pose, encode_order
from agents.vehicles.world.faults import faults_of
from agents.vehicles.world.hand import HandWatch
from agents.vehicles.world.radio import DRIVER_SILENT_S, Radio
from agents.vehicles.world.record import RefereeFile
from agents.vehicles.world.referee import Rules
from agents.vehicles.world.setup import plan_world
from agents.vehicles.world.world import MAX_CATCH_UP, TICK, World
from shared.arrays import rest_of
from shared.codec import encode
from shared.config import structure_scenario
from shared.cylinders import Cylinder
from shared.errors import ConfigError, DeviceError
from shared.memory_bus import MemoryBus, MemoryNetwork
from shared.messages import HandSample, Wish
from shared.scenario import VehicleSettings
from shared.topics import HAND

IDS = (1, 2)


@pytest.fixture
def radio() -> Iterator[Radio]:
    with Radio(("127.0.0.1", 0), IDS, {2}) as made:
        yield made


@pytest.fixture
def driver(radio: Radio) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.connect(("127.0.0.1", radio.port))
        made.settimeout(5.0)
        yield made


def make_world(radio: Radio, failing: Mapping[int, VehicleSettings] = MappingProxyType({})) -> World:
    fleet = park_fleet({1: "identified", 2: "crazyflie"}, [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    rules = Rules(ids=IDS, columns=(), fence=((-9.0, -9.0, -9.0), (9.0, 9.0, 9.0)))
    return World(fleet, radio, rules, 10.0, {drone: faults_of(each) for drone, each in failing.items()})


def test_garbage_is_counted_and_changes_nothing(radio: Radio, driver: socket.socket) -> None:
    driver.send(encode_order(1, Verb.FLY, (0.0, 0.0, 1.0)))
    radio.receive(10.0)
    wrong = bytearray(encode_order(1, Verb.STOP))
    wrong[2] = 9
    for datagram in (b"", b"x", b"ST" * 60, bytes(wrong), encode_order(3, Verb.STOP)):
        driver.send(datagram)
    radio.receive(10.1)
    assert radio.rejected == {"malformed": 3, "version": 1, "unknown-drone": 1}
    assert [radio.command(drone, 10.1)[0] for drone in IDS] == [Command.FLY, Command.CUT]


def test_newest_command_wins_and_ages(radio: Radio, driver: socket.socket) -> None:
    for drone in IDS:
        driver.send(encode_order(drone, Verb.FLY, (0.0, 0.0, 1.0)))
        driver.send(encode_order(drone, Verb.FLY, (0.5, 0.0, 1.0)))
    radio.receive(10.0)
    assert [radio.command(drone, 10.0)[1] for drone in IDS] == [(0.5, 0.0, 1.0)] * 2
    assert [radio.command(drone, 10.6)[0] for drone in IDS] == [Command.LEVEL, Command.FLY]
    assert [radio.command(drone, 12.1)[0] for drone in IDS] == [Command.CUT, Command.FLY]


def test_hello_is_no_command(radio: Radio, driver: socket.socket) -> None:
    driver.send(encode_order(2, Verb.FLY, (0.0, 0.0, 1.0)))
    radio.receive(10.0)
    driver.send(encode_order(2, Verb.HELLO))
    radio.receive(10.1)
    assert radio.command(2, 10.1)[0] == Command.FLY


def test_a_body_belongs_to_whoever_speaks_for_it_until_that_is_silent(
    radio: Radio, driver: socket.socket
) -> None:
    world = make_world(radio)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.settimeout(5.0)
        driver.send(encode_order(2, Verb.HELLO))
        driver.send(encode_order(2, Verb.FLY, (1.0, 0.0, 1.0)))
        radio.receive(10.0)
        for verb in (Verb.HELLO, Verb.STOP, Verb.FLY):
            other.sendto(encode_order(2, verb), ("127.0.0.1", radio.port))
        other.sendto(encode_order(1, Verb.HELLO), ("127.0.0.1", radio.port))
        radio.receive(10.0 + DRIVER_SILENT_S)
        assert radio.command(2, 10.0) == (Command.FLY, (1.0, 0.0, 1.0))
        assert radio.rejected == {"not-its-driver": 3}
        world.run_until(10.0 + TICK)
        assert decode_pose(driver.recv(128))[0] == 2
        assert decode_pose(other.recv(128))[0] == 1

        other.sendto(encode_order(2, Verb.HELLO), ("127.0.0.1", radio.port))
        radio.receive(10.1 + DRIVER_SILENT_S)
        world.run_until(10.2 + DRIVER_SILENT_S)
        assert {decode_pose(other.recv(128))[0] for _ in range(4)} == {1, 2}


def test_ticks_follow_the_clock_however_often_it_is_asked(radio: Radio) -> None:
    world = make_world(radio)
    for now in (10.004, 10.0101, 10.0102, 10.0299, 10.05):
        world.run_until(now)
    assert world.ticks == 5
    assert world.next_tick == pytest.approx(10.06)
    assert world.metrics()["lost_time_s"] == 0.0


def test_time_beyond_the_catch_up_is_given_up(radio: Radio) -> None:
    world = make_world(radio)
    world.run_until(12.0)
    assert world.ticks == MAX_CATCH_UP
    assert world.metrics()["lost_time_s"] == pytest.approx(2.0 - MAX_CATCH_UP * TICK)
    world.run_until(12.0 + TICK)
    assert world.ticks == MAX_CATCH_UP + 1


def test_a_taken_address_says_what_to_do(radio: Radio) -> None:
    with pytest.raises(DeviceError, match="another world may be running"):
        Radio(("127.0.0.1", radio.port), IDS, {2})


def test_plan_parks_the_formation_at_home() -> None:
    scenario = structure_scenario(
        {
            "hand": {"home": [1.0, 2.0]},
            "formation": {"shape": "rhombus"},
            "obstacles": [{"name": "a", "x": 5.0, "y": 6.0}],
            "vehicles": {"all": {"link_loss": "hover"}, "robots": {"3": {"body": "crazyflie"}}},
        },
        "test",
    )
    setup = plan_world(scenario)
    assert list(setup.fleet) == [1, 2, 3, 4]
    assert setup.address == ("127.0.0.1", 7400)
    assert setup.hovers == {1, 2, 3, 4}
    assert setup.rules.columns == (Cylinder(5.0, 6.0, 0.12),)
    expected = rest_of(setup.formation)[:, :2] + np.array([1.0, 2.0])
    places = [flyer.body.position for flyer in setup.fleet.values()]
    assert places == [(x, y, 0.0) for x, y in expected.tolist()]
    moved_by = {drone: flyer.model for drone, flyer in setup.fleet.items()}
    assert moved_by == {drone: BODIES["crazyflie" if drone == 3 else "identified"] for drone in (1, 2, 3, 4)}


@pytest.mark.parametrize(
    ("vehicles", "hint"),
    [
        ({"all": {"uri": "sim://127.0.0.1:7400/1"}}, r"drone 2 has .* which is drone 1; end it with /\{id\}"),
        ({"robots": {"1": {"uri": "sim://127.0.0.1:7401/1"}}}, "a world serves one sim:// address"),
        ({"all": {"uri": "radio://0/80/2M/{id}"}}, "none"),
    ],
)
def test_plans_that_no_world_can_serve_are_refused(vehicles: dict[str, object], hint: str) -> None:
    scenario = structure_scenario({"formation": {"shape": "rhombus"}, "vehicles": vehicles}, "test")
    with pytest.raises(ConfigError, match=hint):
        plan_world(scenario)


def test_hand_watch_keeps_the_newest_valid_position() -> None:
    network = MemoryNetwork()
    watch = HandWatch(MemoryBus(network), lambda: 0)
    publish: Callable[[bytes], None] = MemoryBus(network).publisher(HAND)
    assert watch.position() is None
    for seq, x in enumerate((1.0, 1.2)):
        publish(encode(_hand(seq, x)))
    publish(b"\xc1")
    position = watch.position()
    assert position is not None
    assert position == (1.2, 0.0, 1.2)
    assert watch.rejected == {"malformed": 1}


def test_report_is_written_once_a_second_and_at_the_end(tmp_path: Path) -> None:
    numbers = {"collisions": 0.0}
    path = tmp_path / "run" / "referee.json"
    with RefereeFile(tmp_path / "run") as report:
        report.write_when_due(5.0, lambda: numbers)
        assert json.loads(path.read_text(encoding="utf-8")) == {"collisions": 0.0}
        numbers["collisions"] = 1.0
        report.write_when_due(5.9, lambda: numbers)
        assert json.loads(path.read_text(encoding="utf-8")) == {"collisions": 0.0}
    assert json.loads(path.read_text(encoding="utf-8")) == {"collisions": 1.0}
    assert [p.name for p in path.parent.iterdir()] == ["referee.json"]


def test_report_that_cannot_be_written_is_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "run").write_text("a file where the folder should be", encoding="utf-8")
    RefereeFile(tmp_path / "run").write_when_due(0.0, dict)
    assert "cannot write" in caplog.text


def _hand(seq: int, x: float) -> HandSample:
    return HandSample(
        epoch=1, seq=seq, stamp_ns=0, position=(x, 0.0, 1.2), velocity=(0.0, 0.0, 0.0), yaw=0.0, mode=Wish.FLY
    )


def test_injected_faults_drain_the_battery_and_keep_poses_back() -> None:
    draining = faults_of(VehicleSettings(battery=0.5, endurance=10.0))
    silent = faults_of(VehicleSettings(pose_silence=(2.0, 1.5)))
    assert [draining.left(t) for t in (2.0, 60.0)] == pytest.approx([0.3, 0.0])
    assert [silent.left(t) for t in (2.0, 60.0)] == [1.0, 1.0]
    assert [silent.mute(t) for t in (0.0, 2.0, 3.4, 3.5)] == [False, True, True, False]
    assert not any(draining.mute(t) for t in (0.0, 2.0, 3.4, 3.5))


def test_a_mute_vehicle_sends_no_pose_and_an_old_battery_shows_in_the_others(
    radio: Radio, driver: socket.socket
) -> None:
    world = make_world(radio, {1: VehicleSettings(pose_silence=(0.0, 9.0)), 2: VehicleSettings(battery=0.25)})
    for drone in IDS:
        driver.send(encode_order(drone, Verb.HELLO))
    world.run_until(10.0 + TICK)
    drone, pose = decode_pose(driver.recv(256))
    assert (drone, pose.battery) == (2, 0.25)
    driver.setblocking(False)
    with pytest.raises(BlockingIOError):
        driver.recv(256)


def test_only_who_has_spoken_gets_poses(radio: Radio, driver: socket.socket) -> None:
    driver.send(encode_order(2, Verb.HELLO))
    radio.receive(10.0)
    fleet = park_fleet({1: "identified", 2: "identified"}, [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    radio.send({drone: pose_of(flyer, 1.0, 7) for drone, flyer in fleet.items()})
    drone, pose = decode_pose(driver.recv(256))
    assert (drone, pose.seq) == (2, 7)
    driver.setblocking(False)
    with pytest.raises(BlockingIOError):
        driver.recv(256)
