"""The cross-check: what ships passes, what does not go together is refused with key, numbers and advice."""

import os
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import settings as hypothesis
from hypothesis import strategies as st

from agents import __main__ as agent_process
from agents.control.impedance import AT_REST, LinkState, Spring, step_links
from agents.control.impedance import Link as LawLink
from agents.vehicles.world import __main__ as world_process
from deploy.cli import main
from deploy.doctor.finding import Verdict
from deploy.doctor.scenario import check_values
from deploy.launcher.process_table import hint_overrides, resolve_scenario
from human_relay import __main__ as relay_process
from human_relay.sources import source_hints
from shared.config import SCENARIOS, dump_scenario, load_scenario
from shared.errors import ConfigError
from shared.fence import fence_box
from shared.formation import Formation, Link, build_formation
from shared.nodes import all_nodes
from shared.scenario import Scenario
from shared.scenario_check.check import check_scenario, open_scenario
from shared.scenario_check.checked import check_drone
from shared.scenario_check.network import largest_displacement

SHIPPED = sorted(path.stem for path in SCENARIOS.glob("*.toml"))
DATA = Path(os.environ.get("SWARMTOUCH_DATA", Path(__file__).resolve().parents[2].parent / "shared/data"))


def keys(name: str, *overrides: str) -> list[str]:
    scenario = load_scenario(name, overrides)
    return [finding.key for finding in check_scenario(scenario, build_formation(scenario))]


@pytest.mark.parametrize("name", SHIPPED)
def test_what_ships_passes_with_any_number_and_law(name: str) -> None:
    assert keys(name) == []
    if load_scenario(name).formation.shape in ("line", "vee", "grid"):
        assert keys(name, "formation.n=2") == keys(name, "formation.n=32") == []


def test_vehicles_that_cannot_keep_their_distances_in_the_shape_are_refused_with_numbers() -> None:
    assert keys("line", "formation.spacing=0.305") == []
    close = load_scenario("line", ["formation.spacing=0.305", "vehicles.all.body=crazyflie"])
    (finding,) = check_scenario(close, build_formation(close))
    assert finding.key == "formation"
    assert "rest 0.305 m apart" in finding.what
    assert "(crazyflie, crazyflie) keep 0.307 m" in finding.what


def test_an_envelope_that_is_not_there_is_named_with_those_that_are() -> None:
    scenario = load_scenario("line", ["vehicles.all.envelope=mine"])
    (finding,) = check_scenario(scenario, build_formation(scenario))
    assert finding.key == "vehicles"
    assert "crazyflie, identified" in finding.what


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("more", [(), ("net.profile=radio",), ("net.router=tcp/10.0.0.1:7447",)])
def test_what_the_launcher_resolves_passes_in_every_process(
    name: str, more: tuple[str, ...], tmp_path: Path
) -> None:
    scenario, formation = open_scenario(name, more)
    ports = range(9000, 9000 + len(all_nodes(formation)))
    resolved = resolve_scenario(scenario, formation, list(ports), 7400)
    file = tmp_path / "scenario.toml"
    file.write_text(dump_scenario(resolved))
    assert open_scenario(file) == (resolved, formation)


@pytest.mark.parametrize("flight", sorted((DATA / "flights").glob("*")), ids=lambda path: path.name)
def test_the_recorded_flights_pass(flight: Path) -> None:
    assert keys("maze", *hint_overrides(source_hints(f"recording:{flight}"))) == []


