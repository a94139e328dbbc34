"""Traces by other tools, cut off, with a damaged byte anywhere, and ones that would fill the memory."""

import json
import resource
import struct
import subprocess
import sys
import zlib
from collections import Counter
from io import BytesIO
from pathlib import Path
from typing import Any

import lz4.frame
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from observer.trace.layout import SCENARIO as SCENARIO_RECORD
from observer.trace.mcap_file import CHUNK, METADATA, McapFile
from observer.trace.order import Record, TimeOrder
from observer.trace.read import MOST_IN_MEMORY, Trace, open_trace
from observer.trace.write import TraceWriter
from shared.config import dump_scenario
from shared.errors import ConfigError
from tests.traces import SCENARIO, flight, write

SENT = flight(60)
MB = 1 << 20


def rewritten(path: Path, *, metadata_last: bool = False, backwards: bool = False, **options: Any) -> bytes:
    """Writes a trace anew as another tool would: same messages, other numbers, other layout."""
    out = BytesIO()
    writer = Writer(out, **options)
    writer.start(profile="", library="another tool")
    with path.open("rb") as stream:
        reader = make_reader(stream)
        found = list(reader.iter_messages(log_time_order=False))
        metadata = list(reader.iter_metadata())

    def tell() -> None:
        for record in metadata:
            writer.add_metadata(record.name, record.metadata)

    if not metadata_last:
        tell()
    writer.register_channel("/foreign", "cdr", 0)
    channels: dict[str, int] = {}
    for _, channel, message in reversed(found) if backwards else found:
        if channel.topic not in channels:
            channels[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, 0)
        number = channels[channel.topic]
        writer.add_message(number, message.log_time, message.data, message.publish_time, message.sequence)
    if metadata_last:
        tell()
    writer.finish()
    return out.getvalue()


LAYOUTS: dict[str, dict[str, Any]] = {
    "no chunks": {"use_chunking": False},
    "no chunks, no summary": {
        "use_chunking": False,
        "use_statistics": False,
        "repeat_channels": False,
        "repeat_schemas": False,
        "use_summary_offsets": False,
    },
    "lz4": {"compression": CompressionType.LZ4, "chunk_size": 2_000},
    "not packed": {"compression": CompressionType.NONE, "chunk_size": 2_000},
    "no checksums": {"enable_crcs": False, "chunk_size": 2_000},
    "last message first": {"backwards": True, "chunk_size": 2_000},
    "metadata last": {"metadata_last": True, "chunk_size": 2_000},
    "no chunks, metadata last": {"metadata_last": True, "use_chunking": False},
}


def pairs(trace: Trace) -> list[tuple[str, bytes]]:
    return [(record.key, record.payload) for record in trace.records()]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_what_other_tools_make_of_a_trace_is_the_same_trace(tmp_path: Path, layout: str) -> None:
    path = write(tmp_path, SENT)
    original = list(open_trace(path).records())
    path.write_bytes(rewritten(path, **LAYOUTS[layout]))
    trace = open_trace(path)
    assert list(trace.records()) == original
    assert (trace.faults, trace.scenario) == ([], SCENARIO)
    assert [message for _, message in trace.messages()]


def a_record(number: int, log_ns: int) -> Record:
    return Record("human/hand", bytes([number % 256]), number, log_ns, log_ns)


@given(st.lists(st.integers(0, 2**64 - 1) | st.integers(0, 5), max_size=60), st.integers(1, 60))
def test_records_come_by_time_and_who_is_too_far_away_is_counted(times: list[int], window: int) -> None:
    records = [a_record(number, log_ns) for number, log_ns in enumerate(times)]
    order = TimeOrder(window)
    found = list(order.sort(iter(records)))
    assert sorted(found, key=lambda one: one.seq) == records
    ordered = sorted(records, key=lambda one: one.log_ns)
    if len(times) <= window:
        assert (found, order.late) == (ordered, 0)
    newest, late = -1, 0
    for one in found:
        late += one.log_ns < newest
        newest = max(newest, one.log_ns)
    assert order.late == late


