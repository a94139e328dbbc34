"""A flight by radio, with keys: the hand in the air, whoever disturbs it there, and agents that come back."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from msgspec.structs import replace

from deploy.net.authority import create, issue
from deploy.status.listen import listen
from shared.codec import encode
from shared.config import load_scenario
from shared.formation import build_formation
from shared.messages import Mode
from shared.net.keyring import Keyring
from shared.nodes import RELAY, all_nodes
from shared.radio import Transmitter
from shared.radio_link import radio_group
from shared.signature import blank, sign_with
from shared.topics import DRONE_STATE, HAND
from tests.integration.recorder import RELAY as RELAY_TOKEN
from tests.integration.recorder import START_S
from tests.integration.swarm import Swarm, swarm_of

VICTIM = "drone/1"
NOTICE_S = 10.0


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Keyring:
    made = Keyring(tmp_path_factory.mktemp("radio") / "keys")
    create(made, "rhombus")
    for node in all_nodes(build_formation(load_scenario("rhombus"))):
        if node != RELAY:  # on the air the hand's own key is all that it needs
            issue(made, node)
    return made


@pytest.fixture(scope="module")
def swarm(keys: Keyring, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Swarm]:
    """One flight; every test leaves it flying, the last one lands it."""
    overrides = ("net.profile=radio", f"net.keys={keys.folder}")
    with swarm_of("rhombus", "scripted:eight", tmp_path_factory.mktemp("flight"), *overrides) as made:
        made.fly()
        yield made


@pytest.fixture
def foreign(swarm: Swarm) -> Iterator[Transmitter]:
    """Somebody else who speaks to the group."""
    group = radio_group(swarm.scenario.net)
    with Transmitter(group, swarm.scenario.swarm.name, swarm.recorder.clock) as made:
        yield made


def rejected(swarm: Swarm, reason: str) -> float:
    """Returns how often drone 1 says that it has refused something, as a message or on the radio."""
    status = swarm.recorder.statuses.get(VICTIM)
    if status is None:
        return 0.0
    return status.rejected.get(reason, 0) + status.metrics.get(f"refused radio ({reason})", 0.0)


@pytest.mark.timeout(180)
def test_the_relay_is_present_by_being_heard_and_has_no_socket_that_takes_anything_in(swarm: Swarm) -> None:
    assert RELAY_TOKEN in swarm.recorder.present
    inodes = {
        link.readlink().name.removeprefix("socket:[").removesuffix("]")
        for link in Path(f"/proc/{swarm.processes[RELAY_TOKEN].pid}/fd").iterdir()
        if str(link.readlink()).startswith("socket:")
    }
    tables = [Path(f"/proc/net/{name}").read_text() for name in ("tcp", "tcp6", "udp", "udp6")]
    rows = [line.split() for table in tables for line in table.splitlines()[1:]]
    (remote,) = [row[2] for row in rows if row[9] in inodes]
    address = socket.inet_ntoa(bytes.fromhex(remote[:8])[::-1])
    assert (address, int(remote[9:], 16)) == radio_group(swarm.scenario.net)[:2]


def test_everybody_is_well_in_the_eyes_of_swarmtouch_status(swarm: Swarm) -> None:
    rows = listen(swarm.scenario, longest_s=START_S)
    assert {row.token: row.problems for row in rows if row.problems} == {}


def test_who_disturbs_the_radio_is_counted_by_reason_and_changes_nothing(
    swarm: Swarm, foreign: Transmitter
) -> None:
    start_ns = swarm.recorder.clock()
    hand = swarm.recorder.hands[max(swarm.recorder.hands)]
    newer = replace(hand, seq=hand.seq + 250, position=(9.0, 9.0, 9.0), signature=blank())
    another = sign_with(other_hand(swarm))(encode(newer))
    say_hand, say_state = foreign.publisher(HAND), foreign.publisher(DRONE_STATE, id=2)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as garbage:
        garbage.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        for _ in range(50):
            garbage.sendto(b"\xff" * 40, radio_group(swarm.scenario.net)[:2])
            say_state(encode(replace(swarm.recorder.latest(2), position=(9.0, 9.0, 9.0))))
            say_hand(encode(replace(newer, signature=None)))
            say_hand(another)
            say_hand(encode(hand))
            swarm.recorder.listen(0.02)
    for reason in ("malformed", "unknown-key", "unsigned", "bad-signature", "out-of-order"):
        swarm.recorder.until(lambda r=reason: rejected(swarm, r) > 0, NOTICE_S)  # type: ignore[misc]
    for drone in swarm.ids:
        assert {state.mode for state in swarm.recorder.since(drone, start_ns)} <= {Mode.FOLLOW, Mode.HOLD}
        assert max(abs(x) for state in swarm.recorder.since(drone, start_ns) for x in state.goal) < 5.0


def other_hand(swarm: Swarm) -> Path:
    """Makes the key of another swarm's hand."""
    theirs = Keyring(Path(swarm.scenario.net.keys).parent / "theirs")
    create(theirs, "theirs")
    return theirs.hand_private


@pytest.mark.parametrize("token", [VICTIM, RELAY_TOKEN])
def test_who_was_killed_comes_back_and_everybody_follows(swarm: Swarm, token: str) -> None:
    killed_ns = swarm.kill(token)
    swarm.start(token)

    def reborn() -> bool:
        newest = swarm.recorder.latest(1)
        return (newest.heard[HAND.key()] if token == RELAY_TOKEN else newest).epoch > killed_ns

    swarm.recorder.until(lambda: reborn() and swarm.recorder.all_in(Mode.FOLLOW), START_S)
    assert swarm.recorder.latest(1).heard[HAND.key()].epoch == max(swarm.recorder.hands)[0]


def test_it_lands_and_everybody_ends_in_order(swarm: Swarm) -> None:
    swarm.land()
    assert set(swarm.end().values()) == {0}
    assert swarm.referee()["fence_exits"] == 0
    assert "Traceback" not in swarm.logs()
