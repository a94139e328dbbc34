"""One Compose project: up, watched from outside, hurt, and down."""

import os
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from shared.config import load_scenario
from shared.formation import build_formation
from shared.nodes import RELAY, drone_node
from shared.scenario import Scenario
from tests.container.engine import docker, run

ROOT = Path(__file__).resolve().parents[2]
IMAGE = "swarmtouch"
COMPOSE_FILE = str(ROOT / "deploy/compose.yaml")
ROUTER_FILE = str(ROOT / "deploy/compose.router.yaml")
FIELD_FILE = str(ROOT / "deploy/compose.field.yaml")
PORT = 7447


class Project:
    """The demo's containers.

    Args:
        command: Which Compose.
        name: Name of the project.
        files: Its Compose files.
    """

    def __init__(self, command: Sequence[str], name: str, files: Sequence[str]) -> None:
        self._name = name
        self._command = (
            *command,
            "--project-name",
            name,
            *(part for file in files for part in ("--file", file)),
        )

    def up(self) -> None:
        """Starts everything in the background."""
        run(*self._command, "up", "--detach", "--no-build")

    def down(self) -> None:
        """Ends everything and removes what it left."""
        run(*self._command, "down", "--volumes", "--timeout", "5")

    def logs(self) -> str:
        """Returns what all containers have logged."""
        return run(*self._command, "logs")

    def container(self, service: str) -> str:
        """Returns the container of a service."""
        return run(*self._command, "ps", "--quiet", service).strip()

    def inspect(self, service: str, template: str) -> str:
        """Returns what the engine knows of the container of a service."""
        return docker("inspect", "--format", template, self.container(service)).strip()

    def address(self, service: str, network: str) -> str:
        """Returns the address of a service on a network."""
        return self.inspect(
            service, f'{{{{(index .NetworkSettings.Networks "{self._name}_{network}").IPAddress}}}}'
        )

    def kill(self, service: str) -> None:
        """Kills a container's process with SIGKILL, as a crash would; `docker kill` would not restart it."""
        os.kill(int(self.inspect(service, "{{.State.Pid}}")), signal.SIGKILL)

    def leftovers(self) -> str:
        """Returns the containers, networks and volumes of the project that exist."""
        mine = ("--quiet", "--filter", f"label=com.docker.compose.project={self._name}")
        return docker("ps", "--all", *mine) + docker("network", "ls", *mine) + docker("volume", "ls", *mine)


@contextmanager
def running(project: Project) -> Iterator[Project]:
    """Starts a project and takes it down for sure."""
    try:
        project.up()
        yield project
    finally:
        project.down()


def scenario_seen_from_outside(project: Project) -> Scenario:
    """Returns the scenario with the addresses by which this machine reaches the containers."""
    nodes = [drone_node(drone) for drone in build_formation(load_scenario("rhombus")).ids] + ["world", "bridge"]
    addresses = {node: project.address(node.replace("/", "-"), "mesh") for node in nodes}
    addresses[RELAY] = project.address(RELAY, "hand")
    return load_scenario(
        "rhombus", [f"net.endpoints.{node}=tcp/{address}:{PORT}" for node, address in addresses.items()]
    )
