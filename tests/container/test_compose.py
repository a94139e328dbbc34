"""The demo in containers: up, fly, lose one, heal, and down to nothing."""

import re

import pytest

from observer.console import PORT as CONSOLE_PORT
from shared.config import load_scenario
from shared.messages import Mode
from shared.scenario import Scenario
from tests.container.engine import compose_commands, docker, run, succeeds
from tests.container.project import (
    COMPOSE_FILE,
    PORT,
    ROUTER_FILE,
    Project,
    running,
    scenario_seen_from_outside,
)
from tests.integration.console_page import open_page
from tests.integration.recorder import START_S, WORLD, Recorder

pytestmark = [pytest.mark.container, pytest.mark.timeout(900)]

SERVICES = ("world", "relay", *(f"drone-{i}" for i in (1, 2, 3, 4)), "bridge", "observer", "console")
HEAL_S = 60.0
HEALTHY_S = 120.0
LARGEST_MB = 250.0
"""What our layers may add to the base image."""

V2, V1 = ("docker", "compose"), ("docker-compose",)


def size_mb(image: str) -> float:
    return int(docker("image", "inspect", "--format", "{{.Size}}", image)) / 1e6


@pytest.mark.parametrize("files", [(COMPOSE_FILE,), (COMPOSE_FILE, ROUTER_FILE)], ids=["mesh", "router"])
@pytest.mark.parametrize("command", [V1, V2], ids=["1.29", "v2"])
def test_both_versions_of_compose_read_the_files(command: tuple[str, ...], files: tuple[str, ...]) -> None:
    if command not in compose_commands():
        pytest.skip(f"{' '.join(command)} is not installed")
    arguments = [argument for file in files for argument in ("--file", file)]
    services = run(*command, *arguments, "config", "--services").split()
    assert {*SERVICES} <= set(services)
    assert ("router" in services) == (ROUTER_FILE in files)


def test_the_image_is_small_runs_as_nobody_special_and_has_no_compiler(
    image: str, base: str, capsys: pytest.CaptureFixture[str]
) -> None:
    size, below = size_mb(image), size_mb(base)
    with capsys.disabled():
        print(f"\nimage: {size:.0f} MB, of which {below:.0f} MB are {base}")
    assert size - below <= LARGEST_MB
    script = "id -u; for tool in cc gcc g++ clang ld make uv; do command -v $tool; done; true"
    assert docker("run", "--rm", "--entrypoint", "sh", image, "-c", script).split() == ["10001"]


def test_the_image_flies_the_compiled_law(image: str) -> None:
    assert ", law compiled " in docker("run", "--rm", "--entrypoint", "swarmtouch", image, "--version")


@pytest.mark.usefixtures("image")
def test_the_demo_flies_loses_a_container_heals_and_leaves_nothing() -> None:
    project = Project(compose_commands()[-1], "swarmtouch-test", [COMPOSE_FILE])
    with running(project):
        with Recorder(scenario_seen_from_outside(project)) as recorder:
            recorder.until(lambda: recorder.all_in(Mode.FOLLOW), START_S)
            check_that_the_hand_is_apart(project)
            assert project.inspect("drone-2", "{{.HostConfig.ReadonlyRootfs}}") == "true"
            killed_ns = recorder.clock()
            project.kill("drone-2")

            def healed() -> bool:
                return recorder.latest(2).epoch > killed_ns and recorder.all_in(Mode.FOLLOW)

            recorder.until(healed, HEAL_S)
            for drone in (1, 3, 4):
                assert len({state.epoch for state in recorder.since(drone, killed_ns)}) == 1
            recorder.until(lambda: health_of_all(project) == {"healthy"}, HEALTHY_S)
            assert recorder.statuses[WORLD].metrics["collisions"] == 0.0
            assert recorder.statuses[WORLD].metrics["fence_exits"] == 0.0
        assert project.inspect("drone-2", "{{.RestartCount}}") == "1"
        assert "Traceback" not in project.logs()
    assert project.leftovers() == ""


def health_of_all(project: Project) -> set[str]:
    return {project.inspect(service, "{{.State.Health.Status}}") for service in SERVICES}


def check_that_the_hand_is_apart(project: Project) -> None:
    """The relay is on the hand's network alone, and there no drone answers."""
    networks = project.inspect("relay", "{{range $name, $_ := .NetworkSettings.Networks}}{{$name}} {{end}}")
    assert networks.split() == ["swarmtouch-test_hand"]
    bridge = project.container("bridge")
    for network, answers in (("hand", False), ("mesh", True)):
        address = (project.address("drone-1", network), PORT)
        dial = f"import socket; socket.create_connection({address}, 2)"
        assert succeeds("docker", "exec", bridge, "python", "-c", dial) is answers, network


@pytest.mark.usefixtures("image")
def test_a_page_flies_the_containers_and_nobody_else_reaches_its_socket(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("HAND", "pointer://")
    project = Project(compose_commands()[-1], "swarmtouch-test", [COMPOSE_FILE])
    with running(project), Recorder(scenario_seen_from_outside(project)) as recorder:
        recorder.until(lambda: recorder.all_in(Mode.GROUND), START_S)
        told = re.search(r"\?token=(\S+)", project.logs())
        assert told
        with open_page(CONSOLE_PORT, token=told[1]) as page:
            page.say(type="take")
            page.point(*page.newest["scene"]["hand"]["start"])
            page.say(type="wish", wish="FLY")
            recorder.until(lambda: recorder.all_in(Mode.FOLLOW), START_S)
        socket = "/run/swarmtouch/swarmtouch/pointer.sock"
        for service, there in (("relay", True), ("console", True), ("drone-1", False)):
            assert succeeds("docker", "exec", project.container(service), "test", "-S", socket) is there
        mode = docker("exec", project.container("relay"), "stat", "--format", "%a %U", socket)
        assert mode.split() == ["600", "swarmtouch"]
    assert project.leftovers() == ""


@pytest.mark.usefixtures("image")
def test_everybody_flies_as_client_of_a_router_that_may_die() -> None:
    project = Project(compose_commands()[-1], "swarmtouch-test", [COMPOSE_FILE, ROUTER_FILE])
    with running(project):
        with Recorder(scenario_of_clients(project)) as recorder:
            recorder.until(lambda: recorder.all_in(Mode.FOLLOW), START_S)
            killed_ns = recorder.clock()
            project.kill("router")
            recorder.until(
                lambda: recorder.latest(1).step_ns > killed_ns and recorder.all_in(Mode.FOLLOW), HEAL_S
            )
            for drone in recorder.ids:
                assert {state.epoch for state in recorder.states[drone]} == {recorder.states[drone][0].epoch}
        assert "Traceback" not in project.logs()
    assert project.leftovers() == ""


def scenario_of_clients(project: Project) -> Scenario:
    return load_scenario("rhombus", [f"net.router=tcp/{project.address('router', 'mesh')}:{PORT}"])
