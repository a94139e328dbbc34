"""Traces: what is written comes back byte by byte, whole or damaged, and describes itself."""

import gzip
import json
from pathlib import Path

import jsonschema
import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC

from observer.trace.layout import trace_files
from observer.trace.order import Record
from observer.trace.read import open_trace
from observer.trace.schemas import json_schema
from observer.trace.write import MOST_KEYS, TraceWriter
from shared.codec import encode
from shared.errors import ConfigError
from shared.messages import DroneState, Message
from shared.topics import DRONE_STATE, HAND, TOPICS
from shared.transport import Arrival
from tests.strategies import MESSAGES, fields_of
from tests.traces import SCENARIO, START_NS, STEP_NS, flight, hand, state, write


def pairs(records: list[Record]) -> list[tuple[str, bytes]]:
    return [(record.key, record.payload) for record in records]


GARBAGE = [
    (HAND.key(), b""),
    (HAND.key(), b"\xc1" * 70_000),
    (HAND.key(), msgpack.packb({"v": 1, "seq": "x"})),
    (DRONE_STATE.key(id=2), encode(state(1, 5))),
    ("drone/x/state", encode(state(1, 5))),
    ("**", encode(hand(5))),
]


def test_what_is_written_comes_back_byte_by_byte_and_in_order(tmp_path: Path) -> None:
    sent = flight(90) + GARBAGE
    write(tmp_path, sent)
    trace = open_trace(tmp_path)
    records = list(trace.records())
    assert pairs(records) == sent
    assert [r.log_ns for r in records] == [START_NS + n * STEP_NS for n in range(len(sent))]
    assert (records[3].seq, records[3].publish_ns) == (1, START_NS + 10)
    assert [(r.seq, r.publish_ns - r.log_ns) for r in records[-6:]] == [(0, 0)] * 6
    assert (trace.scenario, trace.truncated, trace.faults) == (SCENARIO, False, [])
    assert {"swarmtouch", "eclipse-zenoh", "mcap"} < trace.metadata["versions"].keys()
    assert trace.metadata["host"]["name"]


def test_messages_leave_out_and_count_what_is_none(tmp_path: Path) -> None:
    write(tmp_path, flight(30) + GARBAGE)
    trace = open_trace(tmp_path)
    messages = [message for _, message in trace.messages()]
    assert len(messages) == 30
    assert messages[0] == hand(0)
    assert messages[-1] == state(2, 9)
    assert sum(trace.rejected.values()) == len(GARBAGE)
    assert trace.rejected[HAND.key(), "oversized"] == 1
    assert trace.rejected[DRONE_STATE.key(id=2), "wrong-id"] == 1


def test_a_publishers_count_is_kept_modulo_2_to_32(tmp_path: Path) -> None:
    write(tmp_path, [(HAND.key(), encode(hand(2**32 + 5)))])
    record = next(open_trace(tmp_path).records())
    assert record.seq == 5


@pytest.mark.parametrize("kept", [0.999, 0.7, 0.31])
def test_a_trace_that_was_cut_is_read_to_its_last_whole_chunk(tmp_path: Path, kept: float) -> None:
    sent = flight(300)
    path = write(tmp_path, sent)
    content = path.read_bytes()
    cut = int(len(content) * kept)
    path.write_bytes(content[:cut])
    trace = open_trace(path)
    assert trace.truncated
    records = pairs(list(trace.records()))
    assert records == sent[: len(records)]
    assert len(records) % 10 == 0
    assert len(records) >= 0.8 * kept * len(sent) - 10
    assert "no end" in trace.faults[0]


def test_every_cut_of_a_trace_is_survived(tmp_path: Path) -> None:
    sent = flight(30)
    path = write(tmp_path, sent)
    content = path.read_bytes()
    begin = content.index(b"cores") + 10
    for cut in range(begin, len(content), 7):
        path.write_bytes(content[:cut])
        trace = open_trace(path)
        records = pairs(list(trace.records()))
        assert records == sent[: len(records)]
        assert trace.truncated


def test_a_killed_recorder_leaves_what_it_had_flushed(tmp_path: Path) -> None:
    sent = flight(45)
    write(tmp_path, sent, every=10, close=False)
    trace = open_trace(tmp_path)
    assert pairs(list(trace.records())) == sent[:40]
    assert trace.truncated


def test_a_damaged_chunk_costs_only_itself(tmp_path: Path) -> None:
    sent = flight(300)
    path = write(tmp_path, sent)
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[12]
    content = bytearray(path.read_bytes())
    middle = chunk.chunk_start_offset + chunk.chunk_length // 2
    content[middle] ^= 0xFF
    path.write_bytes(content)
    trace = open_trace(path)
    assert pairs(list(trace.records())) == sent[:120] + sent[130:]
    assert (trace.truncated, trace.damaged) == (False, 1)
    assert "1 damaged chunk" in trace.faults[0]


