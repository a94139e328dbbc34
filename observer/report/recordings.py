"""The recordings of the original experiments as flight records: flight folders and ROS bags.

Three drones in a triangle behind the mapped hand, without impedance. Rows are the mocap frames of drone 1; the
frames of the others are aligned by number, as the paper did.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from attrs import frozen
from scipy.signal import savgol_filter

from observer.report.record import ROW_HZ, FlightRecord, Played, hold, mapped_hand, resample
from shared.arrays import rest_of
from shared.clock import NS_PER_S
from shared.errors import ConfigError
from shared.formation import build_formation
from shared.recordings.flight_folder import (
    HAND_FILE,
    Setpoints,
    read_arrivals,
    read_meta,
    read_obstacles,
    read_patterns,
    read_setpoints,
    read_track,
)
from shared.recordings.ros_bag import BagTrack, read_bag_tracks
from shared.recordings.track import Stamps, Track, Vec
from shared.scenario import Clip, FormationSettings, Hand, Obstacle, Scenario

DRONES = (1, 2, 3)
SIDE, HEIGHT_FACTOR, SAFETY_RADIUS = 0.4, 0.86, 0.27
"""Triangle and circle around a column, m: a bag does not say them, every flight of 2018 flew them."""

PLAYED_AS = {
    "contracted_right": ("CR", 1.2),
    "contracted_left": ("CL", 1.2),
    "extended_right": ("ER", 0.4),
    "extended_left": ("EL", 0.4),
}
"""Recorded name -> name in the pattern set `flight-2018` and length, s."""

_VELOCITY_WINDOW = 9


@frozen(kw_only=True, eq=False)
class _Recording:
    """What both kinds of recording hold; rows of all drones aligned by number."""

    name: str
    source: str
    hand: Track
    drones: Sequence[Track]
    arrival_ns: Stamps
    setpoints: Sequence[Setpoints]
    obstacles: tuple[Obstacle, ...]
    mapping: Hand | None = None
    side: float = SIDE
    height_factor: float = HEIGHT_FACTOR
    safety_radius: float = SAFETY_RADIUS
    patterns: tuple[tuple[int, str], ...] = ()


def read_folder(folder: Path) -> FlightRecord:
    """Reads a flight folder (`shared.recordings.flight_folder`).

    Raises:
        ConfigError: Names the file and the row.
    """
    meta = read_meta(folder)
    mapping = Hand(
        mapping="relative",
        gain=meta.gain,
        offset=(*meta.offset, 0.0),
        clip=Clip(min=meta.low, max=meta.high),
        follow_yaw=False,
    )
    return _record(
        _Recording(
            name=meta.run,
            source="flight folder",
            hand=read_track(folder / HAND_FILE),
            drones=[read_track(folder / f"cf{drone}.csv.gz") for drone in DRONES],
            arrival_ns=read_arrivals(folder / "cf1.csv.gz"),
            setpoints=[read_setpoints(folder / f"cf{drone}_sp.csv.gz") for drone in DRONES],
            obstacles=read_obstacles(folder),
            mapping=mapping,
            side=meta.side,
            height_factor=meta.height_factor,
            safety_radius=meta.obstacle_radius,
            patterns=read_patterns(folder),
        )
    )


def read_bag_flight(path: Path) -> FlightRecord:
    """Reads a ROS 1 bag of the original experiments.

    A bag does not say how the hand was mapped, so goals are taken to be the set-points.

    Raises:
        ConfigError: `rosbags` is not installed, the bag is broken, or it lacks a topic.
    """
    tracks = read_bag_tracks(path)
    drones = [_topic(path, tracks, f"/vicon/cf{drone}/cf{drone}") for drone in DRONES]
    setpoints = [_topic(path, tracks, f"/cf{drone}_sp").track for drone in DRONES]
    return _record(
        _Recording(
            name=path.stem,
            source="ROS bag",
            hand=_topic(path, tracks, "/vicon/glove/glove").track,
            drones=[drone.track for drone in drones],
            arrival_ns=drones[0].arrival_ns,
            setpoints=[Setpoints(track.t_ns, track.position) for track in setpoints],
            obstacles=_bag_obstacles(tracks),
        )
    )


def _topic(path: Path, tracks: Mapping[str, BagTrack], topic: str) -> BagTrack:
    if topic not in tracks:
        raise ConfigError(f"{path}: no topic {topic}; a recording of the original experiments has it")
    return tracks[topic]


def _bag_obstacles(tracks: Mapping[str, BagTrack]) -> tuple[Obstacle, ...]:
    places = {
        topic.rpartition("/")[2]: np.median(found.track.position, axis=0)
        for topic, found in tracks.items()
        if "/obstacle" in topic
    }
    return tuple(Obstacle(name=name, x=float(x), y=float(y)) for name, (x, y, _) in sorted(places.items()))


def _record(flight: _Recording) -> FlightRecord:
    length = min(len(track.t_ns) for track in flight.drones)
    stamps, arrivals = flight.drones[0].t_ns[:length], flight.arrival_ns[:length]
    t = _since(stamps, stamps)
    position = np.stack([track.position[:length] for track in flight.drones], axis=1)
    setpoint = np.stack(
        [hold(t, _since(track.t_ns, stamps), track.position) for track in flight.setpoints], axis=1
    )
    formation = build_formation(
        Scenario(
            formation=FormationSettings(
                shape="triangle", spacing=flight.side * flight.height_factor, width=flight.side, links=()
            )
        )
    )
    hand_t, velocity = _since(flight.hand.t_ns, stamps), _velocity(flight.hand.position)
    hand = resample(t, hand_t, flight.hand.position)
    if flight.mapping is None:
        mapped, goal = hand, setpoint
    else:
        mapped = mapped_hand(hand, flight.mapping)
        mapped[:, 2] = setpoint[:, 0, 2]
        goal = mapped[:, None] + rest_of(formation)
    return FlightRecord(
        name=flight.name,
        source=flight.source,
        formation=formation,
        t=t,
        recorded_t=_since(arrivals, arrivals),
        hand=hand,
        hand_velocity=resample(t, hand_t, velocity),
        mapped=mapped,
        position=position,
        goal=goal,
        setpoint=setpoint,
        displacement={},
        default_area=flight.side**2 * math.sqrt(3.0) / 4.0,
        obstacles=flight.obstacles,
        safety_radius=flight.safety_radius,
        patterns=_played(flight.patterns, int(arrivals[0])),
        mapping_known=flight.mapping is not None,
    )


def _since(stamps: Stamps, first: Stamps) -> Vec:
    seconds: Vec = (stamps - first[0]) / NS_PER_S
    return seconds


def _velocity(position: Vec) -> Vec:
    """Returns the rate of frames at 60 Hz, m/s: a polynomial of order 2 through 9 of them."""
    velocity: Vec = savgol_filter(position, _VELOCITY_WINDOW, 2, deriv=1, delta=1.0 / ROW_HZ, axis=0)
    return velocity


def _played(patterns: Sequence[tuple[int, str]], first_ns: int) -> tuple[Played, ...]:
    return tuple(
        Played((at_ns - first_ns) / NS_PER_S, *PLAYED_AS[name]) for at_ns, name in patterns if name in PLAYED_AS
    )
