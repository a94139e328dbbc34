"""A checked scenario for those who fly: without the checks, and all that they need, in the flying process.

Who starts a swarm has checked its scenario and leaves beside the file what came of it (`leave_checked`).
Whoever flies takes that if it is of this very file, and else has a short-lived process check it. Either way it
comes as MessagePack, which msgspec decodes; TOML, hints and rules stay out of what lives as long as a flight.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import msgspec

from shared.compiled import hash_of
from shared.errors import ConfigError
from shared.formation import Formation, build_formation
from shared.scenario import Scenario

SUFFIX = ".checked"

_decoder = msgspec.msgpack.Decoder(Scenario)


def encode_checked(scenario: Scenario) -> bytes:
    """Returns a checked scenario as `open_checked` takes it."""
    return msgspec.msgpack.encode(scenario)


def leave_checked(file: Path, scenario: Scenario) -> None:
    """Leaves a checked scenario beside its file.

    Raises:
        OSError: It cannot be written.
    """
    file.with_suffix(SUFFIX).write_bytes(_mark(file.read_bytes()) + encode_checked(scenario))


def open_checked(source: str, overrides: Sequence[str] = ()) -> tuple[Scenario, Formation]:
    """Returns a scenario that is to fly, and its formation.

    Args:
        source: Path of a TOML file, or the bare name of one that ships.
        overrides: `key=value` with dotted keys, as given to `--set`.

    Raises:
        ConfigError: It is refused; one line per thing that is wrong.
    """
    scenario = None if overrides else _left_beside(Path(source))
    if scenario is None:
        scenario = _decoder.decode(_checked_aside(source, overrides))
    return scenario, build_formation(scenario, source)


def check_drone(formation: Formation, drone: int, origin: str) -> None:
    """Looks whether a drone that somebody named is in the formation.

    Raises:
        ConfigError: It is not.
    """
    if drone not in formation.ids:
        drones = ", ".join(map(str, formation.ids))
        raise ConfigError(f"{origin}: no drone {drone} in this formation; its drones are {drones}")


def _left_beside(file: Path) -> Scenario | None:
    try:
        content, left = file.read_bytes(), file.with_suffix(SUFFIX).read_bytes()
        mark = _mark(content)
        return _decoder.decode(left[len(mark) :]) if left.startswith(mark) else None
    except (OSError, msgspec.MsgspecError):
        return None


def _mark(content: bytes) -> bytes:
    """Returns what says of which file, and of which version of ours, a checked scenario is."""
    return (
        f"{hash_of(content)} {hash_of(Path(__file__).parent.with_name('scenario.py').read_bytes())} ".encode()
    )


def _checked_aside(source: str, overrides: Sequence[str]) -> bytes:
    import subprocess  # noqa: PLC0415  only who was not started by a launcher has a use for it

    # Found where this process has found its own modules.
    path = ["-P"] if sys.flags.safe_path else []
    command = [sys.executable, *path, "-m", "shared.scenario_check", source, *overrides]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    if done.returncode:
        said = done.stderr.decode(errors="replace").splitlines()
        raise ConfigError(*said or [f"{source}: cannot be checked"])
    return done.stdout
