"""Exports are read back by readers of others: foxglove-sdk, mcap with JSON Schema, and plain CSV."""

import base64
import csv
import json
from pathlib import Path
from typing import Any

import attrs
import jsonschema
import pytest
from foxglove import messages as foxglove
from mcap.reader import make_reader

from deploy.cli import main
from observer.trace.foxglove import SCENE, export_foxglove
from observer.trace.read import Trace, open_trace
from observer.trace.scene import Scene
from observer.trace.tables import export_csv
from shared.codec import encode
from shared.formation import build_formation
from shared.messages import NO_HAND, FormationState, HandSample, Heard, PatternEvent, ProcessStatus
from shared.scenario import Obstacle, Scenario
from shared.topics import DRONE_STATE, FORMATION_STATE, HAND, PATTERN, STATUS
from tests.traces import SCENARIO, START_NS, Payloads, flight, hand, state, write

ENVELOPE: dict[str, Any] = {"epoch": 1, "seq": 1, "stamp_ns": START_NS}
FORMATION = FormationState(
    **ENVELOPE, area=1.5, area_ratio=1.1, distances={"1-2": 0.7}, extent=0, trend=1, displacement=0.1
)
EVENT = PatternEvent(**ENVELOPE, pattern="EI", outcome="started", state_seq=3)
HEALTH = ProcessStatus(
    **ENVELOPE, role="drone", id=1, pid=5, host="here", state="running", rejected={"version": 2}
)
MAZE = attrs.evolve(SCENARIO, obstacles=(Obstacle(name="a", x=1.0, y=2.0), Obstacle(name="b", x=-1.0, y=0.0)))


def everything(length: int = 300) -> Payloads:
    """One of every kind, and what is no message, among the payloads of a flight."""
    heard = {HAND.key(): Heard(7, 3, START_NS + 5)}
    stretched = {"human-1": (0.25, 0.0, 0.0)}
    others = [
        (HAND.key(), encode(hand(10**6, position=NO_HAND, signature=b"\x00\xff"))),
        (DRONE_STATE.key(id=1), encode(state(1, 500, displacements=stretched, heard=heard))),
        (FORMATION_STATE.key(), encode(FORMATION)),
        (PATTERN.key(), encode(EVENT)),
        (STATUS.key(role="drone", id=1), encode(HEALTH)),
        (HAND.key(), b"no message"),
    ]
    return [*flight(length), *others]


def trace_of(folder: Path, payloads: Payloads, scenario: Scenario = SCENARIO) -> Trace:
    write(folder, payloads, scenario=scenario)
    return open_trace(folder)


def read_json(path: Path) -> list[tuple[Any, Any, Any, Any]]:
    """Reads an MCAP file of JSON messages with the reference reader: schema, channel, message, content."""
    with path.open("rb") as stream:
        found = list(make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False))
    return [(schema, channel, message, json.loads(message.data)) for schema, channel, message in found]


def validator(schema: Any) -> Any:
    """Makes what checks contents against a JSON Schema, which is checked itself."""
    kind = jsonschema.validators.validator_for(schema)
    kind.check_schema(schema)
    return kind(schema)


FOXGLOVE = {
    "timestamp": foxglove.Timestamp,
    "lifetime": foxglove.Duration,
    "pose": foxglove.Pose,
    "position": foxglove.Vector3,
    "orientation": foxglove.Quaternion,
    "size": foxglove.Vector3,
    "color": foxglove.Color,
    "entities": foxglove.SceneEntity,
    "spheres": foxglove.SpherePrimitive,
    "cylinders": foxglove.CylinderPrimitive,
    "lines": foxglove.LinePrimitive,
    "texts": foxglove.TextPrimitive,
    "points": foxglove.Point3,
}
LINE_TYPES = {
    0: foxglove.LinePrimitiveLineType.LineStrip,
    1: foxglove.LinePrimitiveLineType.LineLoop,
    2: foxglove.LinePrimitiveLineType.LineList,
}


