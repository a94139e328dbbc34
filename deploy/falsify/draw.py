"""Draws cases: the hand anywhere it can be, faults, weather, and if wanted vehicles, laws and sizes."""

import functools
import math

import numpy as np
from attrs import evolve, frozen

from agents.settings import hand_settings
from deploy.falsify.case import Case, Fault, FaultKind, Stroke, Weather, Wished
from deploy.falsify.hand import duration_of
from deploy.falsify.swarm import prepare
from shared.arrays import rest_of
from shared.errors import ConfigError
from shared.formation import Formation
from shared.messages import Vector
from shared.scenario import Scenario

Rng = np.random.Generator

FASTEST_HAND = 1.5
"""Hands are no faster than this, m/s."""
HAND_HEIGHTS = (0.2, 2.2)
"""Between these heights the hand is, m."""
BEYOND = 0.3
"""How far the hand goes beyond where the formation still fits into the fence, m."""
SIZES = (2, 32)
"""Between these the number of drones varies."""
FREE = 0.5
"""Columns stand this far from where drones begin, m."""

_ONE_DRONE: tuple[FaultKind, ...] = ("cut", "mute", "deaf", "kill", "held", "blind", "empty")


@frozen(kw_only=True)
class Plan:
    """What may be drawn.

    Attributes:
        scenarios: Names or files.
        overrides: `key=value` items for each of them.
        vary: Whether body, link-loss rule, law, size and columns are drawn too.
        faults: Whether anything fails.
        weather: Whether links lose and delay.
    """

    scenarios: tuple[str, ...]
    overrides: tuple[str, ...] = ()
    vary: bool = False
    faults: bool = True
    weather: bool = True


@frozen(kw_only=True)
class Room:
    """Where the hand of a scenario can be: lower and upper corner, m."""

    low: Vector
    high: Vector

    def draw(self, rng: Rng) -> Vector:
        """Returns a place in it."""
        x, y, z = (float(rng.uniform(a, b)) for a, b in zip(self.low, self.high, strict=True))
        return (x, y, z)

    def clamp(self, place: Vector) -> Vector:
        """Returns the nearest place in it."""
        x, y, z = (min(max(v, a), b) for v, a, b in zip(place, self.low, self.high, strict=True))
        return (x, y, z)


def draw_case(plan: Plan, rng: Rng) -> Case:
    """Draws one case.

    Raises:
        ConfigError: A scenario is refused as it is, whatever is drawn beside it.
    """
    scenario = plan.scenarios[int(rng.integers(len(plan.scenarios)))]
    overrides = _draw_overrides(scenario, plan, rng) if plan.vary else plan.overrides
    _, formation = prepare(scenario, overrides)
    room = hand_room(scenario, overrides)
    seconds = float(rng.uniform(8.0, 20.0))
    hand = room.draw(rng)
    case = Case(
        scenario=scenario,
        overrides=overrides,
        seconds=seconds,
        airborne=bool(rng.random() < 0.6),
        hand=hand,
        strokes=_draw_strokes(hand, room, seconds, rng),
        seed=int(rng.integers(2**31)),
    )
    if plan.weather and rng.random() < 0.7:
        case = evolve(
            case, weather=Weather(loss=float(rng.uniform(0.0, 0.2)), delay=float(rng.uniform(0.0, 0.05)))
        )
    if plan.faults:
        case = evolve(case, wishes=_draw_wishes(seconds, rng), faults=draw_faults(formation, seconds, rng))
    return case


@functools.lru_cache(maxsize=64)
def hand_room(scenario: str, overrides: tuple[str, ...]) -> Room:
    """Returns where the hand can be so that the mapped hand can be anywhere in its box, and a little beyond."""
    hand = hand_settings(*prepare(scenario, overrides))
    low = [(v - c) / hand.gain for v, c in zip(hand.low, hand.offset, strict=True)]
    high = [(v - c) / hand.gain for v, c in zip(hand.high, hand.offset, strict=True)]
    lowest, highest = HAND_HEIGHTS
    return Room(
        low=(low[0] - BEYOND, low[1] - BEYOND, lowest), high=(high[0] + BEYOND, high[1] + BEYOND, highest)
    )


