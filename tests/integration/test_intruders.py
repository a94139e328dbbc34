"""Whoever does not belong is refused, named and counted; the flight does not notice."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import zenoh
from msgspec.structs import replace

from deploy.net.authority import create, issue
from deploy.status.listen import listen
from shared.codec import encode
from shared.messages import HandSample, Mode, ProcessStatus
from shared.net.audit import STRANGER
from shared.net.keyring import Keyring
from shared.net.settings import MAX_PUT_BYTES
from shared.nodes import all_nodes, drone_node, endpoint
from shared.signature import blank, sign_with
from shared.topics import DRONE_STATE, HAND
from tests.integration.intruder import client_of, pour, session_of
from tests.integration.swarm import Swarm, swarm_of

FLOOD, FLOOD_HZ = 15_000, 5000.0
CALM = "scripted:eight"
VICTIM = "drone/1"
RELAY = "relay/0"
NOTICE_S = 15.0
"""A process tells its status once a second; a busy machine has much to catch up with."""


def keyring(folder: Path, nodes: tuple[str, ...]) -> Keyring:
    made = Keyring(folder)
    create(made, "rhombus")
    for node in nodes:
        issue(made, node)
    return made


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Keyring:
    nodes = ("relay", *(drone_node(i) for i in (1, 2, 3, 4)), "world", "bridge", "observer", "mallory")
    made = keyring(tmp_path_factory.mktemp("keys") / "ours", nodes)
    members = [node for node in made.members() if node != "mallory"]
    (made.folder / "members.toml").write_text(f"members = {members}", encoding="utf-8")
    return made


@pytest.fixture(scope="module")
def field(keys: Keyring, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Swarm]:
    """One flight in the field profile; every test leaves it flying."""
    overrides = ("net.profile=field", f"net.keys={keys.folder}")
    with swarm_of("rhombus", CALM, tmp_path_factory.mktemp("field"), *overrides) as swarm:
        swarm.fly()
        yield swarm


@pytest.fixture
def unaffected(field: Swarm) -> Iterator[Swarm]:
    """Demands that everybody follows the hand throughout a test."""
    start_ns = field.recorder.clock()
    yield field
    field.recorder.listen(0.5)
    for drone in field.ids:
        states = field.recorder.since(drone, start_ns)
        assert states
        assert {state.mode for state in states} == {Mode.FOLLOW}


def door(swarm: Swarm, node: str = VICTIM) -> str:
    """Returns the endpoint of a node."""
    return endpoint(swarm.scenario, swarm.formation, node)


def wait_for(swarm: Swarm, condition: Callable[[ProcessStatus], bool], process: str = VICTIM) -> ProcessStatus:
    """Listens until the status of a process fulfils a condition; returns it."""
    statuses = swarm.recorder.statuses
    swarm.recorder.until(lambda: process in statuses and condition(statuses[process]), NOTICE_S)
    return statuses[process]


def refused(swarm: Swarm, who: str, process: str = VICTIM) -> float:
    """Returns how often a process says that it has refused somebody."""
    status = swarm.recorder.statuses.get(process)
    return sum(n for name, n in status.metrics.items() if name.startswith(f"refused {who}")) if status else 0.0


def newest_hand(swarm: Swarm) -> HandSample:
    swarm.recorder.drain()
    return swarm.recorder.hands[max(swarm.recorder.hands)]


@pytest.mark.timeout(180)
def test_everybody_is_linked_by_name(unaffected: Swarm) -> None:
    members = {"relay", "drone/2", "drone/3", "drone/4", "observer"}
    status = wait_for(unaffected, lambda s: {f"linked {m}" for m in members} <= set(s.metrics))
    assert [name for name in status.metrics if name.startswith("refused")] == []


def test_without_a_certificate_nobody_is_let_in(unaffected: Swarm, keys: Keyring) -> None:
    with pytest.raises(zenoh.ZError), session_of(client_of(door(unaffected), keys, None)):
        pass
    wait_for(unaffected, lambda _: refused(unaffected, f"{STRANGER} (peer sent") >= 1)


def test_the_second_swarm_of_the_same_name_has_other_keys_and_is_not_let_in(
    unaffected: Swarm, keys: Keyring, tmp_path: Path
) -> None:
    theirs = keyring(tmp_path / "theirs", ("relay", "drone/2"))
    for name in ("relay", "drone/2"):
        with pytest.raises(zenoh.ZError), session_of(client_of(door(unaffected), keys, name, theirs)):
            pass
    wait_for(unaffected, lambda _: refused(unaffected, f"{STRANGER} (invalid peer") >= 2)


def test_who_is_no_member_any_more_is_not_let_in(unaffected: Swarm, keys: Keyring) -> None:
    before = refused(unaffected, STRANGER)
    for _ in range(3):
        with pytest.raises(zenoh.ZError), session_of(client_of(door(unaffected), keys, "mallory")):
            pass
    status = wait_for(unaffected, lambda _: refused(unaffected, STRANGER) >= before + 3)
    assert "linked mallory" not in status.metrics


def test_a_drone_cannot_speak_for_another(unaffected: Swarm, keys: Keyring) -> None:
    lie = encode(replace(unaffected.recorder.latest(3), position=(9.0, 9.0, 9.0), seq=2**60))
    key = f"rhombus/{DRONE_STATE.key(id=3)}"
    with session_of(client_of(door(unaffected), keys, "drone/2")) as put:
        pour(put, key, lie, count=50, rate_hz=100.0)
        wait_for(unaffected, lambda _: refused(unaffected, f"drone/2 put {key}") >= 10)


def test_a_drone_cannot_play_the_hand_however_fast_it_tries(unaffected: Swarm, keys: Keyring) -> None:
    lie = encode(replace(newest_hand(unaffected), position=(9.0, 9.0, 9.0), seq=2**60))
    key = f"rhombus/{HAND.key()}"
    with session_of(client_of(door(unaffected), keys, "drone/2")) as put:
        pour(put, key, lie, count=FLOOD, rate_hz=FLOOD_HZ)
        wait_for(unaffected, lambda _: refused(unaffected, f"drone/2 put {key}") >= 0.5 * FLOOD)


def test_with_the_stolen_key_of_the_relay_the_hand_is_still_signed(unaffected: Swarm, keys: Keyring) -> None:
    """Replayed, unsigned, forged and oversized samples pass the rules and are told apart by the agent."""
    hand = newest_hand(unaffected)
    before = dict(unaffected.recorder.statuses[VICTIM].rejected)
    replayed = sign_with(keys.hand_private)(encode(replace(hand, signature=blank())))
    newer = replace(hand, epoch=hand.epoch + 1, position=(9.0, 9.0, 9.0))
    samples = {
        "out-of-order": replayed,
        "ahead": sign_with(keys.hand_private)(encode(replace(hand, seq=2**64 - 1, signature=blank()))),
        "unsigned": encode(replace(newer, signature=None)),
        "bad-signature": encode(replace(newer, signature=blank())),
        "oversized": encode(newer) + bytes(8000),
    }
    with session_of(client_of(door(unaffected), keys, "relay")) as put:
        for payload in samples.values():
            pour(put, f"rhombus/{HAND.key()}", payload, count=10, rate_hz=50.0)
        for reason in samples:
            wait_for(unaffected, lambda s, r=reason: s.rejected.get(r, 0) > before.get(r, 0))  # type: ignore[misc]


def test_what_is_far_too_large_is_dropped_unseen(unaffected: Swarm, keys: Keyring) -> None:
    key = f"rhombus/{HAND.key()}"
    with session_of(client_of(door(unaffected), keys, "relay")) as put:
        pour(put, key, bytes(MAX_PUT_BYTES + 1), count=20, rate_hz=50.0)
        wait_for(unaffected, lambda _: refused(unaffected, f"relay put {key}, too large") >= 20)


def test_the_relay_takes_nothing_from_anybody(unaffected: Swarm, keys: Keyring) -> None:
    """Not even what everybody else would: a drone's own state."""
    key = f"rhombus/{DRONE_STATE.key(id=2)}"
    state = encode(unaffected.recorder.latest(2))
    with session_of(client_of(door(unaffected, "relay"), keys, "drone/2")) as put:
        pour(put, key, state, count=20, rate_hz=50.0)
        wait_for(unaffected, lambda _: refused(unaffected, f"drone/2 put {key}", RELAY) >= 20, RELAY)


