"""The vehicle of one drone: what its scenario says of it, resolved."""

from typing import Any

import attrs

from shared.scenario import Scenario, VehicleSettings


def vehicle_settings(scenario: Scenario, drone: int) -> VehicleSettings:
    """Resolves one drone's vehicle: robot over type over all.

    Args:
        scenario: The scenario.
        drone: Number of the drone.

    Returns:
        Every setting that has a default filled in; `{id}` in the URI replaced.
    """
    vehicles = scenario.vehicles
    robot = vehicles.robots.get(str(drone), VehicleSettings())
    kind = vehicles.types.get(robot.type or vehicles.all.type or "", VehicleSettings())
    layers = (robot, kind, vehicles.all, _VEHICLE_DEFAULTS)
    chosen: dict[str, Any] = {
        a.name: next((v for layer in layers if (v := getattr(layer, a.name)) is not None), None)
        for a in attrs.fields(VehicleSettings)
    }
    uri = str(chosen["uri"]).replace("{id}", str(drone))
    return VehicleSettings(**{**chosen, "uri": uri})


_VEHICLE_DEFAULTS = VehicleSettings(uri="sim://127.0.0.1:7400/{id}", body="identified", link_loss="crazyflie")
