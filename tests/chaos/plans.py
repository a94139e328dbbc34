"""The table of plans."""

from tests.chaos.kills import kill_bystander, kill_drones, kill_relay, kill_router, restart_drone
from tests.chaos.links import (
    bad_weather,
    cut_off,
    lose_packets,
    partition,
    rejoin_in_bad_weather,
    silence_vehicle,
)
from tests.chaos.processes import fill_disk, freeze, step_clock, talk
from tests.chaos.radio import simplex
from tests.chaos.steps import Fly

PLANS: dict[str, Fly] = {
    **{f"kill-{drone}": kill_drones(drone) for drone in (1, 2, 3, 4)},
    "kill-two": kill_drones(2, 3),
    "restart": restart_drone,
    "kill-relay": kill_relay,
    "kill-bridge": kill_bystander("bridge"),
    "kill-observer": kill_bystander("observer"),
    "kill-console": kill_bystander("console"),
    "kill-router": kill_router,
    "unheard": silence_vehicle,
    "simplex": simplex,
    "freeze": freeze,
    "part": partition(8.0, "udp"),
    "part-tcp": partition(8.0, "tcp"),
    "part-long": partition(20.0, "udp"),
    **{f"cut-{protocol}": cut_off(protocol) for protocol in ("tcp", "udp", "radio")},
    "loss": lose_packets,
    "weather": bad_weather(60.0),
    "rejoin": rejoin_in_bad_weather,
    "garbage": talk(200.0, "garbage"),
    "flood": talk(5000.0, "flood"),
    "clock": step_clock,
    "disk": fill_disk,
}
"""Name on the command line -> plan."""
