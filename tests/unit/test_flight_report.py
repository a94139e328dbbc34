"""What the operator reads: the live table, the plain lines and the summary."""

import io
import json
import os
import re
from typing import cast

import pytest
from msgspec.structs import replace
from rich.console import Console

from deploy.launcher.flight import GRACE_S, INTERRUPTED_LANDING_S, Outcome
from deploy.launcher.monitor import Monitor
from deploy.launcher.process_table import GloveChoice
from deploy.launcher.status_view import SUMMARISE_ABOVE, AgentRow, plain_lines, status_table
from deploy.launcher.summary import Json, flight_summary, print_summary
from deploy.terminal.console import open_console
from human_relay.relay import IMPOSSIBLE_POSE
from observer.glove_log import MOST_NAMES, OTHERS
from shared.clock import system_clock
from shared.codec import encode
from shared.config import load_scenario
from shared.formation import build_formation
from shared.memory_bus import MemoryBus, MemoryNetwork
from shared.messages import (
    ORIGIN,
    DroneState,
    Flag,
    HandSample,
    Heard,
    Mode,
    PatternEvent,
    ProcessStatus,
    Wish,
)
from shared.nodes import MOST_OTHERS, processes
from shared.topics import DRONE_STATE, HAND, STATUS
from shared.transport import TOO_MANY

FORMATION = build_formation(load_scenario("rhombus"))
NO_FLAGS = Flag(0)
NASTY = "\x1b]0;mine\x07[/x][bold]\u202e"
REFEREE = {"collisions": 0.0, "fence_exits": 0.0, "min_distance_m": 0.5, "min_hand_distance_m": 0.4}


def state(drone: int, mode: Mode = Mode.GROUND, *, seq: int = 0, flags: Flag = NO_FLAGS) -> DroneState:
    return DroneState(
        epoch=1,
        seq=seq,
        stamp_ns=2_000_000 + seq,
        step_ns=2_000_000 + seq,
        id=drone,
        position=(0.5 * drone, 0.0, 1.23),
        velocity=ORIGIN,
        goal=(0.5 * drone, 0.3, 1.23),
        goal_velocity=ORIGIN,
        setpoint=ORIGIN,
        mode=mode,
        flags=flags,
        heard={"human/hand": Heard(1, 0, 1_500_000)},
    )


def status(drone: int, *, seq: int = 1, cpu: float = 0.2, rejected: int = 0) -> ProcessStatus:
    return ProcessStatus(
        epoch=1,
        seq=seq,
        stamp_ns=1,
        role="drone",
        id=drone,
        pid=7,
        host="here",
        state="running",
        rate_hz=60.0,
        cpu=cpu,
        rss_mb=50.0 + seq,
        rejected={"malformed": rejected} if rejected else {},
    )


def hand(mode: Wish = Wish.FLY) -> HandSample:
    return HandSample(epoch=1, seq=0, stamp_ns=1_000_000, position=ORIGIN, velocity=ORIGIN, yaw=0.0, mode=mode)


def outcome(**changes: object) -> Outcome:
    fields = {
        "seconds": 3.0,
        "unexpected_exits": {},
        "restarts": {"drone/1": 0},
        "failed_starts": {},
        "landed": True,
        "stopped": (),
        "interrupted": False,
        "early": False,
        "refused": (),
        "simulated": True,
        "referee": REFEREE,
    }
    return Outcome(**(fields | changes))  # type: ignore[arg-type]


class Swarm:
    """A monitor, and the swarm that it listens to."""

    def __init__(self) -> None:
        network = MemoryNetwork()
        self.bus = MemoryBus(network)
        self.monitor = Monitor(MemoryBus(network), FORMATION, system_clock())

    def say(self, *messages: HandSample | DroneState | ProcessStatus) -> Monitor:
        for message in messages:
            match message:
                case HandSample():
                    self.bus.publisher(HAND)(encode(message))
                case DroneState():
                    self.bus.publisher(DRONE_STATE, id=message.id)(encode(message))
                case ProcessStatus():
                    self.bus.publisher(STATUS, role=message.role, id=message.id)(encode(message))
        self.monitor.drain()
        return self.monitor


def rendered(renderable: object, width: int = 80) -> str:
    console = Console(file=io.StringIO(), width=width)
    console.print(renderable)
    return cast(io.StringIO, console.file).getvalue()


