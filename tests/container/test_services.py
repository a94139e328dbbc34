"""The services of a companion computer: read without complaint, and kept running by a real systemd."""

import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from tests.container.engine import docker, run, succeeds
from tests.container.project import ROOT

pytestmark = [pytest.mark.container, pytest.mark.timeout(600)]

UNITS = ROOT / "deploy/systemd"
AGENT = "swarmtouch-agent@1"
SERVICES = (AGENT, "swarmtouch-relay", "swarmtouch-console", "swarmtouch-glove", "swarmtouch-observer")
MACHINE = "swarmtouch-test-machine"
WAIT_S = 60.0


@pytest.fixture
def units(tmp_path: Path) -> Path:
    """The units, with this environment's Python in the place of the installed one."""
    shutil.copytree(UNITS, tmp_path, dirs_exist_ok=True)
    for unit in tmp_path.glob("*.service"):
        unit.write_text(unit.read_text().replace("/opt/swarmtouch/bin/python", sys.executable))
    return tmp_path


def complaints(units: Path) -> str:
    if not shutil.which("systemd-analyze"):
        pytest.skip("no systemd-analyze; apt-get install systemd")
    files = [str(units / f"{service}.service") for service in SERVICES]
    return subprocess.run(
        ["/usr/bin/env", "systemd-analyze", "verify", *files], check=False, capture_output=True, text=True
    ).stderr


def test_systemd_reads_every_unit_without_complaint(units: Path) -> None:
    assert complaints(units) == ""


def test_a_misspelt_key_would_be_complained_about(units: Path) -> None:
    common = units / "swarmtouch-.service.d/common.conf"
    common.write_text(common.read_text().replace("WatchdogSec=", "WatchDogSec="))
    assert "WatchDogSec" in complaints(units)


@pytest.fixture(scope="module")
def machine(image: str, base: str) -> Iterator[str]:
    """A container in which systemd runs."""
    assert image
    file = str(ROOT / "tests/container/systemd.Dockerfile")
    docker(
        "build",
        "--quiet",
        "--build-arg",
        f"BASE={base}",
        "--file",
        file,
        "--tag",
        MACHINE,
        str(ROOT / "deploy"),
    )
    # What systemd needs of the kernel, and no more: not every host can give all that --privileged asks for.
    rights = [f"--cap-add={name}" for name in ("SYS_ADMIN", "SYS_NICE", "NET_ADMIN")]
    rights += [f"--security-opt={name}=unconfined" for name in ("seccomp", "apparmor")]
    mounts = ["--tmpfs=/run", "--tmpfs=/tmp", "--volume=/sys/fs/cgroup:/sys/fs/cgroup:rw", "--cgroupns=host"]
    succeeds("docker", "rm", "--force", MACHINE)
    try:
        docker("run", "--detach", "--name", MACHINE, *rights, *mounts, MACHINE)
        if not soon(lambda: inside("systemctl", "is-system-running", check=False) == "running"):
            pytest.skip("systemd does not start in a container of this engine")
        yield MACHINE
    finally:
        succeeds("docker", "rm", "--force", MACHINE)


def inside(*command: str, check: bool = True) -> str:
    """Runs a command on the machine; returns what it wrote."""
    full = ("docker", "exec", MACHINE, *command)
    if check:
        return run(*full).strip()
    return subprocess.run(full, check=False, capture_output=True, text=True).stdout.strip()


def shown(unit: str, name: str) -> str:
    return inside("systemctl", "show", f"--property={name}", "--value", unit)


def soon(condition: Callable[[], bool]) -> bool:
    """Waits until it holds; returns whether it did."""
    deadline = time.monotonic() + WAIT_S
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.1)
    return True


@pytest.mark.usefixtures("machine")
def test_services_start_confined_and_end_cleanly() -> None:
    for service in SERVICES:
        inside("systemctl", "start", service, check=False)  # returns when the process has said that it is ready
        said = inside("journalctl", "--no-pager", f"--unit={service}")
        assert shown(service, "ActiveState") == "active", said
        status = inside("cat", f"/proc/{shown(service, 'MainPID')}/status")
        fields = dict(line.split(":\t") for line in status.splitlines() if ":\t" in line)
        assert fields["Uid"].split()[0] != "0"
        assert (fields["CapEff"], fields["NoNewPrivs"], fields["Seccomp"]) == ("0" * 16, "1", "2")
    for service in SERVICES:
        inside("systemctl", "stop", service)
        assert (shown(service, "Result"), shown(service, "ExecMainStatus")) == ("success", "0")


def restarted(before: str) -> bool:
    return shown(AGENT, "MainPID") not in (before, "0")


@pytest.mark.usefixtures("machine")
def test_a_killed_and_a_hung_process_are_started_anew() -> None:
    inside("systemctl", "start", AGENT)
    for signal, why in (("KILL", "killed"), ("STOP", "result 'watchdog'")):
        before = shown(AGENT, "MainPID")
        inside("sh", "-c", f"kill -{signal} {before}")
        assert soon(partial(restarted, before))
        assert soon(lambda: shown(AGENT, "ActiveState") == "active")
        assert why in inside("journalctl", "--no-pager", f"--unit={AGENT}")
    assert shown(AGENT, "NRestarts") == "2"


@pytest.mark.usefixtures("machine")
def test_a_refused_configuration_is_not_tried_again() -> None:
    inside("sh", "-c", "echo 'SWARMTOUCH_SET=formation.nn=3' >> /etc/swarmtouch/swarmtouch.env")
    inside("systemctl", "restart", AGENT, check=False)
    assert soon(lambda: shown(AGENT, "ActiveState") == "failed")
    assert (shown(AGENT, "ExecMainStatus"), shown(AGENT, "NRestarts")) == ("2", "0")
    assert "did you mean 'n'?" in inside("journalctl", "--no-pager", f"--unit={AGENT}")
