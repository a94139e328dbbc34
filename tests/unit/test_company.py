"""Whom a drone hears, misses and knows down; who is missed and must not count on being avoided."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from agents.company import FALL, UNHEARD_AFTER, Company, Memory, look_around
from agents.control.modes import HAND_LAND
from shared.clock import NS_PER_S
from shared.messages import MOST_LOST, ORIGIN, DroneState, Mode, Seen, Vector
from shared.senses import Sensed
from tests.unit.test_agent import T0, state

NOW = T0 + 100 * NS_PER_S
CRAZYFLIE = Memory(hovers=False, takeoff_height=1.2, landing_speed=0.5)
HOVERING = CRAZYFLIE._replace(hovers=True)
PLACE: Vector = (1.0, 2.0, 1.2)


def said(drone: int, age: float = 0.0, mode: Mode = Mode.FOLLOW, **more: object) -> Sensed[DroneState]:
    return Sensed(replace(state(drone, 7, mode, PLACE), **more), NOW - round(age * NS_PER_S))


def around(
    drone: int,
    *known: Sensed[DroneState],
    others: int = 4,
    memory: Memory = CRAZYFLIE,
    doubted: float | None = None,
) -> Company:
    memories = {other: memory for other in range(1, others + 1) if other != drone}
    doubts = {} if doubted is None else {each.message.id: NOW - round(doubted * NS_PER_S) for each in known}
    return look_around(drone, memories, {each.message.id: each for each in known}, doubts, NOW)


def test_who_hears_everybody_has_nothing_to_tell() -> None:
    company = around(2, said(1), said(3, UNHEARD_AFTER), said(4, 0.1))
    assert [each.message.id for each in company.heard] == [1, 3, 4]
    assert (company.missing, company.unheard, company.lost, company.awaited) == ([], (), (), ())
    assert not company.missed
    assert not company.alone
    assert not company.deaf


@pytest.mark.parametrize(
    ("memory", "mode", "lasts"),
    [
        (CRAZYFLIE, Mode.FOLLOW, HAND_LAND),
        (CRAZYFLIE, Mode.TAKEOFF, HAND_LAND),
        (CRAZYFLIE, Mode.LAND, 1.2 / 0.5),
        (HOVERING, Mode.FOLLOW, math.inf),
        (HOVERING, Mode.LAND, math.inf),
        (HOVERING, Mode.STOP, 1.0),
    ],
)
def test_a_body_is_remembered_while_it_can_be_in_the_air(memory: Memory, mode: Mode, lasts: float) -> None:
    for age in (UNHEARD_AFTER + 0.1, min(lasts, 1e4)):
        company = around(2, said(1), said(3, max(age, 0.6), mode), said(4), memory=memory)
        assert [gone.position for gone in company.missing] == [PLACE]
        assert company.unheard == (3,)
        assert company.lost[0][:4] == (3, T0, 7, PLACE)
        assert company.lost[0].mode is mode


@pytest.mark.parametrize(("mode", "age"), [(Mode.FOLLOW, 30.0), (Mode.STOP, FALL + 0.1), (Mode.GROUND, 0.6)])
def test_a_body_that_must_be_down_is_nobodys_obstacle_and_still_told(mode: Mode, age: float) -> None:
    company = around(2, said(1), said(3, age, mode), said(4))
    assert company.missing == []
    assert company.unheard == (3,)
    assert [seen.id for seen in company.lost] == [3]
    assert company.awaited == ()


def test_a_hovering_body_is_forgotten_once_it_is_heard_on_the_ground() -> None:
    assert around(2, said(1), said(3, 1e6), said(4), memory=HOVERING).missing
    assert not around(2, said(1), said(3, 1e6, Mode.GROUND), said(4), memory=HOVERING).missing


def test_one_for_whom_somebody_still_speaks_is_not_forgotten() -> None:
    assert not around(2, said(1), said(3, 60.0), said(4)).missing
    assert around(2, said(1), said(3, 60.0), said(4), doubted=1.0).missing


def test_who_was_never_heard_is_awaited() -> None:
    company = around(2, said(1), said(4))
    assert (company.awaited, company.unheard, company.lost) == ((3,), (3,), ())
    assert not company.missed


def seen(seq: int, position: Vector, age: float, mode: Mode = Mode.FOLLOW) -> Seen:
    return Seen(3, T0, seq, position, ORIGIN, mode, age)


def test_others_tell_where_one_was_seen_that_never_was_heard() -> None:
    older, newer = seen(5, (0.0, 0.0, 1.0), 4.0), seen(6, PLACE, 3.0)
    told = around(2, said(1, unheard=(3,), lost=(older,)), said(4, unheard=(3,), lost=(newer,)))
    assert told.awaited == ()
    assert told.missing == [newer]
    assert told.lost == (newer,)
    assert not told.missed


def test_others_tell_that_one_must_be_down_that_never_was_heard() -> None:
    for gone in (seen(5, PLACE, 60.0), seen(5, PLACE, 1.0, Mode.GROUND)):
        told = around(2, said(1, unheard=(3,), lost=(gone,)), said(4, unheard=(3,)))
        assert (told.missing, told.awaited) == ([], ())


def test_nobody_is_told_where_somebody_is_whom_it_saw_itself() -> None:
    lie = seen(99, (9.0, 9.0, 9.0), 0.0, Mode.GROUND)
    company = around(2, said(1, unheard=(3,), lost=(lie,)), said(3, 2.0), said(4))
    assert [gone.position for gone in company.missing] == [PLACE]


def test_who_is_not_heard_is_told_so_and_knows_who_is_deaf_to_it() -> None:
    company = around(2, said(1), said(3), said(4, unheard=(2,)))
    assert company.missed
    assert company.deaf == {4}
    assert not around(2, said(1), said(3), said(4, unheard=(3,))).missed


@pytest.mark.parametrize(("drone", "other", "missed"), [(3, 2, True), (2, 3, False)])
def test_of_two_that_lost_each_other_the_one_with_the_higher_number_is_missed(
    drone: int, other: int, missed: bool
) -> None:
    third = [said(n) for n in (1, 4)]
    assert around(drone, said(other, 2.0), *third).missed is missed
    # Whom nobody hears is gone itself: that is no reason to stop.
    assert not around(drone, said(other, 2.0), *(said(n, unheard=(other,)) for n in (1, 4))).missed


def test_who_hears_nobody_is_cut_off_unless_all_of_them_are_down() -> None:
    silent = [said(n, 3.0) for n in (1, 3, 4)]
    cut_off = around(2, *silent)
    assert (cut_off.missed, cut_off.alone, len(cut_off.missing)) == (True, True, 3)
    landed = around(2, *(said(n, 3.0, Mode.GROUND) for n in (1, 3, 4)))
    assert (landed.missed, landed.alone) == (False, True)
    newcomer = around(2)
    assert (newcomer.missed, newcomer.awaited) == (True, (1, 3, 4))


def test_a_drone_that_flies_by_itself_misses_nobody() -> None:
    company = around(1, others=1)
    assert not company.missed
    assert not company.alone


def test_of_many_that_are_lost_those_in_the_air_are_told() -> None:
    landed = [said(n, 3.0, Mode.GROUND) for n in range(2, 60)]
    flying = [said(n, 3.0) for n in range(60, 64)]
    company = around(1, *landed, *flying, others=64)
    assert len(company.lost) == MOST_LOST
    assert {gone.id for gone in company.lost} >= {60, 61, 62, 63}
    assert company.unheard == tuple(range(2, 65))


@given(st.lists(st.tuples(st.integers(2, 6), st.floats(0.0, 40.0), st.sampled_from(Mode)), max_size=8))
def test_everybody_is_heard_or_missing_or_down_or_awaited(heard: list[tuple[int, float, Mode]]) -> None:
    company = around(1, *(said(*each) for each in heard), others=6)
    known = [each.message.id for each in company.heard] + [gone.id for gone in company.lost]
    assert sorted([*known, *company.awaited]) == [2, 3, 4, 5, 6]
    assert {gone.id for gone in company.missing} <= {gone.id for gone in company.lost}
    assert sorted(company.unheard) == sorted({2, 3, 4, 5, 6} - {each.message.id for each in company.heard})
