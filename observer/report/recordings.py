"""The recordings of the original experiments as flight records: flight folders and ROS bags.

Three drones in a triangle behind the mapped hand, without impedance. Rows are the mocap frames, which all
bodies share; they are found by their stamps, for every body loses some (the paper aligned them by number).
"""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from attrs import frozen
from scipy.signal import savgol_filter

from observer.report.record import ROW_HZ, FlightRecord, Played, hold, mapped_hand, resample, runs
from shared.arrays import rest_of
from shared.clock import NS_PER_S
from shared.errors import ConfigError
from shared.formation import build_formation
from shared.recordings.check import Checked, check, gap_ns
from shared.recordings.flight_folder import (
    HAND_FILE,
    Setpoints,
    read_body,
    read_meta,
    read_obstacles,
    read_patterns,
    read_setpoints,
)
from shared.recordings.hand import BAG_TOPIC
from shared.recordings.ros_bag import read_bag
from shared.recordings.track import Stamps, Vec
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
_PERIOD_NS = round(NS_PER_S / ROW_HZ)
_FRAME_NS = 3 * _PERIOD_NS // 4
"""Two frames are at least so far apart."""


@frozen(kw_only=True, eq=False)
class _Recording:
    """What both kinds of recording hold."""

    name: str
    source: str
    hand: Checked
    drones: Sequence[Checked]
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
            hand=read_body(folder / HAND_FILE),
            drones=[read_body(folder / f"cf{drone}.csv.gz") for drone in DRONES],
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
    bodies = read_bag(path).bodies

    def body(topic: str) -> Checked:
        if topic not in bodies:
            raise ConfigError(f"{path}: no topic {topic}; a recording of the original experiments has it")
        return check(bodies[topic].found, f"{path}, {topic}")

    return _record(
        _Recording(
            name=path.stem,
            source="ROS bag",
            hand=body(BAG_TOPIC),
            drones=[body(f"/vicon/cf{drone}/cf{drone}") for drone in DRONES],
            setpoints=[_setpoints(body(f"/cf{drone}_sp")) for drone in DRONES],
            obstacles=tuple(
                _bag_obstacle(topic, body(topic)) for topic in sorted(bodies) if "/obstacle" in topic
            ),
        )
    )


def _setpoints(body: Checked) -> Setpoints:
    return Setpoints(body.track.t_ns, body.track.position)


def _bag_obstacle(topic: str, body: Checked) -> Obstacle:
    x, y, _ = np.median(body.track.position, axis=0).tolist()
    return Obstacle(name=topic.rpartition("/")[2], x=x, y=y)


def _record(flight: _Recording) -> FlightRecord:
    stamps, arrivals = _axis(flight.drones)
    first_ns = int(stamps[0])
    t = _since(stamps, first_ns)
    position = np.stack(
        [resample(t, _since(each.track.t_ns, first_ns), each.track.position) for each in flight.drones], axis=1
    )
    setpoint = np.stack(
        [hold(t, _since(track.t_ns, first_ns), track.position) for track in flight.setpoints], axis=1
    )
    formation = build_formation(
        Scenario(
            formation=FormationSettings(
                shape="triangle", spacing=flight.side * flight.height_factor, width=flight.side, links=()
            )
        )
    )
    track = flight.hand.track
    hand = resample(t, _since(track.t_ns, first_ns), track.position)
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
        recorded_t=_since(arrivals, int(arrivals[0])),
        hand=hand,
        hand_velocity=_velocity(hand),
        mapped=mapped,
        position=position,
        goal=goal,
        setpoint=setpoint,
        displacement={},
        default_area=flight.side**2 * math.sqrt(3.0) / 4.0,
        obstacles=flight.obstacles,
        zones=(flight.safety_radius,) * len(flight.obstacles),
        patterns=_played(flight.patterns, int(arrivals[0])),
        remarks=_remarks(flight),
        mapping_known=flight.mapping is not None,
    )


def _axis(drones: Sequence[Checked]) -> tuple[Stamps, Stamps]:
    """Returns stamp and arrival of every row, ns, from the first to the last moment at which all drones flew.

    Where nobody was recorded there are rows all the same, to be left empty.
    """
    begin_ns = max(int(drone.track.t_ns[0]) for drone in drones)
    end_ns = min(int(drone.track.t_ns[-1]) for drone in drones)
    stamps, first = np.unique(np.concatenate([drone.track.t_ns for drone in drones]), return_index=True)
    arrivals = np.concatenate([drone.arrival_ns for drone in drones])[first]
    rows = _frames(stamps, begin_ns, end_ns)
    if len(rows) < 2:
        raise ConfigError("the drones were never recorded at the same time; there is nothing to report")
    stamps, arrivals = stamps[rows], arrivals[rows]
    missing = np.flatnonzero(np.diff(stamps) > gap_ns(stamps))
    if not len(missing):
        return stamps, arrivals
    empty = [np.arange(stamps[k] + _PERIOD_NS, stamps[k + 1] - _PERIOD_NS // 2, _PERIOD_NS) for k in missing]
    axis = np.sort(np.concatenate([stamps, *empty]))
    delay = np.interp(axis - axis[0], stamps - axis[0], arrivals - stamps)
    return axis, axis + np.rint(delay).astype(np.int64)


def _frames(stamps: Stamps, begin_ns: int, end_ns: int) -> list[int]:
    """Returns the rows of different frames: bodies of one frame may be stamped one after the other."""
    rows, next_ns = list[int](), begin_ns
    for row, stamp_ns in enumerate(stamps.tolist()):
        if next_ns <= stamp_ns <= end_ns:
            rows.append(row)
            next_ns = stamp_ns + _FRAME_NS
    return rows


def _remarks(flight: _Recording) -> tuple[str, ...]:
    bodies = {
        "hand": flight.hand,
        **{f"drone {k}": drone for k, drone in zip(DRONES, flight.drones, strict=True)},
    }
    return tuple(f"{name}: {remark}" for name, body in bodies.items() for remark in body.report.remarks)


def _since(stamps: Stamps, first_ns: int) -> Vec:
    seconds: Vec = (stamps - first_ns) / NS_PER_S
    return seconds


def _velocity(position: Vec) -> Vec:
    """Returns the rate of rows at 60 Hz, m/s: a polynomial of order 2 through 9 of them, none across gaps."""
    velocity = np.full_like(position, np.nan)
    for run in runs(position):
        if run.stop - run.start >= _VELOCITY_WINDOW:
            velocity[run] = savgol_filter(
                position[run], _VELOCITY_WINDOW, 2, deriv=1, delta=1.0 / ROW_HZ, axis=0
            )
    return velocity


def _played(patterns: Sequence[tuple[int, str]], first_ns: int) -> tuple[Played, ...]:
    return tuple(
        Played((at_ns - first_ns) / NS_PER_S, *PLAYED_AS[name]) for at_ns, name in patterns if name in PLAYED_AS
    )
