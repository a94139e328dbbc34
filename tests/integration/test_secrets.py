"""No secret leaves its file: a recorded flight with keys and a console, searched to the last byte."""

import stat
from base64 import b64encode
from collections.abc import Iterator
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import load_pem_private_key

from deploy.net.authority import create, issue
from observer.console.arguments import TOKEN_VARIABLE
from observer.trace.read import open_trace
from shared.config import load_scenario
from shared.formation import build_formation
from shared.net.keyring import Keyring
from shared.nodes import all_nodes
from tests.integration.swarm import Launched, launched
from tests.integration.test_up import children_of, pytestmark  # noqa: F401  as there

TOKEN = "a token that nobody else has"  # noqa: S105  of the test
FLOWN_S = 2.0


@pytest.fixture
def keys(tmp_path: Path) -> Keyring:
    made = Keyring(tmp_path / "keys")
    create(made, "rhombus")
    for node in all_nodes(build_formation(load_scenario("rhombus"))):
        issue(made, node)
    return made


def needles(keys: Keyring) -> dict[str, bytes]:
    """Returns what gives a private key away: its bytes, as they are and as text, and the lines of its file."""
    found: dict[str, bytes] = {}
    for file in keys.folder.glob("*.key"):
        pem = file.read_bytes()
        found |= {
            f"{file.name}, line {n}": line for n, line in enumerate(pem.splitlines()[1:-1]) if len(line) > 16
        }
        key = load_pem_private_key(pem, password=None)
        if isinstance(key, EllipticCurvePrivateKey):
            raw = key.private_numbers().private_value.to_bytes(32, "big")
        else:
            assert isinstance(key, Ed25519PrivateKey)
            raw = key.private_bytes_raw()
        found |= {f"{file.name}, raw": raw, f"{file.name}, hexadecimal": raw.hex().encode()}
        found[f"{file.name}, base 64"] = b64encode(raw)[:-4]
    return found


def haystacks(flight: Launched) -> Iterator[tuple[str, bytes]]:
    """Yields every file of the run, and the trace unpacked."""
    for file in flight.runs.rglob("*"):
        if file.is_file():
            yield str(file), file.read_bytes()
    for trace in map(open_trace, flight.runs.glob("latest/*.mcap")):
        yield f"metadata of {trace.files}", repr(trace.metadata).encode()
        for record in trace.records():
            yield record.key, record.payload


def processes(flight: Launched) -> dict[str, bytes]:
    """Returns the command line and the environment of every process, the launcher included."""
    shown = {}
    for pid in (flight.launcher.pid, *children_of(flight.launcher.pid)):
        command = Path(f"/proc/{pid}/cmdline").read_bytes()
        shown[f"command line {command!r}"] = command
        shown[f"environment of {command!r}"] = Path(f"/proc/{pid}/environ").read_bytes()
    return shown


def test_no_secret_leaves_its_file(keys: Keyring, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(TOKEN_VARIABLE, TOKEN)
    runs = tmp_path / "runs"
    runs.mkdir()
    overrides = ("net.profile=field", f"net.keys={keys.folder}")
    with launched("rhombus", "scripted:eight", runs, *overrides, arguments=("--record", "--console")) as flight:
        flight.recorder.listen(FLOWN_S)
        shown = processes(flight)
        summary = flight.end()
    assert len(shown) >= 2 * 9
    places = [*haystacks(flight), *shown.items(), ("the summary", repr(summary).encode())]
    assert len(places) > 500
    secrets = needles(keys)
    assert len(secrets) >= 4 * 10
    assert [(what, where) for where, hay in places for what, needle in secrets.items() if needle in hay] == []
    told = {where for where, hay in places if TOKEN.encode() in hay}
    assert all(where.startswith("environment of") for where in told), told
    assert {("observer.console" in where, "deploy.cli" in where) for where in told} == {
        (True, False),
        (False, True),
    }
    modes = {stat.S_IMODE(file.stat().st_mode) for file in keys.folder.glob("*.key")}
    assert modes == {0o600}
