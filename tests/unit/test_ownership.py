"""One page holds the hand: no sequence of events makes two, or keeps it for a page that is gone."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer.console.ownership import (
    SILENT_S,
    Ownership,
    expire,
    give,
    join,
    leave,
    move,
    release,
    take,
    want,
)
from shared.errors import DecodeError
from shared.messages import Wish

POINT = (1.0, 0.0, 1.2)
PAGES = st.integers(1, 4)

Event = tuple[str, int, int, float]
events = st.tuples(
    st.sampled_from(["join", "leave", "take", "release", "give", "move", "want", "stop"]),
    PAGES,
    PAGES,
    st.floats(0.0, 1.0),
)


def apply(state: Ownership, event: Event, now: float) -> Ownership:
    what, page, other, _ = event
    acts: dict[str, Callable[[], Ownership]] = {
        "join": lambda: join(state, page),
        "leave": lambda: leave(state, page),
        "take": lambda: take(state, page, now, Wish.FLY),
        "release": lambda: release(state, page),
        "give": lambda: give(state, page, other, now),
        "move": lambda: move(state, page, POINT, 0.1, now),
        "want": lambda: want(state, page, Wish.HOLD, now),
        "stop": lambda: want(state, page, Wish.STOP, now),
    }
    try:
        return acts[what]()
    except DecodeError:  # refused: nothing changes
        return state


@given(st.lists(events, max_size=60))
def test_invariants_hold_after_any_sequence(sequence: list[Event]) -> None:
    state, now = Ownership(), 0.0
    for event in sequence:
        now += event[3]
        before = expire(state, now)
        state = apply(before, event, now)
        assert state.holder is None or state.holder in state.pages
        assert state.holder not in state.asking
        assert set(state.asking) <= state.pages
        assert len(set(state.asking)) == len(state.asking)
        assert before.stopped <= state.stopped
        changed_hands = state.holder != before.holder and None not in (state.holder, before.holder)
        assert not changed_hands or event[0] == "give", "only the holder gives it away"
        if event[1] != before.holder:
            assert (state.point, state.wish) == (before.point, before.wish) or event[0] == "take"


@given(st.lists(events, max_size=40))
def test_whatever_happened_a_silent_hand_is_free_and_can_be_taken(sequence: list[Event]) -> None:
    state, now = Ownership(), 0.0
    for event in sequence:
        now += event[3]
        state = apply(state, event, now)
    now += SILENT_S + 0.01
    state = expire(state, now)
    assert state.holder is None
    assert take(join(state, 9), 9, now, Wish.FLY).holder == 9


def opened(*pages: int) -> Ownership:
    state = Ownership()
    for page in pages:
        state = join(state, page)
    return state


def test_the_first_takes_the_second_asks_and_is_given() -> None:
    state = take(opened(1, 2, 3), 1, 0.0, Wish.FLY)
    state = take(take(take(state, 3, 0.1, Wish.FLY), 2, 0.1, Wish.FLY), 3, 0.1, Wish.FLY)
    assert (state.holder, state.asking) == (1, (3, 2))
    state = move(state, 1, POINT, 0.5, 0.2)
    state = give(state, 1, 2, 0.3)
    assert (state.holder, state.asking) == (2, (3,))
    assert (state.point, state.wish) == (POINT, Wish.FLY), "nothing moves because it changed hands"


def test_what_only_the_holder_may() -> None:
    state = take(opened(1, 2), 1, 0.0, Wish.GROUND)
    forbidden: tuple[Callable[[], Ownership], ...] = (
        lambda: move(state, 2, POINT, 0.0, 0.0),
        lambda: want(state, 2, Wish.FLY, 0.0),
        lambda: give(state, 2, 2, 0.0),
    )
    for act in forbidden:
        with pytest.raises(DecodeError, match="does not hold the hand"):
            act()
    with pytest.raises(DecodeError, match="page 2 has not asked"):
        give(state, 1, 2, 0.0)
    assert want(state, 2, Wish.STOP, 0.0).stopped


def test_leaving_releases_and_the_next_starts_afresh() -> None:
    state = take(opened(1, 2), 1, 0.0, Wish.FLY)
    state = leave(move(state, 1, POINT, 0.5, 0.1), 1)
    assert (state.holder, state.point) == (None, None)
    state = take(state, 2, 0.2, Wish.GROUND)
    assert (state.holder, state.wish, state.point, state.yaw) == (2, Wish.GROUND, None, 0.0)


def test_an_asking_page_may_withdraw() -> None:
    state = take(take(opened(1, 2), 1, 0.0, Wish.FLY), 2, 0.0, Wish.FLY)
    assert release(state, 2).asking == ()
    assert leave(state, 2).asking == ()
    assert release(state, 2).holder == 1
