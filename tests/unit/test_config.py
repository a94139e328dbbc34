"""Scenario files: what is refused and how it is said, overrides, and what ships."""

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.config import SCENARIOS, dump_scenario, find_scenario, load_scenario, structure_scenario
from shared.errors import ConfigError
from shared.formation import build_formation
from shared.scenario import Scenario
from shared.vehicles import vehicle_settings

SHIPPED = sorted(path.stem for path in SCENARIOS.glob("*.toml"))


def refusal(tmp_path: Path, text: str, *overrides: str) -> str:
    """Returns why a scenario is refused, without the file that the message begins with."""
    file = tmp_path / "mine.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as refused:
        build_formation(load_scenario(file, overrides), str(file))
    message = str(refused.value)
    assert message.startswith(f"{file}: ")
    assert "\n" not in message
    return message.removeprefix(f"{file}: ")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[impedance]\nstifness = 1.0", ["'stifness'", "did you mean 'stiffness'?", "at key impedance"]),
        ("[impedence]\n", ["'impedence'", "did you mean 'impedance'?"]),
        ("[swarm]\nzzz = 1", ["'zzz'", "known keys: name, law, total_limit", "at key swarm"]),
        ("[[impedance.links]]\nname='1-2'\nmas=1.0", ["did you mean 'mass'?", "at key impedance.links[0]"]),
        ("[[obstacles]]\nname='a'\nx=1.0\ny=2.0\nz=3.0", ["'z'", "at key obstacles[0]"]),
        ("[vehicles.robots.2]\nboddy = 'x'", ["did you mean 'body'?", "vehicles.robots['2']"]),
    ],
)
def test_unknown_keys_are_refused_with_a_hint(text: str, words: list[str], tmp_path: Path) -> None:
    message = refusal(tmp_path, text)
    assert all(word in message for word in ("unknown key", *words)), message


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("impedance.stiffness=0", ["stiffness must be > 0, not 0.0", "impedance"]),
        ("impedance.stiffness=-1", ["stiffness must be > 0, not -1.0"]),
        ("impedance.damping=-1", ["damping must be >= 0"]),
        ("impedance.mass=nan", ["a finite number is expected, not nan", "impedance.mass"]),
        ("impedance.mass=inf", ["a finite number is expected, not inf"]),
        ("impedance.mass='1'", ["a finite number is expected, not '1'"]),
        ("net.base_port=80000", ["base_port must be a port from 0 to 65535", "net"]),
        ("net.router=tcp/10.0.0.1:80000", ["router 'tcp/10.0.0.1:80000'", "expected PROTOCOL/HOST:PORT"]),
        ("net.endpoint={node}:7447", ["endpoint '{node}:7447'", "expected PROTOCOL/HOST:PORT"]),
        ('net.endpoints."drone/2"=tcp/x:99999', ["endpoints.\"drone/2\" 'tcp/x:99999'"]),
        ("impedance.mass=true", ["a finite number is expected, not True"]),
        ("impedance=3", ["a table is expected, not 3", "at key impedance"]),
        ("vehicles.robots.2=5", ["a table is expected, not 5"]),
        ("hand.offset='abc'", ["a list is expected, not 'abc'", "hand.offset"]),
        ("hand.offset=[1, 2]", ["a list of 3 is expected", "hand.offset"]),
        ("hand.offset=[1, 2, nan]", ["not nan", "hand.offset"]),
        ("hand.follow_yaw=1", ["true or false is expected, not 1"]),
        ("hand.clip={min=[1, 1], max=[0, 2]}", ["min (1.0, 1.0) must not exceed max", "hand.clip"]),
        ("hand.clip.min=[1, 1]", ["missing key 'max'", "hand.clip"]),
        ("fence={min=[0, 0, 0], max=[1, 1, -1]}", ["must not exceed", "fence"]),
        ("formation.links='1-2'", ["a list is expected, not '1-2'"]),
        ("formation.n=2.5", ["a whole number is expected, not 2.5"]),
        ("formation.n=0", ["n must be > 0"]),
        ("formation.columns=-1", ["columns must be > 0"]),
        ("formation.shape='ring'", ["ring", "'rhombus'", "formation.shape"]),
        ("swarm.law='papers'", ["papers", "'paper', 'stable'", "swarm.law"]),
        ("swarm.name='a/b'", ["letters, digits", "'a/b'"]),
        ("swarm.name=''", ["letters, digits"]),
        ("obstacles=[{name='a', x=1}]", ["missing key 'y'", "obstacles[0]"]),
        ("obstacles=5", ["a list is expected, not 5"]),
        ("vehicles.all.tau=-1", ["tau must be >= 0"]),
        ("vehicles.all.type='heavy'", ["all: no type 'heavy' in vehicles.types", "known: none"]),
        ("vehicles.robots.2.type='heavy'", ["2: no type 'heavy'"]),
        ("rates.control_hz=0", ["control_hz must be > 0"]),
    ],
)
def test_impossible_values_are_refused_with_their_key(override: str, words: list[str], tmp_path: Path) -> None:
    message = refusal(tmp_path, "", override)
    assert all(word in message for word in words), message


