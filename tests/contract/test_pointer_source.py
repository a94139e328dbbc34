"""The contract of `human_relay.sources.base.HandSource` for hands that somebody points with."""

import itertools
import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from human_relay.sources import open_source, source_hints
from human_relay.sources.base import HandPose, HandSource
from human_relay.sources.pointer import PointerHand
from human_relay.sources.takeover import Takeover, open_takeover
from shared.clock import NS_PER_S
from shared.errors import ConfigError, DeviceError
from shared.messages import Vector, Wish
from shared.pointer_link import Pointed, Verb, encode_pointed
from shared.private_socket import PrivateSender
from shared.uri import parse_uri

START = 5_000 * NS_PER_S
TICK = NS_PER_S // 60
HOME: Vector = (0.5, 0.0, 1.2)


class Hand:
    """A source, and somebody who points; its time is the test's."""

    def __init__(self, source: HandSource, path: Path) -> None:
        self.source = source
        self.now = START
        self._sender = PrivateSender(str(path))

    def send(self, datagram: bytes) -> None:
        assert self._sender.send(datagram) == ""

    def point(self, verb: Verb = Verb.FLY, position: Vector = HOME, sender: int = 7) -> None:
        self.send(encode_pointed(Pointed(sender, verb, position)))

    def poll(self) -> HandPose | None:
        """Polls when the source asks for it."""
        self.now = max(self.now + 1, self.source.next_ns(self.now))
        return self.source.poll(self.now)

    def hold(self, seconds: float, verb: Verb = Verb.FLY, position: Vector = HOME) -> list[HandPose]:
        """Points for a while, as a console does; returns the poses."""
        poses, end = [], self.now + round(seconds * NS_PER_S)
        while self.now < end:
            self.point(verb, position)
            pose = self.poll()
            if pose:
                poses.append(pose)
        return poses

    def rest(self, seconds: float) -> HandPose | None:
        """Says nothing for a while; returns the last sample."""
        pose, end = None, self.now + round(seconds * NS_PER_S)
        while self.now < end:
            pose = self.poll()
        return pose

    def close(self) -> None:
        self.source.close()
        self._sender.close()


@pytest.fixture
def path(short_path: Path) -> Path:
    return short_path / "pointer.sock"


def pointer_at(path: Path) -> PointerHand:
    return PointerHand(parse_uri(f"pointer://{path}?speed=1", example=""), START)


@pytest.fixture
def hand(path: Path) -> Iterator[Hand]:
    with closing(Hand(pointer_at(path), path)) as opened:
        yield opened


@pytest.fixture
def takeover(path: Path) -> Iterator[Callable[[str], Hand]]:
    with ExitStack() as opened:
        yield lambda first: opened.enter_context(
            closing(Hand(Takeover(open_source(first, START), pointer_at(path)), path))
        )


def test_there_is_no_hand_until_somebody_points(hand: Hand) -> None:
    assert hand.rest(0.5) is None
    poses = hand.hold(0.2)
    assert {pose.position for pose in poses} == {HOME}
    assert {pose.mode for pose in poses} == {Wish.FLY}
    assert not hand.source.finished


def test_samples_come_at_60_hz_in_order_and_never_early(hand: Hand) -> None:
    stamps = []
    for _ in range(60):
        hand.point()
        pose = hand.poll()
        assert pose is not None
        assert pose.t_ns <= hand.now
        stamps.append(pose.t_ns)
        assert hand.source.next_ns(hand.now) > hand.now
        assert hand.source.poll(hand.now) == pose, "the same sample again: nothing new"
    gaps = [b - a for a, b in itertools.pairwise(stamps)]
    assert all(abs(gap - TICK) <= 2 for gap in gaps)


def test_it_follows_a_jump_no_faster_than_its_speed(hand: Hand) -> None:
    hand.hold(0.1)
    poses = hand.hold(3.0, position=(2.5, 0.0, 1.2))
    speeds = [
        math.dist(a.position, b.position) * NS_PER_S / (b.t_ns - a.t_ns) for a, b in itertools.pairwise(poses)
    ]
    assert 0.9 < max(speeds) <= 1.0 + 1e-6
    assert poses[-1].position == pytest.approx((2.5, 0.0, 1.2), abs=1e-3)


