"""Flight statistics on streams made by hand."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer.agent_log import AgentSummary
from observer.flight_stats import FlightStats
from observer.hand_log import KEPT, HandLog
from observer.histogram import Histogram
from shared.config import load_scenario
from shared.formation import build_formation
from shared.geometry import hull_area
from shared.messages import ORIGIN, DroneState, HandSample, Heard, Mode, Vector, Wish

MS = 1_000_000
T0 = 1_000_000 * MS
TICK = 16 * MS
RHOMBUS = build_formation(load_scenario("rhombus"))


def hand(seq: int, *, epoch: int = 1, stamp: int | None = None) -> HandSample:
    return HandSample(
        epoch=epoch,
        seq=seq,
        stamp_ns=T0 + seq * TICK if stamp is None else stamp,
        position=ORIGIN,
        velocity=ORIGIN,
        yaw=0.0,
        mode=Wish.FLY,
    )


def state(
    drone: int,
    seq: int,
    at: int,
    heard: dict[str, Heard],
    *,
    epoch: int = 1,
    mode: Mode = Mode.FOLLOW,
    position: Vector = ORIGIN,
    goal: Vector = ORIGIN,
) -> DroneState:
    return DroneState(
        epoch=epoch,
        seq=seq,
        stamp_ns=at,
        step_ns=at,
        id=drone,
        position=position,
        velocity=ORIGIN,
        goal=goal,
        goal_velocity=ORIGIN,
        setpoint=goal,
        mode=mode,
        heard=heard,
    )


def of_hand(seq: int, arrival: int, *, epoch: int = 1) -> dict[str, Heard]:
    return {"human/hand": Heard(epoch, seq, arrival)}


def of_drone(drone: int, seq: int, arrival: int, *, epoch: int = 1) -> dict[str, Heard]:
    return {f"drone/{drone}/state": Heard(epoch, seq, arrival)}


def summary_of(stats: FlightStats, drone: int) -> AgentSummary:
    return next(agent for agent in stats.agents() if agent.id == drone)


def fly_drone_1(used: list[int], *, sent: int, late_ms: float = 1.0) -> AgentSummary:
    """Drone 1 steps once per sample in `used`; the relay sends `sent` samples."""
    stats = FlightStats(RHOMBUS)
    for tick in range(sent):
        stats.update([hand(tick)], [])
        if tick in used:
            arrival = T0 + tick * TICK + MS
            step = arrival + int(late_ms * MS)
            stats.update([], [state(1, used.index(tick), step, of_hand(tick, arrival))])
    return summary_of(stats, 1)


def test_a_perfect_flight_counts_every_sample_and_step() -> None:
    result = fly_drone_1(list(range(100)), sent=100)
    assert (result.steps, result.missed) == (100, 0)
    assert result.hand_used == 1.0
    assert result.on_time == 1.0
    assert result.rate_hz == pytest.approx(1e3 / 16)
    assert result.lateness_ms.p50 == pytest.approx(1.0, rel=0.02)
    assert result.latency_ms.p50 == pytest.approx(2.0, rel=0.02)


def test_overtaken_samples_lower_hand_used_and_do_not_count_for_latency() -> None:
    used = [tick for tick in range(100) if tick % 10 != 5]
    result = fly_drone_1(used, sent=100)
    assert result.hand_used == pytest.approx(0.9)
    assert result.latency_ms.p99 == pytest.approx(2.0, rel=0.02)


def test_samples_before_the_first_that_was_heard_do_not_count() -> None:
    assert fly_drone_1(list(range(40, 100)), sent=100).hand_used == 1.0


def test_a_deaf_agent_that_keeps_stepping_loses_hand_used_and_punctuality() -> None:
    stats = FlightStats(RHOMBUS)
    for tick in range(100):
        at = T0 + tick * TICK + MS
        heard = of_hand(min(tick, 49), T0 + min(tick, 49) * TICK)
        stats.update([hand(tick)], [state(1, tick, at, heard)])
    result = summary_of(stats, 1)
    assert result.hand_used == pytest.approx(0.5)
    assert result.on_time == pytest.approx(0.5)


def test_a_late_step_is_not_on_time() -> None:
    assert fly_drone_1(list(range(10)), sent=10, late_ms=3.9).on_time == 1.0
    result = fly_drone_1(list(range(10)), sent=10, late_ms=4.1)
    assert result.on_time == 0.0
    assert result.lateness_ms.p99 == pytest.approx(4.1, rel=0.02)


def test_punctuality_is_judged_by_the_last_input_that_the_step_needed() -> None:
    stats = FlightStats(RHOMBUS)
    early, late = of_hand(0, T0), of_drone(1, 0, T0 + 8 * MS)
    neighbour = of_drone(3, 0, T0 + 20 * MS)  # avoided, not referred to: nothing waits for it
    stats.update([hand(0)], [state(2, 0, T0 + 9 * MS, {**early, **late, **neighbour})])
    result = summary_of(stats, 2)
    assert result.on_time == 1.0
    assert result.lateness_ms.p50 == pytest.approx(1.0, rel=0.02)


def test_states_that_the_observer_missed_are_counted_by_sequence_number() -> None:
    stats = FlightStats(RHOMBUS)
    for tick in (0, 1, 2, 5, 6, 9):
        stats.update([hand(tick)], [state(1, tick, T0 + tick * TICK, of_hand(tick, T0 + tick * TICK))])
    result = summary_of(stats, 1)
    assert (result.steps, result.missed) == (10, 4)
    assert result.rate_hz == pytest.approx(1e3 / 16)


def test_late_and_repeated_states_are_ignored() -> None:
    stats = FlightStats(RHOMBUS)
    stats.update([hand(0)], [state(1, 5, T0 + MS, of_hand(0, T0))])
    stats.update([], [state(1, 5, T0 + MS, of_hand(0, T0)), state(1, 4, T0, of_hand(0, T0))])
    assert summary_of(stats, 1).steps == 1


def test_a_restarted_agent_is_not_charged_for_its_absence() -> None:
    stats = FlightStats(RHOMBUS)
    for tick in range(100):
        states = []
        if not 40 <= tick < 60:
            epoch, first = (1, 0) if tick < 40 else (2, 60)
            at = T0 + tick * TICK + MS
            states = [state(1, tick - first, at, of_hand(tick, at), epoch=epoch)]
        stats.update([hand(tick)], states)
    result = summary_of(stats, 1)
    assert (result.steps, result.missed) == (80, 0)
    assert result.hand_used == 1.0
    assert result.rate_hz == pytest.approx(1e3 / 16)


def test_a_restarted_relay_continues_the_count() -> None:
    stats = FlightStats(RHOMBUS)
    sequence = [(1, seq) for seq in range(50)] + [(2, seq) for seq in range(50)]
    for tick, (epoch, seq) in enumerate(sequence):
        at = T0 + tick * TICK
        heard = of_hand(seq, at + MS, epoch=epoch)
        stats.update([hand(seq, epoch=epoch, stamp=at)], [state(1, tick, at + 2 * MS, heard)])
    result = summary_of(stats, 1)
    assert result.hand_used == 1.0
    assert result.latency_ms.p99 == pytest.approx(2.0, rel=0.02)


def rhombus_step(tick: int, *, through: str = "23") -> list[DroneState]:
    """One sample through the swarm, 2 ms per hop; drone 4 hears the new states of the drones in `through`."""
    at = T0 + tick * TICK
    direct = of_hand(tick, at + MS)
    one = state(1, tick, at + 2 * MS, direct)
    others = [state(d, tick, at + 4 * MS, {**direct, **of_drone(1, tick, at + 3 * MS)}) for d in (2, 3)]
    heard = dict(direct)
    for drone in (2, 3):
        fresh = str(drone) in through
        heard |= of_drone(drone, tick if fresh else 0, at + 5 * MS if fresh else T0)
    return [one, *others, state(4, tick, at + 6 * MS, heard)]


def test_latency_is_measured_through_every_hop_of_the_reference_path() -> None:
    stats = FlightStats(RHOMBUS)
    for tick in range(50):
        stats.update([hand(tick)], rhombus_step(tick))
    for drone, expected in ((1, 2.0), (2, 4.0), (3, 4.0), (4, 6.0)):
        latency = summary_of(stats, drone).latency_ms
        assert latency.p50 == pytest.approx(expected, rel=0.02)
        assert latency.p99 == pytest.approx(expected, rel=0.02)
        assert stats.latency_ms(drone) == pytest.approx(expected)


def test_one_of_two_reference_paths_is_enough() -> None:
    stats = FlightStats(RHOMBUS)
    for tick in range(50):
        stats.update([hand(tick)], rhombus_step(tick, through="3"))
    assert summary_of(stats, 4).latency_ms.p50 == pytest.approx(6.0, rel=0.02)


def test_a_hand_heard_directly_does_not_shorten_the_reference_path() -> None:
    stats = FlightStats(RHOMBUS)
    for tick in range(50):
        stats.update([hand(tick)], rhombus_step(tick, through=""))
    assert summary_of(stats, 4).hand_used == 1.0
    # Only the first sample ever came through: drone 4 keeps hearing the first states of 2 and 3.
    assert stats.latency_ms(4) == pytest.approx(6.0)
    assert summary_of(stats, 4).latency_ms.p99 == pytest.approx(6.0, rel=0.02)
    newest = summary_of(stats, 2).latency_ms
    assert newest.p50 == pytest.approx(4.0, rel=0.02)


def test_the_order_of_arrival_at_the_observer_does_not_matter() -> None:
    stats = FlightStats(RHOMBUS)
    for tick in range(50):
        stats.update([hand(tick)], rhombus_step(tick)[::-1])
    assert summary_of(stats, 4).latency_ms.p50 == pytest.approx(6.0, rel=0.02)


def test_a_path_through_a_restarted_drone_counts_again() -> None:
    stats = FlightStats(RHOMBUS)
    stats.update([hand(0)], rhombus_step(0))
    at = T0 + TICK
    direct = of_hand(1, at + MS)
    one = state(1, 0, at + 2 * MS, direct, epoch=9)
    two = state(2, 1, at + 4 * MS, {**direct, **of_drone(1, 0, at + 3 * MS, epoch=9)})
    stats.update([hand(1)], [one, two])
    assert stats.latency_ms(2) == pytest.approx(4.0)


def test_memory_is_bounded() -> None:
    stats = FlightStats(RHOMBUS)
    for tick in range(3 * KEPT):
        at = T0 + tick * TICK
        stats.update([hand(tick)], [state(1, tick, at, of_hand(tick, at))])
    assert len(stats._agents[1]._through) <= 1024
    assert len(stats._hands._stamps) <= 2 * KEPT
    assert summary_of(stats, 1).hand_used == 1.0


def test_tracking_is_the_distance_to_the_goal_in_follow_only() -> None:
    stats = FlightStats(RHOMBUS)
    heard = of_hand(0, T0)
    stats.update([hand(0)], [])
    assert summary_of(stats, 1).tracking_rms_m is None
    stats.update([], [state(1, 0, T0, heard, mode=Mode.TAKEOFF, position=(9.0, 0.0, 0.0))])
    stats.update([], [state(1, 1, T0 + 1, heard, position=(0.3, 0.0, 0.0))])
    stats.update([], [state(1, 2, T0 + 2, heard, goal=(0.0, 0.4, 0.0))])
    assert summary_of(stats, 1).tracking_rms_m == pytest.approx(math.sqrt((0.09 + 0.16) / 2))


def test_the_formation_is_measured_while_all_fly() -> None:
    stats = FlightStats(RHOMBUS)
    corners: list[Vector] = [(0.0, 0.0, 1.0), (-0.5, 0.5, 1.0), (-0.5, -0.5, 1.0), (-1.0, 0.0, 1.0)]

    def step(seq: int, scale: float, mode: Mode) -> None:
        stats.update(
            [],
            [
                state(d, seq, T0 + seq, of_hand(0, T0), mode=mode, position=(scale * x, scale * y, z))
                for d, (x, y, z) in enumerate(corners, start=1)
            ],
        )

    step(0, 5.0, Mode.TAKEOFF)
    assert stats.formation().area_m2 is None
    step(1, 1.0, Mode.FOLLOW)
    step(2, 2.0, Mode.FOLLOW)
    area = stats.formation().area_m2
    assert area is not None
    assert (area.min, area.max, area.mean) == pytest.approx((0.5, 2.0, 1.25))
    assert set(stats.formation().distances_m) == {"1-2", "1-3", "2-4", "3-4"}
    assert stats.formation().distances_m["1-2"].max == pytest.approx(math.sqrt(2.0))


def test_unknown_drones_are_ignored() -> None:
    stats = FlightStats(RHOMBUS)
    stats.update([hand(0)], [state(99, 0, T0, of_hand(0, T0))])
    assert 99 not in stats.latest


def test_a_hand_log_finds_samples_by_what_was_sent() -> None:
    log = HandLog()
    for seq in (0, 1, 4):
        log.add(hand(seq))
    assert log.number(Heard(1, 3, 0)) == 3
    assert log.number(Heard(7, 0, 0)) is None
    assert log.stamp_ns(4) == T0 + 4 * TICK
    assert log.stamp_ns(3) is None
    assert log.sent_by(T0 - 1) is None
    assert log.sent_by(T0 + 2 * TICK) == 1


def test_a_hand_log_goes_on_behind_a_number_out_of_the_future() -> None:
    log = HandLog()
    for seq in (2**64 - 1, 3, 4, 4, 2):
        log.add(hand(seq))
    assert log.stamp_ns(2**64) == T0 + 3 * TICK
    assert log.number(Heard(1, 4, 0)) == 2**64 + 1
    assert log.stamp_ns(2**64 + 1) == T0 + 4 * TICK


@given(st.lists(st.floats(1e-2, 1e4), min_size=1, max_size=200), st.floats(0.01, 1.0))
def test_quantiles_are_within_a_bin_of_the_exact_ones(values: list[float], fraction: float) -> None:
    histogram = Histogram()
    for value in values:
        histogram.add(value)
    exact = sorted(values)[math.ceil(fraction * len(values)) - 1]
    assert histogram.quantile(fraction) == pytest.approx(exact, rel=0.013)


def test_quantiles_of_nothing_are_none_and_extremes_stay_inside() -> None:
    histogram = Histogram()
    assert histogram.quantiles() == (None, None)
    for value in (-1.0, 0.0, 1e9):
        histogram.add(value)
    assert histogram.quantile(1.0) == pytest.approx(1e5, rel=0.02)


@given(st.lists(st.tuples(st.floats(-10, 10), st.floats(-10, 10)), max_size=12), st.floats(-5, 5))
def test_hull_area_is_positive_and_does_not_depend_on_order_or_place(
    points: list[tuple[float, float]], shift: float
) -> None:
    area = hull_area(points)
    assert area >= 0.0
    assert hull_area(points[::-1]) == pytest.approx(area)
    assert hull_area([(x + shift, y - shift) for x, y in points]) == pytest.approx(area, abs=1e-9)
    assert hull_area([*points, *points[:1]]) == area


def test_hull_area_of_known_shapes() -> None:
    assert hull_area([(0, 0), (1, 0), (1, 1), (0, 1), (0.5, 0.5)]) == pytest.approx(1.0)
    assert hull_area([(0, 0), (1, 1), (2, 2)]) == 0.0
    assert hull_area([]) == 0.0
