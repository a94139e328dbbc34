"""The hand of a case: its strokes as poses per tick, through the relay's own core, and as a recording."""

import csv
import itertools
import math
from collections.abc import Iterator
from pathlib import Path

from attrs import evolve

from deploy.falsify.case import Case, Fault, Stroke
from deploy.lockstep.ticks import tick_ns
from human_relay.relay import RelayState, make_sample, order
from human_relay.sources.base import HandPose
from shared.clock import NS_PER_S
from shared.formation import Formation
from shared.messages import HandSample, Vector, Wish
from shared.stroke import MINIMUM_JERK_PEAK, minimum_jerk

TURN_RATE = 2.0
"""How fast a hand turns at most on the average, rad/s."""


def duration_of(start: Vector, yaw: float, stroke: Stroke) -> float:
    """Returns how long a stroke from a place and a heading moves, s."""
    way, turn = math.dist(start, stroke.to), abs(stroke.yaw - yaw)
    return max(MINIMUM_JERK_PEAK * way / stroke.peak, turn / TURN_RATE)


def poses(case: Case, rate_hz: float) -> list[HandPose]:
    """Returns the hand at every tick of a case."""
    ticks = math.ceil(case.seconds * rate_hz)
    stamps = [tick_ns(tick, rate_hz) for tick in range(ticks)]
    places = itertools.islice(_places(case, [t / NS_PER_S for t in stamps]), ticks)
    return [
        HandPose(position=place, yaw=yaw, mode=Wish.FLY, t_ns=t)
        for t, (place, yaw) in zip(stamps, places, strict=True)
    ]


def _places(case: Case, times: list[float]) -> Iterator[tuple[Vector, float]]:
    place, yaw, begins = case.hand, 0.0, 0.0
    strokes = iter(case.strokes)
    stroke = next(strokes, None)
    for t in times:
        while stroke is not None and t >= begins + stroke.rest + duration_of(place, yaw, stroke):
            begins += stroke.rest + duration_of(place, yaw, stroke)
            place, yaw = stroke.to, stroke.yaw
            stroke = next(strokes, None)
        if stroke is None or t <= begins + stroke.rest:
            yield place, yaw
            continue
        share = minimum_jerk((t - begins - stroke.rest) / duration_of(place, yaw, stroke))
        (x, y, z), (a, b, c) = place, stroke.to
        yield (
            (x + share * (a - x), y + share * (b - y), z + share * (c - z)),
            yaw + share * (stroke.yaw - yaw),
        )


def tracked(case: Case, hand: list[HandPose], formation: Formation) -> list[HandPose]:
    """Returns where the tracker takes the hand to be at every tick."""
    shifts = [(fault, formation.rest[formation.row(fault.drone)]) for fault in _glitches(case)]
    return [_shifted(pose, shifts) for pose in hand] if shifts else hand


def _glitches(case: Case) -> list[Fault]:
    return [fault for fault in case.faults if fault.kind == "glitch"]


def _shifted(pose: HandPose, shifts: list[tuple[Fault, Vector]]) -> HandPose:
    for fault, (dx, dy, dz) in shifts:
        if fault.on(pose.t_ns / NS_PER_S):
            x, y, z = pose.position
            pose = evolve(pose, position=(x + dx, y + dy, z + dz))
    return pose


def samples(case: Case, hand: list[HandPose]) -> list[HandSample]:
    """Returns what the relay says at every tick of a tracked hand."""
    state, said = RelayState(epoch=0), []
    wishes = iter(sorted(case.wishes, key=lambda each: each.t))
    wish = next(wishes, None)
    for pose in hand:
        while wish is not None and pose.t_ns >= wish.t * NS_PER_S:
            state = order(state, Wish(wish.order))
            wish = next(wishes, None)
        state, sample = make_sample(state, pose, pose.t_ns)
        said.append(sample)
    return said


def write_recording(hand: list[HandPose], path: Path) -> None:
    """Writes a hand as a CSV file that `recording:PATH` plays, see `human_relay.sources.recording`."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("t", "x", "y", "z", "yaw"))
        writer.writerows(
            (repr(pose.t_ns / NS_PER_S), *map(repr, pose.position), repr(pose.yaw)) for pose in hand
        )
