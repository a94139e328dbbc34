"""Every parser of the product, one row each. Their contract: a value or a `SwarmTouchError`, nothing else."""

import gzip
import json
import math
from binascii import crc_hqx
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from io import StringIO
from pathlib import Path

import zenoh
from attrs import frozen
from cobs import cobs
from rich.table import Table

from agents.vehicles import sim
from agents.vehicles.link import decode_order, decode_pose, encode_order, encode_pose
from deploy.net.authority import issued
from deploy.terminal.console import PlainConsole
from glove_bridge.calibration_file import SHIPPED, load_calibration
from glove_bridge.framing import StreamDecoder
from glove_bridge.framing import decode as deframe
from glove_bridge.framing import encode as frame
from glove_bridge.gloves.base import Outcome
from glove_bridge.gloves.serial import link_timing
from glove_bridge.link_timing import USB
from glove_bridge.patterns import FOLDER, load_patterns
from glove_bridge.protocol import PROTOCOL, Ack, Hello, HelloReply, Message, Ping, Play, Set, Stop
from glove_bridge.session import Session
from human_relay.pointing import PointerState, hear
from human_relay.sources.playback import PERIOD_NS
from human_relay.sources.pointer import pointer_socket
from human_relay.sources.recording import RecordedHand
from observer.console import protocol as page
from observer.console.access import is_own_host, is_same_site, is_token
from observer.console.pattern_file import read_patterns as read_page_patterns
from observer.trace.read import open_trace
from shared.clock import NS_PER_S
from shared.codec import decode, encode
from shared.config import SCENARIOS, load_scenario
from shared.errors import DecodeError, SwarmTouchError
from shared.formation import build_formation
from shared.net.audit import Audit
from shared.net.keyring import Keyring
from shared.net.settings import node_settings
from shared.nodes import all_nodes, drone_node
from shared.plain_text import LONGEST, plain
from shared.pointer_link import decode_pointed
from shared.radio_link import decode_datagram, encode_head, radio_group
from shared.recordings.flight_folder import read_meta, read_obstacles, read_patterns, read_track
from shared.senses import Senses
from shared.signature import blank, sign_with, verify_with
from shared.topics import HAND, TOPICS, parse_key, rank
from shared.transport import Arrival
from shared.uri import parse_uri
from tests.fuzz import listeners, seeds

PATIENCE_NS = 3 * NS_PER_S
"""In so long a glove has told what became of a pattern, or the host has given it up."""

CORPUS = Path(__file__).parent / "corpus"
"""Inputs that were findings once, or lead deep into a parser; a folder per row."""


@frozen(kw_only=True)
class Parser:
    """One row.

    Attributes:
        name: For people, test ids and the folder in the corpus.
        parse: Parses; raises nothing but `SwarmTouchError`.
        seeds: Makes good inputs.
        is_wire: Whether it takes bytes from a wire or a binary file: those are fuzzed with coverage, too.
        is_file: Whether it reads a file: those are tried in all sizes, too.
    """

    name: str
    parse: Callable[[bytes], object]
    seeds: Callable[[], Iterable[bytes]]
    is_wire: bool = False
    is_file: bool = False

    def inputs(self) -> list[bytes]:
        """Returns the good inputs and what is kept in the corpus."""
        kept = sorted((CORPUS / self.name).glob("*"))
        return [*self.seeds(), *(file.read_bytes() for file in kept)]

    def accepts(self, data: bytes) -> bool:
        """Parses and says whether it was a value; whatever is neither value nor refusal is raised."""
        try:
            self.parse(data)
        except SwarmTouchError:
            return False
        return True


def _in_file(name: str, read: Callable[[Path], object]) -> Callable[[bytes], object]:
    """Makes a parser of bytes from a reader of files."""

    def parse(data: bytes) -> object:
        path = seeds.scratch() / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(data)
        return read(path)

    return parse


def _argument(data: bytes) -> str:
    """Decodes as the operating system hands over arguments and environment."""
    return data.decode("utf-8", "surrogateescape")