def printed(summary: Json) -> str:
    console = Console(file=io.StringIO(), width=80, markup=False)
    print_summary(summary, console)
    return cast(io.StringIO, console.file).getvalue()


def well(drone: int) -> AgentRow:
    return AgentRow(id=drone, alive=True, state=state(drone, Mode.FOLLOW), status=status(drone))


def ill(drone: int) -> AgentRow:
    flagged = state(drone, Mode.HOLD, flags=Flag.FENCE | Flag.HAND_STALE)
    return AgentRow(id=drone, alive=True, restarts=2, state=flagged, status=status(drone), latency_ms=12.3)


def test_the_live_table_shows_every_agent_within_80_columns() -> None:
    text = rendered(status_table([well(1), ill(2), AgentRow(id=3)], "flying", "hint"))
    lines = text.splitlines()
    assert all(len(line) <= 80 for line in lines)
    assert "FOLLOW 1.23 m     0.30 m       - 60 Hz        0        0 20%" in text
    assert "12.3 ms" in text
    assert "fence, hand stale" in " ".join(text.split())
    assert "absent" in text


def test_a_large_swarm_is_summarised_and_its_unhealthy_agents_listed() -> None:
    rows = [well(drone) for drone in range(1, SUMMARISE_ABOVE + 1)] + [ill(77)]
    text = rendered(status_table(rows, "flying", "hint"))
    assert f"{SUMMARISE_ABOVE} of {SUMMARISE_ABOVE + 1} agents are well" in text
    assert "77" in text
    assert text.count("FOLLOW") == 0
    lines = plain_lines(rows)
    assert [line.split(" | ")[0] for line in lines] == ["drone 77", "swarm"]


def test_plain_lines_are_name_and_line() -> None:
    (line,) = plain_lines([ill(2)])
    assert line.startswith("drone 2 | mode HOLD, height 1.23 m, goal error 0.30 m, latency 12.3 ms")
    assert line.endswith("flags fence, hand stale")


@pytest.mark.parametrize(
    ("modes", "down", "landed"),
    [
        ("", True, False),
        ("GROUND GROUND GROUND", True, False),
        ("GROUND GROUND GROUND GROUND", True, True),
        ("GROUND LAND GROUND GROUND", False, False),
        ("GROUND STOP GROUND GROUND", True, False),
    ],
)
def test_the_monitor_knows_when_everybody_is_down(modes: str, down: bool, landed: bool) -> None:
    states = [state(drone, Mode(mode)) for drone, mode in enumerate(modes.split(), start=1)]
    monitor = Swarm().say(*states)
    assert (monitor.all_down, monitor.all_landed) == (down, landed)


@pytest.mark.parametrize(
    ("wish", "ended"), [(Wish.FLY, False), (Wish.HOLD, False), (Wish.LAND, True), (Wish.STOP, True)]
)
def test_the_hand_ends_the_flight_when_everybody_is_down(wish: Wish, ended: bool) -> None:
    swarm = Swarm()
    assert swarm.say(hand(wish)).ended_by_hand is ended
    assert swarm.say(state(1, Mode.LAND)).ended_by_hand is False


def test_the_monitor_counts_garbage_and_impostors_and_goes_on() -> None:
    swarm = Swarm()
    swarm.bus.publisher(HAND)(b"\xff\x00")
    swarm.bus.publisher(DRONE_STATE, id=3)(encode(state(2)))
    swarm.say(state(1))
    assert swarm.monitor.rejected == {"malformed": 1, "wrong-id": 1}
    assert set(swarm.monitor.stats.latest) == {1}


def test_whatever_key_is_put_the_monitor_goes_on() -> None:
    swarm = Swarm()
    keys = (
        "**",
        "human/*",
        "drone/x/state",
        f"drone/{'9' * 5000}/state",
        "status/[/x]/\x1b[31m",
        "",
        "a" * 9000,
    )
    for key in keys:
        swarm.monitor._inbox.put(key, b"\xc0")
    assert swarm.say(state(1)).stats.latest.keys() == {1}
    assert swarm.monitor.rejected == {"unknown-key": len(keys)}


