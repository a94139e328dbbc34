"""Good inputs of every parser, made by the product itself, so they never go out of date."""

import gzip
import json
import struct
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from agents.vehicles.base import Pose
from agents.vehicles.link import Verb, encode_order, encode_pose
from deploy.net.authority import create, issue
from glove_bridge.framing import encode as frame
from glove_bridge.protocol import PROTOCOL, Ack, Hello, HelloReply, Ping, Play, PlayFrame, Set, Status, Stop
from shared import pointer_link
from shared.codec import encode
from shared.messages import FormationState, Heard, PatternEvent, ProcessStatus
from shared.net.keyring import Keyring
from shared.nodes import drone_node
from shared.radio_link import encode_head
from shared.recordings.hand import BAG_TOPIC
from shared.signature import blank, sign_with
from shared.topics import HAND
from tests.bags import ODOMETRY, POSE, TF, TRANSFORM, Body, steady, write_bag
from tests.traces import flight, hand, state, write

ZENOH_LOG = (
    b"TRACE ThreadId(14) zenoh::access_control: 3551f63a5eee is unauthorized to Put (ingress) on s/human/hand\n"
    b"TRACE rx-1 ThreadId(14) zenoh::net::routing::interceptor: Msg intercepted!\n"
    b'WARN acc-0 zenoh_link_commons: QUIC acceptor failed: reason: "invalid peer certificate: BadSignature"\n'
)
TRACK = b"t_ns,x,y,z,qx,qy,qz,qw\n1,0,0,1,0,0,0,1\n2,0.1,0,1,0,0,0,1\n"
META = {"limits_x": [-2, 2], "limits_y": [-2, 2], "base_offset_c": [0.1, 0], "pos_coef": 2.0, "l": 0.4}
META |= {"triangle_height_factor": 0.86, "R_obstacles": 0.27, "run": "one"}
PAGE_PATTERNS = {"frames": {"EI": [{"ms": 200, "hz": {"3": 150.0}}]}, "cues": ["FENCE"]}
OVERRIDES = (b"formation.n=8", b'net.endpoints."drone/2"=tcp/10.0.0.2:7447', b"hand.home=[1.0, 2.0]")
URIS = (b"pointer:///run/hand.sock?speed=0.5", b"serial:///dev/ttyACM0?baud=115200", b"recording:a%20b?lead=2")


@cache
def scratch() -> Path:
    """Returns a folder for the life of the process, in memory where there is such a place."""
    memory = Path("/dev/shm")  # noqa: S108  a folder of its own is made in it
    folder = tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None)
    _kept.append(folder)
    return Path(folder.name)


_kept: list[object] = []


@cache
def keys() -> Keyring:
    """Makes keys for the life of the process."""
    made = Keyring(scratch() / "keys")
    create(made, "rhombus")
    for node in ("relay", drone_node(1)):
        issue(made, node)
    return made


def files(*paths: Path) -> list[bytes]:
    """Reads files."""
    return [path.read_bytes() for path in paths]


def messages() -> list[bytes]:
    """Makes one message of every topic."""
    envelope: Any = {"epoch": 7, "seq": 3, "stamp_ns": 9}
    formation = FormationState(
        **envelope, area=0.5, area_ratio=1.0, distances={"1-2": 0.7}, extent=0, trend=-1, displacement=0.0
    )
    event = PatternEvent(**envelope, pattern="EI", outcome="finished", state_seq=5)
    status = ProcessStatus(**envelope, role="drone", id=1, pid=2, host="here", state="running")
    return [encode(message) for message in (hand(1), state(2, 3), formation, event, status)]


def said() -> list[bytes]:
    """Makes every message on its key, a status full of nasty words, and one that speaks for somebody else."""
    keys = (HAND.key(), "drone/2/state", "formation/state", "glove/pattern", "status/drone/1")
    nasty = "\x1b]0;mine\x07[/red][bold]\u202e\n"
    envelope: Any = {"epoch": 7, "seq": 3, "stamp_ns": 9}
    status = ProcessStatus(
        **envelope,
        role="relay",
        id=0,
        pid=2,
        host=nasty,
        state=nasty,
        rejected={nasty: 1},
        metrics={f"refused {nasty}": 1e308, f"linked {nasty}": 1.0},
    )
    event = PatternEvent(**envelope, pattern=nasty, outcome="started", state_seq=5)
    drone = state(2, 3, displacements={nasty: (0.0, 0.0, 0.0)}, heard={nasty: Heard(1, 2, 3)})
    others = [("status/relay/0", status), ("glove/pattern", event), ("drone/2/state", drone)]
    spoken = [*zip(keys, messages(), strict=True), *((key, encode(message)) for key, message in others)]
    return [key.encode() + b"\n" + payload for key, payload in spoken]


