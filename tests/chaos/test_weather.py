"""The emulated link does what its weather says: bytes unchanged, and chance as ordered."""

import itertools

from hypothesis import given
from hypothesis import strategies as st

from tests.chaos.emulator import destination
from tests.chaos.weather import Line, Weather

N = 20_000
PERIOD = 0.001
WEATHERS = st.builds(
    Weather,
    delay=st.floats(0.05, 0.2),
    jitter=st.floats(0.0, 0.05),
    loss=st.floats(0.0, 0.5),
    duplicate=st.floats(0.0, 0.5),
    overtaking=st.booleans(),
)


def flown(weather: Weather, count: int) -> list[tuple[float, int]]:
    """Sends numbered packets, one per millisecond; returns (arrival, number), looked at every 0.1 ms."""
    line = Line()
    line.weather = weather
    seen: list[tuple[float, int]] = []
    for number in range(count):
        line.send(number.to_bytes(4), number * PERIOD)
    while (due := line.next_due) is not None:
        seen += ((due, int.from_bytes(packet)) for packet in line.arrivals(due))
    return seen


@given(WEATHERS)
def test_every_packet_arrives_in_its_time_and_none_is_invented(weather: Weather) -> None:
    seen = flown(weather, 200)
    for arrival, number in seen:
        delay = arrival - number * PERIOD
        assert delay >= weather.delay - weather.jitter - 1e-9
        if weather.overtaking:
            assert delay <= weather.delay + weather.jitter + 1e-9
    numbers = [number for _, number in seen]
    assert set(numbers) <= set(range(200))
    assert max((numbers.count(number) for number in set(numbers)), default=0) <= 2
    if not weather.overtaking:
        assert numbers == sorted(numbers)
    assert [arrival for arrival, _ in seen] == sorted(arrival for arrival, _ in seen)


def test_fair_weather_changes_nothing() -> None:
    assert flown(Weather(), 100) == [(number * PERIOD, number) for number in range(100)]


def test_chance_is_as_ordered() -> None:
    seen = flown(Weather(delay=0.05, jitter=0.02, loss=0.2, duplicate=0.1), N)
    numbers = [number for _, number in seen]
    arrived = set(numbers)
    assert abs(len(arrived) / N - 0.8) < 0.02
    assert abs(len(numbers) / len(arrived) - 1.1) < 0.02
    delays = [arrival - number * PERIOD for arrival, number in seen]
    assert abs(sum(delays) / len(delays) - 0.05) < 0.001
    assert sum(a > b for a, b in itertools.pairwise(numbers)) > N / 10, "a jitter of 20 periods reorders"


def test_only_ipv4_has_a_destination() -> None:
    packet = bytes([0x45, *bytes(11), 10, 77, 0, 10, 10, 77, 0, 11])
    assert destination(packet) == "10.77.0.11"
    assert destination(packet[:19]) is None
    assert destination(bytes([0x60, *bytes(39)])) is None
