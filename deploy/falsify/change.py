"""Changes a case a little: the steps of the local search."""

from collections.abc import Callable

import numpy as np
from attrs import evolve

from deploy.falsify.case import Case, Fault, Stroke
from deploy.falsify.draw import FASTEST_HAND, Plan, Rng, Room, draw_faults, draw_stroke, hand_room
from deploy.falsify.swarm import prepare
from shared.messages import Vector

STEP = 0.25
"""How far the end of a stroke is moved, m; standard deviation."""


def change(case: Case, plan: Plan, rng: Rng) -> Case:
    """Returns a case near another one.

    Args:
        case: Where from.
        plan: What may be changed beside the hand.
        rng: Draws.
    """
    ways: list[Callable[[Case, Rng], Case]] = [_stroke, _stroke, _begin, _another_stroke]
    if plan.faults and case.faults:
        ways += [_fault, _fault]
    if plan.faults:
        ways.append(_another_fault)
    if plan.weather:
        ways.append(_weather)
    for _ in range(int(rng.integers(1, 4))):
        case = ways[int(rng.integers(len(ways)))](case, rng)
    return case


def _near(place: Vector, room: Room, rng: Rng) -> Vector:
    x, y, z = place
    dx, dy, dz = (float(step) for step in rng.normal(0.0, STEP, 3))
    return room.clamp((x + dx, y + dy, z + 0.5 * dz))


def _stroke(case: Case, rng: Rng) -> Case:
    if not case.strokes:
        return case
    at = int(rng.integers(len(case.strokes)))
    old = case.strokes[at]
    new = evolve(
        old,
        to=_near(old.to, hand_room(case.scenario, case.overrides), rng),
        peak=float(np.clip(old.peak * rng.lognormal(0.0, 0.3), 0.1, FASTEST_HAND)),
        rest=float(max(0.0, old.rest + rng.normal(0.0, 0.2))),
    )
    return _with_stroke(case, at, new)


def _another_stroke(case: Case, rng: Rng) -> Case:
    if not case.strokes:
        return case
    at = int(rng.integers(len(case.strokes)))
    place = case.strokes[at - 1].to if at else case.hand
    return _with_stroke(case, at, draw_stroke(place, hand_room(case.scenario, case.overrides), rng))


def _with_stroke(case: Case, at: int, stroke: Stroke) -> Case:
    return evolve(case, strokes=(*case.strokes[:at], stroke, *case.strokes[at + 1 :]))


def _begin(case: Case, rng: Rng) -> Case:
    return evolve(case, hand=_near(case.hand, hand_room(case.scenario, case.overrides), rng))


def _fault(case: Case, rng: Rng) -> Case:
    if not case.faults:
        return case
    at = int(rng.integers(len(case.faults)))
    old = case.faults[at]
    start = float(max(0.0, old.start + rng.normal(0.0, 0.5)))
    length = float(max(0.1, old.end - old.start + rng.normal(0.0, 1.0)))
    return _with_fault(case, at, evolve(old, start=start, end=start + length))


def _another_fault(case: Case, rng: Rng) -> Case:
    _, formation = prepare(case.scenario, case.overrides)
    return evolve(case, faults=draw_faults(formation, case.seconds, rng))


def _with_fault(case: Case, at: int, fault: Fault) -> Case:
    return evolve(case, faults=(*case.faults[:at], fault, *case.faults[at + 1 :]))


def _weather(case: Case, rng: Rng) -> Case:
    return evolve(case, seed=int(rng.integers(2**31)))
