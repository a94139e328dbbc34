"""One hand sample through a swarm whose delays, losses and stalls are known."""

import json
import random
from itertools import pairwise
from xml.etree import ElementTree

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from deploy.trace.path import path_table, remarks
from observer.path.diagram import draw_diagram
from observer.path.flight import RecordedFlight
from observer.path.follow import Excess, follow, most_unusual, typical
from observer.path.hop import GLOVE_NODE, Cause, HandPath, Part
from observer.path.perfetto import chrome_trace
from shared.errors import ConfigError
from shared.messages import DroneState, HandSample, Message
from tests.synthetic_swarm import (
    FALLBACK,
    MS,
    RHOMBUS,
    TICK,
    Compute,
    Delay,
    fly,
    pattern,
    usual_compute,
    usual_delay,
)

TICKS = 60
HIT = 30
"""The sample that something happens to."""


def unusual(delay: Delay = usual_delay, compute: Compute = usual_compute) -> tuple[HandPath, Excess]:
    flight = RecordedFlight(RHOMBUS, fly(TICKS, delay, compute))
    path = follow(flight, HIT)
    excess = most_unusual(path, typical(flight))
    assert excess is not None
    return path, excess


def held_up(sender: str, listener: int, took: int | None) -> Delay:
    """One message on one link takes longer, or is lost; drones number their states as the hand its samples."""

    def delay(a: str, b: int, seq: int) -> int | None:
        return took if (a, b, seq) == (sender, listener, HIT) else usual_delay(a, b, seq)

    return delay


def check_sums(path: HandPath) -> None:
    for node in path.effects:
        way = path.way(node)
        assert way
        assert sum(sum(hop.parts_ns.values()) for hop in way) == path.latency_ns(node)
        for hop, following in pairwise(way):
            assert (hop.done_ns, hop.listener) == (following.sent_ns, following.sender)


def test_without_faults_every_hop_is_half_a_millisecond_and_every_step_one() -> None:
    flight = RecordedFlight(RHOMBUS, fly(TICKS))
    path = follow(flight, HIT)
    assert {node: path.latency_ns(node) for node in path.effects} == {
        "drone 1": 3 * MS // 2,
        "drone 2": 3 * MS,
        "drone 3": 3 * MS,
        "drone 4": 9 * MS // 2,
    }
    assert [hop.sender for hop in path.way("drone 4")][0:2] == ["hand", "drone 1"]
    assert path.way("drone 1")[0].parts_ns == {
        Part.MISSED: 0,
        Part.TRANSPORT: MS // 2,
        Part.WAITING: 0,
        Part.COMPUTE: MS,
    }
    check_sums(path)


def test_fan_in_names_every_input_that_carried_the_sample() -> None:
    path = follow(RecordedFlight(RHOMBUS, fly(TICKS)), HIT)
    inputs = path.effects["drone 4"].inputs
    assert {hop.sender for hop in inputs} == {"drone 2", "drone 3", "hand"}
    assert {hop.sender for hop in inputs if hop.on_path} == {"drone 2", "drone 3"}
    assert inputs[0].on_path
    assert not path.effects["drone 4"].lacked


@pytest.mark.parametrize(
    ("sender", "listener"), [("hand", 1), ("drone 1", 2), ("drone 1", 3), ("drone 3", 4), ("hand", 2)]
)
def test_a_delay_is_the_transport_of_its_hop(sender: str, listener: int) -> None:
    path, (hop, part, excess_ns) = unusual(held_up(sender, listener, 6 * MS))
    assert (hop.sender, hop.listener, part) == (sender, f"drone {listener}", Part.TRANSPORT)
    assert excess_ns == pytest.approx(5.5 * MS)
    check_sums(path)


@pytest.mark.parametrize(("sender", "listener"), [("hand", 1), ("drone 1", 2), ("drone 1", 3)])
def test_a_loss_is_missed_on_its_link(sender: str, listener: int) -> None:
    path, (hop, part, _) = unusual(held_up(sender, listener, None))
    assert (hop.sender, hop.listener, part) == (sender, f"drone {listener}", Part.MISSED)
    assert (hop.skipped, hop.cause) == (1, Cause.LINK)
    assert path.effects[f"drone {listener}"].number > HIT
    check_sums(path)


def test_a_loss_at_the_fan_in_leaves_the_other_way() -> None:
    path = follow(RecordedFlight(RHOMBUS, fly(TICKS, held_up("drone 3", 4, None))), HIT)
    assert path.way("drone 4")[-1].sender == "drone 2"
    assert path.effects["drone 4"].lacked == ("drone 3",)
    # It waited for drone 3 until the fallback.
    assert path.way("drone 4")[-1].parts_ns[Part.WAITING] == FALLBACK - TICK
    check_sums(path)