@pytest.mark.parametrize(
    ("name", "override", "key"),
    [
        ("rhombus", "fence={min=[-0.2,-0.2,0],max=[0.2,0.2,2]}", "fence"),
        ("rhombus", "hand.home=[9.0,0.0]|fence.min=[-3,-3,0]|fence.max=[3,3,3]", "hand.home"),
        ("rhombus", "fence.max=[9,9,1.3]", "limits.takeoff_height"),
        ("rhombus", "net.base_port=65530", "net.base_port"),
        ("rhombus", "limits.takeoff_height=0.1", "limits.takeoff_height"),
        ("rhombus", "fence.min=[-9,-9,0.1]", "fence.min"),
        ("rhombus", "hand.height=5.0", "hand.height"),
        ("rhombus", "hand.height=-1.0", "hand.height"),
        ("rhombus", "hand.height=0.1", "hand.height"),
        ("maze", "hand.clip={min=[-2.5,-1.0],max=[1.0,1.0]}", "hand.clip"),
        ("rhombus", 'obstacles=[{name="a",x=-0.5,y=0.1}]', "obstacles"),
        ("rhombus", 'obstacles=[{name="a",x=3,y=0},{name="a",x=2,y=0}]', "obstacles"),
        ("rhombus", 'walkers=[{name="a", path=[[-0.5, 0.2]]}]', "walkers"),
        ("rhombus", 'walkers=[{name="a", path=[[2.0, 2.0], [2.0, 0.0]], speed=1.6}]', "walkers"),
        ("rhombus", "formation.n=5", "formation.n"),
        ("rhombus", "formation.columns=2", "formation.columns"),
        ("line", "formation.width=0.7", "formation.width"),
        ("vee", "formation.height_from=references", "formation.height_from"),
        ("rhombus", "swarm.total_limit=0.7", "swarm.total_limit"),
        ("rhombus", "hand.gain=2.0", "hand.gain"),
        ("rhombus", "hand.offset=[1.0,0.0,0.0]", "hand.offset"),
        ("rhombus", "avoidance.projection_margin=0.1", "avoidance.projection_margin"),
        ("slalom", "fence.room=2.0", "fence.room"),
        ("rhombus", "vehicles.types.big.tau=0.5", "vehicles.types.big"),
        (
            "rhombus",
            "vehicles.robots.2={uri='udpin://0.0.0.0:14540',body='crazyflie'}",
            "vehicles.robots.2.body",
        ),
        ("rhombus", "net.interface=wlan0", "net.interface"),
        ("rhombus", "net.router=tcp/10.0.0.1:7447|net.endpoint=tcp/{node}:7447", "net.endpoint"),
        ("rhombus", "net.endpoints.drone/9=tcp/10.0.0.1:7447", 'net.endpoints."drone/9"'),
        ("rhombus", "vehicles.all.uri=sim://127.0.0.1:7400/1", "vehicles"),
        ("rhombus", "impedance.gain=-30000.0", "impedance"),
        ("rhombus", "impedance.damping=0.0", "impedance"),
        ("line", "formation.n=200|limits.takeoff_height=1.3", "formation"),
    ],
)
def test_what_does_not_go_together_is_named_with_advice(name: str, override: str, key: str) -> None:
    scenario = load_scenario(name, override.split("|"))
    findings = list(check_scenario(scenario, build_formation(scenario)))
    assert key in [finding.key for finding in findings]
    assert all(finding.what and finding.advice for finding in findings)


@pytest.mark.parametrize(
    ("name", "override"),
    [
        ("maze", "formation.n=3"),
        ("rhombus", "impedance.damping=0.0|impedance.gain=0.0"),
        ("rhombus", "vehicles.types.big.tau=0.5|vehicles.robots.2.type=big"),
        ("grid", "formation.columns=2"),
        ("rhombus", "net.profile=radio|net.interface=wlan0"),
        ("rhombus", 'obstacles=[{name="a",x=-0.5,y=0.25}]'),
    ],
)
def test_what_does_go_together_is_not_refused(name: str, override: str) -> None:
    assert keys(name, *override.split("|")) == []


def test_a_simulator_asks_for_no_network() -> None:
    open_scenario("grid", ["formation.n=400"], network=False)
    open_scenario("line", ["formation.n=200"], network=False)
    with pytest.raises(ConfigError, match="no such node"):
        open_scenario("rhombus", ["net.endpoints.drone/9=tcp/10.0.0.1:7447"], network=False)
    with pytest.raises(ConfigError, match="bytes"):
        open_scenario("line", ["formation.n=200"])


