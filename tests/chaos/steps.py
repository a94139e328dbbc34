"""What all plans do: watch, wait, and compare with what was demanded."""

from collections.abc import Callable, Sequence
from pathlib import Path

from shared.clock import NS_PER_S
from shared.messages import Mode
from tests.chaos.flight import ChaosFlight
from tests.chaos.row import Row
from tests.chaos.watch import ALARMS, Watch

Fly = Callable[[Path], Row]
"""Flies one plan in a folder of its own."""

CUE_S = 0.05
"""A token vanishes so soon, on one machine."""
REJOIN_S = 12.0
"""Everybody is back so soon, take-off included ..."""
PATIENCE_S = 40.0
"""... or, on a busy machine, so late."""
SURVIVORS_ERROR = 0.10
"""The survivors stand so well where the repaired graph puts them."""


def watch_from_now(flight: ChaosFlight, without: Sequence[int] = ()) -> Watch:
    """Begins to watch the healthy drones."""
    return Watch(flight, flight.recorder.clock(), tuple(i for i in flight.ids if i not in without))


def follow_at(flight: ChaosFlight, drones: Sequence[int]) -> bool:
    """Says whether these drones follow."""
    return flight.recorder.all_in(Mode.FOLLOW, drones)


def all_follow(flight: ChaosFlight, reborn: Sequence[int] = ()) -> bool:
    """Says whether everybody follows, and whether these are processes that started anew."""
    anew = all(len({state.epoch for state in flight.recorder.states[drone]}) > 1 for drone in reborn)
    return anew and flight.recorder.all_in(Mode.FOLLOW)


def all_calm(flight: ChaosFlight) -> bool:
    """Says whether everybody follows and nobody raises an alarm."""
    return all_follow(flight) and not any(flight.recorder.latest(i).flags & ALARMS for i in flight.ids)


def wait(flight: ChaosFlight, condition: Callable[[], bool]) -> float | None:
    """Waits until it holds; returns how long that took, s; None if it did not come."""
    try:
        return flight.recorder.until(condition, PATIENCE_S)
    except AssertionError:
        return None


def settle(watch: Watch, limit_s: float) -> float | None:
    """Waits as long as is allowed; returns when the healthy drones came into shape and stayed there, s."""
    recorder = watch.flight.recorder
    shaped: float | None = None
    while (elapsed := (recorder.clock() - watch.start_ns) / NS_PER_S) < limit_s:
        recorder.listen(0.05)
        off = watch.geometry_error(watch.drones) > SURVIVORS_ERROR
        shaped = None if off else (elapsed if shaped is None else shaped)
    return shaped


def only(watch: Watch, *modes: Mode) -> bool:
    """Says whether the healthy drones were in these modes only."""
    return {mode for drone in watch.drones for mode in watch.modes(drone)} <= set(modes)
