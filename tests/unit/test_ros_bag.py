"""ROS 1 bags: every type with poses, cut off anywhere, damaged, and none that grows beyond all bounds."""

import struct
from pathlib import Path

import lz4.frame
import numpy as np
import pytest

from shared.clock import NS_PER_S
from shared.errors import ConfigError
from shared.recordings.bag_records import MAGIC, BagRecords
from shared.recordings.hand import BAG_TOPIC, read_hand
from shared.recordings.ros_bag import read_bag
from shared.recordings.unpack import LARGEST_CHUNK
from tests import bags
from tests.bags import Body, Stamped, steady, write_bag

HAND = "/vrpn_client_node/hand/pose"


@pytest.mark.parametrize(
    "kind", [bags.TRANSFORM, bags.POSE, bags.COVARIANT, bags.ODOMETRY, bags.POINT, bags.TF]
)
def test_every_type_with_poses_is_read(tmp_path: Path, kind: str) -> None:
    poses = steady(120)
    bag = write_bag(tmp_path / "hand.bag", {HAND: Body(kind, poses), "/said": Body(bags.STRING, poses)})
    hand = read_hand(bag)
    name = f"{HAND}:hand" if kind == bags.TF else HAND
    assert hand.remarks[0] == f"the hand is {name}, the only body in it"
    assert np.array_equal(hand.checked.track.position, [pose.place for pose in poses])
    assert hand.checked.track.t_ns.tolist() == [pose.stamp_ns for pose in poses]


def test_every_frame_of_a_topic_of_transforms_is_a_body(tmp_path: Path) -> None:
    bodies = {"/tf": Body(bags.TF, steady(5)), "/tf_other": Body(bags.TF, steady(5), frame="cf1")}
    assert set(read_bag(write_bag(tmp_path / "a.bag", bodies)).bodies) == {"/tf:hand", "/tf_other:cf1"}


def test_of_several_bodies_one_is_to_be_named(tmp_path: Path) -> None:
    both = {HAND: Body(bags.POSE, steady(60)), "/cf1": Body(bags.ODOMETRY, steady(90))}
    bag = write_bag(tmp_path / "a.bag", both)
    with pytest.raises(ConfigError) as refused:
        read_hand(bag)
    assert f"choose with topic= one of /cf1 ({bags.ODOMETRY}), {HAND} ({bags.POSE})" in str(refused.value)
    assert len(read_hand(bag, "/cf1").checked.rows) == 90


def test_a_bag_without_poses_names_what_is_in_it(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "a.bag", {"/said": Body(bags.STRING, steady(3))})
    with pytest.raises(ConfigError, match=r"there are no poses in it, but /said \(std_msgs"):
        read_hand(bag)


def test_a_bag_is_read_in_the_order_of_arrival(tmp_path: Path) -> None:
    poses = steady(60)
    mixed = poses[40:] + poses[:40]
    hand = read_hand(write_bag(tmp_path / "a.bag", {BAG_TOPIC: Body(bags.POSE, mixed)}))
    assert hand.remarks == ()
    assert hand.checked.track.t_ns.tolist() == [pose.stamp_ns for pose in poses]


def test_stamps_of_zero_give_way_to_arrival_times(tmp_path: Path) -> None:
    poses = [pose._replace(stamp_ns=0) for pose in steady(60)]
    hand = read_hand(write_bag(tmp_path / "a.bag", {BAG_TOPIC: Body(bags.POSE, poses)}))
    assert hand.checked.track.t_ns.tolist() == [pose.arrival_ns for pose in poses]
    assert "arrival times are used" in hand.remarks[0]


def test_one_stamp_that_is_an_hour_off_costs_one_pose(tmp_path: Path) -> None:
    poses = steady(300)
    poses[60] = poses[60]._replace(stamp_ns=poses[60].stamp_ns + 3600 * NS_PER_S)
    hand = read_hand(write_bag(tmp_path / "a.bag", {BAG_TOPIC: Body(bags.TRANSFORM, poses)}))
    assert hand.remarks == ("1 of 300 poses left out: 1 out of time (the first: pose 61)",)


