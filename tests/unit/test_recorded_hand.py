"""A recorded hand is played by time: the same hand at any rate, in the simulator and in the relay."""

import itertools
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from deploy.lockstep.hand_track import relayed
from human_relay.guard import PROOF_S, WALK
from human_relay.sources import open_source
from shared.clock import NS_PER_S
from shared.errors import ConfigError
from shared.messages import HandSample, Wish
from tests.unit.test_relay_loop import START, Operator, relay

RATE_HZ = 60.0
SECONDS = 4.0
PEAK = 0.5
"""Speed of the hand, m/s."""
BEND = 4.0
"""It goes to and fro at so many rad/s."""


def place(t: float) -> tuple[float, float, float]:
    return PEAK / BEND * math.sin(BEND * t), 0.02 * t, 1.2


def speed(t: float) -> float:
    return PEAK * math.cos(BEND * t)


def write_hand(path: Path, rate_hz: float, is_seen: Callable[[float], bool] = lambda _: True) -> Path:
    """Records the hand at a rate, while it is seen."""
    times = (k / rate_hz for k in range(round(SECONDS * rate_hz) + 1))
    rows = [",".join(map(repr, (t, *place(t)))) for t in times if is_seen(t)]
    path.write_text("t,x,y,z\n" + "\n".join(rows) + "\n", encoding="ascii")
    return path


@pytest.mark.parametrize("rate_hz", [30.0, 60.0, 100.0, 120.0, 240.0, 1000.0])
def test_it_is_the_same_hand_whatever_the_rate_of_the_recording(tmp_path: Path, rate_hz: float) -> None:
    hand = write_hand(tmp_path / "hand.csv", rate_hz)
    samples = relayed(f"recording:{hand}?lead=0", SECONDS, RATE_HZ)
    assert len(samples) == SECONDS * RATE_HZ
    # A chord of 1/30 s is off its arc by a h^2 / 8.
    sagitta = PEAK * BEND / 8.0 / min(rate_hz, RATE_HZ) ** 2
    assert all(math.dist(s.position, place(k / RATE_HZ)) < 2.0 * sagitta for k, s in enumerate(samples))
    lag = 0.0125 * PEAK * BEND  # the estimator's delay at the largest acceleration
    error = [abs(s.velocity[0] - speed(k / RATE_HZ)) for k, s in enumerate(samples)][9:]
    assert max(error) < 2.5 * lag


@pytest.mark.parametrize("rate_hz", [30.0, 60.0, 120.0, 240.0])
@pytest.mark.parametrize("control_hz", [20.0, 60.0, 120.0])
def test_simulator_and_relay_play_the_same_hand(tmp_path: Path, rate_hz: float, control_hz: float) -> None:
    uri = f"recording:{write_hand(tmp_path / 'hand.csv', rate_hz, lambda t: not 1.0 < t < 2.0)}?lead=0.5"
    flown, _, _ = relay(uri, Operator(SECONDS))
    simulated = relayed(uri, SECONDS - 1.0, control_hz)
    times = np.array([sample.stamp_ns - START for sample in flown])
    for sample in simulated:
        # Ticks are rounded to the ns.
        row = int(np.searchsorted(times, sample.stamp_ns + 1, side="right")) - 1
        there: HandSample = flown[row]
        assert there.position == pytest.approx(sample.position, abs=1e-12)
        if there.mode is sample.mode:
            assert there.velocity == pytest.approx(sample.velocity, abs=1e-7)
        else:  # a gap begins between two ticks
            assert abs(times[row] - sample.stamp_ns) < NS_PER_S / 20


def test_in_a_gap_there_is_no_hand(tmp_path: Path) -> None:
    hand = write_hand(tmp_path / "hand.csv", 60.0, lambda t: not 1.0 < t < 2.0)
    samples = relayed(f"recording:{hand}?lead=0", SECONDS, RATE_HZ)
    for tick, sample in enumerate(samples):
        t = tick / RATE_HZ
        if 1.11 < t < 1.99:
            assert (sample.mode, sample.velocity) == (Wish.HOLD, (0.0, 0.0, 0.0))
            assert sample.position == samples[60].position
        elif not 0.99 < t < 2.01:
            assert sample.mode is Wish.FLY


def test_a_few_lost_frames_are_no_gap(tmp_path: Path) -> None:
    lossy = write_hand(tmp_path / "lossy.csv", 100.0, lambda t: round(t * 100) % 10 < 3)
    assert "gap" not in "".join(open_source(f"recording:{lossy}?lead=0", 0).remarks)
    samples = relayed(f"recording:{lossy}?lead=0", SECONDS - 0.1, RATE_HZ)
    assert {sample.mode for sample in samples} == {Wish.FLY}


@pytest.mark.parametrize(
    ("rate_hz", "options", "said"),
    [
        (60.0, "", None),
        (20.0, "", "20.0 poses per second; below 30 the hand's velocity is coarse"),
        (60.0, "?speed=0.25", "15.0 poses per second; below 30"),
        (120.0, "", "120.0 poses per second; the relay sends 60, interpolated"),
    ],
)
def test_a_rate_that_is_not_the_relays_is_said(
    tmp_path: Path, rate_hz: float, options: str, said: str | None
) -> None:
    source = open_source(f"recording:{write_hand(tmp_path / 'hand.csv', rate_hz)}{options}", 0)
    assert source.remarks == () if said is None else source.remarks[-1].startswith(said)


def test_a_hand_that_is_over_at_once_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "short.csv"
    path.write_text("t,x,y,z\n0,0,0,1\n0.001,0,0,1\n", encoding="ascii")
    with pytest.raises(ConfigError, match="the hand is over before it has begun"):
        relayed(f"recording:{path}?lead=0", 1.0, RATE_HZ)


def test_a_recorded_hand_that_jumps_holds_and_is_walked_to(tmp_path: Path) -> None:
    rows = [f"{k / 60},{0.0 if k < 60 else 1.5},0.2,1.2" for k in range(240)]
    (tmp_path / "jump.csv").write_text("t,x,y,z\n" + "\n".join(rows) + "\n", encoding="ascii")
    samples = relayed(f"recording:{tmp_path / 'jump.csv'}?lead=0", SECONDS, RATE_HZ)
    steps = [math.dist(a.position, b.position) * RATE_HZ for a, b in itertools.pairwise(samples)]
    assert max(steps) <= WALK + 1e-3
    jumped = [sample for sample in samples if sample.jumped]
    assert {sample.mode for sample in jumped} == {Wish.HOLD}
    assert len(jumped) / RATE_HZ == pytest.approx(PROOF_S + 1.5 / WALK, abs=0.1)
    assert samples[-1].position[0] == pytest.approx(1.5)
    assert samples[-1].mode is Wish.FLY