def test_messages_in_other_encodings_are_named_and_left_out(tmp_path: Path) -> None:
    path = write(tmp_path, SENT)
    out = BytesIO()
    writer = Writer(out)
    writer.start()
    writer.add_metadata(SCENARIO_RECORD, {"toml": dump_scenario(SCENARIO)})
    channel = writer.register_channel("/pose\x1b[2J", "cdr", 0)
    writer.add_message(channel, 5, b"x", 5)
    writer.finish()
    path.write_bytes(out.getvalue())
    trace = open_trace(path)
    assert list(trace.records()) == []
    assert trace.faults == ["1 messages are cdr, not msgpack"]


def test_what_is_in_a_file_that_is_no_trace_is_named(tmp_path: Path) -> None:
    path = tmp_path / "other.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_message(writer.register_channel("/vrpn/hand\x1b[2J", "cdr", 0), 5, b"x", 5)
        writer.finish()
    with pytest.raises(ConfigError) as refused:
        open_trace(path)
    assert r"it holds no scenario, but /vrpn/hand\x1b[2J (cdr)" in str(refused.value)


WHOLE = {"zstd": {}, **{name: LAYOUTS[name] for name in ("no chunks", "not packed", "no checksums")}}


def damaged(content: bytes, place: int, flip: int) -> bytes:
    return content[:place] + bytes([content[place] ^ flip]) + content[place + 1 :]


@pytest.mark.parametrize("ends", [True, False], ids=["finished", "killed"])
@pytest.mark.parametrize("layout", WHOLE)
def test_a_damaged_byte_costs_at_most_a_chunk(tmp_path: Path, layout: str, ends: bool) -> None:
    path = write(tmp_path, SENT, every=6)
    if layout != "zstd":
        path.write_bytes(rewritten(path, **{**LAYOUTS[layout], "chunk_size": 700}))
    (tmp_path / "scenario.toml").write_text(dump_scenario(SCENARIO), encoding="utf-8")
    content = path.read_bytes()
    if not ends:
        content = content[: content.rindex(b"\x0f\x04\x00\x00\x00\x00\x00\x00\x00")]
    sent, has_checksums = Counter(SENT), layout in ("zstd", "not packed")

    @settings(max_examples=250)
    @given(place=st.integers(0, len(content) - 1), flip=st.integers(1, 255))
    def check(place: int, flip: int) -> None:
        path.write_bytes(damaged(content, place, flip))
        trace = open_trace(path)
        found = Counter(pairs(trace))
        if has_checksums:
            assert found <= sent
        missing = sent.total() - found.total()  # without checksums, who said what may be changed
        # ... and so may be the one word that says how a whole channel is encoded.
        misnamed = not has_checksums and any(fault.endswith("not msgpack") for fault in trace.faults)
        assert missing <= 8 or misnamed, (place, flip, trace.faults)
        assert trace.faults or missing <= 0

    check()


def test_a_wrong_length_that_meets_a_later_record_hides_nothing(tmp_path: Path) -> None:
    path = write(tmp_path, SENT, every=6)
    content = path.read_bytes()
    (tmp_path / "scenario.toml").write_text(dump_scenario(SCENARIO), encoding="utf-8")
    with path.open("rb") as stream:
        records = list(McapFile(stream).records())
    metadata = next(record for record in records if record.opcode == METADATA)
    later = [record for record in records if record.opcode == CHUNK][4]
    length = struct.pack("<Q", later.end - metadata.begin)
    path.write_bytes(content[: metadata.begin - 8] + length + content[metadata.begin :])
    trace = open_trace(path)
    assert pairs(trace) == SENT
    assert any("damaged bytes were skipped" in fault for fault in trace.faults)


def test_without_its_scenario_a_trace_takes_the_one_beside_it(tmp_path: Path) -> None:
    path = write(tmp_path, SENT)
    path.write_bytes(path.read_bytes().replace(b"[swarm]", b"[swarm}", 1))
    with pytest.raises(ConfigError, match="not a trace of a swarm: its scenario is damaged"):
        open_trace(path)
    (tmp_path / "scenario.toml").write_text(dump_scenario(SCENARIO), encoding="utf-8")
    trace = open_trace(path)
    assert trace.scenario == SCENARIO
    assert trace.faults[0].endswith("that of scenario.toml beside it is taken")


@pytest.mark.parametrize("layout", WHOLE)
def test_every_cut_gives_what_is_before_it(tmp_path: Path, layout: str) -> None:
    path = write(tmp_path, SENT, every=6)
    if layout != "zstd":
        path.write_bytes(rewritten(path, **{**LAYOUTS[layout], "chunk_size": 700}))
    content = path.read_bytes()
    begin = content.index(b"cores") + 10
    before = 0
    for cut in range(begin, len(content), 97):
        path.write_bytes(content[:cut])
        trace = open_trace(path)
        found = pairs(trace)
        assert found == SENT[: len(found)]
        assert len(found) >= before - 2  # of what is not packed, records are found up to the last two
        assert trace.truncated
        before = len(found)
    assert before >= len(SENT) - 8


def record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def chunk(data: bytes, compression: str, size: int, crc: int = 0) -> bytes:
    name = struct.pack("<I", len(compression)) + compression.encode()
    head = struct.pack("<QQQI", 0, 0, size, crc) + name + struct.pack("<Q", len(data))
    return record(CHUNK, head + data)


def zeros(size: int) -> bytes:
    """A zstd frame of so many zeros, made in little memory."""
    packer = zstandard.ZstdCompressor().compressobj()
    block = bytes(MB)
    return b"".join((*(packer.compress(block) for _ in range(size // MB)), packer.flush()))


def bombs(kind: str) -> bytes:
    """A chunk that becomes much more than it is, and says so or not."""
    match kind:
        case "zstd":
            return chunk(zeros(1024 * MB), "zstd", 1024 * MB)
        case "zstd that lies":
            return chunk(zeros(1024 * MB), "zstd", 100)
        case "lz4":
            return chunk(lz4.frame.compress(bytes(512 * MB)), "lz4", 512 * MB)
        case "many":
            return chunk(zeros(64 * MB), "zstd", 64 * MB) * 50
        case _:
            return record(CHUNK, b"")[:1] + struct.pack("<Q", 1 << 62)


@pytest.mark.parametrize("kind", ["zstd", "zstd that lies", "lz4", "many", "length"])
def test_a_bomb_is_skipped_in_little_memory(tmp_path: Path, kind: str) -> None:
    good = write(tmp_path, SENT).read_bytes()
    begin = good.index(struct.pack("<B", CHUNK), good.index(b"cores"))
    while not good[begin + 9 :].startswith(struct.pack("<Q", 1_700_000_000_000_000_000)):
        begin = good.index(struct.pack("<B", CHUNK), begin + 1)
    path = tmp_path / "trace.mcap"
    path.write_bytes(good[:begin] + bombs(kind) + good[begin:])
    assert path.stat().st_size < 4 * MB
    script = f"""
import resource, json
from observer.trace.read import open_trace
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
trace = open_trace({str(path)!r})
count = sum(1 for _ in trace.records())
grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
print(json.dumps([count, trace.damaged, trace.lost, grown / 1024]))
"""
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, preexec_fn=_limit
    )
    count, damaged_chunks, lost, grown_mb = json.loads(done.stdout)
    assert count == len(SENT)
    assert damaged_chunks + lost > 0
    assert grown_mb < 250


def _limit() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))


def test_who_keeps_all_messages_is_told_when_they_are_too_many(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert MOST_IN_MEMORY > 60 * 60 * 64
    trace = open_trace(write(tmp_path, SENT))
    assert len(list(trace.all_messages())) == len(SENT)
    monkeypatch.setattr("observer.trace.read.MOST_IN_MEMORY", 59)
    with pytest.raises(ConfigError, match="more than 59 messages; take a part of it"):
        list(trace.all_messages())


def test_a_checksum_of_a_chunk_is_believed(tmp_path: Path) -> None:
    """The reference: what the format calls a good chunk is one here, too."""
    writer = TraceWriter(tmp_path, SCENARIO)
    writer.close(0)
    content = writer.path.read_bytes()
    head, tail = content[: content.rindex(b"\x0f\x04\x00")], content[content.rindex(b"\x0f\x04\x00") :]
    inner = record(5, struct.pack("<HIQQ", 9, 1, 2, 3) + SENT[0][1])
    for crc, count in ((zlib.crc32(inner), 1), (zlib.crc32(inner) ^ 1, 0), (0, 1)):
        writer.path.write_bytes(head + chunk(inner, "", len(inner), crc) + tail)
        trace = open_trace(writer.path)
        assert [(r.key, r.seq) for r in trace.records()] == [("human/hand", 1)] * count
        assert trace.damaged == 1 - count
    assert content.endswith(MCAP0_MAGIC)