@pytest.mark.parametrize("told", [True, False], ids=["told", "silent"])
def test_a_released_hand_is_none_and_resumes_where_it_was(hand: Hand, told: bool) -> None:
    hand.hold(0.2)
    if told:
        hand.point(Verb.RELEASED)
        assert hand.poll() is None
    assert hand.rest(0.4) is None
    first = hand.hold(0.1, position=(3.0, 0.0, 1.2))[0]
    assert math.dist(first.position, HOME) < 0.01


@pytest.mark.parametrize(("verb", "wish"), [(Verb.GROUND, Wish.GROUND), (Verb.HOLD, Wish.HOLD)])
def test_it_says_what_the_holder_wants(hand: Hand, verb: Verb, wish: Wish) -> None:
    hand.hold(0.1)
    assert {pose.mode for pose in hand.hold(0.1, verb)} == {wish}


def test_stop_needs_nobody_to_hold_the_hand_and_lasts(hand: Hand) -> None:
    hand.point(Verb.STOP)
    pose = hand.poll()
    assert pose is not None
    assert pose.mode is Wish.STOP
    assert hand.hold(0.1)[-1].mode is Wish.STOP
    last = hand.rest(5.0)
    assert last is not None
    assert last.mode is Wish.STOP


def test_garbage_and_floods_change_nothing(hand: Hand) -> None:
    hand.hold(0.2)
    for datagram in (b"", b"\xff" * 44, b"SP", b"x" * 2_000):
        hand.send(datagram)
    for _ in range(500):
        hand.send(b"flood")
    pose = hand.hold(0.1)[-1]
    assert (pose.position, pose.mode) == (HOME, Wish.FLY)


def test_it_closes_twice_and_has_no_hand_then(hand: Hand) -> None:
    hand.hold(0.1)
    hand.source.close()
    hand.source.close()
    assert hand.rest(1.0) is None


def test_a_taken_socket_is_said(path: Path) -> None:
    with closing(pointer_at(path)), pytest.raises(DeviceError, match="is another relay running"):
        open_source(f"pointer://{path}", START)


@pytest.mark.parametrize(
    ("uri", "expected"),
    [
        ("pointer://0.0.0.0:7459", "a pointer is heard on a socket of this machine"),
        ("pointer://127.0.0.1:7459", "expected pointer://, pointer://NAME or pointer:///ABSOLUTE/PATH"),
        ("pointer://../elsewhere", "expected pointer://"),
        ("pointer://a/b", "expected pointer://"),
        ("pointer:///a%00b", "expected pointer://"),
        ("pointer://?speed=9", "speed=9 must be a number from 0.01 to 3"),
        ("pointer://?gain=2", "unknown option 'gain'"),
    ],
)
def test_a_wrong_uri_is_refused_with_a_hint(uri: str, expected: str) -> None:
    for refuse in (source_hints, lambda text: open_source(text, START)):
        with pytest.raises(ConfigError) as refused:
            refuse(uri)
        assert expected in str(refused.value)


def test_a_script_plays_until_somebody_takes_the_hand(takeover: Callable[[str], Hand]) -> None:
    hand = takeover("scripted:tour?lead=0")
    played = hand.rest(2.0)
    assert played is not None
    assert played.mode is Wish.FLY
    taken = hand.hold(0.1, position=(-1.0, 0.0, 1.2))
    assert math.dist(taken[0].position, played.position) < 0.05, "no jump"
    assert not hand.source.finished
    assert hand.rest(1.0) is None, "the script does not come back"


def test_a_script_that_nobody_watches_lands(takeover: Callable[[str], Hand]) -> None:
    hand = takeover("scripted:tour?lead=0&duration=1")
    last = hand.rest(1.5)
    assert last is not None
    assert last.mode is Wish.LAND
    assert hand.source.finished
    assert hand.hold(0.2)[-1].mode is Wish.LAND, "an end is an end"
    hand.point(Verb.STOP)
    stopped = hand.poll()
    assert stopped is not None
    assert stopped.mode is Wish.STOP


def test_a_script_that_is_watched_waits_for_a_hand(takeover: Callable[[str], Hand]) -> None:
    hand = takeover("scripted:tour?lead=0&duration=1")
    while hand.now < START + 2 * NS_PER_S:
        hand.point(Verb.RELEASED)
        pose = hand.poll()
    assert pose is None
    assert not hand.source.finished
    assert hand.hold(0.2)[-1].mode is Wish.FLY


def test_only_a_pointer_takes_over() -> None:
    with pytest.raises(ConfigError, match="only a pointer can take over"):
        open_takeover("scripted:tour", "scripted:hold", START)
