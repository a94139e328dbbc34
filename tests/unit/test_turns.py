"""Turns of a loop on several threads."""

import threading
import time
from collections.abc import Callable

import pytest

from agents.turns import Turns
from shared.clock import NS_PER_S

DEADLINE_S = 10.0


class Loop:
    """A loop whose turn does what it is told, counts, and notices when two make it at once."""

    def __init__(self, act: Callable[[], None] = lambda: None) -> None:
        self.made = 0
        self.overlapped = False
        self.due_ns = 0
        self.act = act
        self._busy = threading.Lock()

    def turn(self) -> int:
        self.overlapped |= not self._busy.acquire(blocking=False)
        self.act()
        self.made += 1
        self._busy.release()
        return self.due_ns


def aside(turns: Turns) -> threading.Thread:
    thread = threading.Thread(target=turns.take_aside)
    thread.start()
    return thread


def test_news_during_a_turn_is_worth_another_and_nobody_waits() -> None:
    begun, finish = threading.Event(), threading.Event()

    def hold() -> None:
        begun.set()
        assert finish.wait(DEADLINE_S)

    loop = Loop(hold)
    turns = Turns(loop.turn, time.monotonic_ns)
    first = aside(turns)
    assert begun.wait(DEADLINE_S)
    for _ in range(3):
        turns.take_aside()
    assert loop.made == 0
    finish.set()
    first.join(DEADLINE_S)
    assert loop.made == 2, "one more for all three"
    assert not loop.overlapped


def test_every_piece_of_news_is_seen_by_a_turn_that_begins_after_it() -> None:
    news, seen = [0], [0]

    def look() -> None:
        seen[0] = news[0]

    loop = Loop(look)
    turns = Turns(loop.turn, time.monotonic_ns)
    lock = threading.Lock()

    def bring() -> None:
        for _ in range(2_000):
            with lock:
                news[0] += 1
            turns.take_aside()

    threads = [threading.Thread(target=bring) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(DEADLINE_S)
    assert seen == news == [8_000]
    assert not loop.overlapped


def test_what_fails_aside_is_raised_on_the_main_thread_at_once() -> None:
    def fail() -> None:
        raise ValueError("no such drone")

    loop = Loop(fail)
    loop.due_ns = time.monotonic_ns() + 3600 * NS_PER_S
    turns = Turns(loop.turn, time.monotonic_ns)
    aside(turns).join(DEADLINE_S)
    turns.rest(DEADLINE_S)
    loop.act = lambda: None
    with pytest.raises(ValueError, match="no such drone"):
        turns.take()


def test_a_rest_ends_when_a_turn_aside_finds_the_next_one_due_earlier() -> None:
    loop = Loop()
    hour = 3600 * NS_PER_S
    loop.due_ns = time.monotonic_ns() + hour
    turns = Turns(loop.turn, time.monotonic_ns)
    turns.take()
    resting, rested = threading.Event(), threading.Event()

    def rest() -> None:
        resting.set()
        turns.rest(3600.0)
        rested.set()

    threading.Thread(target=rest, daemon=True).start()
    assert resting.wait(DEADLINE_S)
    loop.due_ns += hour
    turns.take_aside()
    assert not rested.is_set(), "later is no news"
    loop.due_ns -= 2 * hour
    turns.take_aside()
    assert rested.wait(DEADLINE_S)


def test_the_main_thread_waits_for_a_turn_aside_so_that_its_watchdog_sees_it_hang() -> None:
    begun, finish, passed = threading.Event(), threading.Event(), threading.Event()

    def hold() -> None:
        begun.set()
        assert finish.wait(DEADLINE_S)

    loop = Loop(hold)
    turns = Turns(loop.turn, time.monotonic_ns)
    aside(turns)
    assert begun.wait(DEADLINE_S)

    def take() -> None:
        turns.take()
        passed.set()

    threading.Thread(target=take, daemon=True).start()
    assert not passed.wait(0.05)
    finish.set()
    assert passed.wait(DEADLINE_S)
    assert not loop.overlapped


def test_there_is_no_turn_after_the_end() -> None:
    loop = Loop()
    turns = Turns(loop.turn, time.monotonic_ns)
    turns.take()
    turns.end()
    turns.take_aside()
    assert loop.made == 1
