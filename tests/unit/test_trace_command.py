"""`swarmtouch trace`: what it says, and what it refuses before anything starts."""

import json
from pathlib import Path

import pytest

from deploy.cli import main
from deploy.trace.echo import line
from observer.trace.write import TraceWriter
from shared.clock import NS_PER_S
from shared.codec import encode
from shared.messages import ProcessStatus
from shared.topics import HAND, STATUS
from shared.transport import Arrival
from tests.traces import SCENARIO, START_NS, flight, hand, write

HEALTH = ProcessStatus(
    epoch=1,
    seq=1,
    stamp_ns=START_NS,
    role="drone",
    id=1,
    pid=5,
    host="here",
    state="running",
    rejected={"malformed": 3, "version": 0},
)


def output_of(capsys: pytest.CaptureFixture[str], *arguments: str, code: int = 0) -> str:
    assert main(["trace", *arguments]) == code
    return capsys.readouterr().out


def test_info_shows_every_link_and_what_was_rejected(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = [item for item in flight(300) if item != (HAND.key(), encode(hand(50)))]
    said += [(HAND.key(), b"no message"), (STATUS.key(role="drone", id=1), encode(HEALTH))]
    write(tmp_path, said)
    output = output_of(capsys, "info", str(tmp_path))
    rows = {line.split()[0]: line.split() for line in output.splitlines() if "observer" in line}
    assert rows.keys() == {"human/hand", "drone/1/state", "drone/2/state", "status/drone/1"}
    assert rows["human/hand"][2] == "99"
    assert rows["human/hand"][5] == "1", "one is missing"
    assert "malformed 1" in output
    assert "drone/1 has rejected: malformed 3\n" in output
    assert "swarm rhombus, 0.3 s, recorded on" in output


def test_info_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, [*flight(300), (HAND.key(), b"no message")])
    rows = [json.loads(text) for text in output_of(capsys, "info", str(tmp_path), "--json").splitlines()]
    assert [(row["key"], row["messages"], row["missing"]) for row in rows] == [
        ("human/hand", 100, 0),
        ("drone/1/state", 100, 0),
        ("drone/2/state", 100, 0),
    ]
    assert rows[0]["rejected"] == {"malformed": 1}


@pytest.mark.parametrize("far_ns", [0, 2**63])
def test_info_measures_a_flight_by_what_came_together(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], far_ns: int
) -> None:
    writer = TraceWriter(tmp_path, SCENARIO)
    for seq in range(120):
        at_ns = far_ns if seq in (0, 77) else START_NS + seq * NS_PER_S // 60
        writer.add(HAND.key(), Arrival(encode(hand(seq)), at_ns))
    writer.close(dropped=0)
    output = output_of(capsys, "info", str(tmp_path))
    assert "swarm rhombus, 2.0 s" in output
    assert "2 messages came at a time that is hours away from all others" in output


def test_info_says_what_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, flight(300), close=False)
    assert "it has no end: its recorder was killed or still runs" in output_of(capsys, "info", str(tmp_path))


def test_a_trace_without_messages_is_no_success(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, [])
    assert "0.0 s" in output_of(capsys, "info", str(tmp_path), code=1)
    assert output_of(capsys, "export", str(tmp_path), "--csv", str(tmp_path / "tables"), code=1)
    assert (tmp_path / "tables" / "aligned.csv").read_text() == "time_s\n"


def test_echo_writes_json_be_it_a_message_or_not() -> None:
    good = json.loads(line(HAND.key(), Arrival(encode(hand(3)), 17)))
    assert (good["key"], good["arrival_ns"], good["message"]["seq"]) == (HAND.key(), 17, 3)
    replayed = json.loads(line("replay/human/hand", Arrival(encode(hand(3)), 17)))
    assert replayed["message"] == good["message"]
    bad = json.loads(line(HAND.key(), Arrival(b"\xc1\x02", 17)))
    assert bad["rejected"].startswith("malformed")
    assert bad["bytes"] == "c102"


@pytest.mark.parametrize("key", ["", "drone//state", "drone*", "human/hand/", "a?", "$*/x"])
def test_echo_refuses_what_is_no_key(key: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["trace", "echo", key]) == 2
    assert "for example human/hand" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [["info"], ["replay", "."], ["echo", "human/hand"], ["record"]])
def test_without_a_flight_it_says_how_to_get_one(
    arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["trace", *arguments]) == 2
    assert "swarmtouch up" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [["echo", "k", "--count", "0"], ["replay", ".", "--speed", "0"], ["replay", ".", "--delay", "x"]],
)
def test_impossible_numbers_are_refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["trace", *arguments])
    assert arguments[-2] in capsys.readouterr().err


def test_a_replay_of_keys_on_which_nothing_was_said_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, flight(30))
    assert main(["trace", "replay", str(tmp_path), "--keys", "human/*", "drone/9/state"]) == 2
    line = capsys.readouterr().err
    assert "--keys drone/9/state: nothing was said there" in line
    assert "the trace has drone/1/state, drone/2/state, human/hand" in line
