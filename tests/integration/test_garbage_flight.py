"""Garbage from a foreign Zenoh session into a running flight: counted by reason, and nothing else happens."""

import json
import math
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import msgpack
import pytest
import zenoh
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from deploy.status.listen import listen
from deploy.status.show import status_json
from shared.clock import NS_PER_S
from shared.codec import encode
from shared.formation import build_formation
from shared.messages import SCHEMA_VERSION, DroneState, HandSample, Message, Mode, ProcessStatus
from shared.nodes import BRIDGE, all_nodes, endpoint
from shared.scenario import Scenario
from shared.topics import DRONE_STATE, FORMATION_STATE, HAND, PATTERN, STATUS
from tests.integration.recorder import RELAY, WORLD, Recorder
from tests.integration.swarm import launched
from tests.strategies import fields_of, garbage, refusal

PACE_S = 0.004
"""Between two foreign messages: slow enough for every one to be looked at."""
MADE = 400
BURST = 3_000
REASONS = {
    *("malformed", "oversized", "version", "wrong-type", "missing-field", "non-finite", "out-of-range"),
    *("wrong-id", "out-of-order", "ahead", "outside"),
}
EVERYWHERE = ("**", "human/*", "drone/*/state", "drone/x/*", "status/**")
"""Key expressions on which one put reaches many listeners."""
TOKENS = ("**", f"drone/{'9' * 5000}", "[/x]/\x1b[31m", "drone/2/3", "observer/70000")
NASTY = "\x1b]0;mine\x07[/x][bold]"


class Foreigner:
    """A foreign session that reaches every process of a swarm.

    Attributes:
        sent: How many messages on each key were sent, by the reason for which they will be refused.
    """

    def __init__(self, name: str, session: zenoh.Session) -> None:
        self.sent: dict[str, Counter[str]] = {}
        self._prefix = name
        self._session = session

    def put(self, key: str, payload: bytes, reason: str) -> None:
        """Sends one message into the swarm."""
        self.sent.setdefault(key, Counter())[reason] += 1
        # Blocking, or its own queue would drop most of a burst before it hurts anybody.
        self._session.put(f"{self._prefix}/{key}", payload, congestion_control=zenoh.CongestionControl.BLOCK)

    def announce(self, token: str) -> zenoh.LivelinessToken:
        """Announces a process."""
        return self._session.liveliness().declare_token(f"{self._prefix}/alive/{token}")

    def expected(self, drone: int) -> Counter[str]:
        """Returns what one agent should have counted: whatever came on the keys that it listens to."""
        counted: Counter[str] = Counter()
        for key, reasons in self.sent.items():
            other = key.startswith("drone/") and key != DRONE_STATE.key(id=drone) and key in STATE_KEYS
            if key == HAND.key() or other:
                counted += reasons
        return counted


STATE_KEYS = [DRONE_STATE.key(id=drone) for drone in (1, 2, 3, 4)]
KINDS: dict[str, type[Message]] = {
    HAND.key(): HandSample,
    **dict.fromkeys(STATE_KEYS, DroneState),
    FORMATION_STATE.key(): FORMATION_STATE.kind,
    PATTERN.key(): PATTERN.kind,
    **{STATUS.key(role=role, id=number): STATUS.kind for role, number in (("drone", 1), ("world", 0))},
    # Nobody listens to these; a message of any type is garbage there.
    **dict.fromkeys(("drone/9/state", "drone/x/state", "human/foot", "nonsense"), DroneState),
}


@contextmanager
def foreigner(scenario: Scenario) -> Iterator[Foreigner]:
    """Opens a session that is linked to everybody: relay, agents, world and launcher."""
    formation = build_formation(scenario)
    nodes = [node for node in all_nodes(formation) if node != BRIDGE]
    tree = {
        "mode": "peer",
        "listen": {"endpoints": []},
        "connect": {"endpoints": [endpoint(scenario, formation, node) for node in nodes]},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
    }
    with zenoh.open(zenoh.Config.from_json5(json.dumps(tree))) as session:
        deadline = time.monotonic() + 10.0
        while len(session.info.peers_zid()) < len(nodes):
            assert time.monotonic() < deadline
            time.sleep(0.02)
        yield Foreigner(scenario.swarm.name, session)