def test_every_process_and_command_refuses_alike(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "wrong.toml"
    file.write_text('obstacles=[{name="a",x=-0.5,y=0.0}]\n[fence]\nmin=[-0.2,-0.2,0]\nmax=[0.2,0.2,2]\n')
    commands = (["up", str(file), "--runs", str(tmp_path / "runs")], ["sim", str(file)], ["falsify", str(file)])
    told = set()
    for command in commands:
        assert main(command) == 2
        told.add(_reasons(capsys.readouterr().err))
    for process, more in ((agent_process, ["--id", "1"]), (relay_process, []), (world_process, [])):
        monkeypatch.setattr("sys.argv", ["process", "--scenario", str(file), *more])
        assert process.main() == 2
        told.add(_reasons(capsys.readouterr().err))
    (reasons,) = told
    assert [reason.removeprefix(f"{file}: at key ").partition(":")[0] for reason in reasons] == [
        *("fence", "fence", "hand.home", "obstacles")
    ]
    assert f"{file}: at key obstacles: column 'a' stands 0.00 m from where drone 1 begins" in reasons[-1]
    findings = check_values(*_loaded(file))
    assert {finding.verdict for finding in findings} == {Verdict.BAD}


def _reasons(said: str) -> tuple[str, ...]:
    """What was said without the name of who said it, a line per reason."""
    return tuple(line.partition(": ")[2] for line in said.splitlines())


def _loaded(file: Path) -> tuple[Scenario, Formation]:
    scenario = load_scenario(file)
    return scenario, build_formation(scenario)


def test_the_doctor_says_when_all_is_well() -> None:
    scenario = load_scenario("rhombus")
    (finding,) = check_values(scenario, build_formation(scenario))
    assert finding.verdict is Verdict.GOOD


def test_an_agent_of_no_drone_is_refused(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["agents", "--scenario", "rhombus", "--id", "9"])
    assert agent_process.main() == 2
    assert "no drone 9 in this formation; its drones are 1, 2, 3, 4" in capsys.readouterr().err
    check_drone(build_formation(load_scenario("rhombus")), 4, "rhombus")


links = st.builds(
    Link,
    name=st.just("human-1"),
    source=st.just(0),
    target=st.just(0),
    mass=st.floats(0.1, 10.0),
    damping=st.floats(0.5, 40.0),
    stiffness=st.floats(1.0, 60.0),
    gain=st.floats(-20.0, 20.0),
    limit=st.just(0.25),
)


@given(links)
@hypothesis(max_examples=40)
def test_no_hand_makes_a_link_give_way_by_more_than_its_bound(link: Link) -> None:
    """The worst hand turns round at every half period of the link."""
    dt, speed = 0.005, 1.0
    half = np.pi / np.sqrt(max(link.stiffness / link.mass - (link.damping / (2 * link.mass)) ** 2, 1e-2))
    spring = Spring(link.mass, link.damping, link.stiffness, link.gain)
    own, worst = (LawLink(link.name, spring, link.limit),), 0.0
    states: tuple[LinkState, ...] = (AT_REST,)
    for k in range(2000):
        u = speed if int(k * dt / half) % 2 else -speed
        states = step_links(states, own, (u, u, u), dt)
        worst = max(worst, *map(abs, states[0].displacement))
    assert worst <= largest_displacement(link, speed) * (1.0 + 1e-6) + 1e-9


boxes = st.tuples(st.floats(-4.0, 0.0), st.floats(-4.0, 0.0), st.floats(0.5, 4.0), st.floats(0.5, 4.0))


@given(
    box=boxes, roof=st.floats(0.3, 4.0), takeoff=st.floats(0.05, 3.0), home=st.tuples(*[st.floats(-3, 3)] * 2)
)
def test_whatever_is_accepted_begins_inside_its_fence_and_may_climb(
    box: tuple[float, float, float, float], roof: float, takeoff: float, home: tuple[float, float]
) -> None:
    a, b, c, d = box
    scenario = load_scenario("rhombus")
    scenario = evolve(
        scenario,
        hand=evolve(scenario.hand, home=home),
        fence=evolve(scenario.fence, min=(a, b, -0.1), max=(c, d, roof)),
        limits=evolve(scenario.limits, takeoff_height=takeoff),
    )
    formation = build_formation(scenario)
    if list(check_scenario(scenario, formation)):
        return
    low, high = fence_box(scenario, formation)
    starts = np.array([*home, takeoff]) + formation.rest
    assert (starts >= low).all()
    assert (starts <= high).all()
