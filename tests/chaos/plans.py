"""The table of plans."""

from attrs import frozen

from tests.chaos.kills import kill_bystander, kill_drones, kill_relay, kill_router, restart_drone
from tests.chaos.links import bad_weather, lose_packets, partition, silence_vehicle
from tests.chaos.processes import fill_disk, freeze, step_clock, talk
from tests.chaos.steps import Fly, exists


@frozen
class Plan:
    """One fault.

    Attributes:
        fly: Flies it and returns its row.
        missing: What it needs that is not there; empty if all is.
    """

    fly: Fly
    missing: str = ""


def _needs(module: str) -> str:
    return "" if exists(module) else f"there is no {module}"


PLANS = {
    **{f"kill-{drone}": Plan(kill_drones(drone)) for drone in (1, 2, 3, 4)},
    "kill-two": Plan(kill_drones(2, 3)),
    "restart": Plan(restart_drone),
    "kill-relay": Plan(kill_relay),
    "kill-bridge": Plan(kill_bystander("bridge")),
    "kill-observer": Plan(kill_bystander("observer"), _needs("observer.__main__")),
    "kill-console": Plan(kill_bystander("console"), _needs("observer.console.__main__")),
    "kill-router": Plan(kill_router),
    "unheard": Plan(silence_vehicle),
    "freeze": Plan(freeze),
    "part": Plan(partition(8.0)),
    "part-long": Plan(partition(20.0)),
    "loss": Plan(lose_packets),
    "weather": Plan(bad_weather(60.0)),
    "garbage": Plan(talk(200.0, "garbage")),
    "flood": Plan(talk(5000.0, "flood")),
    "clock": Plan(step_clock),
    "disk": Plan(fill_disk),
}
"""Name on the command line -> plan."""