def as_foxglove(value: Any, kind: Any) -> Any:
    """Builds a message with Foxglove's own classes; a field that they do not know or a wrong type raises."""
    if isinstance(value, list):
        return [as_foxglove(item, kind) for item in value]
    if not isinstance(value, dict):
        return value
    fields = {name: as_foxglove(item, FOXGLOVE.get(name)) for name, item in value.items()}
    if kind is foxglove.LinePrimitive:
        fields["type"] = LINE_TYPES[fields["type"]]
    return kind(**fields)


def test_the_export_is_read_by_others(tmp_path: Path) -> None:
    trace = trace_of(tmp_path, everything(), MAZE)
    path = tmp_path / "flight.mcap"
    assert export_foxglove(trace, path) == 305
    found = read_json(path)
    validators = {schema.id: validator(json.loads(schema.data)) for schema, *_ in found}
    for schema, channel, _, content in found:
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        validators[schema.id].validate(content)
        if schema.name == "foxglove.SceneUpdate":
            as_foxglove(content, foxglove.SceneUpdate).encode()
        elif schema.name == "foxglove.PoseInFrame":
            as_foxglove(content, foxglove.PoseInFrame).encode()
        else:
            assert schema.name.startswith("swarmtouch.")
    assert {schema.name for schema, *_ in found} >= {"foxglove.SceneUpdate", "foxglove.PoseInFrame"}


def test_every_message_keeps_its_times_number_and_content(tmp_path: Path) -> None:
    trace = trace_of(tmp_path, everything())
    export_foxglove(trace, tmp_path / "flight.mcap")
    found = [item for item in read_json(tmp_path / "flight.mcap") if not item[1].topic.startswith("/")]
    originals = list(trace.messages())
    assert len(found) == len(originals) == 305
    for (record, message), (_, channel, there, content) in zip(originals, found, strict=True):
        assert channel.topic == record.key
        assert (there.log_time, there.publish_time, there.sequence) == (
            record.log_ns,
            record.publish_ns,
            record.seq,
        )
        assert (content["epoch"], content["seq"]) == (message.epoch, message.seq)
    signed = next(content for _, _, there, content in found if there.sequence == 10**6)
    assert base64.b64decode(signed["signature"]) == b"\x00\xff"


def test_the_scene_shows_where_everything_is(tmp_path: Path) -> None:
    trace = trace_of(tmp_path, everything())
    export_foxglove(trace, tmp_path / "flight.mcap")
    scenes = [
        content for _, channel, _, content in read_json(tmp_path / "flight.mcap") if channel.topic == SCENE
    ]
    still, *moving = scenes
    assert {entity["id"] for entity in still["entities"]} == {"fence", "obstacles"}
    assert len(still["entities"][0]["lines"][0]["points"]) == 24
    assert len(moving) == pytest.approx(0.305 * 20, abs=1)
    entities = {entity["id"]: entity for entity in moving[-2]["entities"]}
    assert entities.keys() == {"hand", "drone/1", "drone/2"}
    assert entities["drone/2"]["texts"][0]["text"] == "2 FOLLOW"
    centre = entities["hand"]["spheres"][0]["pose"]["position"]
    assert centre["z"] == 1.5
    link = entities["drone/2"]["lines"][-1]
    assert link["points"] == [{"x": 0.0, "y": 0.0, "z": 0.0}] * 2


def test_columns_and_their_zones_are_in_the_scene(tmp_path: Path) -> None:
    trace = trace_of(tmp_path, flight(30), MAZE)
    export_foxglove(trace, tmp_path / "flight.mcap")
    first = read_json(tmp_path / "flight.mcap")[0][3]
    columns = next(entity for entity in first["entities"] if entity["id"] == "obstacles")["cylinders"]
    assert len(columns) == 4
    assert columns[0]["pose"]["position"]["x"] == 1.0
    assert columns[0]["size"]["x"] < columns[1]["size"]["x"]


def test_a_stretched_link_has_another_colour() -> None:
    scene = Scene(SCENARIO, build_formation(SCENARIO))
    scene.add(hand(1))
    colours = []
    for displacement in (0.0, 0.1, 0.25, 9.0):
        scene.add(state(1, 1, displacements={"human-1": (displacement, 0.0, 0.0)}))
        drone = next(entity for entity in scene.moment(0).entities if entity.id == "drone/1")
        colours.append(drone.lines[-1].color)
    assert len(set(colours)) == 3
    assert colours[2] == colours[3]