def test_one_orientation_that_is_none_costs_one_pose(tmp_path: Path) -> None:
    poses = steady(300)
    poses[100] = poses[100]._replace(turn=(float("nan"), 0.0, 0.0, 1.0))
    hand = read_hand(write_bag(tmp_path / "a.bag", {BAG_TOPIC: Body(bags.TRANSFORM, poses)}))
    assert hand.remarks == ("1 of 300 poses left out: 1 without an orientation (the first: pose 101)",)


@pytest.mark.parametrize("compression", ["", "lz4", "bz2"])
def test_a_bag_is_read_up_to_where_it_is_cut_off(tmp_path: Path, compression: str) -> None:
    poses = steady(300)
    bag = write_bag(tmp_path / "a.bag", {HAND: Body(bags.POSE, poses)}, compression=compression)
    whole = bag.read_bytes()
    places = np.array([pose.place for pose in poses])
    before = 0
    for size in range(0, len(whole), 997):
        bag.write_bytes(whole[:size])
        try:
            found = read_bag(bag).bodies[HAND].found
        except (ConfigError, KeyError):
            assert before == 0, "a longer file gives more"
            continue
        count = len(found.t_ns)
        assert count >= before
        assert np.array_equal(found.position, places[:count])
        if count < len(poses):
            assert found.remarks[0].endswith(f"of {size}: it is cut off there")
        before = count
    assert before == len(poses), "the index at the end is not needed"


def test_a_chunk_that_is_cut_off_gives_what_is_there(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "a.bag", {HAND: Body(bags.POSE, steady(300))}, chunk=1 << 20)
    bag.write_bytes(bag.read_bytes()[:20_000])
    assert len(read_bag(bag).bodies[HAND].found.t_ns) > 80


@pytest.mark.parametrize("compression", ["", "lz4", "bz2"])
def test_a_damaged_byte_costs_at_most_its_chunk_or_what_follows(tmp_path: Path, compression: str) -> None:
    bag = write_bag(tmp_path / "a.bag", {HAND: Body(bags.POSE, steady(100))}, compression=compression)
    whole = bag.read_bytes()
    sizes = []
    for at in range(0, len(whole), 31):
        bag.write_bytes(whole[:at] + bytes([whole[at] ^ 0x20]) + whole[at + 1 :])
        try:
            sizes.append(len(list(BagRecords(bag).messages(lambda _: True))))
        except ValueError:
            sizes.append(0)
    assert max(sizes) == 100
    assert np.mean(sizes) > 50


def record(fields: dict[str, bytes], data: bytes) -> bytes:
    header = b"".join(struct.pack("<I", len(k) + 1 + len(v)) + k.encode() + b"=" + v for k, v in fields.items())
    return struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data


def chunk(data: bytes, compression: str) -> bytes:
    size = struct.pack("<I", len(data) & 0xFFFF_FFFF)
    return record({"compression": compression.encode(), "op": b"\x05", "size": size}, data)


def test_a_chunk_in_a_chunk_is_none(tmp_path: Path) -> None:
    """It could unpack to itself, without end."""
    data = b""
    for _ in range(2_000):
        data = chunk(data, "none")
    path = tmp_path / "a.bag"
    path.write_bytes(MAGIC + data)
    bag = BagRecords(path)
    assert list(bag.messages(lambda _: True)) == []


def test_a_chunk_that_grows_beyond_bounds_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    good = write_bag(path, {BAG_TOPIC: Body(bags.POSE, steady(60))}).read_bytes()
    bomb = chunk(lz4.frame.compress(bytes(LARGEST_CHUNK + 1)), "lz4")
    assert len(bomb) < LARGEST_CHUNK / 200
    path.write_bytes(MAGIC + bomb + good.removeprefix(MAGIC))
    hand = read_hand(path)
    assert len(hand.checked.rows) == 60
    assert hand.remarks == ("damaged chunks were skipped: 1",)


def test_a_message_that_is_none_is_counted(tmp_path: Path) -> None:
    poses = [*steady(60), Stamped(0, bags.START_NS, (0.0, 0.0, 0.0))]
    bag = write_bag(tmp_path / "a.bag", {BAG_TOPIC: Body(bags.POSE, poses)}, chunk=1 << 20)
    length, wrong = struct.pack("<I", 5), struct.pack("<I", 1 << 30)
    bag.write_bytes(bag.read_bytes().replace(length + b"world", wrong + b"world", 1))
    hand = read_hand(bag)
    assert len(hand.checked.rows) == 59
    assert hand.remarks[0] == "messages could not be read: 1"