def send_one_of_each(stranger: Foreigner, hand: HandSample, state: DroneState) -> None:
    """Sends every kind of fault once, to the hand's key and to drone 2's; a valid message again is one, too."""
    for key, message in ((HAND.key(), hand), (DRONE_STATE.key(id=2), state)):
        fields, payload = fields_of(message), encode(message)
        faults: dict[str, bytes] = {
            "malformed": payload[: len(payload) // 2],
            "oversized": payload + bytes(60_000),
            "version": msgpack.packb({**fields, "v": SCHEMA_VERSION + 1}),
            "wrong-type": msgpack.packb({**fields, "position": "xyz"}),
            "missing-field": msgpack.packb({k: v for k, v in fields.items() if k != "velocity"}),
            "non-finite": msgpack.packb({**fields, "position": [float("nan"), 0.0, 0.0]}),
            "out-of-range": msgpack.packb({**fields, "velocity": [0.0, 0.0, 51.0]}),
            "out-of-order": payload,
            "ahead": encode(replace(message, seq=2**64 - 1)),
        }
        for reason, fault in faults.items():
            assert reason in ("out-of-order", "ahead") or refusal(fault, type(message)) == reason
            stranger.put(key, fault, reason)
            time.sleep(PACE_S)
    stranger.put(DRONE_STATE.key(id=3), encode(state), "wrong-id")
    lie = replace(state, seq=state.seq + 100, position=(0.0, 99.0, 1.0))
    stranger.put(DRONE_STATE.key(id=2), encode(lie), "outside")


def send_made_up(stranger: Foreigner) -> None:
    """Sends what hypothesis makes up, to every key, at a moderate rate."""

    @settings(
        max_examples=MADE,
        deadline=None,
        derandomize=True,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(data=st.data(), key=st.sampled_from(sorted(KINDS)))
    def send(data: st.DataObject, key: str) -> None:
        payload = data.draw(garbage(KINDS[key]))
        stranger.put(key, payload, str(refusal(payload, KINDS[key])))
        time.sleep(PACE_S)

    send()


@contextmanager
def everywhere(stranger: Foreigner, hand: HandSample) -> Iterator[None]:
    """Puts on many keys at once, announces whatever it likes, and speaks for others in a status."""
    status = ProcessStatus(
        epoch=1,
        seq=1,
        stamp_ns=1,
        role="relay",
        id=0,
        pid=1,
        host=NASTY,
        state=NASTY,
        rejected={NASTY: 1},
        metrics={f"refused {NASTY}": 1.0},
    )
    for _ in range(10):
        for key in EVERYWHERE:
            for payload in (encode(hand), b"\xc1"):
                stranger.put(key, payload, "unknown-key")
        for key in ("status/drone/1", "status/relay/0", "status/[/x]/0"):
            stranger.put(key, encode(status), "wrong-id")
        time.sleep(PACE_S)
    tokens = [stranger.announce(token) for token in TOKENS]
    yield
    for token in tokens:
        token.undeclare()  # type: ignore[no-untyped-call]  # the stub lacks its return type


def is_counted(recorder: Recorder, stranger: Foreigner, drone: int) -> bool:
    """Says whether an agent has counted all that it was sent, by reason.

    An agent that the machine held up may have dropped a few unseen: an inbox keeps eight samples per key.
    """
    sent, counted = stranger.expected(drone), Counter(recorder.statuses[f"drone/{drone}"].rejected)
    assert counted <= sent
    return counted.keys() == sent.keys() and counted.total() >= 0.98 * sent.total()


def check_flew_on(recorder: Recorder, start_ns: int, end_ns: int) -> None:
    """Everybody follows, steps and uses the real hand, all the time."""
    for drone in recorder.ids:
        states = [state for state in recorder.since(drone, start_ns) if state.step_ns < end_ns]
        assert {state.mode for state in states} == {Mode.FOLLOW}
        heard = sorted({state.heard[HAND.key()].arrival_ns for state in states})
        assert max(b - a for a, b in pairwise(heard)) < NS_PER_S // 4
        reach = [math.dist(state.goal, state.position) for state in states]
        assert max(reach) < 0.6, "its goals are those of a flight"


@pytest.mark.timeout(120)
def test_garbage_on_every_key_is_counted_and_the_flight_goes_on(tmp_path: Path) -> None:
    with launched("rhombus", "scripted:tour?peak=0.5", tmp_path) as flight:
        recorder = flight.recorder
        start_ns = recorder.clock()
        with foreigner(flight.scenario) as stranger:
            for _ in range(3):
                send_one_of_each(stranger, list(recorder.hands.values())[-30], recorder.states[2][-30])
            send_made_up(stranger)
            assert stranger.expected(1).keys() == REASONS
            recorder.until(lambda: all(is_counted(recorder, stranger, i) for i in recorder.ids), 10.0)
            keys = sorted(KINDS)
            for number in range(BURST):
                stranger.put(keys[number % len(keys)], b"\xc1" * (number % 5_000), "malformed")
            with everywhere(stranger, list(recorder.hands.values())[-30]):
                recorder.until(
                    lambda: all(
                        recorder.statuses[f"drone/{i}"].rejected.get("unknown-key", 0) for i in recorder.ids
                    ),
                    10.0,
                )
                rows = {row.token: row for row in listen(flight.scenario, longest_s=5.0)}
                assert {token for token in rows if not token.startswith("observer/")} <= recorder.present
                assert json.dumps(status_json(list(rows.values()))).isprintable()
            recorder.listen(2.0)
        end_ns = recorder.clock()
        summary = flight.end()
    check_flew_on(recorder, start_ns, end_ns)
    assert summary["ok"] is True
    assert (summary["restarts"], summary["collisions"], summary["fence_exits"]) == (0, 0, 0)
    assert not any(recorder.statuses[RELAY].rejected.values())
    assert sum(recorder.statuses[WORLD].rejected.values()) > len(REASONS)
    said = flight.logs() + (tmp_path / "launcher.log").read_text()
    assert "Traceback" not in said
    assert said.replace("\n", "").isprintable()
