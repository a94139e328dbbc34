"""The tools of the first evening against the firmware itself, on a simulated chip, by USB and by radio."""

import builtins
from collections.abc import Callable
from pathlib import Path

import pytest

from deploy.cli import main
from glove_bridge.calibration import wire_duty
from glove_bridge.calibration_file import load_calibration
from glove_bridge.protocol import PROTOCOL
from tests.chip.simulated_chip import SimulatedChip

pytestmark = [pytest.mark.chip, pytest.mark.parallel]

OFF = (0,) * 5


def test_hello_and_buzz(chip: SimulatedChip, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["glove", "hello", "--glove", chip.uri]) == 0
    told = capsys.readouterr().out
    assert f"protocol {PROTOCOL}" in told
    assert "up to 32 frames and 10000 ms" in told
    assert main(["glove", "buzz", "2", "200", "300", "--glove", chip.uri]) == 0
    assert "finger 2: started after" in capsys.readouterr().out
    calibration = load_calibration()
    kick, run = (wire_duty(duty) for duty in (calibration.limit(2), calibration.duty(2, 200.0)))
    chip.expect((0, kick, 0, 0, 0), (0, run, 0, 0, 0), OFF)
    on, off = chip.steps[0].ms, chip.steps[-1].ms
    assert off - on == pytest.approx(300.0, abs=2.0)


def test_a_pattern_by_radio(start_chip: Callable[..., SimulatedChip]) -> None:
    chip = start_chip("--xbee")
    assert main(["glove", "play", "CR", "--patterns", "flight", "--glove", f"{chip.uri}?link=xbee"]) == 0
    chip.wait(lambda chip: not chip.turning)
    fingers = [{k + 1 for k, duty in enumerate(step.duties) if duty} for step in chip.steps]
    assert [f for k, f in enumerate(fingers) if k == 0 or f != fingers[k - 1]] == [{2}, {3}, {4}, set()]


def test_a_motor_that_is_being_calibrated_is_held(
    chip: SimulatedChip, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def answer(question: str) -> str:
        if "frequency" in question:
            chip.wait(lambda chip: chip.turning)
        return "y" if "did it turn" in question else ""

    monkeypatch.setattr(builtins, "input", answer)
    written = tmp_path / "mine.toml"
    assert main(["glove", "calibrate", "--glove", chip.uri, "--turn", "0.05", "--output", str(written)]) == 0
    assert load_calibration(written).motors["5"].start_duty < 0.1
    chip.wait(lambda chip: not chip.turning)
    for step in chip.steps:
        assert sum(map(bool, step.duties)) <= 1
