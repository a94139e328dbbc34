"""One contract for every hand source: what `human_relay.sources.base.HandSource` promises."""

import csv
import gzip
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from human_relay.sources import BACKENDS, open_source, source_hints
from human_relay.sources.base import HandPose, HandSource
from human_relay.sources.scripted import REST
from shared.clock import NS_PER_S
from shared.config import structure_scenario
from shared.errors import ConfigError
from shared.messages import Wish
from shared.recordings.flight_folder import HAND_FILE, read_track
from shared.recordings.hand import read_hand, relative_yaw
from tests.replay.flights import a_bag_and_its_flight, a_flight, each_flight, read_json

START = 5_000 * NS_PER_S
LEAD = 0.5


def csv_file(folder: Path) -> Path:
    """Half a second of a hand that moves and turns, one frame lost."""
    rows = [f"{100 + k / 60:.9f},{0.1 + 0.005 * k},-0.2,1.1,{0.5 + 0.01 * k}" for k in range(30) if k != 10]
    path = folder / "hand.csv"
    path.write_text("t,x,y,z,yaw\n" + "\n".join(rows) + "\n")
    return path


URIS: dict[str, Callable[[Path], str]] = {
    "tour": lambda _: f"scripted:tour?duration=2&lead={LEAD}",
    "sweep": lambda _: f"scripted:sweep?heading=1&stroke=0.3&peak=0.4&lead={LEAD}",
    "eight": lambda _: f"scripted:eight?duration=2&lead={LEAD}",
    "hold": lambda _: f"scripted:hold?duration=1&lead={LEAD}",
    "csv": lambda folder: f"recording:{csv_file(folder)}?lead={LEAD}",
    "flight": lambda _: f"recording:{a_flight('visual')}?lead={LEAD}",
    "fast": lambda _: f"recording:{a_flight('visual')}?lead={LEAD}&speed=2",
    "bag": lambda _: f"recording:{a_bag_and_its_flight()[0]}?lead={LEAD}",
}


