"""Recorded hands: `recording:PATH?speed=..&lead=..`, played by time at the relay's rate.

PATH is a flight folder (`glove.csv.gz`), a ROS 1 bag (`topic=` names the hand) or a CSV file with the header
`t,x,y,z[,yaw]` (s, m, rad). `speed` scales the pace and with it the velocity; `lead` (s) is a rest at the first
pose in which the drones take off. The yaw is relative to the first sample's.

Between two poses the hand is interpolated, whatever the rate of the recording: so its velocity is estimated
from nine samples at 60 Hz, as that of a living hand. In a gap there is no hand.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from human_relay.sources.base import HandPose
from human_relay.sources.playback import RATE_HZ, Playback
from shared.clock import NS_PER_S
from shared.errors import ConfigError
from shared.files import named
from shared.messages import Wish
from shared.recordings.check import gap_ns
from shared.recordings.flight_folder import HAND_FILE, read_meta, read_obstacles, read_track
from shared.recordings.hand import read_hand, relative_yaw
from shared.recordings.track import Stamps, Track
from shared.uri import Uri

SLOWEST_HZ = 30.0
"""At a lower rate a recording does not hold what a hand does."""
_SAME = 1.05
"""Rates that differ by less are the same."""


class RecordedHand(Playback):
    """The `recording:` backend."""

    def __init__(self, uri: Uri, start_ns: int) -> None:
        """Reads the whole recording.

        Raises:
            ConfigError: Unknown option, or a file that is missing or wrong.
        """
        uri.refuse_unknown("speed", "lead", "topic")
        # Faster than 4 is no hand.
        speed = uri.number("speed", 1.0, low=0.2, high=4.0)
        lead_ns = round(uri.number("lead", 4.0, low=0.0, high=60.0) * NS_PER_S)
        hand = read_hand(_path(uri), uri.options.get("topic"))
        rate_hz = hand.checked.report.rate_hz * speed
        super().__init__(
            _poses(hand.checked.track, start_ns, lead_ns, speed), (*hand.remarks, *_about(rate_hz))
        )

    @staticmethod
    def hints(uri: Uri) -> dict[str, object]:
        """A flight folder knows the law that flew (`base = clip(c + gain * hand_xy)`) and its columns.

        `hand.home` is where that law puts the first hand position, before any obstacle.

        Raises:
            ConfigError: A file of the folder is missing or wrong.
        """
        path = _path(uri)
        if not path.is_dir():
            return {}
        meta, obstacles = read_meta(path), read_obstacles(path)
        first = read_track(path / HAND_FILE).position[0, :2]
        home = np.clip(np.array(meta.offset) + meta.gain * first, meta.low, meta.high)
        return {
            "hand.mapping": "relative",
            "hand.gain": meta.gain,
            "hand.offset": [*meta.offset, 0.0],
            "hand.home": home.tolist(),
            "hand.clip": {"min": list(meta.low), "max": list(meta.high)},
            "obstacles": [{"name": o.name, "x": o.x, "y": o.y} for o in obstacles],
        }


def _about(rate_hz: float) -> tuple[str, ...]:
    """Says what is to be known about the rate at which poses are played, Hz."""
    if rate_hz * _SAME < SLOWEST_HZ:
        return (f"{rate_hz:.1f} poses per second; below {SLOWEST_HZ:g} the hand's velocity is coarse",)
    if rate_hz > RATE_HZ * _SAME:
        return (f"{rate_hz:.1f} poses per second; the relay sends {RATE_HZ}, interpolated",)
    return ()


def _path(uri: Uri) -> Path:
    if not uri.path or "\0" in uri.path:
        raise ConfigError(f"{uri.text}: no path; for example recording:flights/S2_visual_1")
    return named(uri.literal)


def _poses(track: Track, start_ns: int, lead_ns: int, speed: float) -> Iterator[HandPose]:
    """Yields the hand at every period of the relay, from the start on; none in gaps."""
    moments = _moments(track, lead_ns, speed)
    # The recording's own time at each moment: the lead is a rest at the first pose.
    t_ns = np.maximum(moments - lead_ns, 0) * speed
    own_ns = (track.t_ns - track.t_ns[0]).astype(np.float64)
    columns = (*track.position.T, relative_yaw(track.quaternion))
    table = np.column_stack([np.interp(t_ns, own_ns, column) for column in columns])
    stamps = (start_ns + moments).tolist()
    for moment, (x, y, z, yaw) in zip(stamps, table.tolist(), strict=True):
        yield HandPose(position=(x, y, z), yaw=yaw, mode=Wish.FLY, t_ns=moment)


def _moments(track: Track, lead_ns: int, speed: float) -> Stamps:
    """Returns when there is a hand, ns since the start."""
    own_ns = track.t_ns - track.t_ns[0]
    count = (lead_ns + int(own_ns[-1] / speed)) * RATE_HZ // NS_PER_S + 1
    moments = np.arange(count, dtype=np.int64) * NS_PER_S // RATE_HZ
    t_ns = (moments - lead_ns) * speed
    after = np.clip(np.searchsorted(own_ns, t_ns), 1, len(own_ns) - 1)
    is_gap = (
        (np.diff(own_ns) > gap_ns(track.t_ns))[after - 1] & (t_ns > own_ns[after - 1]) & (t_ns < own_ns[after])
    )
    there: Stamps = moments[~is_gap]
    return there
