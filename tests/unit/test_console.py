"""The console between pages and swarm: what it says to whom, with messages, time and datagrams of the test."""

import asyncio
import json
import re
from collections import Counter
from typing import Any

import pytest
from msgspec.structs import replace

from observer.console.console import Console
from observer.console.notices import notices
from observer.console.page_link import MOST_EVENTS, PageLink
from observer.console.pattern_file import read_patterns
from observer.console.scene import CLEARANCE, HandMap, scene
from observer.console.swarm_view import SwarmView
from shared.clock import NS_PER_S
from shared.codec import encode
from shared.config import load_scenario
from shared.errors import ConfigError
from shared.formation import build_formation
from shared.messages import (
    NO_FLAGS,
    DroneState,
    Flag,
    HandSample,
    Message,
    Mode,
    PatternEvent,
    ProcessStatus,
    Vector,
    Wish,
)
from shared.nodes import MOST_OTHERS, processes
from shared.pointer_link import Pointed, Verb, decode_pointed
from shared.scenario import Scenario
from shared.topics import DRONE_STATE, HAND, PATTERN, STATUS
from shared.transport import TOO_MANY, Arrival

START = 1_000 * NS_PER_S
RHOMBUS = load_scenario("slalom")
EI = [{"ms": 200, "hz": {"3": 150.0}}]


class Stage:
    """A console whose clock, swarm and relay are the test's."""

    def __init__(self, scenario: Scenario = RHOMBUS) -> None:
        self.now = START
        self.sent: list[Pointed] = []
        self.deaf = ""
        formation = build_formation(scenario)
        hand = HandMap(scenario, formation)
        view = SwarmView(formation, hand, {"EI": EI}, frozenset({"DRONE_LOST"}), START)
        self.console = Console(
            scenario,
            formation,
            view=view,
            hand=hand,
            point=self.point,
            sender=77,
            clock=lambda: self.now,
        )
        self._seq = 0

    def step(self, seconds: float = 0.02, **messages: Message) -> None:
        """Lets time pass; `drone_1=state`, `hand=sample`, `pattern=event` arrive."""
        self.now += round(seconds * NS_PER_S)
        keys = {"hand": HAND.key(), "pattern": PATTERN.key(), "relay": STATUS.key(role="relay", id=0)}
        keys |= {f"drone_{i}": DRONE_STATE.key(id=i) for i in range(1, 5)}
        self.console.step({keys[name]: [Arrival(encode(m), self.now)] for name, m in messages.items()})

    def point(self, datagram: bytes) -> str:
        self.sent.append(decode_pointed(datagram))
        return self.deaf

    def last(self) -> Pointed:
        """What the relay was told last."""
        return self.sent[-1]

    def envelope(self) -> dict[str, Any]:
        self._seq += 1
        return {"epoch": 1, "seq": self._seq, "stamp_ns": self.now}

    def drone(
        self, mode: Mode = Mode.FOLLOW, flags: Flag = NO_FLAGS, position: Vector = (0.0, 0.0, 1.2)
    ) -> DroneState:
        return DroneState(
            **self.envelope(),
            id=1,
            position=position,
            velocity=(0.0, 0.0, 0.0),
            goal=(0.5, 0.0, 1.2),
            goal_velocity=(0.0, 0.0, 0.0),
            setpoint=(0.4, 0.0, 1.2),
            mode=mode,
            flags=flags,
            displacements={"human-1": (0.1, 0.0, 0.0)},
        )

    def hand(self, position: Vector = (0.2, 0.1, 1.2)) -> HandSample:
        return HandSample(
            **self.envelope(), position=position, velocity=(0.1, 0.0, 0.0), yaw=0.0, mode=Wish.FLY
        )


def read(link: PageLink) -> list[dict[str, Any]]:
    """Everything that waits for a page."""
    texts: list[str] = []

    async def send(text: str) -> None:
        texts.append(text)

    async def drain() -> None:
        task = asyncio.create_task(link.run(send))
        for _ in range(3):
            await asyncio.sleep(0)
        task.cancel()

    asyncio.run(drain())
    return [json.loads(text) for text in texts]


def newest(link: PageLink) -> dict[str, dict[str, Any]]:
    return {message["type"]: message for message in read(link)}


