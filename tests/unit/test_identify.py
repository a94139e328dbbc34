"""What `swarmtouch vehicle identify` finds: what is known, what ships, and in recorded flights."""

import os
import re
from pathlib import Path

import numpy as np
import pytest

from deploy.cli import main
from deploy.vehicle.fit import delay_of, fit_axis
from deploy.vehicle.identify import identify
from deploy.vehicle.motion import RATE_HZ, excited
from shared.arrays import Vec
from shared.config import structure
from shared.envelope import ENVELOPES, AxisEnvelope, Envelope, load_envelope
from shared.errors import ConfigError
from shared.toml_text import parse_toml

DATA = Path(os.environ.get("SWARMTOUCH_DATA", Path(__file__).resolve().parents[2].parent / "shared/data"))
FLIGHTS = sorted((DATA / "flights").glob("*"))
FINE = 10
"""Steps of the integration per row."""


def measured(source: str) -> Envelope:
    return structure(parse_toml(identify(source), source), Envelope, source)


def body(stiffness: float, damping: float, feed: float, lag: float) -> tuple[Vec, Vec]:
    """How a body of the model moves after a set-point of three strokes a second, each held for a row."""
    setpoint = excited("crazyflie").setpoint[0][:, 0]
    rates = np.diff(setpoint, prepend=setpoint[0]) * RATE_HZ
    dt, position, velocity, actual = 1.0 / (RATE_HZ * FINE), setpoint[0], 0.0, 0.0
    moved = []
    for wanted, rate in zip(setpoint, rates, strict=True):
        moved.append(position)
        for _ in range(FINE):
            asked = stiffness * (wanted - position) + feed * rate - damping * velocity
            actual = asked if lag == 0.0 else actual + (asked - actual) * min(dt / lag, 1.0)
            velocity += actual * dt
            position += velocity * dt
    return setpoint, np.array(moved)


@pytest.mark.parametrize("known", [(15.64, 8.65, 0.0, 0.0), (6.85, 3.47, 3.42, 0.18), (9.0, 6.0, 2.0, 0.1)])
def test_a_body_whose_parameters_are_known_is_found_again(known: tuple[float, float, float, float]) -> None:
    """Within a tenth, and 0.02 s; what it is told in flight counts: how far it is behind, within 0.02 s."""
    setpoint, position = body(*known)
    found = fit_axis([setpoint], [position], 5.0)
    stiffness, damping, feed, lag = known
    assert found.stiffness == pytest.approx(stiffness, rel=0.1)
    assert found.damping == pytest.approx(damping, rel=0.1)
    assert found.feed == pytest.approx(feed, rel=0.1, abs=0.1)
    assert found.lag == pytest.approx(lag, abs=0.02)
    behind = (found.damping - found.feed) / found.stiffness
    assert behind == pytest.approx((damping - feed) / stiffness, abs=0.02)
    assert found.error < 0.1 * found.seen


def test_a_pure_delay_is_found() -> None:
    setpoint = excited("identified").setpoint[0][:, 0]
    assert delay_of([setpoint[12:]], [setpoint[:-12]]) == pytest.approx(0.2)


@pytest.mark.parametrize("name", ["identified", "crazyflie"])
def test_the_envelopes_that_ship_are_those_of_the_bodies_that_ship(name: str) -> None:
    """Answers within a fourth and 0.04 s; of acceleration and error what is measured, or less is promised."""
    ships, found = load_envelope(name), measured(f"sim:{name}")
    assert ships.tau == pytest.approx(found.tau, abs=0.11)
    for said, seen in ((ships.horizontal, found.horizontal), (ships.vertical, found.vertical)):
        _answers_alike(said, seen)
        assert said.acceleration <= 1.05 * seen.acceleration
        assert said.error >= seen.error


def _answers_alike(said: AxisEnvelope, seen: AxisEnvelope) -> None:
    for key in ("stiffness", "damping", "feed"):
        assert getattr(said, key) == pytest.approx(getattr(seen, key), rel=0.25, abs=0.05), key
    assert said.lag == pytest.approx(seen.lag, abs=0.04)
    assert said.behind == pytest.approx(seen.behind, abs=0.1)


@pytest.mark.skipif(not FLIGHTS, reason="no recorded flights here (SWARMTOUCH_DATA)")
def test_the_drones_of_recorded_flights_are_as_far_behind_as_the_body_identified_from_them() -> None:
    text = identify(str(FLIGHTS[-1]))
    found = structure(parse_toml(text, "here"), Envelope, "here")
    assert found.horizontal.behind == pytest.approx(load_envelope("identified").horizontal.behind, abs=0.15)
    assert found.horizontal.acceleration < 10.0
    assert "flown at one height" in text


@pytest.mark.parametrize(
    ("source", "words"),
    [("sim:x", ["sim:x", "no such simulated body", "crazyflie, identified"]), ("nowhere", ["nowhere"])],
)
def test_what_is_not_there_is_refused(source: str, words: list[str]) -> None:
    with pytest.raises(ConfigError) as refused:
        identify(source)
    assert all(word in str(refused.value) for word in words)


@pytest.mark.skipif(not FLIGHTS, reason="no recorded flights here (SWARMTOUCH_DATA)")
def test_a_drone_that_did_not_fly_is_refused() -> None:
    with pytest.raises(ConfigError, match="no drone 9 in this flight"):
        identify(str(FLIGHTS[0]), drone=9)


def test_the_command_writes_what_a_scenario_takes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "mine.toml"
    assert main(["vehicle", "identify", "sim:identified", "--output", str(file)]) == 0
    assert load_envelope(str(file)).about == "the simulated body identified, measured"
    assert main(["vehicle", "identify", "sim:identified"]) == 0
    assert capsys.readouterr().out == file.read_text()
    assert main(["vehicle", "identify", "sim:nobody"]) == 2


def test_a_body_that_is_told_nothing_says_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    still = excited("identified")
    still = still._replace(setpoint=[np.zeros_like(each) for each in still.setpoint])
    monkeypatch.setattr("deploy.vehicle.identify.excited", lambda _: still)
    with pytest.raises(ConfigError, match="no set-point moves sideways"):
        identify("sim:identified")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("damping = 8.65", "dampling = 8.65", "missing required field `damping` - at `$.horizontal`"),
        ("radius = 0.3", "radius = 0.3\ncolour = 1", "unknown key 'downwash.colour'"),
        ("stiffness = 15.64", "stiffness = -1", "stiffness must be > 0, not -1.0 - at `$.horizontal`"),
        ("stiffness = 15.64", "stiffness = nan", "stiffness must be > 0, not nan - at `$.horizontal`"),
        ("tau = 0.45", 'tau = "soon"', "Expected `float`, got `str` - at `$.tau`"),
    ],
)
def test_a_damaged_envelope_is_refused_with_file_and_key(old: str, new: str, said: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text((ENVELOPES / "identified.toml").read_text().replace(old, new, 1))
    with pytest.raises(ConfigError, match=re.escape(f"{file}: ") + ".*" + re.escape(said)):
        load_envelope(str(file))