def _message(data: bytes) -> object:
    refusals = []
    for topic in TOPICS:
        try:
            message = decode(data, topic.kind)
            assert decode(encode(message), topic.kind) == message
        except SwarmTouchError as refusal:
            refusals.append(refusal)
    if len(refusals) == len(TOPICS):
        raise refusals[0]
    return refusals


def _signed_hand(data: bytes) -> object:
    """What an agent with keys makes of a payload on any of its keys, as it came and signed."""
    senses = Senses((1, 2), verify_with(seeds.keys().hand_public))
    senses.take({key: [Arrival(data, 5)] for key in (*senses.keys, "nonsense")})
    assert senses.hand is None or data in seeds.hands(), "a hand that the relay has not signed"
    signed = sign_with(seeds.keys().hand_private)(data + blank())
    senses.take({HAND.key(): [Arrival(signed, 6)]})
    return senses


def _serial(data: bytes) -> object:
    """Bytes on the line, and as a packet whose checksum is right."""
    with suppress(DecodeError):
        deframe(cobs.encode(data + crc_hqx(data, 0xFFFF).to_bytes(2, "big")))
    session = Session(USB, nonce=0)
    session.opened(0)
    for half in (data[: len(data) // 2], data[len(data) // 2 :]):
        session.receive(half, 1)
        session.due(2)
    heard = StreamDecoder().feed(data + frame(Ping(9)))
    assert heard[-1] == Ping(9), "garbage has cost the message after it"
    return [frame(message) for message in heard]


def _glove(data: bytes) -> object:
    """A glove that answers what the data says, well framed, eight bytes each time, again and again."""
    session, reports, now_ns, turn = Session(USB, nonce=0), [], 0, 0
    session.opened(now_ns)
    asked_ns = None
    while now_ns < PATIENCE_NS:
        if session.device is not None and asked_ns is None:
            asked_ns = now_ns
            session.play(seeds.FRAMES, now_ns)
        line = session.due(now_ns)
        if line:
            session.receive(_glove_answer(deframe(line[1:-1]), data[turn : turn + 8]), now_ns + 1)
            turn = turn + 8 if turn + 8 < len(data) else 0
        reports += [report.outcome for report in session.take_reports()]
        now_ns = max(session.next_ns() or PATIENCE_NS, now_ns + 1_000_000)
    ended = [outcome for outcome in reports if outcome is not Outcome.STARTED]
    assert asked_ns is None or asked_ns > PATIENCE_NS / 2 or len(ended) == 1, "a pattern that never ends"
    return reports


def _glove_answer(command: Message, said: bytes) -> bytes:
    """Makes a frame whose checksum is right: any packet, or an answer to this very command; or nothing."""
    kind, body = (said[0] & 3, said[1:]) if said else (0, b"")
    if kind == 0:
        return b""
    packet = body
    if kind == 1 and isinstance(command, Hello):
        name = command.nonce.to_bytes(2, "big")
        packet = bytes((HelloReply.TYPE, command.seq, PROTOCOL, 2, 0)) + name + body[:6]
    elif kind == 1 and isinstance(command, Set | Play | Stop | Ping):
        packet = bytes((Ack.TYPE, command.seq)) + command.session.to_bytes(2, "big") + body[:5]
    return b"\0" + bytes(cobs.encode(packet + crc_hqx(packet, 0xFFFF).to_bytes(2, "big"))) + b"\0"


def _vehicle(data: bytes) -> object:
    with suppress(SwarmTouchError):
        return encode_order(*decode_order(data))
    return encode_pose(*decode_pose(data))


def _trace(path: Path) -> object:
    trace = open_trace(path)
    return list(trace.records()), list(trace.messages()), trace.faults


def _hand(path: Path) -> object:
    """Reads a recorded hand and plays its begin."""
    hand = RecordedHand(parse_uri(f"recording:{path}?lead=0", example=""), 0)
    poses = [hand.poll(period * PERIOD_NS) for period in range(100)]
    assert all(math.isfinite(x) for pose in poses if pose for x in (*pose.position, pose.yaw))
    return poses, hand.remarks


def _scenario(path: Path) -> object:
    scenario = load_scenario(path)
    formation = build_formation(scenario)
    return [node_settings(scenario, formation, node) for node in all_nodes(formation)[:3]]


def _endpoint(data: bytes) -> object:
    """An endpoint becomes a part of Zenoh's configuration."""
    text = json.dumps(data.decode(errors="replace"))
    scenario = load_scenario("rhombus", [f"net.endpoints.relay={text}", f"net.endpoint={text}"])
    settings = node_settings(scenario, build_formation(scenario), drone_node(1))
    with suppress(zenoh.ZError):  # `shared.bus` makes a `DeviceError` of it
        zenoh.Config.from_json5(json.dumps(settings))
    return settings


def _group(data: bytes) -> object:
    text = json.dumps(data.decode(errors="replace"))
    return radio_group(load_scenario("rhombus", [f"net.multicast={text}", f"net.interface={text}"]).net)


def _radio(data: bytes) -> object:
    said = decode_datagram(data)
    assert encode_head(said.swarm, said.key) + said.payload == data
    return said


def _uri(data: bytes) -> object:
    uri = parse_uri(_argument(data), example="pointer://")
    uri.number("speed", 1.0, low=0.0, high=4.0)
    return [part(uri) for part in (pointer_socket, link_timing)]


def _headers(data: bytes) -> object:
    text = data.decode("latin-1")
    return (
        is_own_host(text, ["here"]),
        is_same_site(text, "localhost:8080"),
        is_token(_argument(data), "secret"),
    )


def _key(data: bytes) -> object:
    text = data.decode(errors="replace")
    rank(text)
    place = parse_key(text)
    assert place.topic.key(role=place.role, id=place.id) == text, "a key has one way to be written"
    return place


def _text(data: bytes) -> object:
    """Foreign text in a terminal, a table and a log."""
    text = data.decode("utf-8", "surrogateescape")
    shown = plain(text)
    assert shown.isprintable(), shown
    assert len(shown) <= LONGEST + 3, shown
    assert not text.isprintable() or text.startswith(shown.removesuffix("..."))
    out = StringIO()
    table = Table(title=text, caption=text)
    table.add_column(text)
    table.add_row(text)
    for each in (text, table):
        PlainConsole(file=out, width=80).print(each)
    assert out.getvalue().replace("\n", "").isprintable(), out.getvalue()
    out.getvalue().encode()
    return shown


def _zenoh_log(data: bytes) -> object:
    audit = Audit(["drone/1"])
    audit.read(data.decode(errors="replace"))
    return audit.report(10**10), audit.metrics()


def _certificate(path: Path) -> object:
    (path.parent / "members.toml").write_text("members = []", encoding="ascii")
    return issued(Keyring(path.parent))


_Wire = partial(Parser, is_wire=True)
_File = partial(Parser, is_file=True)

PARSERS = (
    _Wire(name="message", parse=_message, seeds=seeds.messages),
    _Wire(name="signed-hand", parse=_signed_hand, seeds=seeds.hands),
    _Wire(name="serial", parse=_serial, seeds=seeds.frames),
    _Wire(name="glove", parse=_glove, seeds=seeds.glove_answers),
    _Wire(name="vehicle", parse=_vehicle, seeds=seeds.vehicle_datagrams),
    _Wire(
        name="pointer",
        parse=lambda data: hear(PointerState(moved_ns=0), decode_pointed(data), 1),
        seeds=seeds.pointers,
    ),
    _Wire(name="radio", parse=_radio, seeds=seeds.radio_datagrams),
    _Wire(name="page", parse=page.parse, seeds=seeds.page_messages),
    _Wire(name="key", parse=_key, seeds=lambda: [b"human/hand", b"drone/12/state", b"status/relay/0"]),
    _Wire(name="said", parse=listeners.hear, seeds=seeds.said),
    _Wire(
        name="token",
        parse=listeners.hear_token,
        seeds=lambda: [b"alive/drone/12", b"alive/relay/0", b"alive/observer/65535"],
    ),
    _Wire(name="text", parse=_text, seeds=lambda: [b"drone 2", "Müller".encode(), b"[/red] \x1b[31m"]),
    _Wire(name="zenoh-log", parse=_zenoh_log, seeds=lambda: [seeds.ZENOH_LOG]),
    _File(name="trace", parse=_in_file("trace.mcap", _trace), seeds=seeds.traces, is_wire=True),
    _File(name="bag", parse=_in_file("hand.bag", _hand), seeds=seeds.bags, is_wire=True),
    _File(
        name="scenario",
        parse=_in_file("scenario.toml", _scenario),
        seeds=lambda: seeds.files(*sorted(SCENARIOS.glob("*.toml"))),
    ),
    Parser(
        name="override",
        parse=lambda data: load_scenario("rhombus", [_argument(data)]),
        seeds=lambda: seeds.OVERRIDES,
    ),
    Parser(
        name="scenario-name",
        parse=lambda data: load_scenario(_argument(data)),
        seeds=lambda: [b"rhombus", b"line"],
    ),
    Parser(name="endpoint", parse=_endpoint, seeds=lambda: [b"tcp/10.0.0.1:7447", b"quic/[::1]:7?mixed_rel=1"]),
    Parser(name="radio-group", parse=_group, seeds=lambda: [b"224.0.0.225:7450"]),
    Parser(name="uri", parse=_uri, seeds=lambda: seeds.URIS[:1]),
    Parser(
        name="vehicle-uri",
        parse=lambda data: sim.parse_uri(_argument(data)),
        seeds=lambda: [b"sim://127.0.0.1:7400/2", b"sim://[::1]:7400/2"],
    ),
    Parser(
        name="headers",
        parse=_headers,
        seeds=lambda: [b"localhost:8080", b"http://localhost:8080", b"[::1]:80", b"secret"],
    ),
    _File(
        name="calibration",
        parse=_in_file("calibration.toml", load_calibration),
        seeds=lambda: seeds.files(SHIPPED),
    ),
    _File(
        name="patterns",
        parse=_in_file("patterns.toml", load_patterns),
        seeds=lambda: seeds.files(*sorted(FOLDER.glob("*.toml"))),
    ),
    _File(
        name="page-patterns",
        parse=_in_file("patterns.json", read_page_patterns),
        seeds=lambda: [json.dumps(seeds.PAGE_PATTERNS).encode()],
    ),
    _File(
        name="members",
        parse=_in_file("members/members.toml", lambda path: Keyring(path.parent).members()),
        seeds=lambda: seeds.files(seeds.keys().folder / "members.toml"),
    ),
    _File(
        name="hand-public-key",
        parse=_in_file("hand.pub", verify_with),
        seeds=lambda: seeds.files(seeds.keys().hand_public),
    ),
    _File(
        name="hand-private-key",
        parse=_in_file("hand.key", sign_with),
        seeds=lambda: seeds.files(seeds.keys().hand_private),
    ),
    _File(
        name="certificate",
        parse=_in_file("issued/relay.crt", _certificate),
        seeds=lambda: seeds.files(seeds.keys().authority, seeds.keys().certificate("relay")),
    ),
    _File(name="flight-track", parse=_in_file("glove.csv", read_track), seeds=lambda: [seeds.TRACK]),
    _File(name="flight-track-packed", parse=_in_file("glove.csv.gz", read_track), seeds=seeds.tracks),
    _File(
        name="flight-patterns",
        parse=_in_file("pattern_topic.csv.gz", lambda path: read_patterns(path.parent)),
        seeds=lambda: [gzip.compress(b"t_bag_ns,name\n1,\n2,extended_left\n", mtime=0)],
    ),
    _File(
        name="flight-obstacles",
        parse=_in_file("obstacles.csv", lambda path: read_obstacles(path.parent)),
        seeds=lambda: [b"name,median_x,median_y\na,1.0,2.0\nb,-1,0\n"],
    ),
    _File(
        name="flight-meta",
        parse=_in_file("meta.json", lambda path: read_meta(path.parent)),
        seeds=lambda: [json.dumps(seeds.META).encode()],
    ),
    _File(
        name="hand-csv",
        parse=_in_file("hand.csv", _hand),
        seeds=seeds.hand_tables,
    ),
)