def say(stage: Stage, link: PageLink, **message: object) -> None:
    stage.console.hear(link, json.dumps(message))


def test_a_page_learns_everything_first() -> None:
    stage = Stage()
    stage.step(drone_1=stage.drone(), hand=stage.hand())
    messages = read(stage.console.open())
    assert [m["type"] for m in messages] == ["scene", "control", "notices", "health", "snapshot"]
    first = messages[0]
    assert (first["you"], first["swarm"], first["can_steer"]) == (1, "slalom", True)
    assert [drone["references"] for drone in first["drones"]] == [["human"], [1], [1], [2, 3]]
    assert first["links"][0] == {"name": "human-1", "from": "human", "to": 1, "limit": 0.25}
    assert first["obstacles"][0]["radius"] == 0.12
    snapshot = messages[-1]
    assert snapshot["hand"]["point"] == [0.2, 0.1, 1.2]
    (drone,) = snapshot["drones"]
    assert (drone["mode"], drone["links"], drone["flags"]) == ("FOLLOW", {"human-1": [0.1, 0.0, 0.0]}, [])


def test_of_snapshots_only_the_newest_is_sent_events_all() -> None:
    stage = Stage()
    link = stage.console.open()
    read(link)
    for x in (1.0, 2.0, 3.0):
        event = PatternEvent(
            **stage.envelope(), pattern="EI", outcome="started", state_seq=0, started_ns=stage.now
        )
        stage.step(drone_1=stage.drone(position=(x, 0.0, 1.2)), pattern=event)
    messages = read(link)
    snapshots = [m for m in messages if m["type"] == "snapshot"]
    patterns = [m for m in messages if m["type"] == "pattern"]
    assert [m["drones"][0]["position"][0] for m in snapshots] == [3.0]
    assert [(m["name"], m["frames"]) for m in patterns] == [("EI", EI)] * 3


def test_a_page_that_joins_late_is_told_what_plays() -> None:
    stage = Stage()
    event = PatternEvent(**stage.envelope(), pattern="EI", outcome="started", state_seq=0, started_ns=stage.now)
    stage.step(pattern=event)
    stage.now += NS_PER_S // 10
    pattern = newest(stage.console.open())["pattern"]
    assert pattern["elapsed"] == pytest.approx(0.12)
    done = PatternEvent(**stage.envelope(), pattern="EI", outcome="finished", state_seq=0)
    stage.step(pattern=done)
    assert "pattern" not in newest(stage.console.open())


def test_the_holder_moves_the_relay_and_silence_releases() -> None:
    stage = Stage()
    stage.step(drone_1=stage.drone(), hand=stage.hand())
    link = stage.console.open()
    say(stage, link, type="take")
    assert stage.last() == Pointed(77, Verb.FLY, (0.2, 0.1, 1.2)), "it begins where the hand is"
    say(stage, link, type="hand", point=[-1.0, 0.5, 1.0], yaw=0.3)
    assert stage.last() == Pointed(77, Verb.FLY, (-1.0, 0.5, 1.0), 0.3)
    say(stage, link, type="wish", wish="HOLD")
    assert stage.last().verb is Verb.HOLD
    assert newest(link)["control"] == {"type": "control", "holder": 1, "asking": [], "pages": 1, "wish": "HOLD"}
    stage.step(0.4)
    assert stage.last().verb is Verb.HOLD, "repeated without being asked"
    stage.step(0.4)
    assert stage.last().verb is Verb.RELEASED
    assert newest(link)["control"]["holder"] is None


def test_on_the_ground_nothing_flies_before_it_is_told_to() -> None:
    stage = Stage()
    stage.step(drone_1=stage.drone(Mode.GROUND))
    link = stage.console.open()
    say(stage, link, type="take")
    assert stage.last().verb is Verb.GROUND
    say(stage, link, type="wish", wish="FLY")
    assert stage.last().verb is Verb.FLY


def test_closing_the_page_releases_at_once_and_without_pages_it_is_silent() -> None:
    stage = Stage()
    one, other = stage.console.open(), stage.console.open()
    say(stage, one, type="take")
    stage.console.close(one)
    assert stage.last().verb is Verb.RELEASED
    stage.console.close(other)
    count = len(stage.sent)
    stage.step(1.0)
    assert len(stage.sent) == count


