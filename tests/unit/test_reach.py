"""How many are on time: the same question to agents and bare nodes, and a search that finds the answer."""

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from deploy.bench.hop import Token
from deploy.bench.reach import ON_TIME, Ladder, climb, of_agents, of_bare
from observer.agent_log import AgentSummary
from observer.histogram import Quantiles

HZ = 60.0
PERIOD_NS = 16_666_667
NOTHING = Quantiles(None, None)


@given(st.integers(1, 200), st.integers(0, 200), st.sets(st.integers(1, 200), max_size=5))
@example(96, 96, {4, 8, 16, 32})
@example(96, 0, set())
def test_the_ladder_finds_the_largest_that_passes_in_few_tries(
    largest: int, holds: int, tried: set[int]
) -> None:
    ladder = Ladder(largest)
    ladder.tried = {size: size <= holds for size in tried if size <= largest}
    known, sizes = len(ladder.tried), []
    while (size := ladder.next) is not None:
        assert 1 <= size <= largest
        sizes.append(size)
        ladder.tried[size] = size <= holds
    assert ladder.reached == min(holds, largest)
    assert len(set(sizes)) == len(sizes)
    assert len(ladder.tried) - known <= 2 * math.ceil(math.log2(largest + 1)) + 1


@given(st.integers(1, 100), st.lists(st.booleans(), min_size=20, max_size=20))
def test_a_noisy_answer_never_keeps_the_ladder_busy(largest: int, answers: list[bool]) -> None:
    ladder = Ladder(largest)
    for passed in answers:
        size = ladder.next
        if size is None:
            break
        assert size not in ladder.tried
        ladder.tried[size] = passed
    assert ladder.next is None
    assert ladder.tried.get(ladder.reached, True)


def test_kinds_take_turns() -> None:
    ladders = {"agents": Ladder(8), "bare": Ladder(8)}
    holds = {"agents": 3, "bare": 5}
    order = []

    def probe(kind: str, size: int) -> None:
        order.append((kind, size))
        ladders[kind].tried[size] = size <= holds[kind]

    climb(ladders, probe)
    assert {kind: ladder.reached for kind, ladder in ladders.items()} == holds
    assert order[:4] == [("agents", 1), ("bare", 1), ("agents", 2), ("bare", 2)]


def answers(numbers: list[int], late_ns: int = 0) -> list[Token]:
    """What a node sends that answers these samples of the hand and no others."""
    return [
        Token(1, number, number * PERIOD_NS, number * PERIOD_NS, number * PERIOD_NS + late_ns, seq)
        for seq, number in enumerate(numbers, 1)
    ]


def test_bare_nodes_that_answer_every_sample_at_once_keep_up() -> None:
    punctuality = of_bare([answers(list(range(1, 601)))] * 3, HZ)
    assert (punctuality.on_time, punctuality.used) == (1.0, 1.0)
    assert punctuality.rate == pytest.approx(1.0, rel=1e-6)
    assert punctuality.keeps_up


def test_what_the_listener_lost_is_not_the_nodes_fault() -> None:
    heard = answers(list(range(1, 601)))
    assert of_bare([[*heard[:100], *heard[300:]]], HZ).keeps_up


@pytest.mark.parametrize(
    "heard",
    [
        [answers(list(range(1, 601)), late_ns=4_000_001)],
        [answers([n for n in range(1, 601) if n % 50])],
        [answers(list(range(1, 601)))] * 9 + [[]],
        [[]],
        [],
    ],
    ids=["late", "skips", "one silent", "silent", "nobody"],
)
def test_bare_nodes_that_are_late_skip_samples_or_are_silent_do_not(heard: list[list[Token]]) -> None:
    assert not of_bare(heard, HZ).keeps_up


def summary(
    steps: int = 600, missed: int = 0, on_time: float = 1.0, used: float = 1.0, hz: float = HZ
) -> AgentSummary:
    return AgentSummary(
        id=1,
        steps=steps,
        missed=missed,
        rate_hz=hz,
        on_time=on_time,
        hand_used=used,
        lateness_ms=NOTHING,
        tracking_rms_m=None,
        latency_ms=NOTHING,
    )


def test_agents_count_by_the_steps_that_were_heard() -> None:
    assert of_agents([summary(), summary(steps=1200, missed=600, on_time=0.98)], HZ).on_time == 0.99
    assert of_agents([summary(), summary(on_time=2 * ON_TIME - 1.0)], HZ).keeps_up


@pytest.mark.parametrize("bad", [summary(on_time=0.97), summary(used=0.97), summary(hz=58.0)])
def test_agents_that_are_late_skip_samples_or_step_too_seldom_do_not_keep_up(bad: AgentSummary) -> None:
    assert not of_agents([summary(), bad], HZ).keeps_up