def test_a_slow_step_is_the_computing_of_its_drone() -> None:
    def slow(drone: int, tick: int) -> int:
        return 5 * MS if (drone, tick) == (3, HIT) else MS

    path, (hop, part, excess_ns) = unusual(compute=slow)
    assert (hop.listener, part) == ("drone 3", Part.COMPUTE)
    assert excess_ns == pytest.approx(4 * MS)
    assert [hop.listener for hop in path.way("drone 4")] == ["drone 1", "drone 3", "drone 4"]
    check_sums(path)


def test_what_a_stalled_drone_misses_is_its_own_doing() -> None:
    def stalled(drone: int, tick: int) -> int:
        return 60 * MS if (drone, tick) == (2, HIT - 1) else MS

    path, (hop, part, _) = unusual(compute=stalled)
    assert (hop.sender, hop.listener, part) == ("drone 1", "drone 2", Part.MISSED)
    assert hop.cause is Cause.LISTENER
    assert hop.skipped >= 2
    check_sums(path)


def test_a_step_on_old_inputs_after_a_stall_does_not_blame_the_link() -> None:
    """A stopped process runs again before its messages are delivered."""
    begin, end = HIT - 2, HIT + 3

    def late(a: str, b: int, seq: int) -> int | None:
        if b != 2 or not begin < seq < end:
            return usual_delay(a, b, seq)
        return (end - seq) * TICK + FALLBACK

    def stopped(drone: int, tick: int) -> int:
        return 6 * TICK if (drone, tick) == (2, begin) else MS

    path, (hop, _, _) = unusual(late, stopped)
    assert hop.listener == "drone 2"
    missed = path.effects["drone 2"].inputs[0]
    assert missed.skipped
    assert missed.cause is Cause.LISTENER
    check_sums(path)


def test_the_first_step_with_the_hands_velocity_may_come_before_the_reference() -> None:
    path = follow(RecordedFlight(RHOMBUS, fly(TICKS, held_up("drone 1", 2, None))), HIT)
    effect = path.effects["drone 2"]
    assert effect.directly_ns < effect.done_ns