def test_made_up_processes_do_not_fill_the_memory() -> None:
    swarm = Swarm()
    for number in range(2_000):
        made_up = replace(status(1), role="observer", id=number)
        swarm.bus.publisher(STATUS, role="observer", id=number)(encode(made_up))
        swarm.monitor._presence_changed(f"observer/{number}", present=True)
    swarm.monitor.drain()
    most = len(processes(FORMATION)) + MOST_OTHERS
    assert len(swarm.monitor.health) == len(swarm.monitor.present) == most
    assert swarm.monitor.rejected[TOO_MANY] == 2_000 - most
    swarm.bus.announce("drone", 4)
    assert "drone/4" in swarm.monitor.present
    newest = swarm.say(replace(status(1), cpu=0.75)).health["drone/1"].status
    assert newest is not None
    assert newest.cpu == 0.75


def test_made_up_patterns_fill_neither_the_summary_nor_the_memory() -> None:
    swarm = Swarm()
    for number in range(1_000):
        swarm.monitor.glove.add(
            PatternEvent(
                epoch=1, seq=number, stamp_ns=0, pattern=f"{number}{NASTY * 10}", outcome="started", state_seq=0
            )
        )
    summary = flight_summary(outcome(), swarm.monitor, GloveChoice(uri="screen://", patterns="paper"))
    assert len(summary["glove"]["delivered"]) == MOST_NAMES + 1
    assert summary["glove"]["delivered"][OTHERS] == 1_000 - MOST_NAMES
    text = printed(summary)
    assert all(word in text for word in ("played", "delivered", "suppressed", "failed", "lost"))
    assert max(map(len, text.splitlines())) <= 80


def test_nobody_speaks_for_another() -> None:
    swarm = Swarm()
    swarm.bus.publisher(STATUS, role="drone", id=2)(encode(status(1)))
    swarm.bus.publisher(STATUS, role="relay", id=1)(encode(status(1)))
    swarm.bus.publisher(DRONE_STATE, id=2)(encode(state(1)))
    assert swarm.say(status(1)).health.keys() == {"drone/1"}
    assert swarm.monitor.rejected == {"wrong-id": 3}


def test_one_number_out_of_the_future_does_not_end_the_statistics() -> None:
    swarm = Swarm()
    last = 2**63
    monitor = swarm.say(hand(), replace(hand(Wish.STOP), seq=last), state(1), state(1, Mode.STOP, seq=last))
    monitor = swarm.say(state(1, Mode.FOLLOW, seq=1))
    assert monitor.stats.latest[1].mode is Mode.FOLLOW
    assert monitor.stats.hand == hand()
    assert monitor.stats.agents()[0].steps == 2
    assert monitor.rejected == {"ahead": 2}


def test_who_is_called_off_before_it_can_have_taken_off_is_not_to_blame() -> None:
    monitor = Swarm().say(hand(), state(1, Mode.TAKEOFF))
    summary = flight_summary(outcome(interrupted=True, early=True), monitor)
    assert (summary["ok"], summary["faults"]) == (True, [])
    summary = flight_summary(outcome(interrupted=True), monitor)
    assert "never followed it" in summary["faults"][0]


def test_presence_is_followed() -> None:
    swarm = Swarm()
    swarm.bus.announce("drone", 1)
    assert swarm.monitor.present == {"drone/1"}
    swarm.bus.close()
    assert swarm.monitor.present == set()


def test_the_summary_keeps_the_contract() -> None:
    swarm = Swarm()
    monitor = swarm.say(
        hand(),
        *(status(1, seq=seq, cpu=cpu) for seq, cpu in enumerate((5.0, 0.1, 0.3))),
        *(state(drone, Mode.FOLLOW) for drone in FORMATION.ids),
    )
    summary = flight_summary(outcome(), monitor)
    assert json.loads(json.dumps(summary)) == summary
    assert summary["ok"] is True
    assert summary["min_distance_m"] == 0.5
    agent = summary["agents"][0]
    assert agent["cpu"] == pytest.approx(0.2)  # the first status covers the start-up
    assert agent["rss_mb"] == 52.0
    assert agent["latency_ms"]["p50"] == pytest.approx(1.0, rel=0.02)
    assert set(agent) >= {
        *("id", "steps", "rate_hz", "on_time", "hand_used"),
        *("tracking_rms_m", "latency_ms", "cpu", "rss_mb"),
    }


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"landed": False}, "not every drone was seen to land"),
        (
            {"landed": False, "stopped": (1, 3)},
            "it was ended by STOP: the motors of drones 1, 3 were cut, wherever they were",
        ),
        ({"unexpected_exits": {"drone-1": [-9, 1]}}, "drone-1 ended unexpectedly (SIGKILL, exit code 1)"),
        ({"failed_starts": {"drone-1": 3}}, "drone-1 could not be started (3 times)"),
        ({"referee": REFEREE | {"collisions": 1.0}}, "1 collisions"),
        ({"referee": REFEREE | {"fence_exits": 2.0}}, "2 times out of the fence"),
        ({"referee": {}}, "what the referee saw is unknown"),
    ],
)
def test_what_makes_a_flight_not_ok_is_said(changes: dict[str, object], why: str) -> None:
    summary = flight_summary(outcome(**changes), Swarm().say(hand(Wish.GROUND)))
    assert (summary["ok"], summary["faults"]) == (False, [why])
    assert f"not ok: {why}" in printed(summary)


