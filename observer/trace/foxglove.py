"""A trace for Foxglove, Lichtblick and PlotJuggler: everything as JSON, and the flight as a 3D scene."""

import json
import math
from pathlib import Path
from typing import IO, Any

from cattrs import Converter
from mcap.writer import Writer

from observer.trace.foxglove_types import Pose, PoseInFrame, Quaternion, SceneUpdate, Time, Vector3
from observer.trace.order import Record
from observer.trace.read import Trace
from observer.trace.scene import FRAME, Scene
from observer.trace.schemas import Kind, json_fields, json_schema
from shared.clock import NS_PER_S
from shared.formation import build_formation
from shared.messages import NO_HAND, DroneState, HandSample, Message

SCENE = "/scene"
"""Topic of the 3D scene."""
SCENE_RATE_HZ = 20.0

_SCENE_PERIOD_NS = round(NS_PER_S / SCENE_RATE_HZ)
_converter = Converter()


def export_foxglove(trace: Trace, path: Path) -> int:
    """Writes an MCAP file with messages in JSON.

    Every valid message is on its own key, with its two times and its sequence number; in addition there are
    `/scene` (`foxglove.SceneUpdate`: fence, columns, hand, drones, goals, links, moving obstacles) and, of hand
    and drones, `<key>/pose` (`foxglove.PoseInFrame`).

    Args:
        trace: What to write.
        path: The new file; one that exists is replaced.

    Returns:
        How many messages of the trace it holds.

    Raises:
        OSError: It cannot be written.
    """
    with path.open("wb") as stream:
        writer = _JsonWriter(stream)
        scene = Scene(trace.scenario, build_formation(trace.scenario))
        count = due_ns = 0
        for record, message in trace.messages():
            if not count:
                writer.add(SCENE, scene.surroundings(record.log_ns), record.log_ns)
            writer.add_message(record, message)
            pose = _pose(message)
            if pose is not None:
                writer.add(f"/{record.key}/pose", pose, record.log_ns)
            scene.add(message)
            if record.log_ns >= due_ns:
                due_ns = record.log_ns + _SCENE_PERIOD_NS
                writer.add(SCENE, scene.moment(record.log_ns), record.log_ns)
            count += 1
        writer.close()
    return count


class _JsonWriter:
    """MCAP with JSON messages, each class under its own schema."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._writer = Writer(stream)
        self._writer.start(library="swarmtouch")
        self._schemas: dict[type, int] = {}
        self._channels: dict[str, int] = {}

    def add_message(self, record: Record, message: Message) -> None:
        """Writes one message of the swarm."""
        self._write(record.key, type(message), json_fields(message), record)

    def add(self, topic: str, content: SceneUpdate | PoseInFrame, stamp_ns: int) -> None:
        """Writes one message of Foxglove's."""
        record = Record(topic, b"", 0, stamp_ns, stamp_ns)
        self._write(topic, type(content), _converter.unstructure(content), record)

    def close(self) -> None:
        """Finishes the file."""
        self._writer.finish()

    def _write(self, topic: str, kind: Kind, fields: dict[str, Any], record: Record) -> None:
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._writer.register_channel(topic, "json", self._schema(kind))
            self._channels[topic] = channel
        self._writer.add_message(
            channel,
            log_time=record.log_ns,
            data=json.dumps(fields, separators=(",", ":")).encode(),
            publish_time=record.publish_ns,
            sequence=record.seq,
        )

    def _schema(self, kind: Kind) -> int:
        if kind not in self._schemas:
            family = "swarmtouch" if issubclass(kind, Message) else "foxglove"
            schema = json.dumps(json_schema(kind)).encode()
            self._schemas[kind] = self._writer.register_schema(
                f"{family}.{kind.__name__}", "jsonschema", schema
            )
        return self._schemas[kind]


def _pose(message: Message) -> PoseInFrame | None:
    """Returns the pose of a hand or a drone (drones say no attitude), None of anything else."""
    if isinstance(message, HandSample) and message.position != NO_HAND:
        half = message.yaw / 2.0
        turned = Quaternion(z=math.sin(half), w=math.cos(half))
        return PoseInFrame(Time.of(message.stamp_ns), FRAME, Pose(Vector3(*message.position), turned))
    if isinstance(message, DroneState):
        return PoseInFrame(Time.of(message.stamp_ns), FRAME, Pose.at(message.position))
    return None
