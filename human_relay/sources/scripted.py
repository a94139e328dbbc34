"""Scripted hands: `scripted:NAME?duration=..&peak=..&lead=..`, sampled at 60 Hz.

| name | motion from the rest position (0, 0, 1.2) |
|---|---|
| `tour` | eight minimum-jerk strokes in eight directions, a figure eight, a hold; again and again |
| `sweep` | one stroke and back: `heading` (rad, 0 = +x, counter-clockwise), `stroke` (m); then it ends |
| `eight` | a figure eight, again and again |
| `hold` | nothing |

`peak` is the largest speed (m/s), `duration` the time of motion (s), `lead` the rest before it (s) in which
the drones take off. Strokes follow the minimum-jerk profile of human reaching (Flash and Hogan 1985).
"""

import itertools
import math
from collections.abc import Callable, Iterator

from attrs import frozen

from human_relay.sources.base import HandPose
from human_relay.sources.playback import Playback
from shared.clock import NS_PER_S
from shared.errors import ConfigError
from shared.messages import Vector, Wish
from shared.stroke import MINIMUM_JERK_PEAK, minimum_jerk
from shared.uri import Uri

REST: Vector = (0.0, 0.0, 1.2)
RATE_HZ = 60
HOLD_S = 2.0
SIDE = 0.6
"""Length of each stroke of the tour, m."""
EIGHT = (0.15, 0.3)
"""Half extent of the figure eight along x and y, m."""
Point = tuple[float, float]


@frozen
class Segment:
    """A piece of motion.

    Attributes:
        duration: s.
        at: Time in [0, duration] -> displacement (x, y) from the rest position, m.
    """

    duration: float
    at: Callable[[float], Point]


class ScriptedHand(Playback):
    """The `scripted:` backend."""

    def __init__(self, uri: Uri, start_ns: int) -> None:
        """Builds the script of a URI.

        Raises:
            ConfigError: Unknown name or option, or a value out of range.
        """
        super().__init__(_poses(_segments(uri), *_span(uri), start_ns))

    @staticmethod
    def hints(uri: Uri) -> dict[str, object]:
        """A script moves in the world frame as it is: it says nothing about the mapping."""
        _segments(uri)
        return {}


def _segments(uri: Uri) -> list[Segment]:
    uri.refuse_unknown("duration", "peak", "lead", *(("heading", "stroke") if uri.path == "sweep" else ()))
    _span(uri)
    peak = uri.number("peak", 0.5, low=0.01, high=2.0)
    hold = Segment(HOLD_S, lambda _: (0.0, 0.0))
    if uri.path == "tour":
        return [*_star(peak), _figure_eight(peak), hold]
    if uri.path == "sweep":
        heading = uri.number("heading", math.pi, low=-10.0, high=10.0)
        stroke = uri.number("stroke", 0.8, low=0.01, high=5.0)
        end = (stroke * math.cos(heading), stroke * math.sin(heading))
        return [_stroke((0.0, 0.0), end, peak), _stroke(end, (0.0, 0.0), peak), hold]
    if uri.path == "eight":
        return [_figure_eight(peak)]
    if uri.path == "hold":
        return [hold]
    raise ConfigError(f"{uri.text}: no script {uri.path!r}; scripts: tour, sweep, eight, hold")


def _span(uri: Uri) -> tuple[float, float]:
    """Returns (lead, duration), s; a duration of 0 stands for that of the script itself."""
    lead = uri.number("lead", 4.0, low=0.0, high=60.0)
    endless = 0.0 if uri.path == "sweep" else math.inf
    return lead, uri.number("duration", endless, low=0.1, high=86_400.0)


def _star(peak: float) -> list[Segment]:
    """Eight equal strokes, each turned by 135 degrees: eight directions in little room, and back home."""
    corners: list[Point] = [(0.0, 0.0)]
    for turn in range(8):
        angle = math.pi + turn * 0.75 * math.pi
        x, y = corners[-1]
        corners.append((x + SIDE * math.cos(angle), y + SIDE * math.sin(angle)))
    return [_stroke(start, end, peak) for start, end in itertools.pairwise(corners)]


def _stroke(start: Point, end: Point, peak: float) -> Segment:
    duration = MINIMUM_JERK_PEAK * math.dist(start, end) / peak

    def at(t: float) -> Point:
        s = minimum_jerk(t / duration)
        return (start[0] + s * (end[0] - start[0]), start[1] + s * (end[1] - start[1]))

    return Segment(duration, at)


def _figure_eight(peak: float) -> Segment:
    """A Lissajous figure from rest to rest: its phase follows the minimum-jerk profile."""
    along, across = EIGHT
    duration = MINIMUM_JERK_PEAK * math.tau * math.hypot(2.0 * along, across) / peak

    def at(t: float) -> Point:
        phase = math.tau * minimum_jerk(t / duration)
        return (along * math.sin(2.0 * phase), across * math.sin(phase))

    return Segment(duration, at)


def _poses(segments: list[Segment], lead: float, duration: float, start_ns: int) -> Iterator[HandPose]:
    length = sum(segment.duration for segment in segments)
    duration = duration or length
    for tick in itertools.count():
        seconds = tick / RATE_HZ - lead
        if seconds > duration:
            return
        x, y = _at(segments, max(0.0, seconds) % length)
        yield HandPose(
            position=(REST[0] + x, REST[1] + y, REST[2]),
            yaw=0.0,
            mode=Wish.FLY,
            t_ns=start_ns + tick * NS_PER_S // RATE_HZ,
        )


def _at(segments: list[Segment], t: float) -> Point:
    """Returns the displacement at a time since the script began, anew or for the first time, s."""
    for segment in segments:
        if t <= segment.duration:
            return segment.at(t)
        t -= segment.duration
    return (0.0, 0.0)
