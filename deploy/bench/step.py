"""`bench step`: one control step of one agent, decoding included, without bus and sleep.

A flight in lockstep provides the bytes that the drone would hear and the poses it would be in; a fresh agent
then hears and steps through it again under the stopwatch. In flight a step costs more, because the processor
has done something else in between: `bench chain` shows that.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from agents.agent import Agent
from agents.settings import agent_settings
from agents.vehicles.base import Pose
from deploy.bench.figures import TEXT_COLUMNS, spread
from deploy.bench.report import Report, Sheet
from deploy.lockstep.hand_track import relayed
from deploy.lockstep.lockstep import Lockstep
from deploy.lockstep.start import start_flyers
from deploy.lockstep.ticks import tick_ns
from shared.codec import encode
from shared.config import load_scenario
from shared.formation import Formation, build_formation
from shared.messages import DroneState, Vector
from shared.scenario import Scenario
from shared.transport import Arrival

HEIGHT = 1.2
"""Of the hand and of the drones, m."""
WARM_UP = 200
"""Steps that do not count."""
PARTS = {"receive": "decode what arrived", "step": "control step", "encode": "encode the state"}

Heard = tuple[int, Mapping[str, Sequence[Arrival]], Pose]
"""One tick as the drone meets it: time, ns; what arrived; its pose."""


def measure(
    *,
    scenario: str = "rhombus",
    n: int,
    overrides: Sequence[str] = (),
    say: Callable[[str], None] = lambda _: None,
) -> Report:
    """Measures the control step of the deepest drone.

    Args:
        scenario: Whose last drone; it hears the hand and all others.
        n: Steps that count.
        overrides: `key=value` items for the scenario.
        say: Told what is going on.

    Raises:
        ConfigError: The scenario is refused.
    """
    settings = load_scenario(scenario, overrides)
    formation = build_formation(settings, scenario)
    drone = formation.ids[formation.levels[-1][-1]]
    say(f"flying {n + WARM_UP} ticks in lockstep to have something to hear")
    heard = list(flight_of(settings, formation, drone, n + WARM_UP))
    say(f"{n} steps of drone {drone}")
    agent = Agent(settings, formation, drone, agent_settings(settings, formation, drone), epoch=0)
    times: dict[str, list[float]] = {part: [] for part in (*PARTS, "total")}
    for tick in heard:
        _time_one(agent, tick, times)
    counted = {part: spread(values[WARM_UP:]) for part, values in times.items()}
    total = counted["total"]
    record = {
        "median_us": total.p50,
        "n": total.n,
        "p10_us": total.p10,
        "p90_us": total.p90,
        "p99_us": total.p99,
        **{f"{part}_us": counted[part].p50 for part in PARTS},
    }
    rows = (("decode and step", *total.text(0)), *((PARTS[part], *counted[part].text(0)) for part in PARTS))
    sheet = Sheet(
        title=f"One step of drone {drone}, {settings.swarm.name}, us", columns=("", *TEXT_COLUMNS), rows=rows
    )
    return Report(name="step", records=(record,), sheets=(sheet,), draw=lambda figure: _draw(figure, times))


def flight_of(scenario: Scenario, formation: Formation, drone: int, ticks: int) -> Iterator[Heard]:
    """Flies in lockstep and yields what one drone meets in each tick."""
    rate = scenario.rates.control_hz
    samples = relayed("scripted:tour?lead=1", ticks / rate, rate)[:ticks]
    swarm = Lockstep(scenario, formation, start_flyers(scenario, formation, _places(formation), airborne=True))
    row = formation.row(drone)
    own = set(
        Agent(scenario, formation, drone, agent_settings(scenario, formation, drone), epoch=0).senses.keys
    )
    for tick, sample in enumerate(samples):
        now = tick_ns(tick, rate)
        states = swarm.advance(sample)
        arrived = {key: [Arrival(payload, now)] for key, payload in swarm.payloads.items() if key in own}
        yield now, arrived, _pose(states[row], tick)


def _places(formation: Formation) -> list[Vector]:
    return [(x, y, z + HEIGHT) for x, y, z in formation.rest]


def _pose(state: DroneState, tick: int) -> Pose:
    return Pose(position=state.position, velocity=state.velocity, yaw=0.0, battery=1.0, airborne=True, seq=tick)


def _time_one(agent: Agent, tick: Heard, times: dict[str, list[float]]) -> None:
    now, arrived, pose = tick
    started = time.perf_counter_ns()
    agent.receive(arrived)
    received = time.perf_counter_ns()
    state = agent.step(now, pose, 0.0)
    stepped = time.perf_counter_ns()
    encode(state)
    encoded = time.perf_counter_ns()
    times["receive"].append((received - started) / 1e3)
    times["step"].append((stepped - received) / 1e3)
    times["encode"].append((encoded - stepped) / 1e3)
    times["total"].append((stepped - started) / 1e3)


def _draw(figure: Any, times: dict[str, list[float]]) -> None:
    axes = figure.subplots()
    highest = spread(times["total"]).p99
    for part, label in PARTS.items():
        axes.hist(times[part][WARM_UP:], bins=100, range=(0.0, highest), histtype="step", label=label)
    axes.set(xlabel="time, us", ylabel="steps")
    axes.legend()