@pytest.fixture(params=URIS)
def uri(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    return URIS[request.param](tmp_path)


def play(source: HandSource, seconds: float = 60.0) -> list[HandPose]:
    """Polls a source exactly when it asks to be polled, until it ends."""
    now, poses = START, list[HandPose]()
    while not source.finished and now < START + seconds * NS_PER_S:
        pose = source.poll(now)
        if pose:
            poses.append(pose)
        now = max(source.next_ns(now), now)
    return poses


def test_it_rests_then_moves_then_lands(uri: str) -> None:
    source = open_source(uri, START)
    poses = play(source)
    lead = [pose for pose in poses if pose.t_ns < START + LEAD * NS_PER_S]
    assert len(lead) == LEAD * 60
    assert {pose.position for pose in lead} == {poses[0].position}
    assert {pose.mode for pose in poses[:-1]} == {Wish.FLY}
    assert poses[-1].mode is Wish.LAND
    assert source.finished
    source.close()


def test_every_sample_comes_once_in_order_and_never_early(uri: str) -> None:
    source = open_source(uri, START)
    assert source.poll(START - 1) is None
    now, stamps = START, []
    while not source.finished:
        pose = source.poll(now)
        assert pose is not None
        assert pose.t_ns <= now
        stamps.append(pose.t_ns)
        now = source.next_ns(now)
        assert source.poll(now - 1) == pose or source.finished
    assert np.all(np.diff(stamps) > 0)


def test_after_the_end_it_lands_for_ever_and_closes_twice(uri: str) -> None:
    source = open_source(uri, START)
    last = play(source)[-1]
    for seconds in (1, 100):
        now = last.t_ns + seconds * NS_PER_S
        assert source.poll(now) == last
        assert source.next_ns(now) > now
        assert source.finished
    source.close()
    source.close()
    assert source.finished


def test_a_loop_that_is_held_up_skips_to_the_newest(uri: str) -> None:
    source = open_source(uri, START)
    source.poll(START)
    late = START + round(0.9 * LEAD * NS_PER_S)
    pose = source.poll(late)
    assert pose is not None
    assert late - pose.t_ns < NS_PER_S / 60
    assert source.next_ns(late) > late


def test_its_values_are_finite_and_its_yaw_starts_at_zero(uri: str) -> None:
    poses = play(open_source(uri, START))
    table = np.array([(*pose.position, pose.yaw) for pose in poses])
    assert np.all(np.isfinite(table))
    assert poses[0].yaw == 0.0
    assert np.abs(np.diff(table[:, 3])).max() < 1.0


def test_its_hints_fit_the_scenario(uri: str) -> None:
    tree: dict[str, object] = {}
    for key, value in source_hints(uri).items():
        node = tree
        *tables, leaf = key.split(".")
        for table in tables:
            inner = node.setdefault(table, {})
            assert isinstance(inner, dict)
            node = inner
        node[leaf] = value
    assert structure_scenario(tree, uri)


def test_the_suite_covers_every_backend(tmp_path: Path) -> None:
    available = {"tour", "csv"}
    played = {URIS[name](tmp_path).split(":")[0] for name in available}
    assert played | {"pointer"} == set(BACKENDS)  # its own part of the contract: test_pointer_source.py


@pytest.mark.parametrize("peak", [0.2, 0.5])
@pytest.mark.parametrize("name", ["tour", "sweep", "eight"])
def test_a_script_respects_its_peak_speed(name: str, peak: float) -> None:
    poses = play(open_source(f"scripted:{name}?lead=0&peak={peak}&duration=40", START), 30)
    places = np.array([pose.position for pose in poses])
    speed = 60 * np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert 0.95 * peak < speed.max() <= peak * 1.001
    assert places[0].tolist() == list(REST)
    assert set(places[:, 2]) == {REST[2]}


def test_the_tour_goes_in_eight_directions_and_repeats_from_home() -> None:
    poses = play(open_source("scripted:tour?lead=0", START), 35)
    places = np.array([pose.position[:2] for pose in poses])
    step = np.diff(places, axis=0)
    fast = np.linalg.norm(step[: 18 * 60], axis=1) * 60 > 0.3
    headings = np.degrees(np.arctan2(step[: 18 * 60][fast, 1], step[: 18 * 60][fast, 0]))
    assert len(np.unique(np.round(headings / 45) % 8)) == 8
    home = np.linalg.norm(places, axis=1) < 1e-6
    assert home[0]
    assert np.any(home[29 * 60 : 31 * 60])
    assert not home[-1]


def test_a_sweep_goes_where_it_is_told_and_back() -> None:
    poses = play(open_source("scripted:sweep?heading=1&stroke=0.7&lead=0", START))
    places = np.array([pose.position[:2] for pose in poses])
    farthest = places[np.argmax(np.linalg.norm(places, axis=1))]
    assert farthest == pytest.approx((0.7 * math.cos(1), 0.7 * math.sin(1)), abs=1e-3)
    assert places[-1] == pytest.approx((0.0, 0.0), abs=1e-9)


@each_flight
@pytest.mark.parametrize("speed", [0.3, 1.0, 2.0])
def test_a_recording_is_played_by_time_at_the_rate_of_the_relay(folder: Path, speed: float) -> None:
    track = read_track(folder / HAND_FILE)
    poses = play(open_source(f"recording:{folder}?lead=0&speed={speed}", START), 300.0)
    t = np.array([pose.t_ns - START for pose in poses])
    assert np.array_equal(t, np.arange(len(t)) * NS_PER_S // 60)
    own = track.t_ns - track.t_ns[0]
    assert 0 <= own[-1] / speed - t[-1] <= NS_PER_S / 60
    expected = np.stack([np.interp(t * speed, own, axis) for axis in track.position.T], axis=1)
    assert np.abs(np.array([pose.position for pose in poses]) - expected).max() < 1e-9


def test_a_bag_and_its_flight_folder_are_the_same_hand() -> None:
    bag, folder = (read_hand(path).checked.track for path in a_bag_and_its_flight())
    assert np.array_equal(bag.t_ns, folder.t_ns)
    assert np.allclose(bag.position, folder.position, atol=1e-8)
    assert np.allclose(bag.quaternion, folder.quaternion, atol=1e-5)


@each_flight
def test_a_flight_folder_hints_at_the_law_that_flew(folder: Path) -> None:
    hints, known = source_hints(f"recording:{folder}"), read_json(folder)
    assert hints["hand.mapping"] == "relative"
    assert hints["hand.gain"] == known["pos_coef"]
    assert hints["hand.offset"] == [*known["base_offset_c"], 0.0]
    low, high = zip(known["limits_x"], known["limits_y"], strict=True)
    assert hints["hand.clip"] == {"min": list(low), "max": list(high)}
    with gzip.open(folder / HAND_FILE, "rt", encoding="ascii") as file:
        first = next(csv.DictReader(file))
    wanted = np.array(known["base_offset_c"]) + known["pos_coef"] * np.array([float(first[a]) for a in "xy"])
    assert hints["hand.home"] == pytest.approx(np.clip(wanted, low, high))
    with (folder / "obstacles.csv").open(encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    assert hints["obstacles"] == [
        {"name": row["name"], "x": float(row["median_x"]), "y": float(row["median_y"])} for row in rows
    ]


def test_yaw_is_relative_and_does_not_jump_at_half_a_turn() -> None:
    yaw = np.linspace(3.0, 7.0, 50)
    zero = np.zeros(50)
    quaternion = np.column_stack((zero, zero, np.sin(yaw / 2), np.cos(yaw / 2)))
    assert np.allclose(relative_yaw(quaternion), yaw - 3.0)


@pytest.mark.parametrize(
    ("uri", "expected"),
    [
        ("tour", "no scheme"),
        ("mouse:x", "unknown hand source 'mouse'; known ones: scripted:, recording:, pointer:"),
        ("scripted:waltz", "no script 'waltz'; scripts: tour, sweep, eight, hold"),
        ("scripted:tour?speed=2", "unknown option 'speed'; known ones: duration, peak, lead"),
        ("scripted:tour?peak=fast", "peak=fast must be a number from 0.01 to 2"),
        ("scripted:tour?peak=9", "peak=9 must be a number"),
        ("scripted:tour?peak=nan", "peak=nan must be a number"),
        ("scripted:tour?peak", "not a URI"),
        ("recording:", "no path"),
        ("recording:/nowhere/hand.csv", "/nowhere/hand.csv: no such recording; expected a flight folder"),
    ],
)
def test_a_wrong_uri_is_refused_with_a_hint(uri: str, expected: str) -> None:
    with pytest.raises(ConfigError) as refused:
        open_source(uri, START)
    assert expected in str(refused.value)


def test_a_missing_relative_path_is_named_in_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match=str(tmp_path / "hand.csv")):
        open_source("recording:hand.csv", START)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("", "empty"),
        ("t,x,y\n0,0,0\n", "no column z; expected the header t,x,y,z, found t,x,y"),
        ("t,x,y,z\n", "no rows"),
        ("t,x,y,z\n0,0,0,1\n1,0,zero,1\n", "line 3: 'zero' is no number"),
        ("\n\nt,x,y,z\n\n0,0,0,1\n1,0,zero,1\n", "line 6: 'zero' is no number"),
        ('t,x,y,z,note\n0,0,0,1,"a\nb"\n1,0,zero,1,c\n', "line 4: 'zero' is no number"),
        ("t,x,y,z\n0,0,0,1\n1,0,0\n2,0,0,1\n", "line 3: 3 cells, but 4 columns"),
        ("t,x,y,z\n0,0,0,1\n1,0,0\n", "the last line, 3, is cut off"),
        ("t,x,y,z\n0,0,0,nan\n", "1 pose is not a number (the first: line 2)"),
        ("t,x,y,z\n1,0,0,1\n1,0,0,1\n", "1 pose is out of time (the first: line 2)"),
        ("t,x,y,z\n0,0,0,1200\n1,5,0,1201\n", "are they millimetres?"),
        ("t,x,y,z\n" + ",".join(["1"] * 100_000), "line 2: longer than 65536 characters"),
    ],
)
def test_a_wrong_recording_is_refused_with_file_and_line(tmp_path: Path, content: str, expected: str) -> None:
    path = tmp_path / "hand.csv"
    path.write_text(content)
    with pytest.raises(ConfigError) as refused:
        open_source(f"recording:{path}", START)
    assert expected in str(refused.value)
    assert str(path) in str(refused.value)


def test_a_folder_that_is_no_flight_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=str(tmp_path / HAND_FILE)):
        open_source(f"recording:{tmp_path}", START)


def test_a_broken_bag_or_another_topic_is_refused(tmp_path: Path) -> None:
    whole, _ = a_bag_and_its_flight()
    with pytest.raises(ConfigError, match=r"choose with topic= one of .*/vicon/cf1/cf1"):
        open_source(f"recording:{whole}?topic=/vicon/wand/wand", START)
    broken = tmp_path / "broken.bag"
    broken.write_bytes(whole.read_bytes()[:5000])
    with pytest.raises(ConfigError, match=r"read up to byte \d+ of 5000: it is cut off there"):
        open_source(f"recording:{broken}", START)
    broken.write_bytes(b"#ROSBAG V1.2\n" + whole.read_bytes()[13:])
    with pytest.raises(ConfigError, match="it does not begin as ROS 1 bags do"):
        open_source(f"recording:{broken}", START)
