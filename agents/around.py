"""What a drone has to keep away from, from what it has heard: the word of others as encounters. Pure."""

from collections.abc import Iterable

from agents.company import Company
from agents.control.modes import GROUND, is_airborne
from agents.control.safety.demands import SafetySettings
from agents.control.safety.encounter import (
    SILENT_AFTER,
    Clearance,
    Encounter,
    drone_heard,
    drone_silent,
    walker_seen,
)
from shared.messages import ORIGIN, ObstacleState


def drones_around(company: Company, keep: dict[int, Clearance], lag: float, now_ns: int) -> list[Encounter]:
    """Returns where the other drones are, or may be.

    One that is silent, or that does not see itself, may be anywhere from where it was to where it would have
    come. So may one that speaks and is not believed: what it says moves nobody, but it is there. Who is missed
    itself stays where the others saw it last, and only keeps off the places where it saw them.

    Args:
        company: Who is heard, and who is missing.
        keep: How far to keep from each drone.
        lag: Of the own vehicle, s.
        now_ns: Own clock.
    """
    found = []
    for sensed in company.heard:
        state = sensed.message
        heard = sensed.age(now_ns)
        age = heard + state.pose_age
        # Who stands on the ground says so less often, and stays there.
        if age > SILENT_AFTER and state.mode is not GROUND:
            found.append(drone_silent(state.position, state.velocity, age, keep[state.id], lag))
            continue
        yields = is_airborne(state.mode) and state.id not in company.deaf
        ahead = state.position if state.ahead is None else state.ahead
        pace = state.velocity if state.pace is None else state.pace
        found.append(
            drone_heard(ahead, pace, state.asked, min(heard, SILENT_AFTER), keep[state.id], yields=yields)
        )
    for seen in company.missing:
        velocity, age = (ORIGIN, 0.0) if company.missed else (seen.velocity, seen.age)
        found.append(drone_silent(seen.position, velocity, age, keep[seen.id], lag))
    return found


def walkers_around(obstacles: Iterable[tuple[ObstacleState, float]], safety: SafetySettings) -> list[Encounter]:
    """Returns moving obstacles: upright cylinders that do not look, where they may have come to by now.

    Args:
        obstacles: What was said of each that may be relied on, and how long ago, s.
        safety: Of the filter.
    """
    return [
        walker_seen(
            state.position,
            state.velocity,
            age,
            safety.horizontal.lag,
            safety.hand,
            radius=state.radius,
            above=state.height + safety.over,
            below=safety.over,
        )
        for state, age in obstacles
    ]