def test_two_pages_contend() -> None:
    stage = Stage()
    one, other = stage.console.open(), stage.console.open()
    say(stage, one, type="take")
    say(stage, other, type="take")
    say(stage, other, type="hand", point=[9.0, 9.0, 1.0], yaw=0.0)
    told = newest(other)
    assert told["control"]["holder"] == 1
    assert told["control"]["asking"] == [2]
    assert "does not hold the hand" in told["refused"]["why"]
    say(stage, one, type="give", to=2)
    assert newest(one)["control"]["holder"] == 2
    say(stage, one, type="wish", wish="STOP")
    assert stage.last().verb is Verb.STOP
    stage.step(0.1)
    assert stage.last().verb is Verb.STOP
    assert newest(one)["control"]["wish"] == "STOP"


def test_stop_needs_no_page_and_says_whether_it_was_heard() -> None:
    stage = Stage()
    stage.deaf = "nobody listens at pointer.sock"
    assert stage.console.stop() == stage.deaf
    stage.deaf = ""
    stage.step(0.1)
    assert stage.last().verb is Verb.STOP, "it is repeated, also without any page"
    assert stage.console.stop() == ""
    assert newest(stage.console.open())["control"]["wish"] == "STOP"


def test_garbage_from_a_page_is_answered() -> None:
    stage = Stage()
    link = stage.console.open()
    stage.console.hear(link, b"\x00\xff")
    assert newest(link)["refused"]["why"].startswith("malformed")


def test_garbage_from_the_swarm_is_counted() -> None:
    stage = Stage()
    stage.console.step(
        {PATTERN.key(): [Arrival(b"\xc1", START)], STATUS.key(role="x", id=1): [Arrival(b"", START)]}
    )
    assert sum(stage.console.view.rejected.values()) == 2


def test_what_several_drones_suffer_reads_as_well_as_what_one_does() -> None:
    stage = Stage()
    every = Flag.OLD_POSE | Flag.MISSED | Flag.REJECTED_INPUT | Flag.BLOCKED
    told = [
        [
            notice["text"]
            for notice in notices(dict.fromkeys(ids, stage.drone(flags=every)), (), hand_silent=False)
        ]
        for ids in ([1], [1, 2])
    ]
    assert [text.replace("drone 1", "drones 1, 2") for text in told[0]] == told[1]
    assert not any(re.search(r"^drones 1, 2 (is|does|has)\b|\b(it|its)\b", text) for text in told[1])


def test_made_up_processes_fill_neither_the_page_nor_the_memory() -> None:
    stage = Stage()
    link = stage.console.open()
    for number in range(1_000):
        made_up = ProcessStatus(**stage.envelope(), role="evil", id=number, pid=1, host="h", state="running")
        key = STATUS.key(role="evil", id=number)
        stage.console.step({key: [Arrival(encode(made_up), stage.now)]})
        stage.console.view.presence_changed(f"evil/{number}", present=True)
    relay = ProcessStatus(**stage.envelope(), role="relay", id=0, pid=1, host="h", state="running")
    stage.console.view.presence_changed("drone/4", present=True)
    stage.step(1.1, relay=relay)
    listed = {process["name"]: process for process in newest(link)["health"]["processes"]}
    assert listed["relay"]["age"] is not None
    assert listed["drone-4"]["present"]
    assert len(listed) <= 2 + len(processes(build_formation(RHOMBUS))) + MOST_OTHERS
    assert stage.console.view.rejected[TOO_MANY] > 900


def test_notices_and_health_come_when_something_changes() -> None:
    stage = Stage()
    link = stage.console.open()
    status = ProcessStatus(**stage.envelope(), role="relay", id=0, pid=1, host="h", state="running", cpu=0.05)
    stage.step(0.2, drone_1=stage.drone(flags=Flag.BLOCKED), relay=status)
    told = newest(link)
    assert told["notices"]["notices"] == [{"level": "warning", "text": "drone 1 blocked: goal not reached"}]
    stage.step(1.0)
    told = newest(link)
    assert told["notices"]["notices"][0] == {"level": "alarm", "text": "drone 1 is lost"}
    assert told["health"]["processes"][0]["cpu"] == 0.05
    assert told["health"]["processes"][0]["present"] is False