def read_csv(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_table_per_key_holds_every_message(tmp_path: Path) -> None:
    trace = trace_of(tmp_path, everything())
    names = [path.name for path in export_csv(trace, tmp_path / "tables").files]
    assert names == [
        "human-hand.csv",
        "drone-1-state.csv",
        "drone-2-state.csv",
        "formation-state.csv",
        "glove-pattern.csv",
        "status-drone-1.csv",
        "aligned.csv",
    ]
    rows = read_csv(tmp_path / "tables" / "drone-1-state.csv")
    assert [int(row["seq"]) for row in rows] == [*range(100), 500]
    assert rows[0]["displacements.human-1_x"] == ""
    assert float(rows[-1]["displacements.human-1_x"]) == 0.25
    assert int(rows[-1]["heard.human/hand.arrival_ns"]) == START_NS + 5
    assert rows[-1]["mode"] == "FOLLOW"
    (event,) = read_csv(tmp_path / "tables" / "glove-pattern.csv")
    assert (event["pattern"], event["state_seq"]) == ("EI", "3")
    (health,) = read_csv(tmp_path / "tables" / "status-drone-1.csv")
    assert health["rejected.version"] == "2"
    (formation,) = read_csv(tmp_path / "tables" / "formation-state.csv")
    assert (float(formation["distances.1-2"]), formation["missing"]) == (0.7, "")


def test_the_aligned_table_holds_the_newest_of_everything(tmp_path: Path) -> None:
    payloads = everything(3000)
    payloads[1500:] = [item for item in payloads[1500:] if item[0] != DRONE_STATE.key(id=2)]
    trace = trace_of(tmp_path, payloads)
    export_csv(trace, tmp_path / "tables")
    rows = read_csv(tmp_path / "tables" / "aligned.csv")
    times = [float(row["time_s"]) for row in rows]
    assert times == pytest.approx([n / 60 for n in range(len(rows))], abs=1e-6)
    records = list(trace.messages())
    for row, moment_s in zip(rows[::11], times[::11], strict=True):
        until = START_NS + round(moment_s * 1e9)
        hands = [m for record, m in records if isinstance(m, HandSample) and record.log_ns <= until]
        assert float(row["human_hand_position_x"] or "nan") == hands[-1].position[0]
    silent_s = 1.6 + DRONE_STATE.stale_s
    silent = [row for row in rows if float(row["time_s"]) > silent_s]
    assert silent
    assert {row["drone_2_mode"] for row in silent} == {""}
    assert {row["drone_1_mode"] for row in silent} == {"FOLLOW"}
    assert not any(name.endswith((".seq", "epoch", "_v")) for name in rows[0])


def test_the_command_exports_both_and_says_what_it_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, everything(), close=False)
    target = tmp_path / "flight.mcap"
    arguments = ["trace", "export", str(tmp_path), "--foxglove", str(target), "--csv", str(tmp_path / "tables")]
    assert main(arguments) == 0
    output = capsys.readouterr().out
    assert "300 messages" in output
    assert "7 tables" not in output
    assert "it has no end" in output


@pytest.mark.parametrize(
    ("arguments", "hint"),
    [
        ([], "--foxglove FILE or --csv DIR"),
        (["--foxglove", "{run}/trace.mcap"], "that is the trace itself"),
        (["--csv", "{run}/trace.mcap"], "trace.mcap is no folder"),
    ],
)
def test_an_impossible_export_is_refused(
    arguments: list[str], hint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path, flight(30))
    content = path.read_bytes()
    filled = [argument.replace("{run}", str(tmp_path)) for argument in arguments]
    try:
        code = main(["trace", "export", str(tmp_path), *filled])
    except SystemExit as refused:  # by the parser of arguments
        code = int(refused.code or 0)
    assert code == 2
    assert hint in capsys.readouterr().err
    assert path.read_bytes() == content