def draw_stroke(place: Vector, room: Room, rng: Rng) -> Stroke:
    """Draws a stroke from a place: mostly level, sometimes upright or slanting, sometimes with a turn."""
    kind = rng.random()
    if kind < 0.15:
        to = room.draw(rng)
    else:
        heading, length = rng.uniform(0.0, math.tau), rng.uniform(0.1, 2.5)
        rise = 0.0 if kind < 0.6 else rng.uniform(-1.5, 1.5)
        level = 0.0 if kind > 0.85 else length
        x, y, z = place
        to = room.clamp(
            (x + float(level * math.cos(heading)), y + float(level * math.sin(heading)), z + float(rise))
        )
    return Stroke(
        to=to,
        yaw=float(rng.uniform(-2.0, 2.0)) if rng.random() < 0.3 else 0.0,
        peak=float(rng.uniform(0.2, FASTEST_HAND)),
        rest=float(rng.exponential(0.6)) if rng.random() < 0.6 else 0.0,
    )


def _draw_strokes(place: Vector, room: Room, seconds: float, rng: Rng) -> tuple[Stroke, ...]:
    strokes, t, yaw = [], 0.0, 0.0
    while t < seconds:
        stroke = draw_stroke(place, room, rng)
        t += stroke.rest + duration_of(place, yaw, stroke)
        place, yaw = stroke.to, stroke.yaw
        strokes.append(stroke)
    return tuple(strokes)


def draw_faults(formation: Formation, seconds: float, rng: Rng) -> tuple[Fault, ...]:
    """Draws what fails: mostly one drone in one way, sometimes relay or tracker as well."""
    faults = []
    if rng.random() < 0.75:
        kind = _ONE_DRONE[int(rng.integers(len(_ONE_DRONE)))]
        start = float(rng.uniform(0.0, 0.6 * seconds))
        length = float(rng.exponential(8.0))
        drone = formation.ids[int(rng.integers(len(formation.ids)))]
        faults.append(Fault(kind=kind, drone=drone, start=start, end=start + length))
    if rng.random() < 0.15:
        start = float(rng.uniform(0.0, seconds))
        faults.append(Fault(kind="relay", start=start, end=start + float(rng.exponential(2.0))))
    if rng.random() < 0.1:
        start = float(rng.uniform(0.0, seconds))
        drone = formation.ids[int(rng.integers(len(formation.ids)))]
        faults.append(Fault(kind="glitch", drone=drone, start=start, end=start + float(rng.exponential(0.5))))
    return tuple(faults)


def _draw_wishes(seconds: float, rng: Rng) -> tuple[Wished, ...]:
    if rng.random() < 0.75:
        return ()
    start = float(rng.uniform(0.0, seconds))
    return (
        Wished(t=start, order="HOLD" if rng.random() < 0.6 else "LAND"),
        Wished(t=start + float(rng.exponential(3.0)), order="FLY"),
    )


def _draw_overrides(scenario: str, plan: Plan, rng: Rng) -> tuple[str, ...]:
    """Draws vehicles, law, size and columns; draws again what does not go together."""
    while True:
        try:
            drawn = _overrides(scenario, plan, rng)
            prepare(scenario, drawn)
        except ConfigError:
            prepare(scenario, plan.overrides)
            continue
        return drawn


def _overrides(scenario: str, plan: Plan, rng: Rng) -> tuple[str, ...]:
    loaded, _ = prepare(scenario, plan.overrides)
    body = ("identified", "crazyflie")[int(rng.integers(2))]
    rule = ("crazyflie", "hover")[int(rng.integers(2))]
    law = ("paper", "stable")[int(rng.integers(2))]
    drawn = [f"vehicles.all.body={body}", f"vehicles.all.link_loss={rule}", f"swarm.law={law}"]
    if loaded.formation.shape in ("line", "vee", "grid"):
        smallest, largest = SIZES
        n = round(math.exp(rng.uniform(math.log(smallest), math.log(largest + 0.4))))
        drawn.append(f"formation.n={n}")
    drawn += plan.overrides
    if not loaded.obstacles and rng.random() < 0.4:
        drawn.append(_draw_columns(*prepare(scenario, tuple(drawn)), rng))
    return tuple(drawn)


def _draw_columns(scenario: Scenario, formation: Formation, rng: Rng) -> str:
    """Draws columns about the formation, none of them where a drone begins."""
    home = np.array(scenario.hand.home)
    rest = home + rest_of(formation)[:, :2]
    columns = []
    for number in range(int(rng.integers(1, 5))):
        place = home + rng.uniform(-1.0, 1.0, 2) * (formation.radius + 1.5)
        if np.linalg.norm(rest - place, axis=1).min() > FREE:
            columns.append(f'{{name="c{number}", x={place[0]:.3f}, y={place[1]:.3f}}}')
    return f"obstacles=[{', '.join(columns)}]"