@cache
def hands() -> list[bytes]:
    """Makes hand samples: to be signed, signed, and unsigned."""
    sample = encode(hand(1, signature=blank()))
    return [sample, sign_with(keys().hand_private)(sample), encode(hand(2))]


FRAMES = (PlayFrame(200, (0, 0, 130, 0, 0)), PlayFrame(300, (191, 0, 0, 0, 191)))


def glove_answers() -> list[bytes]:
    """Makes what a glove says after each other, in pieces of eight bytes: greeting, playing, at rest."""
    greeting = struct.pack(">BBBHHx", 1, 5, 32, 10_000, 350)
    playing = [struct.pack(">BBHHxx", 1, Status.OK, ms, 0) for ms in (500, 383, 267, 150, 33, 0)]
    return [b"".join((greeting, *playing)), greeting + playing[0], greeting]


def frames() -> list[bytes]:
    """Makes one frame of every message on the glove's line."""
    steps = FRAMES
    replies = (Ack(7, Status.OK, 500, 0), HelloReply(1, PROTOCOL, (1, 0), 9, 5, 32, 10_000, 350))
    commands = (Hello(0, 9, 350), Set(1, (1, 2, 3, 4, 5)), Play(2, steps), Stop(3), Ping(4))
    return [frame(message) for message in (*replies, *commands)]


def vehicle_datagrams() -> list[bytes]:
    """Makes one datagram towards the world and one from it."""
    pose = Pose((1.0, 2.0, 3.0), (0.0, 0.1, 0.0), 0.5, 0.9, True, 4)
    return [encode_order(2, Verb.FLY, (1.0, 2.0, 3.0)), encode_pose(2, pose)]


def pointers() -> list[bytes]:
    """Makes one datagram of every verb."""
    pointed = (pointer_link.Pointed(5, verb, (1.0, 0.0, 1.5), 0.1) for verb in pointer_link.Verb)
    return [pointer_link.encode_pointed(each) for each in pointed]


def radio_datagrams() -> list[bytes]:
    """Makes a signed hand sample on the air, and an empty payload."""
    return [encode_head("rhombus", HAND.key()) + payload for payload in (hands()[1], b"")]


def page_messages() -> list[bytes]:
    """Makes every message of a page."""
    moves = ({"type": "hand", "point": [1.0, -2.0, 1.5], "yaw": 0.1}, {"type": "wish", "wish": "STOP"})
    others = ({"type": "take"}, {"type": "release"}, {"type": "give", "to": 2})
    return [json.dumps(message).encode() for message in (*moves, *others)]


def traces() -> list[bytes]:
    """Makes a whole trace, and one that a killed recorder has left."""
    with tempfile.TemporaryDirectory() as folder:
        return files(*(write(Path(folder), flight(12), close=close) for close in (True, False)))


def tracks() -> list[bytes]:
    """Makes a packed table of a recorded body."""
    return [gzip.compress(TRACK, mtime=0)]


def hand_tables() -> list[bytes]:
    """Makes tables of hands: with and without a heading, in the encodings of editors, packed."""
    text = "t,x,y,z\n" + "".join(f"{k / 60:.4f},0,0,1\n" for k in range(9))
    turned = b"t,x,y,z,yaw\n0,0,0,1,0\n0.1,0,0,1,0.1\n"
    return [turned, *(text.encode(name) for name in ("utf-8-sig", "utf-16")), gzip.compress(turned, mtime=0)]


def bags() -> list[bytes]:
    """Makes a ROS 1 bag of every type with poses, and one that is cut off."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hand.bag"
        written = [
            write_bag(path, {BAG_TOPIC: Body(kind, steady(60))}).read_bytes()
            for kind in (TRANSFORM, POSE, ODOMETRY, TF)
        ]
    return [*written, written[0][: len(written[0]) // 2]]
