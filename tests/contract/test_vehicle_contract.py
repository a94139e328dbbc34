"""What every vehicle backend promises, run against each of them.

The simulated vehicle talks through real loopback sockets to a real world whose clock the test turns.
"""

from collections.abc import Callable, Iterator
from typing import Protocol

import pytest

from agents.vehicles import BACKENDS, open_vehicle
from agents.vehicles.base import Pose, Vehicle
from agents.vehicles.bodies.fleet import park_fleet
from agents.vehicles.sim import SimVehicle
from agents.vehicles.world.radio import DRIVER_SILENT_S, Radio
from agents.vehicles.world.referee import Rules
from agents.vehicles.world.world import TICK, World
from shared.errors import ConfigError

DRONE = 2
HOME = (0.4, -0.3, 0.0)
ABOVE = (0.4, -0.3, 1.0)


class Stage(Protocol):
    """A backend with its counterpart, on a clock that only `run` advances."""

    vehicle: Vehicle

    def run(self, seconds: float, each_step: Callable[[], None]) -> None: ...

    def close(self) -> None: ...


class SimStage:
    """`sim://` and a world with one drone that stands at `HOME`."""

    def __init__(self) -> None:
        self._now = 100.0
        self._fleet = park_fleet({DRONE: "identified"}, [HOME])
        self._rules = Rules(
            ids=(DRONE,),
            columns=(),
            fence=((-9.0, -9.0, -9.0), (9.0, 9.0, 9.0)),
        )
        self.radio = Radio(("127.0.0.1", 0), (DRONE,), frozenset())
        self.world = World(self._fleet, self.radio, self._rules, self._now)
        self.port = self.radio.port
        self.vehicle: Vehicle = self.open_driver()

    def open_driver(self) -> SimVehicle:
        return SimVehicle(f"sim://127.0.0.1:{self.port}/{DRONE}", lambda: self._now)

    def restart_world(self) -> None:
        self.radio.close()
        self.run(0.5, lambda: None, world=False)
        self.radio = Radio(("127.0.0.1", self.port), (DRONE,), frozenset())
        self.world = World(self._fleet, self.radio, self._rules, self._now)

    def run(self, seconds: float, each_step: Callable[[], None], *, world: bool = True) -> None:
        for _ in range(round(seconds / TICK)):
            each_step()
            self.vehicle.pose()
            self._now += TICK
            if world:
                self.world.run_until(self._now)

    def close(self) -> None:
        self.vehicle.close()
        self.radio.close()


STAGES: dict[str, Callable[[], Stage]] = {"sim": SimStage}


def nothing() -> None:
    """The agent says nothing."""


@pytest.fixture(params=STAGES)
def stage(request: pytest.FixtureRequest) -> Iterator[Stage]:
    made = STAGES[request.param]()
    yield made
    made.close()


@pytest.fixture
def sim() -> Iterator[SimStage]:
    made = SimStage()
    yield made
    made.close()


def reported(stage: Stage) -> Pose:
    pose = stage.vehicle.pose()
    assert pose is not None
    return pose


def take_off(stage: Stage) -> None:
    stage.run(15.0, lambda: stage.vehicle.fly(ABOVE))
    assert reported(stage).position == pytest.approx(ABOVE, abs=0.1)


def test_every_backend_has_a_stage() -> None:
    assert set(STAGES) == set(BACKENDS)


def test_no_pose_before_the_first_report(stage: Stage) -> None:
    assert stage.vehicle.pose() is None


def test_reports_come_without_any_command(stage: Stage) -> None:
    stage.run(0.5, nothing)
    pose = reported(stage)
    assert pose.position == pytest.approx(HOME, abs=1e-6)
    assert not pose.airborne
    assert 0.0 <= pose.battery <= 1.0


def test_seq_changes_with_every_report_and_only_then(stage: Stage) -> None:
    stage.run(0.5, nothing)
    first = reported(stage)
    assert reported(stage) == first
    stage.run(0.1, nothing)
    assert reported(stage).seq != first.seq


def test_fly_goes_to_the_setpoint_and_stays(stage: Stage) -> None:
    take_off(stage)
    assert reported(stage).airborne
    stage.run(8.0, lambda: stage.vehicle.fly((0.9, 0.2, 1.0)))
    pose = reported(stage)
    assert pose.position == pytest.approx((0.9, 0.2, 1.0), abs=0.1)
    assert pose.velocity == pytest.approx((0.0, 0.0, 0.0), abs=0.1)