@given(data=st.data())
def test_whatever_is_wrong_with_a_file_reading_it_raises_nothing_but_a_refusal(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("trace")
    path = write(folder, flight(60))
    content = bytearray(path.read_bytes())
    for place in data.draw(st.lists(st.integers(0, len(content) - 1), min_size=1, max_size=20)):
        content[place] = data.draw(st.integers(0, 255))
    path.write_bytes(content)
    try:
        trace = open_trace(path)
    except ConfigError:
        return
    assert len(list(trace.records())) <= 60
    list(trace.messages())


def test_a_recorder_that_was_started_again_goes_on_in_a_new_file(tmp_path: Path) -> None:
    sent = flight(60)
    write(tmp_path, sent[:25], close=False)
    write(tmp_path, sent[25:])
    assert [path.name for path in trace_files(tmp_path)] == ["trace.mcap", "trace-2.mcap"]
    trace = open_trace(tmp_path)
    assert pairs(list(trace.records())) == sent[:20] + sent[25:]
    assert trace.truncated


def test_what_the_recorder_dropped_is_in_the_trace(tmp_path: Path) -> None:
    for dropped in (3, 4):
        writer = TraceWriter(tmp_path, SCENARIO)
        for count in (1, dropped):
            writer.add(HAND.key(), Arrival(encode(hand(1)), START_NS))
            writer.flush(count)
        writer.close(dropped)
    trace = open_trace(tmp_path)
    list(trace.records())
    assert trace.dropped == 7
    assert "dropped 7 messages" in trace.faults[0]


def test_made_up_keys_do_not_fill_a_trace(tmp_path: Path) -> None:
    write(tmp_path, [(f"drone/{n}/state", b"x") for n in range(MOST_KEYS + 5)], every=500)
    trace = open_trace(tmp_path)
    assert len(list(trace.records())) == MOST_KEYS
    assert trace.dropped == 5


def test_what_is_no_trace_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no trace; record one with swarmtouch up --record"):
        open_trace(tmp_path)
    file = tmp_path / "other.mcap"
    for content, why in (
        (b"nonsense", "it is no MCAP file"),
        (gzip.compress(MCAP0_MAGIC), "it is no MCAP file"),
        (b"", "it is empty"),
        (2 * MCAP0_MAGIC, "it holds no scenario"),
    ):
        file.write_bytes(content)
        with pytest.raises(ConfigError, match=f"not a trace of a swarm: {why}"):
            open_trace(file)
    with pytest.raises(ConfigError, match="no trace can be written"):
        TraceWriter(file / "below", SCENARIO)


@pytest.mark.parametrize("kind", [topic.kind for topic in TOPICS])
def test_the_schema_of_a_message_describes_what_is_sent(kind: type[Message]) -> None:
    schema = json_schema(kind)
    validator = jsonschema.Draft202012Validator(schema)
    validator.check_schema(schema)

    @given(message=MESSAGES[kind])
    def check(message: Message) -> None:
        fields = json.loads(json.dumps(fields_of(message), default=lambda raw: raw.hex()))
        validator.validate(fields)
        for missing in ("epoch", "seq", "stamp_ns", "v"):
            assert not validator.is_valid({k: v for k, v in fields.items() if k != missing})
        assert not validator.is_valid({**fields, "seq": -1})
        assert not validator.is_valid({**fields, "v": 2})

    check()


def test_the_schema_knows_ranges_words_and_lengths() -> None:
    validator = jsonschema.Draft202012Validator(json_schema(DroneState))
    fields = fields_of(state(1, 1))
    validator.validate(fields)
    for wrong in (
        {"position": [0.0, 0.0]},
        {"position": [0.0, 0.0, 1001.0]},
        {"mode": "follow"},
        {"heard": {"human/hand": [1, 2]}},
        {"displacements": {"1-2": 3.0}},
        {"id": 0},
    ):
        assert not validator.is_valid({**fields, **wrong}), wrong


def test_the_file_is_a_good_mcap_for_others(tmp_path: Path) -> None:
    path = write(tmp_path, flight(30))
    with path.open("rb") as stream:
        found = list(make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False))
    assert len(found) == 30
    for schema, channel, message in found:
        assert schema is not None
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "msgpack")
        jsonschema.validate(msgpack.unpackb(message.data), json.loads(schema.data))


def test_a_trace_may_be_read_more_than_once(tmp_path: Path) -> None:
    write(tmp_path, flight(30))
    trace = open_trace(tmp_path)
    assert list(trace.records()) == list(trace.records())
