"""One pattern at a time, the newest state, the gate, safety cues first."""

import itertools
from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glove_bridge.cues import Cue, active_cues
from glove_bridge.patterns import load_patterns
from glove_bridge.patterns.schema import CUE_PATTERNS
from glove_bridge.scheduler import (
    CLEAR_NS,
    REMIND_NS,
    RETRY_NS,
    Decision,
    Request,
    Schedule,
    decide,
    ended,
    started,
)
from shared.messages import NO_FLAGS, ORIGIN, DroneState, Flag, Mode

MS = 1_000_000
FLIGHT, CUES = load_patterns("flight").patterns, load_patterns("cues").patterns
LOST, FENCE = Cue("DRONE_LOST", 3), Cue("FENCE")


def request(name: str, seq: int = 0) -> Request:
    return Request(pattern={**FLIGHT, **CUES}[name], state_seq=seq)


class Player:
    """A scheduler with a glove that plays exactly as long as it should."""

    def __init__(self) -> None:
        self.schedule = Schedule()
        self.now_ms = 0
        self.ends_ms: int | None = None
        self.played: list[tuple[int, str]] = []
        self.ended: list[int] = []
        self.suppressed: list[str] = []

    def at(self, now_ms: int, wish: str | None = None, *cues: Cue, silent: bool = False) -> Decision:
        self.now_ms = now_ms
        if self.ends_ms is not None and now_ms >= self.ends_ms:
            self.schedule, self.ends_ms = ended(self.schedule, felt=True), None
            self.ended.append(now_ms)
        wanted = request(wish) if wish else None
        due = [(cue, request(cue.pattern)) for cue in cues]
        self.schedule, decision = decide(self.schedule, wanted, due, now_ms * MS, silent=silent)
        if decision.play:
            self.schedule = started(self.schedule, now_ms * MS)
            self.ends_ms = now_ms + decision.play.pattern.length_ms
            self.played.append((now_ms, decision.play.pattern.name))
        self.suppressed += [missed.pattern.name for missed in decision.suppressed]
        return decision

    def through(self, times_ms: Iterable[int], wish: str | None = None, *cues: Cue) -> None:
        for now_ms in times_ms:
            self.at(now_ms, wish, *cues)


def test_a_wish_plays_at_once_when_the_gate_is_open() -> None:
    player = Player()
    assert player.at(0).play is None
    decision = player.at(7, "CR")
    assert decision.play == request("CR")
    assert decision.suppressed == ()


def test_a_lasting_state_is_repeated_when_the_gate_opens() -> None:
    player = Player()
    player.through(range(0, 2000, 10), "CR")
    assert player.played == [(0, "CR"), (800, "CR"), (1600, "CR")]
    assert player.suppressed == []


def test_the_newest_state_wins_and_what_was_missed_is_told_once() -> None:
    player = Player()
    player.at(0, "CR")
    player.through(range(10, 300, 10), "CL")
    player.at(300)
    player.through(range(310, 400, 10), "CL")
    player.through(range(400, 900, 10), "EL")
    assert player.played == [(0, "CR"), (800, "EL")]
    assert player.suppressed == ["CL"]


def test_a_wish_that_is_gone_when_the_gate_opens_is_suppressed() -> None:
    player = Player()
    player.at(0, "ER")
    player.at(50, "CL")
    player.through(range(60, 1000, 10))
    assert player.played == [(0, "ER")]
    assert player.suppressed == ["CL"]


def test_the_wish_that_plays_is_not_suppressed_by_flickering() -> None:
    player = Player()
    player.through(range(0, 700, 20), "ER")
    player.through(range(10, 700, 20))
    player.at(700)
    assert player.suppressed == []


def test_the_gate_counts_from_the_first_frame_not_from_the_decision() -> None:
    schedule, decision = decide(Schedule(), request("CR"), [], 0)
    assert decision.play
    schedule = ended(started(schedule, 140 * MS), felt=True)
    assert decide(schedule, request("CR"), [], 939 * MS)[1].play is None
    assert decide(schedule, request("CR"), [], 940 * MS)[1].play == request("CR")


