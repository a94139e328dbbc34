"""What docs/safety.md promises, in flights in which it was once broken: real agents, virtual clock."""

import pytest
from attrs import evolve

from agents.vehicles.world.setup import referee_rules
from deploy.falsify.case import Case, Fault, FaultKind, Stroke, Weather
from deploy.falsify.judge import CLASSES, Verdict, broken, judge
from deploy.falsify.swarm import fly, prepare
from shared.scenario import Triple

BODIES = ("identified", "crazyflie")
LAWS = ("paper", "stable")
RAIN = Weather(loss=0.2, delay=0.05)


def flight(
    scenario: str, hand: Triple, *strokes: Stroke, body: str, law: str, more: tuple[str, ...] = ()
) -> Case:
    overrides = (f"vehicles.all.body={body}", f"swarm.law={law}", *more)
    return Case(scenario=scenario, overrides=overrides, seconds=9.0, hand=hand, strokes=strokes)


def verdict(case: Case) -> Verdict:
    scenario, formation = prepare(case.scenario, case.overrides)
    found = judge(fly(case), referee_rules(scenario, formation, formation.ids))
    print({kind: round(worst.value, 3) for kind, worst in found.items()})
    return found


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("height", [0.2, 2.2])
def test_a_hand_that_is_lifted_or_lowered_leaves_nobody_outside_or_on_the_ground(
    body: str, law: str, height: float
) -> None:
    up, back = Stroke(to=(0.0, 0.0, height), peak=1.5), Stroke(to=(0.0, 0.0, 1.2), peak=1.5, rest=2.0)
    found = verdict(flight("rhombus", (0.0, 0.0, 1.2), up, back, body=body, law=law))
    assert broken(found) == []


@pytest.mark.parametrize("body", BODIES)
def test_a_grid_behind_a_hand_at_its_fastest(body: str) -> None:
    there, back = Stroke(to=(-1.2, 0.8, 1.2), peak=1.5, rest=0.5), Stroke(to=(0.8, -0.8, 1.2), peak=1.5)
    case = flight("grid", (0.0, 0.0, 1.2), there, back, body=body, law="stable", more=("formation.n=9",))
    assert broken(verdict(case)) == []


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("body", BODIES)
def test_through_the_columns(body: str, law: str) -> None:
    places = [(-3.0, -1.4, 1.2), (-4.2, 0.8, 1.2), (-5.4, -0.6, 1.2)]
    strokes = [Stroke(to=place, peak=1.0, rest=0.2) for place in places]
    case = flight("slalom", (-1.6, 0.0, 1.2), *strokes, body=body, law=law)
    assert broken(verdict(case)) == []


@pytest.mark.parametrize("rule", ["hover", "crazyflie"])
@pytest.mark.parametrize("kind", ["cut", "kill", "mute", "deaf"])
def test_a_formation_that_flies_through_the_place_of_one_that_fell_silent(kind: FaultKind, rule: str) -> None:
    there, back = Stroke(to=(-1.0, 0.0, 1.2), peak=0.8, rest=3.0), Stroke(to=(1.0, 0.3, 1.2), peak=1.0)
    case = flight(
        "rhombus",
        (0.0, 0.0, 1.2),
        there,
        back,
        body="crazyflie",
        law="stable",
        more=(f"vehicles.all.link_loss={rule}",),
    )
    fault = Fault(kind=kind, drone=2, start=1.5, end=30.0)
    assert broken(verdict(evolve(case, seconds=16.0, faults=(fault,), weather=RAIN, seed=3))) == []


@pytest.mark.parametrize("n", [2, 12, 32])
def test_any_number_in_the_rain(n: int) -> None:
    strokes = [Stroke(to=to, peak=1.5) for to in ((-0.8, 0.8, 1.2), (0.8, -0.8, 1.2))]
    more = (f"formation.n={n}", "net.full_mesh=32")
    case = flight("vee", (0.0, 0.0, 1.2), *strokes, body="crazyflie", law="stable", more=more)
    found = verdict(evolve(case, seconds=6.0, weather=RAIN))
    assert CLASSES["drones"].margin(found["drones"].value) >= 0.0
    assert broken(found) == []