def test_a_pattern_is_an_effect_of_the_state_that_brought_it_about() -> None:
    messages = fly(TICKS)
    cause = next(m for m in messages if isinstance(m, DroneState) and (m.id, m.seq) == (4, HIT))
    messages += pattern("CR", cause, started_ns=cause.stamp_ns + 5 * MS, arrival_ns=cause.stamp_ns + MS)
    path = follow(RecordedFlight(RHOMBUS, messages), HIT)
    glove = path.effects[GLOVE_NODE]
    assert (glove.pattern, path.latency_ns(GLOVE_NODE)) == ("CR", 19 * MS // 2)
    assert [hop.listener for hop in path.way(GLOVE_NODE)][-2:] == ["drone 4", "glove"]
    assert glove.inputs[0].parts_ns == {
        Part.MISSED: 0,
        Part.TRANSPORT: MS,
        Part.WAITING: 2 * MS,
        Part.COMPUTE: 2 * MS,
    }
    check_sums(path)
    later = follow(RecordedFlight(RHOMBUS, messages), HIT + 1)
    assert GLOVE_NODE not in later.effects


def test_a_pattern_that_comes_later_says_why() -> None:
    messages = fly(TICKS)
    cause = next(m for m in messages if isinstance(m, DroneState) and (m.id, m.seq) == (4, HIT))
    messages += pattern("CR", cause, started_ns=cause.stamp_ns + 5 * MS, arrival_ns=cause.stamp_ns + MS)
    path = follow(RecordedFlight(RHOMBUS, messages), HIT - 10)
    hop = path.effects[GLOVE_NODE].inputs[0]
    assert (hop.skipped, hop.cause) == (10, Cause.PATTERN)
    assert hop.parts_ns[Part.MISSED] == 10 * TICK
    check_sums(path)


def test_numbers_count_on_across_a_restart_of_the_relay() -> None:
    def again(message: Message) -> Message:
        later = replace(message, epoch=2, stamp_ns=message.stamp_ns + TICKS * TICK)
        if isinstance(later, DroneState):
            heard = {
                key: h._replace(epoch=2, arrival_ns=h.arrival_ns + TICKS * TICK)
                for key, h in later.heard.items()
            }
            return replace(later, step_ns=later.step_ns + TICKS * TICK, heard=heard)
        return later

    first = fly(TICKS)
    path = follow(RecordedFlight(RHOMBUS, [*first, *map(again, first)]), TICKS + HIT)
    assert (path.sample.epoch, path.sample.seq) == (2, HIT)
    assert path.latency_ns("drone 4") == 9 * MS // 2


def test_what_the_trace_lacks_is_said_and_not_made_up() -> None:
    messages = [m for m in fly(TICKS) if not (isinstance(m, DroneState) and m.id == 1)]
    path = follow(RecordedFlight(RHOMBUS, messages), HIT)
    assert path.effects == {}
    with pytest.raises(ConfigError, match="hand sample 99 is not in this trace; it holds 0 to 59"):
        follow(RecordedFlight(RHOMBUS, messages), 99)
    hands = [m for m in messages if not isinstance(m, HandSample)]
    with pytest.raises(ConfigError, match="it holds no hand"):
        follow(RecordedFlight(RHOMBUS, hands), 0)


@settings(max_examples=30)
@given(st.integers(0, 2**32))
def test_whatever_happens_the_hops_add_up(seed: int) -> None:
    rng = random.Random(seed)

    def delay(_sender: str, _listener: int, _seq: int) -> int | None:
        return None if rng.random() < 0.1 else rng.randrange(30 * MS)

    flight = RecordedFlight(RHOMBUS, fly(12, delay, lambda _drone, _tick: rng.randrange(20 * MS)))
    for number in flight.hands:
        path = follow(flight, number)
        check_sums(path)
        assert all(effect.number >= number for effect in path.effects.values())
        for effect in path.effects.values():
            assert effect.directly_ns <= effect.done_ns


def faulty() -> HandPath:
    messages = fly(TICKS, held_up("drone 1", 2, None))
    cause = next(m for m in messages if isinstance(m, DroneState) and (m.id, m.seq) == (4, HIT))
    messages += pattern("C<R", cause, started_ns=cause.stamp_ns + 40 * MS, arrival_ns=cause.stamp_ns + MS)
    return follow(RecordedFlight(RHOMBUS, messages), HIT)


def test_the_chrome_trace_joins_steps_by_arrows() -> None:
    path = faulty()
    events = json.loads(json.dumps(chrome_trace(path)))["traceEvents"]
    names = {e["pid"]: e["args"]["name"] for e in events if e["name"] == "process_name"}
    slices = [e for e in events if e["ph"] == "X"]
    begins = {e["id"]: e for e in events if e["ph"] == "s"}
    ends = {e["id"]: e for e in events if e["ph"] == "f"}
    hops = [hop for effect in path.effects.values() for hop in effect.inputs]
    assert begins.keys() == ends.keys()
    assert sorted((names[begins[i]["pid"]], names[ends[i]["pid"]]) for i in begins) == sorted(
        (hop.sender, hop.listener) for hop in hops
    )
    for event in (*begins.values(), *ends.values()):  # an arrow binds to the slice around its end
        assert any(
            (s["pid"], s["tid"]) == (event["pid"], event["tid"])
            and s["ts"] <= event["ts"] <= s["ts"] + s["dur"]
            for s in slices
        )
    step = next(s for s in slices if names[s["pid"]] == "drone 1" and s["cat"] == "compute")
    assert (step["ts"], step["dur"]) == (500.0, 1000.0)
    assert [s["name"] for s in slices if s["cat"] == "missed"] == [
        "drone 1 to drone 2, 1 missed: lost or late on the link",
        "hand to drone 2, 1 missed: an earlier step had used it",
    ]


def test_the_diagram_has_a_line_per_node_and_a_slope_per_hop() -> None:
    path = faulty()
    root = ElementTree.fromstring(draw_diagram(path))  # noqa: S314  our own text
    texts = [element.text or "" for element in root.iter() if element.tag.endswith("text")]
    for node in ("hand", *path.effects):
        assert node in texts
    titles = [element.text or "" for element in root.iter() if element.tag.endswith("title")]
    assert sum(" to " in title for title in titles) == sum(len(e.inputs) for e in path.effects.values())
    assert any("C<R" in text for text in texts)
    width = float(root.attrib["width"])
    rows = [element for element in root.iter() if element.tag.endswith("rect") and "x" in element.attrib]
    assert all(0 <= float(r.attrib["x"]) + float(r.attrib["width"]) <= width for r in rows)


def test_the_table_and_its_remarks_say_what_happened() -> None:
    flight = RecordedFlight(RHOMBUS, fly(TICKS, held_up("drone 1", 2, None)))
    path, usual = follow(flight, HIT), typical(flight)
    assert path_table(path, usual).row_count == sum(len(e.inputs) for e in path.effects.values())
    said = remarks(path, most_unusual(path, usual))
    assert "drone 1 -> drone 2: 1 message went by: lost or late on the link" in said
    assert f"drone 2: sample {HIT + 1} came through first" in said
    assert "glove: no pattern began within a second" in said
    assert any(line.startswith("most unusual: missed drone 1 -> drone 2") for line in said)
