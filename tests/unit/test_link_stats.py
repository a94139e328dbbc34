"""Rate, jitter and loss of links, judged by (epoch, seq)."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer.link_stats import MOST_LINKS, OTHER_KEYS, LinkStats, LinkSummary, SwarmLinks
from shared.messages import Heard
from shared.nodes import OBSERVER
from shared.topics import DRONE_STATE, HAND
from shared.transport import TOO_MANY
from tests.traces import hand, state

MS = 1_000_000
PERIOD = 16 * MS


def link(samples: list[tuple[int, int]], delay_ns: int = 0) -> LinkSummary:
    """Counts (epoch, seq) samples that arrive one per period, sent one per period and `seq`."""
    stats = LinkStats()
    for number, (epoch, seq) in enumerate(samples):
        stats.add(Heard(epoch, seq, number * PERIOD + delay_ns), seq * PERIOD)
    return stats.summary("human/hand", OBSERVER)


def test_a_perfect_link() -> None:
    row = link([(1, seq) for seq in range(100)], delay_ns=3 * MS)
    assert (row.messages, row.missing, row.late, row.jitter_ms) == (100, 0, 0, 0.0)
    assert row.rate_hz == pytest.approx(62.5)
    assert row.age_ms.p50 == pytest.approx(3.0, rel=0.02)
    assert row.last_ns == 99 * PERIOD + 3 * MS


def test_what_was_lost_counts_in_the_rate_of_the_publisher_and_not_in_the_jitter() -> None:
    row = link([(1, seq) for seq in range(100) if seq % 10])
    assert row.missing == 9  # nobody can know of number 0
    assert row.rate_hz == pytest.approx(62.5)
    assert row.jitter_ms == 0.0


def test_a_restarted_publisher_has_lost_nothing() -> None:
    row = link([(1, 5), (1, 6), (2, 0), (2, 1), (2, 3)])
    assert (row.messages, row.missing, row.late) == (5, 1, 0)


def test_what_comes_late_is_not_lost_and_what_comes_twice_is_late_only() -> None:
    assert (link([(1, 0), (1, 2), (1, 1)]).missing, link([(1, 0), (1, 2), (1, 1)]).late) == (0, 1)
    row = link([(1, 0), (1, 2), (1, 2), (1, 1), (1, 1), (1, 0)])
    assert (row.missing, row.late) == (0, 4)


@given(st.sets(st.integers(0, 250), min_size=1), st.randoms(use_true_random=False))
def test_loss_is_what_lies_between_the_first_and_the_newest_and_never_came(
    seqs: set[int], random: Random
) -> None:
    order = sorted(seqs)
    for place in range(len(order) - 1):  # the network swaps some neighbours
        if place and random.random() < 0.3:
            order[place], order[place + 1] = order[place + 1], order[place]
    row = link([(1, seq) for seq in order])
    assert row.missing == max(seqs) - order[0] + 1 - len(seqs)
    assert row.messages == len(seqs)


def test_a_number_out_of_the_future_is_refused_and_changes_nothing() -> None:
    swarm = SwarmLinks()
    for number, seq in enumerate((0, 1, 2**64 - 1, 2, 3)):
        swarm.add(HAND.key(), hand(seq), number * PERIOD)
    (row,) = swarm.rows()
    assert (row.messages, row.missing, row.late) == (4, 0, 0)
    assert swarm.rejected[HAND.key()] == {"ahead": 1}


def test_a_link_whose_first_number_was_out_of_the_future_is_counted_on_after_a_silence() -> None:
    swarm = SwarmLinks()
    for seq, at in ((2**64 - 1, 0), (10, PERIOD), (11, 200 * PERIOD), (12, 201 * PERIOD)):
        swarm.add(HAND.key(), hand(seq), at)
    (row,) = swarm.rows()
    assert (row.messages, row.missing, row.late) == (4, 0, 1)


def test_keys_that_are_made_up_have_one_row() -> None:
    swarm = SwarmLinks()
    for number in range(1000):
        swarm.reject(f"drone/x{number}/state", "unknown-key")
        heard = {f"made/up/{number}": Heard(1, 1, 1), HAND.key(): Heard(1, number, number * PERIOD)}
        swarm.add(DRONE_STATE.key(id=2), state(2, number, heard=heard), number * PERIOD)
    assert [(row.key, row.listener) for row in swarm.rows()] == [
        (DRONE_STATE.key(id=2), OBSERVER),
        (OTHER_KEYS, OBSERVER),
        (HAND.key(), "drone/2"),
    ]
    assert swarm.rejected[OTHER_KEYS] == {"unknown-key": 1000}


def test_invented_keys_and_listeners_do_not_fill_the_memory() -> None:
    swarm, key = SwarmLinks(), DRONE_STATE.key(id=1)
    for number in range(300):
        heard = {DRONE_STATE.key(id=1 + 100 * number + k): Heard(1, 1, 1) for k in range(100)}
        swarm.add(key, state(1, number, heard=heard), number * PERIOD)
        swarm.add(DRONE_STATE.key(id=2 + number), state(2 + number, 0), number * PERIOD)
    assert len(swarm.rows()) <= MOST_LINKS + 1
    assert swarm.rejected[OTHER_KEYS][TOO_MANY] > 100


def test_a_long_gap_costs_no_memory() -> None:
    stats = LinkStats()
    for seq in (0, 10**9):
        stats.add(Heard(1, seq, seq * PERIOD), seq * PERIOD)
    assert stats.summary("human/hand", OBSERVER).missing == 10**9 - 1
    assert len(stats._missing) <= 1024


def test_jitter_is_the_deviation_of_the_arrivals() -> None:
    stats = LinkStats()
    now = 0
    for seq in range(1000):
        now += PERIOD + (2 * MS if seq % 2 else -2 * MS)
        stats.add(Heard(1, seq, now), now)
    assert stats.summary("k", OBSERVER).jitter_ms == pytest.approx(2.0, rel=0.01)


def test_the_links_of_others_are_known_from_what_they_say_they_heard() -> None:
    swarm = SwarmLinks()
    for seq in range(60):
        sent = seq * PERIOD
        swarm.add(HAND.key(), hand(seq, stamp_ns=sent), sent + 5 * MS)
        used = seq - seq % 3  # two of three samples are overtaken
        heard = {HAND.key(): Heard(7, used, used * PERIOD + 1 * MS)}
        swarm.add(DRONE_STATE.key(id=1), state(1, seq, stamp_ns=sent + 2 * MS, heard=heard), sent + 5 * MS)
    rows = {(row.key, row.listener): row for row in swarm.rows()}
    assert list(rows) == [(HAND.key(), OBSERVER), ("drone/1/state", OBSERVER), (HAND.key(), "drone/1")]
    theirs = rows[HAND.key(), "drone/1"]
    assert (theirs.messages, theirs.missing, theirs.late) == (20, 38, 0)
    assert theirs.rate_hz == pytest.approx(62.5)
    assert theirs.age_ms.p50 == pytest.approx(1.0, rel=0.02)
    assert rows[HAND.key(), OBSERVER].missing == 0


def test_a_key_on_which_only_garbage_came_has_a_row() -> None:
    swarm = SwarmLinks()
    swarm.reject("drone/9/state", "malformed")
    (row,) = swarm.rows()
    assert (row.key, row.listener, row.messages, row.last_ns) == ("drone/9/state", OBSERVER, 0, 0)
    assert swarm.rejected["drone/9/state"] == {"malformed": 1}


def test_rows_are_in_the_order_of_people() -> None:
    swarm = SwarmLinks()
    for drone in (10, 2, 1):
        swarm.add(DRONE_STATE.key(id=drone), state(drone, 0), 0)
    swarm.add(HAND.key(), hand(0), 0)
    assert [row.key for row in swarm.rows()] == [HAND.key(), *(DRONE_STATE.key(id=i) for i in (1, 2, 10))]
