"""The inbox between a bus thread and the loop."""

import itertools
import threading
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shared.transport import MOST_KEYS, PENDING_PER_KEY, Arrival, Inbox

DEADLINE_S = 10.0


def ticking() -> Inbox:
    """An inbox whose clock counts the arrivals."""
    return Inbox(itertools.count(100).__next__)


def test_samples_come_per_key_in_order_with_their_arrival() -> None:
    inbox = ticking()
    for key, payload in (("a", b"1"), ("b", b"2"), ("a", b"3")):
        inbox.put(key, payload)
    assert inbox.take() == {"a": [Arrival(b"1", 100), Arrival(b"3", 102)], "b": [Arrival(b"2", 101)]}
    assert inbox.take() == {}
    assert inbox.dropped == 0


def test_a_full_key_drops_its_oldest_and_counts_them() -> None:
    inbox = Inbox(lambda: 0)
    for number in range(PENDING_PER_KEY + 3):
        inbox.put("a", bytes([number]))
    inbox.put("b", b"x")
    taken = inbox.take()
    assert [arrival.payload[0] for arrival in taken["a"]] == list(range(3, PENDING_PER_KEY + 3))
    assert taken["b"] == [Arrival(b"x", 0)]
    assert inbox.dropped == 3


def test_made_up_keys_do_not_fill_the_memory() -> None:
    inbox = Inbox(lambda: 0)
    for number in range(MOST_KEYS + 10):
        inbox.put(f"status/x/{number}", b"")
    assert len(inbox.take()) == MOST_KEYS
    assert inbox.dropped == 10
    inbox.put("a", b"x")
    assert inbox.take() == {"a": [Arrival(b"x", 0)]}


@given(depth=st.integers(1, 5), keys=st.lists(st.sampled_from("abc"), max_size=30))
def test_the_newest_of_every_key_are_kept(depth: int, keys: list[str]) -> None:
    inbox = Inbox(lambda: 0, depth)
    for number, key in enumerate(keys):
        inbox.put(key, bytes([number]))
    expected = {
        key: [number for number, other in enumerate(keys) if other == key][-depth:] for key in set(keys)
    }
    assert {key: [a.payload[0] for a in arrivals] for key, arrivals in inbox.take().items()} == expected
    assert inbox.dropped == len(keys) - sum(map(len, expected.values()))


def test_waiting_ends_when_something_is_there() -> None:
    inbox = ticking()
    assert not inbox.wait(0.0)
    assert not inbox.wait(-1.0)
    inbox.put("a", b"1")
    assert inbox.wait(DEADLINE_S)
    inbox.take()
    assert not inbox.wait(0.0)


@pytest.mark.parametrize("wake", ["put", "wake"])
def test_another_thread_ends_a_wait(wake: str) -> None:
    inbox = ticking()
    waiting, woken = threading.Event(), threading.Event()

    def loop() -> None:
        waiting.set()
        if inbox.wait(DEADLINE_S):
            woken.set()

    thread = threading.Thread(target=loop)
    thread.start()
    assert waiting.wait(DEADLINE_S)
    inbox.put("a", b"1") if wake == "put" else inbox.wake()
    assert woken.wait(DEADLINE_S)
    thread.join()


def test_nothing_is_lost_between_threads() -> None:
    inbox = Inbox(lambda: 0, depth=10_000)
    payloads = [number.to_bytes(2, "big") for number in range(2_000)]

    def write(key: str) -> None:
        for payload in payloads:
            inbox.put(key, payload)

    writers = [threading.Thread(target=write, args=(key,)) for key in ("a", "b")]
    for writer in writers:
        writer.start()
    seen: dict[str, list[bytes]] = {"a": [], "b": []}
    while any(len(taken) < len(payloads) for taken in seen.values()):
        assert inbox.wait(DEADLINE_S)
        for key, arrivals in inbox.take().items():
            seen[key] += [arrival.payload for arrival in arrivals]
    for writer in writers:
        writer.join()
    assert seen == {"a": payloads, "b": payloads}
    assert inbox.dropped == 0


def test_an_arrival_during_a_take_is_not_forgotten() -> None:
    """The take must not clear the wake-up of what it does not return."""

    def clock() -> Iterator[int]:
        yield 0
        # The second sample is stamped while the loop takes the first.
        taken.append(inbox.take())
        yield 1

    taken: list[dict[str, list[Arrival]]] = []
    inbox = Inbox(clock().__next__)
    inbox.put("a", b"1")
    inbox.put("a", b"2")
    assert taken == [{"a": [Arrival(b"1", 0)]}]
    assert inbox.wait(0.0)
    assert inbox.take() == {"a": [Arrival(b"2", 1)]}


def test_only_what_is_expected_is_news_once_all_of_it_is_there() -> None:
    inbox, news = Inbox(lambda: 0), []
    inbox.answer = lambda: news.append(set(inbox.take()))
    inbox.expect(["a", "b"])
    for key in ("a", "c", "a"):
        inbox.put(key, b"")
    assert news == []
    inbox.put("b", b"")
    assert news == [{"a", "b", "c"}]
    for key in ("a", "b", "c"):
        inbox.put(key, b"")
    assert len(news) == 1, "what was expected has come: nothing is until the next time"
    inbox.expect(["a", "b"])
    assert news[1:] == [{"a", "b", "c"}], "what is there already counts"


def test_who_expects_nothing_gets_no_news() -> None:
    inbox = Inbox(lambda: 0)
    inbox.expect([])
    inbox.put("a", b"")
    assert not inbox.wait(0.0)
    assert set(inbox.take()) == {"a"}
