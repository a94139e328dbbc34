"""Fleets of mixed bodies, held bodies, and the vehicles' link-loss rules."""

import numpy as np
import pytest

from agents.vehicles.bodies.advance import BODIES, advance
from agents.vehicles.bodies.fleet import advance_fleet, hold, park_fleet, poses
from agents.vehicles.bodies.link_loss import apply_link_loss
from agents.vehicles.bodies.single.fleet import advance_flyer, flyers, pose_of
from agents.vehicles.bodies.state import Command, Commands, at_rest

PLACES = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
MIXED = {1: "crazyflie", 2: "identified", 5: "crazyflie"}


def fly(setpoints: "np.typing.NDArray[np.float64]") -> Commands:
    return Commands(np.full(len(setpoints), Command.FLY, dtype=np.int8), setpoints)


def test_mixed_fleet_is_its_bodies_side_by_side() -> None:
    goals = PLACES + np.array([0.3, 0.2, 1.0])
    fleet = advance_fleet(park_fleet(MIXED, PLACES), fly(goals), 3.0)
    for row, body in enumerate(MIXED.values()):
        alone = advance(BODIES[body], at_rest(PLACES[row : row + 1]), fly(goals[row : row + 1]), 3.0)
        assert fleet.position[row].tolist() == alone.position[0].tolist()
        assert fleet.velocity[row].tolist() == alone.velocity[0].tolist()
    assert fleet.airborne.all()


def test_parked_fleet_is_on_the_ground() -> None:
    fleet = park_fleet(MIXED, PLACES)
    assert fleet.ids == (1, 2, 5)
    assert not fleet.airborne.any()
    assert fleet.position.tolist() == PLACES.tolist()


def test_held_drone_stays_and_flies_on_when_released() -> None:
    fleet = advance_fleet(park_fleet(MIXED, PLACES), fly(PLACES + np.array([0.0, 0.0, 1.0])), 5.0)
    caught = hold(fleet, {2})
    later = advance_fleet(caught, fly(PLACES + np.array([1.0, 0.0, 1.0])), 1.0)
    assert later.position[1].tolist() == fleet.position[1].tolist()
    assert not later.velocity[1].any()
    assert later.position[0, 0] > 0.5
    released = advance_fleet(hold(later, set()), fly(PLACES + np.array([1.0, 0.0, 1.0])), 1.0)
    assert released.position[1, 0] > later.position[1, 0] + 0.5


def test_one_by_one_a_fleet_flies_as_in_its_rows() -> None:
    goals = PLACES + np.array([0.3, 0.2, 1.0])
    fleet = hold(advance_fleet(park_fleet(MIXED, PLACES), fly(goals), 2.0), {5})
    alone = [
        advance_flyer(flyer, Command.FLY.value, (x, y, z), 1.0)
        for flyer, (x, y, z) in zip(flyers(fleet), goals.tolist(), strict=True)
    ]
    together = advance_fleet(fleet, fly(goals), 1.0)
    assert [pose_of(flyer, 0.5, 7) for flyer in alone] == poses(together, [0.5] * 3, 7)
    assert [flyer.held for flyer in alone] == [False, False, True]


@pytest.mark.parametrize(
    ("age", "crazyflie", "hover"),
    [
        (0.0, Command.FLY, Command.FLY),
        (0.49, Command.FLY, Command.FLY),
        (0.5, Command.LEVEL, Command.FLY),
        (1.99, Command.LEVEL, Command.FLY),
        (2.0, Command.CUT, Command.FLY),
        (np.inf, Command.CUT, Command.FLY),
    ],
)
def test_link_loss_rules(age: float, crazyflie: Command, hover: Command) -> None:
    kinds = np.full(2, Command.FLY, dtype=np.int8)
    obeyed = apply_link_loss(kinds, np.full(2, age), np.array([False, True]))
    assert obeyed.tolist() == [crazyflie, hover]


@pytest.mark.parametrize("age", [0.0, 1.0, np.inf])
def test_a_cut_vehicle_stays_cut(age: float) -> None:
    kinds = np.full(2, Command.CUT, dtype=np.int8)
    obeyed = apply_link_loss(kinds, np.full(2, age), np.array([False, True]))
    assert obeyed.tolist() == [Command.CUT, Command.CUT]
