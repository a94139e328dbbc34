"""Fleets of mixed bodies, held bodies, and the vehicles' link-loss rules."""

import math

import pytest

from agents.control.vectors import ORIGIN, Vector
from agents.vehicles.base import Pose
from agents.vehicles.bodies.fleet import BODIES, Fleet, Flyer, advance, hold, hover, park_fleet, pose_of
from agents.vehicles.bodies.link_loss import obeyed
from agents.vehicles.bodies.state import Command, at_rest
from tests.values import fields

PLACES: list[Vector] = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)]
MIXED = {1: "crazyflie", 2: "identified", 5: "crazyflie"}


def fly(fleet: Fleet, shift: Vector, seconds: float) -> Fleet:
    """Flies every drone to its place on the ground plus a shift."""
    return {
        drone: advance(flyer, Command.FLY.value, (x + shift[0], y + shift[1], z + shift[2]), seconds)
        for (drone, flyer), (x, y, z) in zip(fleet.items(), PLACES, strict=True)
    }


def test_every_drone_flies_its_own_body() -> None:
    fleet = fly(park_fleet(MIXED, PLACES), (0.3, 0.2, 1.0), 3.0)
    for (x, y, _), drone, body in zip(PLACES, MIXED, MIXED.values(), strict=True):
        alone = Flyer(at_rest((x, y, 0.0)), BODIES[body])
        goal = (x + 0.3, y + 0.2, 1.0)
        flown = advance(alone, Command.FLY.value, goal, 3.0).body
        assert repr(fields(fleet[drone].body)) == repr(fields(flown))
    assert all(flyer.airborne for flyer in fleet.values())


def test_parked_fleet_is_on_the_ground() -> None:
    fleet = park_fleet(MIXED, [(x, y, z - 0.1) for x, y, z in PLACES])
    assert list(fleet) == [1, 2, 5]
    assert not any(flyer.airborne for flyer in fleet.values())
    assert [flyer.body.position for flyer in fleet.values()] == PLACES


def test_held_drone_stays_and_flies_on_when_released() -> None:
    fleet = fly(park_fleet(MIXED, PLACES), (0.0, 0.0, 1.0), 5.0)
    later = fly({**fleet, 2: hold(fleet[2])}, (1.0, 0.0, 1.0), 1.0)
    assert later[2].held
    assert later[2].body.position == fleet[2].body.position
    assert later[2].body.velocity == ORIGIN
    assert later[1].body.position[0] > 0.5
    released = fly({**later, 2: hold(later[2], held=False)}, (1.0, 0.0, 1.0), 1.0)
    assert released[2].body.position[0] > later[2].body.position[0] + 0.5


def test_a_hover_is_where_the_body_was() -> None:
    flyer = hover(Flyer(at_rest((0.3, -0.2, 1.2)), BODIES["crazyflie"]), held=True)
    assert flyer.held
    assert advance(
        hold(flyer, held=False), Command.FLY.value, (0.3, -0.2, 1.2), 2.0
    ).body.position == pytest.approx((0.3, -0.2, 1.2), abs=1e-3)


def test_a_pose_says_where_the_body_is() -> None:
    flyer = fly(park_fleet(MIXED, PLACES), (0.0, 0.0, 1.0), 1.0)[5]
    assert pose_of(flyer, 0.5, 7) == Pose(
        flyer.body.position, flyer.body.velocity, 0.0, 0.5, airborne=True, seq=7
    )


def test_no_time_changes_nothing() -> None:
    flyer = park_fleet(MIXED, PLACES)[1]
    assert advance(flyer, Command.FLY.value, (1.0, 1.0, 1.0), 0.0) is flyer


@pytest.mark.parametrize(
    ("age", "crazyflie", "hover"),
    [
        (0.0, Command.FLY, Command.FLY),
        (0.49, Command.FLY, Command.FLY),
        (0.5, Command.LEVEL, Command.FLY),
        (1.99, Command.LEVEL, Command.FLY),
        (2.0, Command.CUT, Command.FLY),
        (math.inf, Command.CUT, Command.FLY),
    ],
)
def test_link_loss_rules(age: float, crazyflie: Command, hover: Command) -> None:
    assert obeyed(Command.FLY.value, age, hovers=False) == crazyflie
    assert obeyed(Command.FLY.value, age, hovers=True) == hover


@pytest.mark.parametrize("age", [0.0, 1.0, math.inf])
@pytest.mark.parametrize("hovers", [True, False])
def test_a_cut_vehicle_stays_cut(age: float, hovers: bool) -> None:
    assert obeyed(Command.CUT.value, age, hovers=hovers) == Command.CUT