def drones(*entries: str) -> str:
    """Writes a custom formation; each entry is `id<-references`, all far enough apart."""
    blocks = []
    for place, entry in enumerate(entries):
        number, _, references = entry.partition("<-")
        blocks.append(
            f"[[formation.drones]]\nid = {number}\nreferences = {references.split()}\n"
            f"offset = [{place + 1}.0, 0.0, 0.0]"
        )
    return '[formation]\nshape = "custom"\n' + "\n".join(blocks)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (drones("1<-human", "1<-human"), ["formation.drones", "id 1 appears 2 times", "ids are unique"]),
        (drones("1<-2", "2<-1"), ["drones [1, 2] form a cycle", "Let one of them refer only"]),
        (drones("1<-human", "2<-3", "3<-2"), ["drones [2, 3] form a cycle", "no path to the human"]),
        (drones("1<-1"), ["drones [1] form a cycle"]),
        (drones("1<-human", "2<-3", "3<-2", "4<-3"), ["drones [2, 3, 4]", "no path to the human"]),
        (drones("1<-"), ["drone 1: no references", 'refer to "human"']),
        (drones("1<-9"), ["drone 1", "'9' is neither \"human\" nor a drone of [1]"]),
        (drones("1<-humn"), ["'humn' is neither"]),
        (drones("0<-human"), ["id must be 1 to 65535, not 0"]),
        (drones("70000<-human"), ["id must be 1 to 65535"]),
        (drones("1<-human") + "\nweights = [0.5]", ["weights (0.5,)", "sum 1"]),
        (drones("1<-human human") + "\nweights = [1.5, -0.5]", ["weights", ">= 0"]),
        (drones("1<-human human"), ["'human-1' appears 2 times"]),
        (drones(), ["formation.drones: no drones", "choose a shape"]),
        ("[swarm]\nlaw='paper'\n[formation]\nshape='line'\nn=5", ["5 hops deep", 'law = "stable"']),
        ("[formation]\nspacing = 0.1", ["drones 1 and 4 rest 0.200 m apart", "limits.safety_distance = 0.3"]),
        ("[formation]\nlinks = ['1-9']", ["formation.links, '1-9'", "'9' is neither"]),
        ("[formation]\nlinks = ['12']", ["formation.links, '12'", '"human-1"']),
        ("[formation]\nlinks = ['1-human']", ["a link is", "with a drone at its end"]),
        ("[formation]\nlinks = ['1-2', '1-2']", ["'1-2' appears 2 times"]),
        ("[[impedance.links]]\nname = '9-9'", ["impedance.links names '9-9'", "the links are ['human-1'"]),
        ("[[impedance.links]]\nname = '1-2'\nstiffness = 0.0", ["formation.links, '1-2'", "must be > 0"]),
        ("[vehicles.robots.9]\nbody = 'crazyflie'", ["vehicles.robots.9", "the formation's are 1, 2, 3, 4"]),
        ("x ==", ["not valid TOML", "line 1"]),
    ],
)
def test_formations_that_cannot_fly_are_refused(text: str, words: list[str], tmp_path: Path) -> None:
    message = refusal(tmp_path, text)
    assert all(word in message for word in words), message


def test_several_faults_are_said_at_once(tmp_path: Path) -> None:
    message = refusal(tmp_path, "[impedance]\nmass = 'x'\n[hand]\noffset = 3")
    assert "impedance.mass" in message
    assert "hand.offset" in message


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=r"mine\.toml: not valid TOML"):
        load_scenario(file)


