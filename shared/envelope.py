"""What a vehicle can do: its measured envelope, a TOML file per type, and the margins that follow from it.

`agents.control.safety.response` has the model whose parameters these are, docs/safety.md the theorem that makes
margins of them. `swarmtouch vehicle identify` measures them.
"""

import functools
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import msgspec
from attrs import field, frozen

from shared.errors import ConfigError
from shared.scenario import Scenario
from shared.toml_text import read_toml
from shared.validators import not_negative, positive
from shared.vehicles import vehicle_settings

ENVELOPES = Path(__file__).resolve().parent.parent / "agents" / "vehicles" / "envelopes"

BODY = 0.06
"""Half the distance at which two bodies touch, m: a Crazyflie's arm (0.046) and its propeller."""
KEEP_DRONE = 0.20
"""Distance that the bodies of two drones keep, m."""
KEEP_HAND = 0.25
"""Distance that a body keeps from a hand, m."""
BRAKE_SHARE = 0.6
"""Share of the acceleration that barriers are made for; the rest is for errors, and for who comes second."""
MISSION_SHARE = 0.7
"""Share of the acceleration that the mission may use."""
REACTION = 0.15
"""Time constant of the barriers of a vehicle that answers at once, s: sensing, a control step, a message."""


@frozen(kw_only=True)
class AxisEnvelope:
    """One axis of a vehicle under its own position controller.

    Attributes:
        stiffness: Acceleration per metre between body and set-point, 1/s^2.
        damping: Acceleration against the body's velocity, 1/s.
        feed: Acceleration with the set-point's velocity, 1/s.
        lag: From what is asked for to what happens, s.
        acceleration: Largest that can be asked for, m/s^2.
        error: Largest acceleration that model and observer leave over, m/s^2.
    """

    stiffness: float = field(validator=positive)
    damping: float = field(validator=not_negative)
    feed: float = field(validator=not_negative)
    lag: float = field(validator=not_negative)
    acceleration: float = field(validator=positive)
    error: float = field(validator=not_negative)

    @property
    def brake(self) -> float:
        """Deceleration that can be relied on, m/s^2."""
        return BRAKE_SHARE * self.acceleration

    @property
    def rate(self) -> float:
        """How fast barriers may be approached, 1/s."""
        return 1.0 / (REACTION + self.lag)

    @property
    def tube(self) -> float:
        """How far the body may be from where a barrier lets it rest, m."""
        return self.error / self.rate**2

    @property
    def behind(self) -> float:
        """How far, in time, the body is behind a set-point that moves evenly, s; an integrator not counted."""
        return (self.damping - self.feed) / self.stiffness


@frozen(kw_only=True)
class Downwash:
    """The air below a drone, which carries nobody.

    Attributes:
        radius: m.
        height: m.
    """

    radius: float = field(default=0.3, validator=not_negative)
    height: float = field(default=1.0, validator=not_negative)


@frozen(kw_only=True)
class Envelope:
    """One type of vehicle.

    Attributes:
        about: One line for people.
        tau: By what time the set-point leads, s.
        horizontal: Both horizontal axes.
        vertical: The vertical one.
        downwash: The air below it.
    """

    about: str
    tau: float = field(validator=not_negative)
    horizontal: AxisEnvelope
    vertical: AxisEnvelope
    downwash: Downwash = Downwash()

    def clearance(self, other: "Envelope") -> float:
        """Returns the horizontal distance that two drones keep between their points ahead, m.

        Both may be off by their tubes, and nobody flies in the air below anybody.
        """
        bodies = KEEP_DRONE + self.horizontal.tube + other.horizontal.tube
        return max(bodies, self.downwash.radius, other.downwash.radius)


def envelope_of(scenario: Scenario, drone: int) -> Envelope:
    """Returns the envelope of one drone's vehicle: the file that the scenario names, or that of its body.

    Raises:
        ConfigError: There is no such file, or something is wrong with it.
    """
    return load_envelope(envelope_name(scenario, drone))


def envelope_name(scenario: Scenario, drone: int) -> str:
    """Returns what names the envelope of one drone's vehicle, see `load_envelope`."""
    settings = vehicle_settings(scenario, drone)
    return settings.envelope or str(settings.body)


@functools.cache
def load_envelope(source: str) -> Envelope:
    """Reads an envelope.

    Args:
        source: Path of a TOML file, or the bare name of one that ships (`identified`).

    Raises:
        ConfigError: There is none, or something is wrong with it.
    """
    path = ENVELOPES / f"{source}.toml"
    if Path(source).suffix == ".toml":
        path = Path(source)
    elif not path.is_file():
        shipped = ", ".join(sorted(each.stem for each in ENVELOPES.glob("*.toml")))
        raise ConfigError(f"{source}: no such envelope of a vehicle; those that ship: {shipped}")
    tree = read_toml(path, "`swarmtouch vehicle identify` makes one")
    try:
        # Not as a scenario is read: who flies reads envelopes too, and has none of that in memory.
        envelope = msgspec.convert(tree, Envelope)
    except msgspec.ValidationError as error:
        raise ConfigError(f"{path}: {error}") from error
    for key in _unknown(tree, msgspec.to_builtins(envelope)):
        raise ConfigError(f"{path}: unknown key {key!r}")
    return envelope


def _unknown(tree: Mapping[str, Any], known: Mapping[str, Any]) -> Iterator[str]:
    """Yields the keys of a tree that mean nothing, dotted."""
    for key, value in tree.items():
        if key not in known:
            yield key
        elif isinstance(value, Mapping):
            yield from (f"{key}.{inner}" for inner in _unknown(value, known[key]))
