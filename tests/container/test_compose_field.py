"""The demo in containers with keys: everybody has its own and no other, and the swarm flies and is well."""

import json
import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from deploy.cli import main
from shared.net.keyring import Keyring
from tests.container.engine import compose_commands, docker, run, succeeds
from tests.container.project import COMPOSE_FILE, FIELD_FILE, Project, running

pytestmark = [pytest.mark.container, pytest.mark.timeout(600)]

USER = 10001
"""The image's."""
FLYING_S = 90.0
AT = ("net.endpoint=quic/{node}.mesh:7447", "net.endpoints.relay=quic/relay.hand:7447")
PUBLIC = {"ca.crt", "members.toml", "hand.pub"}


@pytest.fixture
def keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, image: str) -> Keyring:
    """Made as compose.field.yaml says."""
    assert image
    made = Keyring(tmp_path / "keys")
    where = ["--keys", str(made.folder), *(part for item in AT for part in ("--set", item))]
    assert main(["net", "keys", "init", "rhombus", *where]) == 0
    assert main(["net", "keys", "issue", "rhombus", *where]) == 0
    for secret in made.folder.glob("*.key"):
        os.chown(secret, USER, USER)
    monkeypatch.setenv("KEYS", str(made.folder))
    return made


@pytest.fixture
def project() -> Project:
    return Project(compose_commands()[-1], "swarmtouch-test", [COMPOSE_FILE, FIELD_FILE])


def until(condition: Callable[[], bool], last: Callable[[], object]) -> None:
    """Waits until it holds, or tells what was there last."""
    deadline = time.monotonic() + FLYING_S
    while not condition():
        assert time.monotonic() < deadline, last()
        time.sleep(1.0)


def test_the_demo_flies_with_keys_and_each_container_has_its_own(keys: Keyring, project: Project) -> None:
    with running(project):
        modes: dict[str, str | None] = {}

        def all_follow() -> bool:
            modes.clear()
            modes.update(modes_seen_by_the_observer(project))
            return [modes.get(f"drone/{drone}") for drone in (1, 2, 3, 4)] == 4 * ["FOLLOW"]

        until(all_follow, lambda: f"{modes}\n{project.logs()}")
        look = ("docker", "exec", project.container("observer"), "swarmtouch", "status", "rhombus")
        until(lambda: succeeds(*look), project.logs)
        for service in ("drone-1", "relay", "console"):
            own = {"observer"} if service == "console" else {service}
            hand = {"hand.key"} if service == "relay" else set()
            held = run("docker", "exec", project.container(service), "ls", "/run/secrets").split()
            assert set(held) == PUBLIC | hand | {f"{name}.{kind}" for name in own for kind in ("crt", "key")}
        logs = project.logs()
        assert "Traceback" not in logs
        assert not [secret for secret in secrets(keys) if secret in logs]
    assert project.leftovers() == ""


def modes_seen_by_the_observer(project: Project) -> dict[str, str | None]:
    script = "swarmtouch status rhombus --json || true"
    shown = docker("exec", project.container("observer"), "sh", "-c", script)
    return {row["process"]: row["mode"] for row in json.loads(shown or "[]")}


def test_no_key_is_in_the_image(keys: Keyring, image: str) -> None:
    find = r"find / -xdev \( -name hand.key -o -name ca.key -o -name members.toml \)"
    assert docker("run", "--rm", "--user", "0", "--entrypoint", "sh", image, "-c", find) == ""
    described = docker("image", "inspect", image) + docker("history", "--no-trunc", image)
    assert not [secret for secret in secrets(keys) if secret in described]


def secrets(keys: Keyring) -> list[str]:
    """The first line of every private key."""
    found = [file.read_text().splitlines()[1] for file in keys.folder.glob("*.key")]
    assert len(found) >= 9
    return found
