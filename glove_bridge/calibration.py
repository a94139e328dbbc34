"""What the motors of one glove need: from the frequency of a pattern's frame to the duty of a motor. Pure.

An eccentric-mass motor couples frequency and strength: both follow its mean voltage, which is the supply times
the duty of the pulse-width modulation. It starts from rest only above some duty, and slowly; a short kick at
its full voltage brings it to speed.
"""

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from attrs import Attribute, field, frozen

from glove_bridge.patterns.pattern import Pattern
from glove_bridge.patterns.schema import FINGERS
from glove_bridge.protocol import PlayFrame

FULL_DUTY = 255
"""Duty on the wire that is always on."""

HIGHEST_SUPPLY_V = 12.0
LONGEST_KICK_MS = 100


def _check_curve(_: Any, __: "Attribute[Any]", curve: tuple[tuple[float, float], ...]) -> None:
    if len(curve) < 2:
        raise ValueError("duty_hz needs at least two pairs [duty, Hz]")
    if not all(0.0 < duty <= 1.0 and hz > 0.0 for duty, hz in curve):
        raise ValueError("duty_hz: a duty must be more than 0 and at most 1, a frequency more than 0 Hz")
    if not all(a[0] < b[0] and a[1] < b[1] for a, b in pairwise(curve)):
        raise ValueError("duty_hz: both duty and frequency must increase from pair to pair")


@frozen(kw_only=True)
class Motor:
    """One motor on its supply; duties are fractions of the time that it is on.

    Attributes:
        start_duty: The smallest duty at which it starts from rest.
        duty_hz: Pairs of duty and frequency (Hz) at which it settles, increasing; straight lines between.
        kick_ms: How long it gets its full voltage when it starts from rest, ms.
        max_v: The largest mean voltage that it ever gets, V.
    """

    start_duty: float = field()
    duty_hz: tuple[tuple[float, float], ...] = field(validator=_check_curve)
    kick_ms: int = field()
    max_v: float = field()

    @start_duty.validator
    def _check_start(self, _: "Attribute[Any]", value: float) -> None:
        if not 0.0 <= value < 1.0:
            raise ValueError(f"start_duty must be at least 0 and less than 1, not {value!r}")

    @kick_ms.validator
    def _check_kick(self, _: "Attribute[Any]", value: int) -> None:
        if not 0 <= value <= LONGEST_KICK_MS:
            raise ValueError(f"kick_ms must be 0 to {LONGEST_KICK_MS}, not {value!r}")

    @max_v.validator
    def _check_max(self, _: "Attribute[Any]", value: float) -> None:
        if not 0.0 < value <= HIGHEST_SUPPLY_V:
            raise ValueError(f"max_v must be more than 0 and at most {HIGHEST_SUPPLY_V:g}, not {value!r}")


@frozen(kw_only=True)
class Calibration:
    """One glove.

    Attributes:
        about: One line for people.
        supply_v: Voltage that the motors get at full duty, V.
        motors: Finger `"1"` (thumb) .. `"5"` (little) -> motor.
    """

    about: str
    supply_v: float = field()
    motors: Mapping[str, Motor] = field(hash=False)

    @supply_v.validator
    def _check_supply(self, _: "Attribute[Any]", value: float) -> None:
        if not 0.0 < value <= HIGHEST_SUPPLY_V:
            raise ValueError(f"supply_v must be more than 0 and at most {HIGHEST_SUPPLY_V:g}, not {value!r}")

    def __attrs_post_init__(self) -> None:
        if set(self.motors) != set(map(str, FINGERS)):
            raise ValueError(f"motors: one for each finger is needed, {', '.join(map(str, FINGERS))}")
        for finger, motor in self.motors.items():
            if motor.start_duty > self.limit(int(finger)):
                raise ValueError(f"motor {finger}: max_v {motor.max_v:g} is too little for its start_duty")

    def limit(self, finger: int) -> float:
        """Returns the largest duty that a motor may get, as a fraction."""
        return min(1.0, self.motors[str(finger)].max_v / self.supply_v)

    def duty(self, finger: int, hz: float) -> float:
        """Returns the duty (fraction) for a frequency; where the motor cannot follow, the nearest it can."""
        motor = self.motors[str(finger)]
        duties, frequencies = zip(*motor.duty_hz, strict=True)
        wanted = float(np.interp(hz, frequencies, duties))
        return min(max(wanted, motor.start_duty), self.limit(finger))

    def hz(self, finger: int, duty: float) -> float:
        """Returns the frequency at which a motor settles, Hz: inverts `duty` where that is not limited."""
        duties, frequencies = zip(*self.motors[str(finger)].duty_hz, strict=True)
        return float(np.interp(duty, duties, frequencies))


def device_frames(pattern: Pattern, calibration: Calibration) -> tuple[PlayFrame, ...]:
    """Turns a pattern into what the device plays, of the same length, in at most twice as many frames.

    A frame in which motors start from rest is cut in two: they get their full voltage in the first part, which
    is as long as the longest of their kicks, and no longer than the frame.

    Args:
        pattern: The pattern.
        calibration: That of the glove.
    """
    frames: list[PlayFrame] = []
    turning: frozenset[int] = frozenset()
    for frame in pattern.frames:
        kicks = {f: calibration.motors[str(f)].kick_ms for f in frame.hz if f not in turning}
        kicked = frozenset(f for f, kick_ms in kicks.items() if kick_ms)
        cut = min(max(kicks.values(), default=0), frame.ms)
        if cut:
            frames.append(PlayFrame(cut, _wire_duties(frame.hz, kicked, calibration)))
        if cut < frame.ms:
            frames.append(PlayFrame(frame.ms - cut, _wire_duties(frame.hz, frozenset(), calibration)))
        turning = frozenset(frame.hz)
    return tuple(frames)


def wire_duty(duty: float) -> int:
    """Returns a duty (fraction) as it is on the wire, rounded down: it never exceeds a limit."""
    return int(duty * FULL_DUTY)


def _wire_duties(hz: Mapping[int, float], kicked: frozenset[int], calibration: Calibration) -> tuple[int, ...]:
    duties = {f: calibration.limit(f) if f in kicked else calibration.duty(f, hz[f]) for f in hz}
    return tuple(wire_duty(duties.get(finger, 0.0)) for finger in FINGERS)
