"""The firmware on a simulated ATmega328P behind a pseudo-terminal, and what its motors did.

Times are the chip's own, ms of simulated time since its start. It keeps pace with the wall clock as well as the
machine allows: timing is judged by the chip's time only.
"""

import json
import subprocess
import threading
from collections.abc import Callable, Iterable
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from glove_bridge.protocol import MOTORS

ROOT = Path(__file__).parents[2]
FIRMWARE = ROOT / "build" / "firmware" / "glove.elf"
HARNESS = ROOT / "build" / "chip" / "simulated_uno"
CYCLES_PER_MS = 16_000
SPREAD_MS = 0.3
"""The firmware sets the motors one after the other; changes this close together are one step."""

REPEAT_S = 120.0
"""What ten minutes of the chip's time may take here."""

REPORT_S = 2.0
"""What a motor did is known here only after the host has its answer."""


class Drive(NamedTuple):
    """Motor 1 (thumb) to 5 has had a duty (0..255) since `ms`; until then its pin was high for `high_ms`."""

    ms: float
    motor: int
    duty: int
    high_ms: float


class Step(NamedTuple):
    """All motors have had these duties since `ms`, when the first of them changed."""

    ms: float
    duties: tuple[int, ...]


class SimulatedChip:
    """A simulated Arduino UNO; runs while it is entered.

    Args:
        folder: Where its port appears.
        options: Of `simulated_uno`, for example `--xbee` or `--noise 0.01`.
    """

    def __init__(self, folder: Path, *options: str) -> None:
        self.path = folder / "ttySIM"
        self._options = options
        self._events: list[dict[str, Any]] = []
        self._changed = threading.Condition()

    def __enter__(self) -> Self:
        self._process = subprocess.Popen(
            [HARNESS, FIRMWARE, self.path, *self._options],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            bufsize=1,
        )
        self._reader = threading.Thread(target=self._read)
        self._reader.start()
        self._wait_event("ready")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        code = self._process.wait(10)
        self._reader.join(10)
        self._process.stdout.close()
        assert code == 0, f"the simulated chip ended with {code}"

    @property
    def uri(self) -> str:
        """Returns it as the URI of a glove."""
        return f"serial://{self.path}"

    @property
    def drives(self) -> list[Drive]:
        """Returns every change of a motor's duty so far."""
        return [
            Drive(e["cycle"] / CYCLES_PER_MS, e["motor"], e["duty"], e["high"] / CYCLES_PER_MS)
            for e in self._snapshot()
            if e["event"] == "motor"
        ]

    @property
    def steps(self) -> list[Step]:
        """Returns the duties of all motors, step by step; they rest before the first."""
        return merge(self.drives)

    @property
    def turning(self) -> bool:
        """Returns whether a motor is on now."""
        return any(self.steps[-1].duties) if self.steps else False

    def times(self, event: str) -> list[float]:
        """Returns when frames were `heard` or `said` by the chip, to the end of their last stop bit, ms."""
        return [e["cycle"] / CYCLES_PER_MS for e in self._snapshot() if e["event"] == event]

    def do(self, command: str, timeout_s: float = 10.0) -> float:
        """Has it unplugged, plugged, cut, joined, reset or hung, by the verb; returns when it was done, ms."""
        assert self._process.stdin is not None
        seen = len(self._snapshot())
        self._process.stdin.write(f"{command}\n")
        done = self._wait_event("done", seen, timeout_s)
        assert done["command"] == command.split(maxsplit=1)[0]
        return float(done["cycle"] / CYCLES_PER_MS)

    def repeat(self, lines: Iterable[bytes], period_ms: int, length_s: int) -> float:
        """Has it hear lines in turn, one per period, as fast as it can be simulated; returns the end, ms."""
        pieces = ",".join(line.hex() for line in lines)
        return self.do(f"repeat {period_ms} {1000 * length_s} {pieces}", REPEAT_S)

    def wait(self, condition: Callable[[Self], bool], timeout_s: float = 10.0) -> None:
        """Waits until an event makes a condition true; fails the test if none does in time."""
        with self._changed:
            assert self._changed.wait_for(lambda: condition(self), timeout_s), f"{timeout_s} s in vain"

    def expect(self, *duties: tuple[int, ...]) -> None:
        """Fails the test unless the motors have gone through these duties, and no others, in a moment."""
        wanted = list(duties)
        with self._changed:
            self._changed.wait_for(lambda: [step.duties for step in self.steps] == wanted, REPORT_S)
            assert [step.duties for step in self.steps] == wanted

    def _wait_event(self, name: str, since: int = 0, timeout_s: float = 10.0) -> dict[str, Any]:
        self.wait(lambda chip: any(event["event"] == name for event in chip._events[since:]), timeout_s)
        return next(event for event in self._events[since:] if event["event"] == name)

    def _snapshot(self) -> list[dict[str, Any]]:
        with self._changed:
            return list(self._events)

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            with self._changed:
                self._events.append(json.loads(line))
                self._changed.notify_all()


def merge(drives: Iterable[Drive]) -> list[Step]:
    """Returns the duties of all motors after each burst of changes."""
    steps: list[Step] = []
    duties = (0,) * MOTORS
    for drive in drives:
        duties = (*duties[: drive.motor - 1], drive.duty, *duties[drive.motor :])
        if steps and drive.ms - steps[-1].ms < SPREAD_MS:
            steps[-1] = Step(steps[-1].ms, duties)
        else:
            steps.append(Step(drive.ms, duties))
    return steps