def test_a_flight_in_which_not_everybody_followed_the_hand_is_not_ok() -> None:
    monitor = Swarm().say(hand(), *(state(drone, Mode.FOLLOW) for drone in (1, 2)), state(3, Mode.TAKEOFF))
    summary = flight_summary(outcome(), monitor)
    assert summary["faults"] == ["the hand asked, but drones 3, 4 never followed it"]
    assert [agent["followed"] for agent in summary["agents"]] == [True, True, False, False]
    assert summary["hand"] == {"asked": True, "rejected": 0, "jumps": 0, "remarks": []}


def test_a_flight_whose_hand_was_never_heard_is_not_ok_but_where_it_was_called_off() -> None:
    summary = flight_summary(outcome(), Swarm().say(state(1)))
    assert summary["faults"] == ["nobody flew: no hand was ever heard; its log is relay.log"]
    assert flight_summary(outcome(interrupted=True), Swarm().monitor)["ok"] is True
    assert flight_summary(outcome(refused=("bridge",)), Swarm().monitor)["faults"] == []


def test_nobody_is_to_blame_where_the_hand_never_asked() -> None:
    summary = flight_summary(outcome(), Swarm().say(hand(Wish.HOLD), state(1)))
    assert summary["ok"] is True
    assert summary["hand"] == {"asked": False, "rejected": 0, "jumps": 0, "remarks": []}
    assert re.search("the hand asked to fly +no", printed(summary))


def test_a_hand_of_which_every_pose_is_impossible_makes_no_flight() -> None:
    def relay(epoch: int, rejected: int) -> ProcessStatus:
        return replace(status(0), role="relay", epoch=epoch, rejected={IMPOSSIBLE_POSE: rejected})

    monitor = Swarm().say(hand(Wish.HOLD), relay(1, 10), relay(1, 25), relay(2, 5))
    summary = flight_summary(outcome(), monitor)
    assert summary["hand"] == {"asked": False, "rejected": 30, "jumps": 0, "remarks": []}, (
        "the relay was restarted"
    )
    assert summary["faults"] == ["nobody flew: all poses of the hand are impossible (30); metres?"]


def test_without_a_simulated_world_the_referees_numbers_are_unknown() -> None:
    summary = flight_summary(outcome(simulated=False, referee={}), Swarm().say(hand(Wish.GROUND)))
    assert summary["ok"] is True
    assert summary["min_distance_m"] is None
    assert summary["collisions"] is None


def test_the_printed_summary_fits_80_columns_and_survives_missing_numbers() -> None:
    text = printed(flight_summary(outcome(referee={}), Swarm().say(hand(), state(1))))
    assert all(len(line) <= 80 for line in text.splitlines())
    assert "…" not in text
    assert "collisions" in text


def test_an_interrupt_ends_everything_within_its_promise() -> None:
    assert INTERRUPTED_LANDING_S + GRACE_S[1] < 6.0
    assert GRACE_S[2] < 1.0


def test_a_console_outlives_its_reader(monkeypatch: pytest.MonkeyPatch) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w", encoding="utf-8") as stream:
        monkeypatch.setattr("sys.stdout", stream)
        console = open_console(stderr=False)
        for _ in range(3):
            console.print("still flying")
        stream.flush()  # as the interpreter does at exit, where an error would become the exit code