def test_status_tells_of_links_and_refusals_by_name(field: Swarm) -> None:
    rows = {row.token: row for row in listen(field.scenario, longest_s=NOTICE_S)}
    assert {"relay", "drone/2", "drone/3", "drone/4", "observer"} <= set(rows[VICTIM].links)
    assert rows[VICTIM].refused[f"drone/2 put rhombus/{HAND.key()}"] >= 0.5 * FLOOD
    assert f"drone/2 put rhombus/{DRONE_STATE.key(id=2)}" in rows[RELAY].refused


def test_refusals_are_logged_with_a_name_at_a_limited_rate(field: Swarm) -> None:
    lines = [line for line in field.logs().splitlines() if "refused: " in line]
    assert any("drone/2 put rhombus/human/hand" in line for line in lines)
    assert any(STRANGER in line for line in lines)
    assert len(lines) < 100


def test_no_secret_is_in_a_log_or_a_command_line(field: Swarm, keys: Keyring) -> None:
    secrets = [file.read_text().splitlines()[1] for file in keys.folder.glob("*.key")]
    assert len(secrets) >= 9
    seen = field.logs()
    for process in field.processes.values():
        seen += Path(f"/proc/{process.pid}/cmdline").read_text()
    assert not [secret for secret in secrets if secret in seen]


def test_the_referee_saw_nothing_unusual(field: Swarm) -> None:
    field.land()
    assert set(field.end().values()) == {0}
    report = field.referee()
    assert report["collisions"] == 0
    assert report["fence_exits"] == 0
    assert report["min_distance_m"] > 0.35


def test_every_node_of_the_rhombus_has_been_issued_a_key(field: Swarm, keys: Keyring) -> None:
    assert set(all_nodes(field.formation)) <= set(keys.members())