def test_a_glove_that_fails_is_not_asked_again_before_the_gate_opens() -> None:
    schedule, decision = decide(Schedule(), request("CR"), [], 0)
    assert decision.play
    schedule = ended(schedule, felt=True)
    assert decide(schedule, request("CR"), [], 799 * MS)[1].play is None
    assert decide(schedule, request("CR"), [], 800 * MS)[1].play == request("CR")


def test_a_state_without_a_side_closes_the_gate_as_long_as_the_last_pattern() -> None:
    player = Player()
    player.at(0, None, silent=True)
    player.at(1, "ER")
    assert player.played == [(1, "ER")]
    player.at(701, None, silent=True)
    player.through(range(710, 1401, 10), "CR")
    assert player.played == [(1, "ER")]
    player.at(1401, "CR")
    assert player.played[-1] == (1401, "CR")


def test_a_cue_waits_for_the_pattern_but_not_for_the_gate() -> None:
    player = Player()
    player.at(0, "CR")
    player.through(range(10, 400, 10), "CR", LOST)
    assert player.played == [(0, "CR"), (300, "DRONE_LOST")]


def test_the_most_urgent_cue_comes_first_and_before_any_wish() -> None:
    player = Player()
    player.through(range(0, 2500, 10), "CR", LOST, FENCE)
    assert [name for _, name in player.played][:3] == ["DRONE_LOST", "FENCE", "CR"]