@given(
    tree=st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(
                st.sampled_from(["swarm", "hand", "all", "robots", "2", "links", "drones"]), inner, max_size=3
            )
        ),
    )
)
def test_any_tree_is_a_scenario_or_refused(tree: Any) -> None:
    for section in ("formation", "vehicles", "hand", "impedance", "obstacles", "fence", "net"):
        try:
            scenario = structure_scenario({section: tree}, "here")
        except ConfigError as error:
            reason = str(error)
        else:
            reason = "" if isinstance(scenario, Scenario) else "no scenario"
        assert reason == "" or reason.startswith("here: ")


def test_names_of_scenarios(tmp_path: Path) -> None:
    assert find_scenario("rhombus") == SCENARIOS / "rhombus.toml"
    file = tmp_path / "own.toml"
    file.touch()
    assert find_scenario(file) == file
    with pytest.raises(ConfigError, match="rhombux: no such scenario file; did you mean 'rhombus'"):
        find_scenario("rhombux")
    with pytest.raises(ConfigError, match=f"scenarios that ship: {', '.join(SHIPPED)}"):
        find_scenario("/nowhere/at/all")


def test_overrides_win_and_take_toml_values_or_bare_words() -> None:
    scenario = load_scenario(
        "rhombus",
        [
            "impedance.mass=2",
            "swarm.name=other",
            'hand.mapping="relative"',
            "hand.offset=[1, 2, 3]",
            "vehicles.all.uri=sim://10.0.0.5:7400/{id}",
            "net.endpoints.drone/2=tcp/10.0.0.2:7447",
            'net.endpoints."world"="tcp/10.0.0.5:7447"',
            " limits.speed =0.5",
            "impedance.mass=3",
        ],
    )
    assert scenario.impedance.mass == 3.0
    assert scenario.swarm.name == "other"
    assert (scenario.hand.mapping, scenario.hand.offset) == ("relative", (1.0, 2.0, 3.0))
    assert scenario.vehicles.all.uri == "sim://10.0.0.5:7400/{id}"
    assert scenario.net.endpoints == {"drone/2": "tcp/10.0.0.2:7447", "world": "tcp/10.0.0.5:7447"}
    assert scenario.limits.speed == 0.5
    assert scenario.swarm.law == "paper"


@pytest.mark.parametrize("item", ["formation.n", "=3", " =3", ""])
def test_an_override_without_key_or_value_is_refused(item: str) -> None:
    with pytest.raises(ConfigError, match=r"--set .*expected key=value, for example"):
        load_scenario("rhombus", [item])


def test_an_override_below_a_value_is_refused() -> None:
    with pytest.raises(ConfigError, match="'name' is a value, not a table"):
        load_scenario("rhombus", ["swarm.name.first=x"])


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize(
    "overrides", [(), ("net.endpoints.relay=tcp/10.0.0.1:7447", "vehicles.robots.2.tau=0.3")]
)
def test_a_scenario_survives_being_written(name: str, overrides: tuple[str, ...], tmp_path: Path) -> None:
    scenario = load_scenario(name, overrides)
    file = tmp_path / "again.toml"
    file.write_text(dump_scenario(scenario), encoding="utf-8")
    assert load_scenario(file) == scenario


def test_those_that_ship_are_those_of_the_issue() -> None:
    assert {"rhombus", "maze", "line", "vee", "grid"} <= set(SHIPPED)


def test_robot_wins_over_type_wins_over_all() -> None:
    tables = {
        "all": {"body": "crazyflie", "tau": 0.1, "type": "slow"},
        "types": {"slow": {"tau": 0.9, "link_loss": "hover"}, "fast": {"tau": 0.2}},
        "robots": {"2": {"tau": 0.5}, "3": {"type": "fast", "uri": "sim://h:1/{id}"}},
    }
    scenario = structure_scenario({"vehicles": tables}, "here")
    one, two, three = (vehicle_settings(scenario, drone) for drone in (1, 2, 3))
    assert (one.body, one.tau, one.link_loss) == ("crazyflie", 0.9, "hover")
    assert (two.body, two.tau, two.link_loss) == ("crazyflie", 0.5, "hover")
    assert (three.body, three.tau, three.link_loss) == ("crazyflie", 0.2, "crazyflie")
    assert (one.uri, three.uri) == ("sim://127.0.0.1:7400/1", "sim://h:1/3")


def test_a_vehicle_without_settings_has_all_that_it_needs() -> None:
    chosen = vehicle_settings(load_scenario("rhombus"), 4)
    assert (chosen.uri, chosen.body, chosen.link_loss) == ("sim://127.0.0.1:7400/4", "identified", "crazyflie")
    assert chosen.tau is None, "its envelope says"
