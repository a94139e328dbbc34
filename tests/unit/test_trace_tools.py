"""Every tool that reads traces, on valid messages that say what nobody would: an answer or a refusal."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from deploy.cli import main
from observer.path.flight import RecordedFlight
from observer.path.follow import follow, typical
from observer.trace.foxglove import export_foxglove
from observer.trace.read import open_trace
from observer.trace.tables import export_csv
from observer.trace.write import TraceWriter
from shared.codec import encode
from shared.errors import SwarmTouchError
from shared.formation import build_formation
from shared.messages import DroneState, HandSample, Message, ProcessStatus
from shared.topics import TOPICS
from shared.transport import Arrival
from tests.strategies import MESSAGES
from tests.synthetic_swarm import fly
from tests.traces import SCENARIO

GOOD = fly(220)
TIMES = st.integers(0, 2**64 - 1) | st.sampled_from([0, 1, 2**63, 2**64 - 1, GOOD[-1].stamp_ns])


@st.composite
def strange(draw: st.DrawFn) -> Message:
    """A valid message of somebody in the swarm: anything, or a good one with a number that cannot be."""
    if draw(st.booleans()):
        message: Message = draw(st.sampled_from(list(MESSAGES.values())).flatmap(lambda messages: messages))
    else:
        message = draw(st.sampled_from(GOOD))
        names = [name for name in ("epoch", "seq", "stamp_ns", "step_ns") if hasattr(message, name)]
        message = _changed(message, **{draw(st.sampled_from(names)): draw(TIMES)})
    if isinstance(message, DroneState):
        message = _changed(message, id=draw(st.integers(1, 5)))
    if isinstance(message, ProcessStatus):
        message = _changed(message, role="drone", id=1)
    return message


def _changed(message: Message, **fields: Any) -> Message:
    changed: Message = replace(message, **fields)
    return changed


def key_of(message: Message) -> str:
    topic = next(topic for topic in TOPICS if isinstance(message, topic.kind))
    return topic.pattern.format(**{name: getattr(message, name) for name in message.__struct_fields__})


@pytest.mark.slow
@pytest.mark.timeout(300)
@settings(max_examples=25, suppress_health_check=[HealthCheck.too_slow])
@given(said=st.lists(st.tuples(strange(), st.integers(0, len(GOOD)), TIMES | st.none()), max_size=6))
def test_whatever_was_said_every_tool_answers(
    tmp_path_factory: pytest.TempPathFactory, said: list[tuple[Message, int, int | None]]
) -> None:
    from observer.report.source import open_record  # noqa: PLC0415  the extra `plot`

    folder = tmp_path_factory.mktemp("run")
    messages: list[tuple[Message, int]] = [(message, message.stamp_ns) for message in GOOD]
    for message, place, log_ns in said:
        usual_ns = messages[min(place, len(messages) - 1)][1]
        messages.insert(place, (message, usual_ns if log_ns is None else log_ns))
    writer = TraceWriter(folder, SCENARIO)
    for message, log_ns in messages:
        writer.add(key_of(message), Arrival(encode(message), log_ns))
    writer.close(0)
    trace = open_trace(folder)
    assert len(list(trace.messages())) == len(messages)
    exported = export_csv(trace, folder / "tables")
    assert sum(path.stat().st_size for path in exported.files) < 40 << 20
    export_foxglove(trace, folder / "flight.mcap")
    assert (folder / "flight.mcap").stat().st_size < 40 << 20
    assert main(["trace", "info", str(folder), "--links"]) == 0
    flight = RecordedFlight(build_formation(SCENARIO), (message for _, message in trace.all_messages()))
    typical(flight)
    for number in (0, 100):
        try:
            follow(flight, number)
        except SwarmTouchError:
            continue
    try:
        record = open_record(folder)
    except SwarmTouchError:
        return
    assert record.t[-1] < 60.0


def test_json_of_links_is_json_whatever_was_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    writer = TraceWriter(tmp_path, SCENARIO)
    for stamp in (0, 2**64 - 1):
        message = next(m for m in GOOD if isinstance(m, HandSample))
        writer.add("human/hand", Arrival(encode(_changed(message, stamp_ns=stamp)), stamp))
    writer.close(0)
    assert main(["trace", "info", str(tmp_path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["key"] == "human/hand"
