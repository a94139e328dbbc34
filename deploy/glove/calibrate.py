"""`swarmtouch glove calibrate`: asks what each motor does, and writes what the glove then plays by."""

import argparse
import threading
import time
from collections.abc import Callable
from datetime import date

from attrs import frozen

from deploy.glove.device import worn_on_serial
from glove_bridge.calibration import HIGHEST_SUPPLY_V, LONGEST_KICK_MS, Calibration, Motor, wire_duty
from glove_bridge.calibration_file import load_calibration, save_calibration
from glove_bridge.gloves.serial import SerialGlove
from glove_bridge.gloves.serial_link import Order
from glove_bridge.patterns.schema import FINGERS
from glove_bridge.session import Session
from shared.errors import ConfigError, DeviceError

SMALLEST_DUTY, RESOLUTION = 0.05, 0.03
"""Where the search for the smallest duty at which a motor starts begins, and how narrow it ends."""
SHARES = (0.25, 0.6, 1.0)
"""Where between start and limit the frequency is measured."""
LOWEST_HZ, HIGHEST_HZ = 20.0, 500.0
"""What a motor may be measured at."""

OBEYED_S = 2.0
"""A glove that has not obeyed after so long is gone."""

NAMES = ("thumb", "index", "middle", "ring", "little finger")

Ask = Callable[[str], str]


def run(arguments: argparse.Namespace) -> int:
    """Calibrates all motors and writes the file.

    Raises:
        ConfigError: The URI of the glove is refused, or the file cannot be written.
        DeviceError: The glove does not answer, or goes away.
    """
    with worn_on_serial(arguments.glove) as glove:
        print(_INTRODUCTION)
        try:
            calibration = calibrate(Bench(glove, input, arguments.turn))
        except (EOFError, KeyboardInterrupt):
            print("\nnothing was written")
            return 1
    save_calibration(calibration, arguments.output)
    print(f"written; wear it: serial://DEVICE?calibration={arguments.output}")
    return 0


_INTRODUCTION = """Each motor in turn: at which duty it starts, and how fast it runs at three duties. A phone's
spectrum analyser (microphone against the motor) or accelerometer tells the frequency. Enter keeps the value in
brackets; Ctrl-C ends without a file."""


@frozen
class Bench:
    """The glove under calibration, and the person who does it.

    Attributes:
        glove: Its glove.
        ask: Asks the person.
        turn_s: How long a motor gets to show whether it starts, s; half as long to come to rest.
    """

    glove: SerialGlove
    ask: Ask
    turn_s: float

    def hold(self, finger: int, duty: float) -> None:
        """Holds one motor at a duty (fraction), the others at rest.

        Raises:
            DeviceError: The glove is not there.
        """
        duties = tuple(wire_duty(duty) if f == finger else 0 for f in FINGERS)
        self._have(lambda session, now_ns: session.hold(duties, now_ns))

    def rest(self) -> None:
        """Stops every motor and waits until it rests.

        Raises:
            DeviceError: The glove is not there.
        """
        self._have(Session.stop)
        time.sleep(self.turn_s / 2.0)

    def _have(self, order: Order) -> None:
        """Gives an order and waits until the device has obeyed: a motor that was not told says nothing."""
        session = self.glove.link.session
        given, until = threading.Event(), time.monotonic() + OBEYED_S

        def give(session: Session, now_ns: int) -> None:
            order(session, now_ns)
            given.set()

        self.glove.link.order(give)
        while not (given.is_set() and session.quiet) and time.monotonic() < until:
            time.sleep(0.001)
        if session.fault or not session.quiet:
            raise DeviceError(f"the glove went away: {session.fault or 'no answer'}")

    def number(self, question: str, default: float, low: float, high: float) -> float:
        """Asks for a number until it is one between `low` and `high`."""
        while True:
            text = self.ask(f"{question} [{default:g}]: ").strip()
            try:
                value = float(text) if text else default
            except ValueError:
                value = low - 1.0
            if low <= value <= high:
                return value
            print(f"a number from {low:g} to {high:g}, please")

    def yes(self, question: str) -> bool:
        """Asks a question until it is answered with yes or no."""
        while (text := self.ask(f"{question} [y/n]: ").strip().lower()) not in ("y", "n"):
            print("y or n, please")
        return text == "y"


def calibrate(bench: Bench) -> Calibration:
    """Goes through supply and motors; what is not measured is as in the shipped calibration.

    Raises:
        DeviceError: The glove went away.
    """
    shipped = load_calibration()
    supply_v = bench.number("supply of the motors, V", shipped.supply_v, 1.0, HIGHEST_SUPPLY_V)
    default_v = min(shipped.motors["1"].max_v, supply_v)
    max_v = bench.number("most that the motors may get, V", default_v, 0.5, supply_v)
    motors = {str(f): _calibrate_motor(bench, f, shipped, max_v, max_v / supply_v) for f in FINGERS}
    return Calibration(about=f"Calibrated on {date.today()}.", supply_v=supply_v, motors=motors)


def _calibrate_motor(bench: Bench, finger: int, shipped: Calibration, max_v: float, limit: float) -> Motor:
    print(f"finger {finger}, {NAMES[finger - 1]}")
    start = find_start(bench, finger, limit)
    default_ms = shipped.motors[str(finger)].kick_ms
    while True:
        curve = _measure_curve(bench, finger, shipped, start, limit)
        kick_ms = int(bench.number("  kick-start, ms", default_ms, 0, LONGEST_KICK_MS))
        try:
            return Motor(start_duty=start, duty_hz=curve, kick_ms=kick_ms, max_v=max_v)
        except ValueError as error:
            print(f"  {error}; once more")


def find_start(bench: Bench, finger: int, limit: float) -> float:
    """Bisects for the smallest duty (fraction) at which a motor starts from rest.

    Raises:
        ConfigError: It does not start at its limit.
        DeviceError: The glove went away.
    """
    low, high = SMALLEST_DUTY, limit
    if not _starts(bench, finger, high):
        raise ConfigError(f"finger {finger}: does not turn at its largest voltage; check wiring and supply")
    while high - low > RESOLUTION:
        middle = (low + high) / 2
        if _starts(bench, finger, middle):
            high = middle
        else:
            low = middle
    return round(high, 3)


def _starts(bench: Bench, finger: int, duty: float) -> bool:
    bench.hold(finger, duty)
    time.sleep(bench.turn_s)
    bench.rest()
    return bench.yes(f"  duty {duty:.0%}: did it turn?")


def _measure_curve(
    bench: Bench, finger: int, shipped: Calibration, start: float, limit: float
) -> tuple[tuple[float, float], ...]:
    """Asks for the frequency at three duties, from just above the start to the limit."""
    curve = []
    for share in SHARES:
        duty = round(start + share * (limit - start), 3)
        bench.hold(finger, duty)
        default_hz = round(shipped.hz(finger, duty))
        hz = bench.number(f"  duty {duty:.0%}: frequency, Hz", default_hz, LOWEST_HZ, HIGHEST_HZ)
        bench.rest()
        curve.append((duty, hz))
    return tuple(curve)