def test_velocity_is_that_of_the_positions(stage: Stage) -> None:
    take_off(stage)
    stage.run(0.3, lambda: stage.vehicle.fly((1.4, -0.3, 1.0)))
    before = reported(stage)
    stage.run(0.1, lambda: stage.vehicle.fly((1.4, -0.3, 1.0)))
    after = reported(stage)
    mean = (before.velocity[0] + after.velocity[0]) / 2
    assert mean > 0.2
    assert (after.position[0] - before.position[0]) / 0.1 == pytest.approx(mean, rel=0.1)


@pytest.mark.parametrize("verb", ["descend", "idle"])
def test_descent_reaches_the_ground(stage: Stage, verb: str) -> None:
    take_off(stage)
    speeds: list[float] = []

    def down() -> None:
        getattr(stage.vehicle, verb)()
        speeds.append(reported(stage).velocity[2])

    stage.run(6.0, down)
    assert not reported(stage).airborne
    assert min(speeds) > -1.5


def test_idle_stays_on_the_ground(stage: Stage) -> None:
    stage.run(1.0, stage.vehicle.idle)
    assert reported(stage).position == pytest.approx(HOME, abs=1e-6)


def test_stop_cuts_at_once(stage: Stage) -> None:
    take_off(stage)
    stage.run(0.3, stage.vehicle.stop)
    assert reported(stage).velocity[2] < -1.0
    stage.run(1.0, stage.vehicle.stop)
    assert not reported(stage).airborne


def test_silence_ends_in_the_link_loss_rule(stage: Stage) -> None:
    take_off(stage)
    stage.run(1.8, nothing)
    assert reported(stage).airborne
    stage.run(1.5, nothing)
    assert not reported(stage).airborne


def test_close_twice_and_calls_afterwards_are_harmless(stage: Stage) -> None:
    stage.vehicle.close()
    stage.vehicle.close()
    stage.vehicle.fly(ABOVE)
    stage.vehicle.stop()
    stage.vehicle.pose()


def test_driver_may_start_before_the_world_and_outlive_it(sim: SimStage) -> None:
    sim.run(0.5, nothing)
    sim.restart_world()
    before = reported(sim).seq
    sim.run(0.5, nothing)
    assert reported(sim).seq != before


def test_a_new_driver_takes_over_in_the_air(sim: SimStage) -> None:
    take_off(sim)
    sim.vehicle.close()
    sim.vehicle = sim.open_driver()
    sim.run(DRIVER_SILENT_S - 0.1, nothing)
    assert sim.vehicle.pose() is None, "the one before may only have stuttered"
    sim.run(0.4, nothing)
    assert reported(sim).airborne
    sim.run(3.0, lambda: sim.vehicle.fly(ABOVE))
    assert reported(sim).position == pytest.approx(ABOVE, abs=0.1)


@pytest.mark.parametrize("setpoint", [(float("nan"), 0.0, 1.0), (0.0, 0.0, 1e9)])
def test_impossible_setpoints_are_refused_by_the_world(
    sim: SimStage, setpoint: tuple[float, float, float]
) -> None:
    take_off(sim)
    sim.run(0.3, lambda: sim.vehicle.fly(setpoint))
    assert reported(sim).position == pytest.approx(ABOVE, abs=0.1)
    assert sim.radio.rejected["out-of-range"] == 30


@pytest.mark.parametrize(
    "uri", ["sim://127.0.0.1/2", "sim://127.0.0.1:x/2", "sim://127.0.0.1:7400", "sim://127.0.0.1:7400/two"]
)
def test_malformed_uris_are_refused_with_an_example(uri: str) -> None:
    with pytest.raises(ConfigError, match=r"sim://127\.0\.0\.1:7400/2"):
        open_vehicle(uri)


def test_unknown_scheme_lists_the_known_ones() -> None:
    with pytest.raises(ConfigError, match="no backend for 'smi'; known: sim://"):
        open_vehicle("smi://127.0.0.1:7400/2")


def test_open_vehicle_opens_the_backend() -> None:
    vehicle = open_vehicle("sim://127.0.0.1:7400/2")
    assert isinstance(vehicle, SimVehicle)
    vehicle.close()