def test_a_lasting_cue_is_repeated_and_patterns_go_on_between() -> None:
    player = Player()
    player.through(range(0, 11_000, 10), "CR", FENCE)
    reminders = [at for at, name in player.played if name == "FENCE"]
    assert len(reminders) == 3
    assert all(REMIND_NS // MS <= b - a <= REMIND_NS // MS + 300 for a, b in itertools.pairwise(reminders))
    assert [name for _, name in player.played].count("CR") > 8


def test_a_flickering_cue_plays_no_more_often_than_a_lasting_one() -> None:
    player = Player()
    for now in range(0, 4_900, 20):
        player.at(now, None, FENCE)
        player.at(now + 10)
    assert len(player.played) == 1


def test_a_cue_whose_condition_was_over_for_a_second_begins_anew() -> None:
    player = Player()
    player.through(range(0, 1000, 10), None, FENCE)
    player.through(range(1000, 1980, 10))
    player.at(1980, None, FENCE)
    assert len(player.played) == 1
    player.through(range(1990, 3000, 10))
    player.at(3000, None, FENCE)
    assert player.played == [(0, "FENCE"), (3000, "FENCE")]


def test_a_second_lost_drone_is_told_at_once() -> None:
    player = Player()
    player.through(range(0, 1000, 10), None, LOST)
    player.through(range(1000, 1500, 10), None, LOST, Cue("DRONE_LOST", 4))
    assert player.played == [(0, "DRONE_LOST"), (1000, "DRONE_LOST")]


NAMES = st.none() | st.sampled_from(sorted(FLIGHT))
CONDITIONS = st.lists(st.sampled_from([LOST, FENCE, Cue("HAND_STALE")]), max_size=3, unique=True)


@given(st.lists(st.tuples(st.integers(1, 400), NAMES, CONDITIONS, st.booleans()), max_size=60))
def test_never_two_at_once_never_cut_short_gate_kept(
    steps: list[tuple[int, str | None, list[Cue], bool]],
) -> None:
    player, now = Player(), 0
    for wait, wish, cues, silent in steps:
        now += wait
        player.at(now, wish, *cues, silent=silent)
    for (start, name), (following, other) in zip(player.played, player.played[1:], strict=False):
        pattern = request(name).pattern
        assert following >= start + pattern.length_ms
        if other in FLIGHT:
            assert following >= start + pattern.gate_ms
    for cue in CUE_PATTERNS:
        times = [at for at, name in player.played if name == cue]
        assert all(b - a >= CLEAR_NS // MS for a, b in itertools.pairwise(times))


@given(st.lists(st.tuples(st.integers(1, 200), NAMES), max_size=60))
def test_every_wish_is_played_or_told_as_suppressed(steps: list[tuple[int, str | None]]) -> None:
    player, now, wished = Player(), 0, set()
    for wait, wish in steps:
        now += wait
        wished.add(wish)
        player.at(now, wish)
    player.at(now + 10_000)
    assert {name for _, name in player.played} | set(player.suppressed) == wished - {None}


def state(drone: int, mode: Mode = Mode.FOLLOW, flags: Flag = NO_FLAGS) -> DroneState:
    return DroneState(
        epoch=0,
        seq=0,
        stamp_ns=0,
        id=drone,
        position=ORIGIN,
        velocity=ORIGIN,
        goal=ORIGIN,
        goal_velocity=ORIGIN,
        setpoint=ORIGIN,
        mode=mode,
        flags=flags,
    )


def test_cues_come_in_the_order_of_urgency() -> None:
    states = {
        1: state(1, flags=Flag.LOW_BATTERY | Flag.BLOCKED),
        2: state(2, flags=Flag.FENCE),
        3: state(3),
        4: state(4),
    }
    assert active_cues(states, (3, 4), hand_stale=True) == (
        Cue("DRONE_LOST", 3),
        Cue("DRONE_LOST", 4),
        Cue("HAND_STALE"),
        Cue("FENCE"),
        Cue("BLOCKED"),
        Cue("LOW_BATTERY"),
    )
    assert [cue.pattern for cue in active_cues(states, (1, 2), hand_stale=False)] == ["DRONE_LOST"] * 2


@pytest.mark.parametrize("mode", [Mode.GROUND, Mode.STOP])
def test_on_the_ground_there_is_nothing_to_be_warned_of(mode: Mode) -> None:
    flagged = {1: state(1, mode, Flag.FENCE), 2: state(2, mode)}
    assert active_cues(flagged, (2,), hand_stale=True) == ()
    assert active_cues({}, (1, 2), hand_stale=True) == ()


def test_a_drone_that_was_last_heard_in_the_air_is_lost() -> None:
    assert active_cues({1: state(1, Mode.LAND)}, (1,), hand_stale=False) == (Cue("DRONE_LOST", 1),)


def test_one_flying_drone_that_does_not_hear_the_hand_is_enough() -> None:
    deaf = {1: state(1), 2: state(2, flags=Flag.HAND_STALE)}
    assert active_cues(deaf, (), hand_stale=False) == (Cue("HAND_STALE"),)
    deaf[2] = state(2, Mode.GROUND, Flag.HAND_STALE)
    assert active_cues(deaf, (), hand_stale=False) == ()


def test_a_critical_battery_is_a_low_one() -> None:
    assert active_cues({1: state(1, flags=Flag.CRITICAL_BATTERY)}, (), hand_stale=False) == (
        Cue("LOW_BATTERY"),
    )


def played_while(*, connected_from_ns: int, until_ns: int) -> list[int]:
    """When a lasting cue is played on a glove that fails every pattern until it is there, ns."""
    schedule, times, lost = Schedule(), [], Cue("DRONE_LOST", 2)
    for now_ns in range(0, until_ns, 50 * MS):
        connected = now_ns >= connected_from_ns
        schedule, decision = decide(
            schedule, None, [(lost, request("DRONE_LOST"))], now_ns, connected=connected
        )
        if decision.play:
            times.append(now_ns)
            schedule = ended(schedule, felt=connected)
    return times


def test_a_cue_that_was_not_felt_is_felt_as_soon_as_the_glove_is_there() -> None:
    back_ns = REMIND_NS // 2
    assert played_while(connected_from_ns=back_ns, until_ns=REMIND_NS + back_ns) == [0, back_ns]
    soon_ns = RETRY_NS // 2
    assert played_while(connected_from_ns=soon_ns, until_ns=REMIND_NS) == [0, RETRY_NS]


def test_without_a_glove_a_cue_is_asked_for_no_more_often_than_with_one() -> None:
    assert played_while(connected_from_ns=10 * REMIND_NS, until_ns=3 * REMIND_NS) == [
        0,
        REMIND_NS,
        2 * REMIND_NS,
    ]
