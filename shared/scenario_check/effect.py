"""Whether every key that was set does anything.

What counts is the value: one that differs from its default was meant to change something.
"""

from collections.abc import Iterator
from typing import Any

import attrs

from shared.formation import Formation
from shared.scenario import (
    Avoidance,
    Fence,
    FormationSettings,
    Hand,
    Net,
    Scenario,
    Swarm,
    VehicleSettings,
)
from shared.scenario_check.finding import Finding
from shared.vehicles import vehicle_settings

_OF_SIMULATED = ("body", "link_loss", "battery", "endurance", "pose_silence")


def check_effect(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    """Yields the keys without effect."""
    yield from _of_the_shape(scenario, formation)
    yield from _of_the_law(scenario)
    yield from _of_the_room(scenario)
    yield from _of_the_vehicles(scenario, formation)
    yield from _of_the_net(scenario)


def _of_the_shape(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    settings, count = scenario.formation, len(formation.ids)
    listed = settings.shape == "custom" or bool(settings.drones)
    shape = "a list of drones" if listed else f"shape {settings.shape!r}"
    if settings.n != count and _is_set(settings, FormationSettings, "n"):
        yield Finding(
            "formation.n",
            f"{settings.n} has no effect: {shape} has {count} drones",
            f'set formation.n={count}, or choose shape "line", "vee" or "grid" for any number of drones',
        )
    if settings.drones and settings.shape != "custom" and _is_set(settings, FormationSettings, "shape"):
        yield Finding(
            "formation.shape",
            f"{settings.shape!r} has no effect beside formation.drones",
            'leave out one of the two, or say "custom"',
        )
    without = [
        *(("spacing", "width") if listed else ("width",) if settings.shape == "line" else ()),
        *(("columns",) if listed or settings.shape != "grid" else ()),
    ]
    yield from _unused(settings, FormationSettings, "formation", without, f"in {shape}")


def _of_the_law(scenario: Scenario) -> Iterator[Finding]:
    if scenario.swarm.law == "paper":
        yield from _unused(scenario.swarm, Swarm, "swarm", ["total_limit"], 'under swarm.law = "paper"')
    else:
        without = ["height_from"]
        yield from _unused(
            scenario.formation, FormationSettings, "formation", without, 'under swarm.law = "stable"'
        )
    if scenario.hand.mapping == "absolute":
        yield from _unused(scenario.hand, Hand, "hand", ["gain", "offset"], 'with hand.mapping = "absolute"')
    if scenario.avoidance.rule == "field":
        without = ["projection_radius", "projection_margin"]
        yield from _unused(scenario.avoidance, Avoidance, "avoidance", without, 'with avoidance.rule = "field"')


def _of_the_room(scenario: Scenario) -> Iterator[Finding]:
    if scenario.fence.min is not None and scenario.fence.max is not None:
        yield from _unused(scenario.fence, Fence, "fence", ["room"], "beside fence.min and fence.max")


def _of_the_vehicles(scenario: Scenario, formation: Formation) -> Iterator[Finding]:
    vehicles = scenario.vehicles
    used = {vehicles.all.type, *(robot.type for robot in vehicles.robots.values())}
    for name in vehicles.types:
        if name not in used:
            yield Finding(
                f"vehicles.types.{name}",
                "no vehicle is of this type",
                f'say vehicles.all.type = "{name}", or name it for a robot',
            )
    for number in map(str, formation.ids):
        own = vehicles.robots.get(number)
        if own is not None and not str(vehicle_settings(scenario, int(number)).uri).startswith("sim:"):
            table = f"vehicles.robots.{number}"
            yield from _unused(
                own, VehicleSettings, table, _OF_SIMULATED, "for a vehicle that is not simulated"
            )


def _of_the_net(scenario: Scenario) -> Iterator[Finding]:
    net = scenario.net
    if net.router is not None:
        yield from _unused(net, Net, "net", ["endpoint", "endpoints"], "beside net.router")
    if net.profile != "radio":
        without = ["multicast", "interface"]
        yield from _unused(net, Net, "net", without, f'with net.profile = "{net.profile}"')


def _unused(
    settings: attrs.AttrsInstance, kind: type[attrs.AttrsInstance], table: str, names: Any, why: str
) -> Iterator[Finding]:
    for name in names:
        if _is_set(settings, kind, name):
            yield Finding(f"{table}.{name}", f"{getattr(settings, name)!r} has no effect {why}", "leave it out")


def _is_set(settings: attrs.AttrsInstance, kind: type[attrs.AttrsInstance], name: str) -> bool:
    return bool(getattr(settings, name) != getattr(kind(), name))