def test_a_hand_that_has_jumped_is_told_while_somebody_flies() -> None:
    said = [notices({1: Stage().drone(mode=mode)}, (), hand_silent=False, hand_jumped=True) for mode in Mode]
    texts = {mode: [notice["text"] for notice in found] for mode, found in zip(Mode, said, strict=True)}
    assert texts[Mode.GROUND] == []
    assert texts[Mode.FOLLOW] == ["the hand jumped: the swarm holds until it moves like a hand again"]


def test_who_waits_says_for_whom_and_who_is_missed_is_an_alarm() -> None:
    stage = Stage()
    waiting = replace(stage.drone(mode=Mode.GROUND, flags=Flag.WAITING), unheard=(2, 3))
    (notice,) = notices({1: waiting}, (), hand_silent=False)
    assert notice == {"level": "warning", "text": "drone 1 waits to hear drones 2, 3"}
    (alarm,) = notices({1: stage.drone(flags=Flag.MISSED)}, (), hand_silent=False)
    assert alarm["level"] == "alarm"


def test_a_page_that_steers_and_is_not_heard_is_told() -> None:
    stage = Stage()
    link = stage.console.open()
    stage.deaf = "nobody listens at pointer.sock"
    stage.step(0.2)
    assert newest(link)["notices"]["notices"] == [], "whoever only watches need not know"
    say(stage, link, type="take")
    say(stage, link, type="wish", wish="FLY")
    stage.step(0.2)
    (notice,) = newest(link)["notices"]["notices"]
    assert notice == {"level": "alarm", "text": f"no relay hears this page: {stage.deaf}"}
    stage.deaf = ""
    say(stage, link, type="wish", wish="FLY")
    stage.step(0.2)
    assert newest(link)["notices"]["notices"] == []


def test_what_others_do_fills_no_page_and_closes_none() -> None:
    stage = Stage()
    slow, toggling = stage.console.open(), stage.console.open()
    read(slow)
    for k in range(10 * MOST_EVENTS):
        say(stage, toggling, type="take" if k % 2 else "release")
    stage.step(drone_1=stage.drone())
    said = Counter(message["type"] for message in read(slow))
    assert said == {"control": 1, "health": 1, "snapshot": 1}

    for k in range(3 * MOST_EVENTS):
        event = PatternEvent(**stage.envelope(), pattern=f"{k}", outcome="finished", state_seq=0)
        stage.step(pattern=event)
    patterns = [message["name"] for message in read(slow) if message["type"] == "pattern"]
    assert patterns == [str(k) for k in range(2 * MOST_EVENTS, 3 * MOST_EVENTS)]


@pytest.mark.parametrize("name", ["slalom", "maze", "grid"])
def test_a_mapped_hand_comes_back_from_the_real_one(name: str) -> None:
    scenario = load_scenario(name)
    hand = HandMap(scenario, build_formation(scenario))
    for point in (hand.start, hand.low, hand.high):
        there = hand.mapped(point)
        assert hand.mapped(hand.real(there)) == pytest.approx(there)
    far = hand.mapped(hand.real((99.0, -99.0, -99.0)))
    assert all(low - 1e-9 <= x <= high + 1e-9 for low, x, high in zip(hand.low, far, hand.high, strict=True))
    if scenario.hand.height is None:
        assert far[2] >= CLEARANCE - 0.1


def test_without_a_pointer_a_page_cannot_steer() -> None:
    scenario = load_scenario("rhombus", ["net.pointer="])
    formation = build_formation(scenario)
    assert scene(scenario, formation, HandMap(scenario, formation))["can_steer"] is False


def test_a_pattern_file_is_read_or_refused(tmp_path: Any) -> None:
    path = tmp_path / "patterns.json"
    path.write_text(json.dumps({"frames": {"EI": EI}, "cues": ["DRONE_LOST"]}))
    assert read_patterns(path) == ({"EI": EI}, frozenset({"DRONE_LOST"}))
    for wrong in ("", "[]", '{"frames": {"EI": [{"ms": "x"}]}, "cues": []}'):
        path.write_text(wrong)
        with pytest.raises(ConfigError, match="no readable pattern file"):
            read_patterns(path)
