"""A container engine for the tests: found running or, as root, started for them; and an image to build on."""

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

OFFICIAL_BASE = "python:3.12-slim-bookworm"
LOCAL_BASE = "swarmtouch-test-base"
START_S = 30.0
CERTIFICATES = Path("/etc/ssl/certs/ca-certificates.crt")
PACKAGES = "python3,python3-venv,ca-certificates"
INSTALL = "apt-get install docker.io docker-compose debootstrap iptables"


class NoEngineError(Exception):
    """Why no container can run here."""


def run(*command: str, timeout: float = 300.0, **environment: str) -> str:
    """Runs a command to its end; returns what it wrote on stdout.

    Raises:
        AssertionError: It failed; the message has both its outputs.
    """
    done = subprocess.run(
        command, check=False, capture_output=True, text=True, timeout=timeout, env={**os.environ, **environment}
    )
    assert done.returncode == 0, f"{' '.join(command)}: {done.stdout}{done.stderr}"
    return done.stdout


def succeeds(*command: str) -> bool:
    """Says whether a command runs to its end without error."""
    return subprocess.run(command, check=False, capture_output=True).returncode == 0


def docker(*arguments: str, timeout: float = 300.0) -> str:
    """Runs one docker command. The classic builder is what every engine has."""
    return run("docker", *arguments, timeout=timeout, DOCKER_BUILDKIT="0")


def compose_commands() -> list[tuple[str, ...]]:
    """Returns every Compose on this machine: the plugin (v2) and the program that Debian ships (1.29)."""
    known = (("docker", "compose"), ("docker-compose",))
    return [command for command in known if shutil.which(command[0]) and succeeds(*command, "version")]


@contextmanager
def engine() -> Iterator[None]:
    """Makes sure that an engine answers; one that was started for this ends with it.

    Raises:
        NoEngineError: None runs and none can be started; what to do.
    """
    if not (shutil.which("docker") and compose_commands()):
        raise NoEngineError(f"no docker with Compose; {INSTALL}")
    if _answers():
        yield
        return
    if not shutil.which("dockerd") or os.geteuid() != 0:
        raise NoEngineError("the docker daemon does not answer, and only root with dockerd can start one")
    command = ("dockerd",)
    with tempfile.NamedTemporaryFile(prefix="dockerd-", suffix=".log") as log:
        daemon = subprocess.Popen(command, stdout=log, stderr=log)
        try:
            deadline = time.monotonic() + START_S
            while not _answers():
                if daemon.poll() is not None or time.monotonic() > deadline:
                    raise NoEngineError(f"dockerd does not start: {Path(log.name).read_text()[-2000:]}")
                time.sleep(0.2)
            yield
        finally:
            daemon.terminate()
            daemon.wait(START_S)


def base_image() -> str:
    """Returns the name of an image with Python, made from Debian's packages where no registry answers.

    Raises:
        NoEngineError: It can neither be pulled nor made here.
    """
    for image in (OFFICIAL_BASE, LOCAL_BASE):
        if succeeds("docker", "image", "inspect", image):
            return image
    if succeeds("docker", "pull", "--quiet", OFFICIAL_BASE):
        return OFFICIAL_BASE
    if not shutil.which("debootstrap") or os.geteuid() != 0:
        raise NoEngineError(
            f"{OFFICIAL_BASE} cannot be pulled, and only root with debootstrap can make a base image"
        )
    with tempfile.TemporaryDirectory() as folder:
        if not succeeds("debootstrap", "--variant=minbase", f"--include={PACKAGES}", "bookworm", folder):
            raise NoEngineError(
                f"{OFFICIAL_BASE} cannot be pulled, nor a base image made from Debian's packages"
            )
        _import(Path(folder))
    return LOCAL_BASE


def _answers() -> bool:
    return succeeds("docker", "info")


def _import(root: Path) -> None:
    """Makes an image of a file system, with this machine's authorities: it may sit behind a proxy."""
    shutil.copy(CERTIFICATES, root / CERTIFICATES.relative_to("/"))
    for cache in ("var/cache/apt", "var/lib/apt/lists"):
        shutil.rmtree(root / cache)
    trust = f"ENV SSL_CERT_FILE={CERTIFICATES} PIP_CERT={CERTIFICATES}"
    pack = ("tar", "-C", str(root), "-c", ".")
    with subprocess.Popen(pack, stdout=subprocess.PIPE) as tar:
        load = ("docker", "import", "--change", trust, "-", LOCAL_BASE)
        subprocess.run(load, stdin=tar.stdout, check=True, timeout=300.0)
